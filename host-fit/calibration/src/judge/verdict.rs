//! What a calibration is good for at work.

use hallstage_input::finding::{Code, Finding, Severity};
use hallstage_input::stage::TemperatureTable;
use hallstage_solver::solve::field::carry::Service;
use hallstage_solver::solve::field::parameters::FieldParameters;
use hallstage_solver::solve::field::posterior::covariance_at;
use hallstage_solver::solve::field::terms::COUNT;
use nalgebra::DMatrix;
use runtime::Temperature;
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

/// Errors at work over the noise floor up to which a calibration is good, ...
pub const GOOD_MAX: f64 = 1.10;
/// ... and up to which it serves at all.
pub const LIMITED_MAX: f64 = 1.30;
/// The ends of the range are where one of twenty stages is below, and one above: standard deviations.
const END: f64 = 1.645;
/// Mean squares of the errors of one calibration over services within the declared range, standard deviation
/// over mean.
const OF_MOTION: f64 = 0.7;

/// Whether a calibration can be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// At work its errors are those of the sensors.
    Good,
    /// It serves with larger errors, or on movements like those of the log only.
    Limited,
    /// It is not to be used.
    Refused,
}

impl Verdict {
    /// Of a calibration with these findings; `for_service` where its model describes service and its log
    /// could show it.
    pub fn new(for_service: bool, predicted: Option<&Predicted>, findings: &[Finding]) -> Self {
        let is_refused = findings.iter().any(|f| f.severity == Severity::Refuse);
        // No prediction holds what contradicts the drawing or the model, nor what a probe or a gap that is late at work,
        // too, makes of motion.
        let is_doubtful = findings.iter().any(|f| {
            let of_beams = f
                .channel
                .as_deref()
                .is_none_or(|channel| channel.starts_with("ifm"));
            let is_late = f.code == Code::ReferenceLag && !of_beams;
            let of_model = matches!(
                f.code,
                Code::TermsAtLimit | Code::ModelLacks | Code::ScaleWrong
            );
            (of_model || is_late) && f.severity > Severity::Note
        });
        let ratio = predicted.map_or(LIMITED_MAX, Predicted::worst_ratio);
        match (is_refused, for_service) {
            (true, _) => Self::Refused,
            (false, true) if ratio <= GOOD_MAX && !is_doubtful => Self::Good,
            (false, true) if ratio > LIMITED_MAX => Self::Refused,
            // What other models lack is no fault of the log.
            _ => Self::Limited,
        }
    }
}

/// Errors of X, Y, Rz that are predicted for service over the range that `[motion]` declares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Predicted {
    /// rms: m, m, rad.
    pub rms: [f64; 3],
    /// The same over the noise floor, which is that of the probes.
    pub ratio: [f64; 3],
    /// Nine of ten stages with such a log have an rms between these: m, m, rad.
    pub range: [[f64; 2]; 3],
}

impl Predicted {
    /// Of parameters that are `off` the best estimate, which has this covariance.
    pub fn new(service: &Service, covariance: &DMatrix<f64>, off: &[f64]) -> Self {
        let variance = service.variance(covariance);
        let known = service.squares(off);
        let spread = service.spread(covariance, off);
        let rms =
            |axis: usize| (variance.noise[axis] + variance.systematic[axis] + known[axis]).sqrt();
        let range = |axis: usize| {
            let mean = variance.systematic[axis] + known[axis];
            let spread = spread[axis] + (OF_MOTION * mean) * (OF_MOTION * mean);
            [-END, END].map(|end| (variance.noise[axis] + quantile(mean, spread, end)).sqrt())
        };
        let rms = [0, 1, 2].map(rms);
        Self {
            rms,
            ratio: [0, 1, 2].map(|axis| rms[axis] / variance.noise[axis].sqrt()),
            range: [0, 1, 2].map(range),
        }
    }

    /// The ratio of the worst axis.
    pub fn worst_ratio(&self) -> f64 {
        self.ratio.into_iter().fold(0.0, f64::max)
    }
}

/// How far from the temperature of its log a calibration is good; all parts change alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Validity {
    /// Errors at work are at most [`GOOD_MAX`] times the noise floor within this distance, K.
    pub within_k: f64,
    /// Whether the calibration follows temperature; without sensors the distance is an estimate by what is
    /// known of the parts.
    pub is_followed: bool,
}

impl Validity {
    /// Of a calibration at a service.
    pub fn new(
        service: &Service,
        parameters: &FieldParameters,
        covariance: &DMatrix<f64>,
        table: &TemperatureTable,
    ) -> Self {
        let is_followed = covariance.nrows() > COUNT;
        let [k, h] = table.prior_per_k;
        let mut covariance = covariance.clone();
        if !is_followed {
            covariance.resize_mut(COUNT + 6, COUNT + 6, 0.0);
            for (place, [_, deviation]) in (COUNT..).zip([k, h, k, h, k, h]) {
                covariance[(place, place)] = deviation * deviation;
            }
        }
        let off_per_k = if is_followed { 0.0 } else { k[0] + h[0] };
        let is_good = |change_k: f64| {
            let off = parameters.by_gain([off_per_k * change_k; 3]);
            let covariance = covariance_at(&covariance, parameters, [change_k; 2]);
            Predicted::new(service, &covariance, &off).worst_ratio() <= GOOD_MAX
        };
        let [mut good, mut bad] = [0.0, f64::from(Temperature::<f64>::REACH_MK) * 1e-3];
        if is_good(bad) {
            good = bad;
        }
        // To a hundredth of a kelvin.
        for _ in 0..12 {
            let middle = 0.5 * (good + bad);
            if is_good(middle) {
                good = middle;
            } else {
                bad = middle;
            }
        }
        Self {
            within_k: good,
            is_followed,
        }
    }
}

/// The quantile, this many standard deviations from the middle, of a sum of squares with this mean and
/// variance: as of a chi-square with as many degrees of freedom, by Wilson and Hilferty.
pub(crate) fn quantile(mean: f64, variance: f64, deviations: f64) -> f64 {
    if mean <= 0.0 {
        return 0.0;
    }
    let part = variance / (9.0 * mean * mean);
    mean * (1.0 - part + deviations * part.sqrt()).max(0.0).powi(3)
}

/// By axis `rms_um` or `rms_urad`, `ratio` and the range of the rms, and `worst_ratio`.
impl Serialize for Predicted {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Um {
            rms_um: f64,
            ratio: f64,
            range_um: [f64; 2],
        }
        #[derive(Serialize)]
        struct Urad {
            rms_urad: f64,
            ratio: f64,
            range_urad: [f64; 2],
        }
        let [x, y, rz] = self.rms.map(|rms| rms * 1e6);
        let [of_x, of_y, of_rz] = self.range.map(|range| range.map(|end| end * 1e6));
        let um = |axis: usize, rms_um, range_um| Um {
            rms_um,
            ratio: self.ratio[axis],
            range_um,
        };
        let rz = Urad {
            rms_urad: rz,
            ratio: self.ratio[2],
            range_urad: of_rz,
        };
        let mut map = serializer.serialize_map(Some(4))?;
        map.serialize_entry("x", &um(0, x, of_x))?;
        map.serialize_entry("y", &um(1, y, of_y))?;
        map.serialize_entry("rz", &rz)?;
        map.serialize_entry("worst_ratio", &self.worst_ratio())?;
        map.end()
    }
}

//! The errors that a calibration has to expect in service, and how far from the temperature of its log it is good.

use super::verdict::GOOD_MAX;
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::parameters::FieldParameters;
use hallstage_solver::estimator::posterior::covariance_at;
use hallstage_solver::estimator::service::{Service, service_poses};
use hallstage_solver::estimator::temperature::Coefficient;
use hallstage_solver::estimator::terms::COUNT;
use nalgebra::DMatrix;
use runtime::Temperature;
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

/// Ends of the range of predicted errors, standard deviations: one stage of twenty is below, one above.
const RANGE_END: f64 = 1.645;
/// The mean squared error of one calibration differs between services within the declared range: standard
/// deviation over mean.
const MOTION_SPREAD: f64 = 0.7;

/// The service that `[motion]` declares, with the white noise of the probes, m.
pub fn declared_service(
    stage: &Stage,
    parameters: &FieldParameters,
    white_m: [f64; 3],
) -> Option<Service> {
    Service::new(parameters, white_m, service_poses(service_range(stage)))
}

/// The range of evenly spread poses with the rms that `[motion]` declares for service: half its range.
pub fn service_range(stage: &Stage) -> ([f64; 3], [f64; 3]) {
    let most = |axis: usize| 0.75f64.sqrt() * stage.motion.axes[axis].service;
    ([0, 1, 2].map(most), [3, 4, 5].map(most))
}

/// The worst axis over the noise floor where these variances are added to the variances of the floor: m2, m2, rad2.
pub fn cost(added: [f64; 3], floor: [f64; 3]) -> f64 {
    let ratio = |axis: usize| (1.0 + added[axis].max(0.0) / floor[axis]).sqrt();
    [0, 1, 2].map(ratio).into_iter().fold(1.0, f64::max)
}

/// Errors of X, Y, Rz that are predicted for service over the range that `[motion]` declares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Predicted {
    /// rms: m, m, rad.
    pub rms: [f64; 3],
    /// The same over the noise floor from the probes.
    pub ratio: [f64; 3],
    /// Nine stages of ten with such a log have an rms in this range: m, m, rad.
    pub range: [[f64; 2]; 3],
}

impl Predicted {
    /// For parameters that differ by `off` from the best estimate, with the covariance of the estimate.
    pub fn new(service: &Service, covariance: &DMatrix<f64>, off: &[f64]) -> Self {
        let variance = service.variance(covariance);
        let known = service.squares(off);
        let spread = service.spread(covariance, off);
        let rms =
            |axis: usize| (variance.noise[axis] + variance.systematic[axis] + known[axis]).sqrt();
        let range = |axis: usize| {
            let mean = variance.systematic[axis] + known[axis];
            let spread = spread[axis] + (MOTION_SPREAD * mean) * (MOTION_SPREAD * mean);
            [-RANGE_END, RANGE_END]
                .map(|end| (variance.noise[axis] + quantile(mean, spread, end)).sqrt())
        };
        let rms = [0, 1, 2].map(rms);
        Self {
            rms,
            ratio: [0, 1, 2].map(|axis| rms[axis] / variance.noise[axis].sqrt()),
            range: [0, 1, 2].map(range),
        }
    }

    /// The noise floor of an axis, m or rad.
    pub fn noise(&self, axis: usize) -> f64 {
        self.rms[axis] / self.ratio[axis]
    }

    /// The cost of these variances alone.
    pub fn cost_of(&self, added: [f64; 3]) -> f64 {
        cost(added, [0, 1, 2].map(|axis| self.noise(axis).powi(2)))
    }

    /// With other errors that add these variances (m2, m2, rad2), or cancel known ones.
    #[must_use]
    pub fn with_added(&self, variances: [f64; 3]) -> Self {
        let more = |rms: f64, axis: usize| {
            let least = self.noise(axis);
            (rms * rms + variances[axis]).max(least * least).sqrt()
        };
        let rms = [0, 1, 2].map(|axis| more(self.rms[axis], axis));
        Self {
            rms,
            ratio: [0, 1, 2].map(|axis| rms[axis] / self.noise(axis)),
            range: [0, 1, 2].map(|axis| self.range[axis].map(|end| more(end, axis))),
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
    /// Errors in service are at most [`GOOD_MAX`] times the noise floor within this distance, K.
    pub within_k: f64,
    /// Whether the calibration follows temperature. Without sensors the distance is an estimate from the stage file.
    pub is_followed: bool,
}

impl Validity {
    /// For parameters with this covariance, as
    /// [`Posterior::covariance`](hallstage_solver::estimator::posterior::Posterior::covariance), and probes with
    /// this white noise, mm; `None` where the probes do not determine the pose.
    pub fn new(
        stage: &Stage,
        parameters: &FieldParameters,
        white_m: [f64; 3],
        covariance: &DMatrix<f64>,
    ) -> Option<Self> {
        let service = &declared_service(stage, parameters, white_m)?;
        let is_followed = covariance.nrows() > COUNT;
        let [k, h] = stage.temperature.prior_per_k;
        let mut covariance = covariance.clone();
        if !is_followed {
            covariance.resize_mut(Coefficient::ROWS, Coefficient::ROWS, 0.0);
            for of in Coefficient::ALL {
                let [_, deviation] = stage.temperature.prior_per_k[of.sensor];
                covariance[(of.row(), of.row())] = deviation * deviation;
            }
        }
        let off_per_k = if is_followed { 0.0 } else { k[0] + h[0] };
        let is_good = |change_k: f64| {
            let off = parameters.gain_change([off_per_k * change_k; 3]);
            let covariance = covariance_at(&covariance, parameters, [change_k; 2]);
            Predicted::new(service, &covariance, &off).worst_ratio() <= GOOD_MAX
        };
        let [mut good, mut bad] = [0.0, f64::from(Temperature::<f64>::REACH_MK) * 1e-3];
        if is_good(bad) {
            good = bad;
        }
        // Bisection to a hundredth of a kelvin.
        for _ in 0..12 {
            let middle = 0.5 * (good + bad);
            if is_good(middle) {
                good = middle;
            } else {
                bad = middle;
            }
        }
        Some(Self {
            within_k: good,
            is_followed,
        })
    }
}

/// The quantile at this many standard deviations of a sum of squares with this mean and variance, as a scaled
/// chi-square (Wilson and Hilferty 1931).
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

#[cfg(test)]
mod tests {
    use super::*;
    use hallstage_input::shipped::STAGE_TOML;
    use hallstage_solver::estimator::paper::Parameters;

    #[test]
    fn a_calibration_is_good_while_k_is_known_well_enough() {
        let stage = Stage::from_toml(STAGE_TOML, "stage.toml".as_ref()).expect("sound");
        let white_m = [5e-7; 3];
        let parameters = FieldParameters::from_model_31(&Parameters::designed(&stage), &stage);
        let within = |error_per_k: f64| {
            let mut covariance = DMatrix::zeros(Coefficient::ROWS, Coefficient::ROWS);
            (0..3).for_each(|probe| {
                let k = Coefficient::new(probe, 0).row();
                covariance[(k, k)] = error_per_k * error_per_k;
            });
            let found = Validity::new(&stage, &parameters, white_m, &covariance);
            found.expect("a service").within_k
        };
        let (rough, fine) = (within(3e-4), within(1e-4));
        assert!((fine / rough - 3.0).abs() < 0.05, "{rough} {fine}");
        assert_eq!(within(0.0), 30.0);
        // At that distance the error of the gain makes errors of the limit.
        let service = declared_service(&stage, &parameters, white_m).expect("a service");
        let mut covariance = DMatrix::zeros(COUNT, COUNT);
        for probe in 0..3 {
            let mut parts = [0.0; 3];
            parts[probe] = 3e-4 * rough;
            let by = DMatrix::from_column_slice(COUNT, 1, &parameters.gain_change(parts));
            covariance += &by * by.transpose();
        }
        let ratio = Predicted::new(&service, &covariance, &[0.0; COUNT]).worst_ratio();
        assert!((ratio - GOOD_MAX).abs() < 2e-3, "{ratio}");
        // Without a sensor the whole effect of temperature is an error.
        let blind = DMatrix::zeros(COUNT, COUNT);
        let blind = Validity::new(&stage, &parameters, white_m, &blind).expect("a service");
        assert!(
            !blind.is_followed && blind.within_k < 0.3 * rough,
            "{blind:?}"
        );
    }
}

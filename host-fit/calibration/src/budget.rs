//! The uncertainty budget of a calibration in service, by the Guide to the expression of uncertainty in measurement.
//!
//! The noise of the probes and the errors of the fit come first, then each input of `[uncertainty]`. An error of
//! the reference is linear in the pose. The field model has these terms, so the fit absorbs it whole, and the decoded
//! pose is wrong by it. An error of the gaps goes into the slopes of the sensitivities: only a reference that depends on
//! the gaps passes it on. Errors of the sensors after the fit are gains of the probes.

use crate::judge::predicted::{Predicted, declared_service};
use hallstage_input::stage::{Input, Interferometer, Stage};
use hallstage_solver::estimator::parameters::FieldParameters;
use hallstage_solver::estimator::posterior::Posterior;
use hallstage_solver::estimator::terms::CARRY;
use nalgebra::Vector3;
use runtime::capacitive::{gaps_m, vertical_per_gap};
use runtime::matrix::inverse;
use runtime::{Temperature, VerticalPose};
use serde::{Deserialize, Serialize};

/// Errors of X, Y, Rz per X, Y, Rz, Z, Rx, Ry: m and rad.
pub type Effect = [[f64; 6]; 3];

/// A step along an axis, m or rad.
const STEP: f64 = 1e-4;

/// A source of uncertainty. Variances of several errors of one kind add.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Source {
    /// What it is.
    pub name: String,
    /// Its standard uncertainty in `unit`; `None` of a source that the log shows.
    pub value: Option<f64>,
    /// The unit; empty for a part.
    pub unit: String,
    /// Contribution to X, Y, Rz over service, rms: m, m, rad.
    pub rms: [f64; 3],
    /// The largest contribution in service: m, m, rad.
    pub ends: [f64; 3],
    /// An error of one standard uncertainty each; none of a source that the log shows.
    effects: Vec<Effect>,
}

/// All sources of a calibration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Budget {
    /// The sources: first those that the log shows.
    pub sources: Vec<Source>,
    /// Inputs that nothing is declared of.
    pub not_included: Vec<String>,
    /// Degrees of freedom of the fit.
    pub freedom: f64,
    /// Variances of X, Y, Rz by faults and motion: m2, m2, rad2.
    other: [f64; 3],
    /// See [`Predicted::range`].
    range: [[f64; 2]; 3],
}

impl Budget {
    /// The budget over the service of `[motion]`, of parameters of the field model with their posterior, k and h, and the
    /// errors in service by a log with these degrees of freedom. `None` where the probes do not determine a pose.
    pub fn new(
        stage: &Stage,
        (parameters, posterior): (&FieldParameters, &Posterior),
        temperature: &Temperature<f64>,
        predicted: &Predicted,
        freedom: usize,
    ) -> Option<Self> {
        let at_work = declared_service(stage, parameters, posterior.white_m)?;
        let systematic = at_work.variance(&posterior.covariance).systematic;
        let service = stage.motion.axes.map(|axis| axis.service);
        let mut ends = [[0.0f64; 3]; 2];
        for corner in 0..64u32 {
            let side = |axis: usize| if corner >> axis & 1 == 0 { 1.0 } else { -1.0 };
            let at: [f64; 6] = std::array::from_fn(|axis| side(axis) * service[axis]);
            let [x, y, rz, z, rx, ry] = at;
            let there = posterior.at_pose([x, y, rz], [z, rx, ry])?;
            for axis in 0..3 {
                for (end, matrix) in ends.iter_mut().zip([there.noise, there.systematic]) {
                    end[axis] = end[axis].max(matrix[(axis, axis)]);
                }
            }
        }
        let noise = [0, 1, 2].map(|axis| predicted.noise(axis));
        let shown = |name: &str, variances: [[f64; 3]; 2]| {
            let [rms, ends] = variances.map(|of_axes| of_axes.map(f64::sqrt));
            let (name, unit) = (name.to_owned(), String::new());
            Source {
                name,
                value: None,
                unit,
                rms,
                ends,
                effects: Vec::new(),
            }
        };
        let mut budget = Self {
            sources: vec![
                shown("noise of the probes", [noise.map(|x| x * x), ends[0]]),
                shown("parameters by the fit", [systematic, ends[1]]),
                shown("faults and motion that the log shows", [[0.0; 3]; 2]),
            ],
            not_included: Vec::new(),
            freedom: freedom as f64,
            other: [0.0; 3],
            range: predicted.range,
        };
        for (input, name) in NAMES {
            let value = stage.uncertainty.get(input);
            let effects =
                value.and_then(|value| effects(stage, (parameters, temperature), input, value));
            match (value, effects) {
                (Some(value), Some(effects)) => {
                    budget
                        .sources
                        .push(Source::new(name, (value, input.unit()), effects, service));
                }
                _ => budget
                    .not_included
                    .push(format!("{name} (uncertainty.{})", input.key())),
            }
        }
        Some(budget.with_service(predicted))
    }

    /// The budget with the errors in service that a log shows beyond noise and fit.
    #[must_use]
    pub fn with_service(mut self, predicted: &Predicted) -> Self {
        self.range = predicted.range;
        if let [noise, fit, shown, ..] = self.sources.as_mut_slice() {
            let square = |axis: usize, of: [f64; 3]| of[axis] * of[axis];
            self.other = [0, 1, 2].map(|axis| {
                let known = square(axis, noise.rms) + square(axis, fit.rms);
                (square(axis, predicted.rms) - known).max(0.0)
            });
            shown.rms = self.other.map(f64::sqrt);
            shown.ends = shown.rms;
        }
        self
    }

    /// The noise floor of X, Y, Rz, rms over service: m, m, rad.
    pub fn noise(&self) -> [f64; 3] {
        self.sources
            .first()
            .map_or([f64::NAN; 3], |noise| noise.rms)
    }

    /// Errors of X, Y, Rz in service without those of the declared inputs, rms: m, m, rad.
    pub fn in_service(&self) -> [f64; 3] {
        self.variances(false).map(f64::sqrt)
    }

    /// The errors in service that the log shows.
    pub fn predicted(&self) -> Predicted {
        let (rms, noise) = (self.in_service(), self.noise());
        Predicted {
            rms,
            ratio: [0, 1, 2].map(|axis| rms[axis] / noise[axis]),
            range: self.range,
        }
    }

    /// Variances of X, Y, Rz by the declared inputs, or by the sources that the log shows: m2, m2, rad2.
    fn variances(&self, are_declared: bool) -> [f64; 3] {
        let of_kind = self
            .sources
            .iter()
            .filter(|source| source.value.is_some() == are_declared);
        of_kind.fold([0.0; 3], |sum, source| {
            [0, 1, 2].map(|axis| sum[axis] + source.rms[axis].powi(2))
        })
    }

    /// Standard uncertainty of X, Y, Rz by the declared inputs alone, rms over service: m, m, rad.
    pub fn declared(&self) -> [f64; 3] {
        self.variances(true).map(f64::sqrt)
    }

    /// Combined standard uncertainty of X, Y, Rz, rms over service and at its ends: m, m, rad.
    pub fn combined(&self) -> [[f64; 3]; 2] {
        let root = |of: fn(&Source) -> [f64; 3]| {
            let square = |axis: usize| {
                self.sources
                    .iter()
                    .map(move |source| of(source)[axis].powi(2))
            };
            [0, 1, 2].map(|axis| square(axis).sum::<f64>().sqrt())
        };
        [root(|source| source.rms), root(|source| source.ends)]
    }

    /// Effective degrees of freedom of X, Y, Rz (Welch and Satterthwaite); inputs that are declared have infinitely many.
    pub fn effective_freedom(&self) -> [f64; 3] {
        let [combined, _] = self.combined();
        let shown = self.variances(false);
        [0, 1, 2].map(|axis| self.freedom * (combined[axis].powi(2) / shown[axis]).powi(2))
    }

    /// Variances of X, Y, Rz (m2, m2, rad2) at a pose, beside the variances of the posterior.
    pub fn variance_at(&self, planar: [f64; 3], vertical: [f64; 3]) -> [f64; 3] {
        let at = [planar, vertical];
        let at = at.as_flattened();
        let effects = self.sources.iter().flat_map(|source| &source.effects);
        effects.fold(self.other, |sum, effect| {
            let error = effect.map(|row| row.iter().zip(at).map(|(by, x)| by * x).sum::<f64>());
            [0, 1, 2].map(|axis| sum[axis] + error[axis] * error[axis])
        })
    }

    /// Whether all numbers are finite.
    pub fn is_finite(&self) -> bool {
        let of_source = |source: &Source| {
            let effects = source.effects.iter().flatten().flatten();
            let own = source.rms.iter().chain(&source.ends).chain(&source.value);
            own.chain(effects).all(|x| x.is_finite())
        };
        let mut own = self.other.iter().chain(self.range.as_flattened());
        self.sources.iter().all(of_source) && own.all(|x| x.is_finite())
    }
}

impl Source {
    fn new(
        name: &str,
        (value, unit): (f64, &str),
        effects: Vec<Effect>,
        service: [f64; 6],
    ) -> Self {
        let sum = |of_effect: &dyn Fn(&[f64; 6]) -> f64| {
            [0, 1, 2].map(|axis: usize| {
                effects
                    .iter()
                    .map(|by| of_effect(&by[axis]))
                    .sum::<f64>()
                    .sqrt()
            })
        };
        // Half the range is the rms in service.
        let parts =
            |row: &[f64; 6]| std::array::from_fn::<f64, 6, _>(|k| (row[k] * service[k]).abs());
        let rms = sum(&|row| parts(row).iter().map(|part| part * part / 4.0).sum());
        let ends = sum(&|row| parts(row).iter().sum::<f64>().powi(2));
        let (name, unit) = (name.to_owned(), unit.to_owned());
        Self {
            name,
            value: Some(value),
            unit,
            rms,
            ends,
            effects,
        }
    }
}

/// The inputs with errors that the fit does not see.
const NAMES: [(Input, &str); 8] = [
    (Input::BeamScale, "scales of the beams"),
    (Input::Baseline, "distance of the two beams along Y"),
    (Input::BeamPlaces, "places of the beams"),
    (Input::BeamAngles, "angles of the beams"),
    (Input::GapScale, "scale of the capacitive codes"),
    (Input::GapPlaces, "places of the capacitive sensors"),
    (Input::Temperature, "sensors of temperature"),
    (Input::Drift, "gains of the probes since the calibration"),
];

/// Errors of the pose by independent errors of an input; `None` where it is unknown how the input acts.
fn effects(
    stage: &Stage,
    (parameters, temperature): (&FieldParameters, &Temperature<f64>),
    input: Input,
    value: f64,
) -> Option<Vec<Effect>> {
    let declared = &stage.interferometer;
    let reference = |read: &dyn Fn([f64; 3], [f64; 3]) -> ([f64; 3], [f64; 3])| {
        effect(|planar, vertical| {
            let (beams_m, vertical) = read(planar, vertical);
            declared.pose(beams_m, vertical)
        })
    };
    let vertical = |measured: &dyn Fn([f64; 3]) -> [f64; 3]| {
        reference(&|planar, vertical| (declared.beams_m(planar, vertical), measured(vertical)))
    };
    let gains = |parts: [f64; 3]| by_gains(parameters, parts);
    match input {
        Input::GapScale => Some(vec![vertical(&|v| v.map(|x| x * (1.0 + value)))]),
        Input::GapPlaces => {
            let to_vertical = vertical_per_gap(&stage.capacitive_probes_m)?;
            let moved = (0..6).map(|coordinate| {
                let mut places_m = stage.capacitive_probes_m;
                places_m[coordinate / 2][coordinate % 2] += value;
                vertical(&|v| {
                    let gaps_m = gaps_m(&places_m, &VerticalPose::from_array(v));
                    (to_vertical * Vector3::from(gaps_m)).into()
                })
            });
            Some(moved.collect())
        }
        Input::Temperature if !temperature.is_used() => None,
        Input::Temperature => (0..2)
            .map(|sensor| gains(temperature.per_mk.map(|by| 1e3 * by[sensor] * value)))
            .collect(),
        Input::Drift => (0..3)
            .map(|probe| gains([0, 1, 2].map(|k| if k == probe { value } else { 0.0 })))
            .collect(),
        _ => {
            let actual = declared.with_error(input, value).into_iter();
            let read = |actual: Interferometer| {
                reference(&|planar, vertical| (actual.beams_m(planar, vertical), vertical))
            };
            Some(actual.map(read).collect())
        }
    }
}

/// The error of a measured pose by steps along the axes.
fn effect(measured: impl Fn([f64; 3], [f64; 3]) -> [f64; 3]) -> Effect {
    let by_step: [[f64; 3]; 6] = std::array::from_fn(|column| {
        let step = |k: usize| if k == column { STEP } else { 0.0 };
        let planar = [0, 1, 2].map(step);
        let found = measured(planar, [3, 4, 5].map(step));
        [0, 1, 2].map(|axis| (found[axis] - planar[axis]) / STEP)
    });
    [0, 1, 2].map(|axis| by_step.map(|error| error[axis]))
}

/// The error of the pose where the gains of A, B, C are wrong by these parts; the field's terms p, some hundredths, are
/// left out. `None` where the probes do not determine the pose.
fn by_gains(parameters: &FieldParameters, parts: [f64; 3]) -> Option<Effect> {
    let plane = parameters.model_31().geometry().plane();
    let pose_rows = inverse(&plane)?;
    let signal = |probe: usize, k: usize| match k {
        0..3 => plane[(probe, k)],
        _ => parameters.probes[probe][CARRY + k - 3],
    };
    let by = |axis: usize, k: usize| {
        (0..3)
            .map(|probe| pose_rows[(axis, probe)] * parts[probe] * signal(probe, k))
            .sum()
    };
    Some([0, 1, 2].map(|axis| std::array::from_fn(|k| by(axis, k))))
}

#[cfg(test)]
mod tests;

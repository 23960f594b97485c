//! Values of a model's parameters, and the box in which a fit searches for them.

use super::model::{COUNT, GAIN_TERMS, Model, SLOPES_MAX};
use crate::input::stage::{Range, Stage};
use runtime::geometry::{ProbeGeometry, SensingAxes};
use runtime::model::{Probes, Sensitivity};
use runtime::{ModelKind, ParameterSet};

/// Where the misalignments start.
pub const THETA: usize = 3;
/// Where eta starts.
pub const ETA: usize = 6;
/// Where the slopes start: the first of A, B, C, then the second, ...
pub const SLOPES: usize = 3 * GAIN_TERMS;

/// Values of parameters in SI units, in the order of [`Model::parameters`]; zero beyond those that
/// the model has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// The values.
    pub values: [f64; COUNT],
}

impl Parameters {
    /// The designed values: Table 1 of the paper, eta = 1, no slopes.
    pub fn designed(stage: &Stage) -> Self {
        let geometry = stage.designed.geometry([0.0; 3]);
        Self::new(&geometry, [1.0; 3], [[0.0; SLOPES_MAX]; 3])
    }

    /// Of a geometry, eta and the slopes of A, B, C.
    pub fn new(
        geometry: &ProbeGeometry<f64>,
        eta: [f64; 3],
        slopes: [[f64; SLOPES_MAX]; 3],
    ) -> Self {
        let mut values = [0.0; COUNT];
        for probe in 0..3 {
            values[probe] = geometry.lever_arm_m[probe];
            values[THETA + probe] = geometry.misalignment_rad[probe];
            values[ETA + probe] = eta[probe];
            for (k, slope) in slopes[probe].into_iter().enumerate() {
                values[SLOPES + 3 * k + probe] = slope;
            }
        }
        Self { values }
    }

    /// The parameters of a blob or a calibration with the sensitivities of Model (31).
    pub fn of_model_31(geometry: &ProbeGeometry<f64>, sensitivity: &[Sensitivity<f64>; 3]) -> Self {
        let slopes = sensitivity.map(|s| {
            let mut slopes = [0.0; SLOPES_MAX];
            slopes[..3].copy_from_slice(&[s.per_z_m, s.per_rx_rad, s.per_ry_rad]);
            slopes
        });
        Self::new(geometry, sensitivity.map(|s| s.eta), slopes)
    }

    /// Three neighbours of the list: those of A, B, C.
    const fn three(&self, start: usize) -> [f64; 3] {
        let v = &self.values;
        [v[start], v[start + 1], v[start + 2]]
    }

    /// Lever arms and misalignments.
    pub const fn geometry(&self) -> ProbeGeometry<f64> {
        ProbeGeometry {
            lever_arm_m: self.three(0),
            misalignment_rad: self.three(THETA),
        }
    }

    /// eta of A, B, C.
    pub const fn eta(&self) -> [f64; 3] {
        self.three(ETA)
    }

    /// The slopes of A, B, C.
    pub fn slopes(&self) -> [[f64; SLOPES_MAX]; 3] {
        [0, 1, 2].map(|probe| std::array::from_fn(|k| self.values[SLOPES + 3 * k + probe]))
    }

    /// The sensitivities of Model (31), whose slopes are a, b, c.
    pub fn sensitivity(&self) -> [Sensitivity<f64>; 3] {
        let (eta, slopes) = (self.eta(), self.slopes());
        [0, 1, 2].map(|probe| Sensitivity {
            eta: eta[probe],
            per_z_m: slopes[probe][0],
            per_rx_rad: slopes[probe][1],
            per_ry_rad: slopes[probe][2],
        })
    }
}

impl Model {
    /// The coefficients of the probes as the decoder of this model's kind takes them, or `None`
    /// where the parameters hold more slopes than it has.
    pub fn probes(&self, parameters: &Parameters) -> Option<Probes<f64>> {
        let linear = parameters.sensitivity();
        let same = Parameters::of_model_31(&parameters.geometry(), &linear) == *parameters;
        match self.kind {
            ModelKind::M12 | ModelKind::M15 | ModelKind::M30 | ModelKind::M31 => {
                same.then_some(Probes::Linear(linear))
            }
            // Its coefficients are no slopes: see `solve::field`.
            ModelKind::Field => None,
        }
    }
}

impl Parameters {
    /// The parameters that a blob carries, in `f64`: of a field model those that it shares with
    /// Model (31).
    pub fn of_set(set: &ParameterSet) -> Self {
        let geometry = ProbeGeometry {
            lever_arm_m: set.geometry.lever_arm_m.map(f64::from),
            misalignment_rad: set.geometry.misalignment_rad.map(f64::from),
        };
        let sensitivity = set.probes.sensitivities().map(Sensitivity::rounded);
        Self::of_model_31(&geometry, &sensitivity)
    }
}

/// The search box of the parameters; those that the model lacks, or
/// that the stage has no range for, are held. That of the
/// lever arms is the image of the box of the six coordinates at the given misalignments, so it
/// moves with them.
pub fn search_box(
    stage: &Stage,
    model: &'static Model,
    misalignment_rad: [f64; 3],
) -> [Range; COUNT] {
    let mut ranges = [Range {
        low: 0.0,
        high: 0.0,
    }; COUNT];
    for id in model.parameters() {
        ranges[id.index] = if id.index < THETA {
            lever_arm_range(stage, id.probe, misalignment_rad[id.probe])
        } else {
            let held = Range {
                low: id.term.fixed,
                high: id.term.fixed,
            };
            let ranges = stage.search.of(id.term.range_key);
            ranges.map_or(held, |ranges| ranges[id.probe])
        };
    }
    ranges
}

/// The lever arm is linear in its two coordinates: its range is the sum of two intervals.
fn lever_arm_range(stage: &Stage, probe: usize, misalignment_rad: f64) -> Range {
    let factors = SensingAxes::at([misalignment_rad; 3]).arm_factors()[probe];
    let ranges = stage.search.h_m.pairs()[probe];
    let ends = |k: usize| {
        let (a, b) = (ranges[k].low * factors[k], ranges[k].high * factors[k]);
        (a.min(b), a.max(b))
    };
    let ((x_low, x_high), (y_low, y_high)) = (ends(0), ends(1));
    Range {
        low: x_low + y_low,
        high: x_high + y_high,
    }
}

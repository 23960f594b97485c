//! Values of a model's parameters, and their search ranges.

use super::model::{COUNT, GAIN_TERMS, Model};
use hallstage_input::stage::{Range, Stage};
use runtime::ParameterSet;
use runtime::geometry::{ProbeGeometry, SensingAxes};
use runtime::model::Sensitivity;

/// Where the misalignments start.
pub const THETA: usize = 3;
/// Where eta starts.
pub const ETA: usize = 6;
/// Where the slopes start: the first of A, B, C, then the second, ...
pub const SLOPES: usize = 3 * GAIN_TERMS;

/// Values of parameters in SI units, in the order of [`Model::parameters`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// The values.
    pub values: [f64; COUNT],
}

impl Parameters {
    /// The designed values: Table 1 of the paper, eta = 1, no slopes.
    pub fn designed(stage: &Stage) -> Self {
        Self::new(&stage.geometry(), [1.0; 3], [[0.0; 3]; 3])
    }

    /// The parameters with this geometry, eta and slopes of A, B, C.
    pub fn new(geometry: &ProbeGeometry<f64>, eta: [f64; 3], slopes: [[f64; 3]; 3]) -> Self {
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
    pub fn from_model_31(
        geometry: &ProbeGeometry<f64>,
        sensitivity: &[Sensitivity<f64>; 3],
    ) -> Self {
        let slopes = sensitivity.map(|s| [s.per_z_m, s.per_rx_rad, s.per_ry_rad]);
        Self::new(geometry, sensitivity.map(|s| s.eta), slopes)
    }

    /// The parameters with these values, in the order of the list.
    pub fn from_slice(slice: &[f64]) -> Self {
        let mut values = [0.0; COUNT];
        for (value, x) in values.iter_mut().zip(slice) {
            *value = *x;
        }
        Self { values }
    }

    /// The values of A, B, C from a place in the list on.
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

    /// The places nearest to the designed ones (least sum of squared changes) that have these
    /// lever arms, m. They are a choice, not a measurement: see [`runtime::geometry`].
    pub fn nearest_places_m(&self, stage: &Stage) -> [[f64; 2]; 3] {
        let axes = SensingAxes::at(self.three(THETA));
        let mut places_m = stage.places_m();
        let (arms, factors) = (axes.lever_arms_m(places_m), axes.arm_factors());
        for (k, [x, y]) in places_m.iter_mut().enumerate() {
            // A step along the gradient, which has length one.
            let step = self.values[k] - arms[k];
            *x += step * factors[k][0];
            *y += step * factors[k][1];
        }
        places_m
    }

    /// eta of A, B, C.
    pub const fn eta(&self) -> [f64; 3] {
        self.three(ETA)
    }

    /// The slopes of A, B, C.
    pub fn slopes(&self) -> [[f64; 3]; 3] {
        [0, 1, 2].map(|probe| std::array::from_fn(|k| self.values[SLOPES + 3 * k + probe]))
    }

    /// The sensitivities of Model (31).
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

impl Parameters {
    /// The parameters that a blob carries, in `f64`: of a field model those that it shares with
    /// Model (31).
    pub fn from_set(set: &ParameterSet) -> Self {
        let geometry = ProbeGeometry {
            lever_arm_m: set.geometry.lever_arm_m.map(f64::from),
            misalignment_rad: set.geometry.misalignment_rad.map(f64::from),
        };
        let sensitivity = set.probes.sensitivities().map(Sensitivity::rounded);
        Self::from_model_31(&geometry, &sensitivity)
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
    let mut ranges = [Range::new(0.0, 0.0); COUNT];
    let arms_m = lever_arm_ranges(stage, misalignment_rad);
    for id in model.parameters() {
        ranges[id.index] = if id.index < THETA {
            arms_m[id.probe]
        } else {
            let held = Range::new(id.term.fixed, id.term.fixed);
            let ranges = stage.search.get(id.term.range_key);
            let mut range = ranges.map_or(held, |ranges| ranges[id.probe]);
            if id.index < ETA {
                range.low += stage.probes[id.probe].theta_rad;
                range.high += stage.probes[id.probe].theta_rad;
            }
            range
        };
    }
    ranges
}

/// The ranges of the lever arms, m. Each is linear in its two coordinates: its range is the sum of two
/// intervals.
pub fn lever_arm_ranges(stage: &Stage, misalignment_rad: [f64; 3]) -> [Range; 3] {
    let factors = SensingAxes::at(misalignment_rad).arm_factors();
    let places = stage.search.places_m;
    [0, 1, 2].map(|probe| {
        let [x, y] = [0, 1].map(|k| {
            let (range, factor) = (places[probe][k], factors[probe][k]);
            Range::around([range.low * factor, range.high * factor])
        });
        Range::new(x.low + y.low, x.high + y.high)
    })
}

//! The 18 parameters of Model (31) as a fit sees them: names, units, order and search box.
//!
//! The smaller models are the same list with some parameters fixed: (12) fixes eta at 1 and
//! a = b = c = 0, (15) and (30) fix a = b = c = 0.

use crate::input::stage::{Range, Stage};
use runtime::ModelKind;
use runtime::geometry::ProbeGeometry;
use runtime::model::Sensitivity;

/// Number of parameters of Model (31), zero deviations not counted.
pub const COUNT: usize = 18;

/// What a parameter is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Lever arm: third column of PM.
    LeverArm,
    /// Misalignment theta.
    Misalignment,
    /// Sensitivity eta.
    Eta,
    /// a: change of sensitivity with Z.
    PerZ,
    /// b: change of sensitivity with Rx.
    PerRx,
    /// c: change of sensitivity with Ry.
    PerRy,
}

impl Quantity {
    /// Whether it is a change of sensitivity with the vertical pose.
    pub const fn is_vertical(self) -> bool {
        matches!(self, Self::PerZ | Self::PerRx | Self::PerRy)
    }
}

/// One parameter: what it is, and of which probe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ParameterId {
    /// What it is.
    pub quantity: Quantity,
    /// Probe, 0 to 2 for A to C.
    pub probe: usize,
}

const QUANTITIES: [Quantity; 6] = [
    Quantity::LeverArm,
    Quantity::Misalignment,
    Quantity::Eta,
    Quantity::PerZ,
    Quantity::PerRx,
    Quantity::PerRy,
];

impl ParameterId {
    /// The parameter at `index` of the order used everywhere: lever arms A, B, C, then
    /// misalignments, eta, a, b, c. `index` is taken modulo [`COUNT`].
    pub const fn at(index: usize) -> Self {
        Self {
            quantity: QUANTITIES[(index / 3) % 6],
            probe: index % 3,
        }
    }

    /// All parameters in order.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..COUNT).map(Self::at)
    }

    /// Name in reports and JSON, for instance `lever_arm_a`, `theta_b`, `eta_c`, `a_a`.
    pub fn name(self) -> String {
        let quantity = match self.quantity {
            Quantity::LeverArm => "lever_arm",
            Quantity::Misalignment => "theta",
            Quantity::Eta => "eta",
            Quantity::PerZ => "a",
            Quantity::PerRx => "b",
            Quantity::PerRy => "c",
        };
        format!("{quantity}_{}", ["a", "b", "c"][self.probe % 3])
    }

    /// Its SI unit.
    pub const fn unit(self) -> &'static str {
        match self.quantity {
            Quantity::LeverArm => "m",
            Quantity::Misalignment => "rad",
            Quantity::Eta => "1",
            Quantity::PerZ => "1/m",
            Quantity::PerRx | Quantity::PerRy => "1/rad",
        }
    }

    /// Which motion of the stage makes it visible in a log.
    pub const fn seen_in(self) -> &'static str {
        match (self.quantity, self.probe) {
            (Quantity::LeverArm, _) => "Rz motion",
            (Quantity::Misalignment, 2) => "Y motion",
            (Quantity::Misalignment, _) => "X motion",
            (Quantity::Eta, 2) => "X motion",
            (Quantity::Eta, _) => "Y motion",
            (Quantity::PerZ, _) => "movements at different heights Z",
            (Quantity::PerRx, _) => "movements at different tilts Rx",
            (Quantity::PerRy, _) => "movements at different tilts Ry",
        }
    }

    /// Whether `model` fits it.
    pub const fn is_free_in(self, model: ModelKind) -> bool {
        match self.quantity {
            Quantity::LeverArm | Quantity::Misalignment => true,
            Quantity::Eta => model.has_sensitivity(),
            Quantity::PerZ | Quantity::PerRx | Quantity::PerRy => model.has_vertical_terms(),
        }
    }
}

/// Values of the 18 parameters, in SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// Lever arms and misalignments.
    pub geometry: ProbeGeometry<f64>,
    /// eta, a, b, c of the probes.
    pub sensitivity: [Sensitivity<f64>; 3],
}

impl Parameters {
    /// The designed values: Table 1 of the paper, eta = 1, a = b = c = 0.
    pub fn designed(stage: &Stage) -> Self {
        Self {
            geometry: stage.designed.geometry([0.0; 3]),
            sensitivity: [Sensitivity::constant(1.0); 3],
        }
    }

    /// The values in the order of [`ParameterId::at`].
    pub fn to_array(&self) -> [f64; COUNT] {
        let mut out = [0.0; COUNT];
        for k in 0..3 {
            let s = &self.sensitivity[k];
            out[k] = self.geometry.lever_arm_m[k];
            out[3 + k] = self.geometry.misalignment_rad[k];
            out[6 + k] = s.eta;
            out[9 + k] = s.per_z_m;
            out[12 + k] = s.per_rx_rad;
            out[15 + k] = s.per_ry_rad;
        }
        out
    }

    /// From values in the order of [`ParameterId::at`].
    pub fn from_array(p: &[f64; COUNT]) -> Self {
        Self {
            geometry: ProbeGeometry {
                lever_arm_m: [p[0], p[1], p[2]],
                misalignment_rad: [p[3], p[4], p[5]],
            },
            sensitivity: [0, 1, 2].map(|k| Sensitivity {
                eta: p[6 + k],
                per_z_m: p[9 + k],
                per_rx_rad: p[12 + k],
                per_ry_rad: p[15 + k],
            }),
        }
    }

    /// eta of A, B, C.
    pub fn eta(&self) -> [f64; 3] {
        self.sensitivity.map(|s| s.eta)
    }
}

/// The search box of the 18 parameters. That of the lever arms is the image of the box of
/// the six coordinates at the given misalignments, so it moves with them.
pub fn search_box(stage: &Stage, misalignment_rad: [f64; 3]) -> [Range; COUNT] {
    let search = &stage.search;
    let term = |key, probe: usize| search.of(key).unwrap_or_default()[probe];
    std::array::from_fn(|index| {
        let ParameterId { quantity, probe } = ParameterId::at(index);
        match quantity {
            Quantity::LeverArm => lever_arm_range(stage, probe, misalignment_rad[probe]),
            Quantity::Misalignment => term("theta_deg", probe),
            Quantity::Eta => term("eta", probe),
            Quantity::PerZ => term("a_per_m", probe),
            Quantity::PerRx => term("b_per_rad", probe),
            Quantity::PerRy => term("c_per_rad", probe),
        }
    })
}

/// The lever arm is linear in its two coordinates: its range is the sum of two intervals.
fn lever_arm_range(stage: &Stage, probe: usize, misalignment_rad: f64) -> Range {
    let (sin, cos) = misalignment_rad.sin_cos();
    let h = &stage.search.h_m;
    let (x, x_factor, y, y_factor) = match probe {
        0 => (h.h1x_m, cos, h.h1y_m, sin),
        1 => (h.h2x_m, -cos, h.h2y_m, sin),
        _ => (h.h3x_m, sin, h.h3y_m, -cos),
    };
    let ends = |range: Range, factor: f64| {
        let (a, b) = (range.low * factor, range.high * factor);
        (a.min(b), a.max(b))
    };
    let ((x_low, x_high), (y_low, y_high)) = (ends(x, x_factor), ends(y, y_factor));
    Range {
        low: x_low + y_low,
        high: x_high + y_high,
    }
}

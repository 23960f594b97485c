//! The terms of a model: one table that sizes, names, units, search ranges and the fit follow.
//!
//! The sensitivity of a probe is phi = eta + a Z + b Rx + c Ry (equation 33). The first three terms
//! are the lever arm, the misalignment and eta, which together make the gain G = PM^-1 diag(1/eta);
//! those after them are the slopes, in the order of Z, Rx, Ry.

use hallstage_input::axis::AXES;

/// A motion of the stage that shows a parameter in a log, in the order of [`AXES`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// Along X.
    X,
    /// Along Y.
    Y,
    /// About Z.
    Rz,
    /// Along Z.
    Z,
    /// About X.
    Rx,
    /// About Y.
    Ry,
}

impl Motion {
    /// All of them: X, Y, Rz of the reference, then Z, Rx, Ry of the capacitive sensors.
    pub const ALL: [Self; 6] = [Self::X, Self::Y, Self::Rz, Self::Z, Self::Rx, Self::Ry];

    /// The axis, as reports name it.
    pub const fn axis(self) -> &'static str {
        AXES[self as usize].name
    }

    /// um or urad.
    pub const fn micro_unit(self) -> &'static str {
        AXES[self as usize].micro
    }
}

/// One parameter that each of the three probes has.
#[derive(Clone, Copy, Debug)]
pub struct Term {
    /// Name in reports and JSON, before the letter of the probe: `a` in `a_b`.
    pub name: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// Its range in the table `[search]` of `stage.toml`: see
    /// [`SearchRanges::of`](hallstage_input::stage::SearchRanges::get). A lever arm's follows from the
    /// coordinates' ranges instead.
    pub range_key: &'static str,
    /// The motion that shows it, for A, B, C in the directions of the paper; see
    /// [`ParameterId::seen_in`](super::model::ParameterId::seen_in).
    pub seen_in: [Motion; 3],
    /// Its value in models that do not fit it.
    pub fixed: f64,
}

use Motion::{Rx, Ry, Rz, X, Y, Z};

/// The terms of Models (12), (15), (30) and (31), in the order of every list of parameters.
pub const MODEL_31: [Term; 6] = [
    Term {
        name: "lever_arm",
        unit: "m",
        range_key: "",
        seen_in: [Rz; 3],
        fixed: 0.0,
    },
    Term {
        name: "theta",
        unit: "rad",
        range_key: "theta_deg",
        seen_in: [X, X, Y],
        fixed: 0.0,
    },
    Term {
        name: "eta",
        unit: "1",
        range_key: "eta",
        seen_in: [Y, Y, X],
        fixed: 1.0,
    },
    Term {
        name: "a",
        unit: "1/m",
        range_key: "a_per_m",
        seen_in: [Z; 3],
        fixed: 0.0,
    },
    Term {
        name: "b",
        unit: "1/rad",
        range_key: "b_per_rad",
        seen_in: [Rx; 3],
        fixed: 0.0,
    },
    Term {
        name: "c",
        unit: "1/rad",
        range_key: "c_per_rad",
        seen_in: [Ry; 3],
        fixed: 0.0,
    },
];

/// A value of a term as people read it, with its unit: misalignments in mrad, everything else in SI.
pub fn shown(value: f64, unit: &str) -> (f64, &str) {
    match unit {
        "rad" => (value * 1e3, "mrad"),
        _ => (value, unit),
    }
}

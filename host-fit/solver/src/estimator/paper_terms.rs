//! The terms of a model: one table that sizes, names, units, search ranges and the fit follow.
//!
//! The sensitivity of a probe is phi = eta + a Z + b Rx + c Ry (equation 33). The first three terms
//! are the lever arm, the misalignment and eta, which together make the gain G = PM^-1 diag(1/eta);
//! those after them are the slopes, in the order of Z, Rx, Ry.

use hallstage_input::channel::Channel::{self, Rx, Ry, Rz, X, Y, Z};

/// One parameter that each of the three probes has.
#[derive(Clone, Copy, Debug)]
pub struct PaperTerm {
    /// Name in reports and JSON, before the letter of the probe: `a` in `a_b`.
    pub name: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// Its range in the table `[search]` of `stage.toml`: see
    /// [`SearchRanges::of`](hallstage_input::stage::SearchRanges::get). A lever arm's follows from the
    /// coordinates' ranges instead.
    pub range_key: &'static str,
    /// The axis that has to move to show it, for A, B, C in the directions of the paper; see
    /// [`ParameterId::seen_in`](super::model::ParameterId::seen_in).
    pub seen_in: [Channel; 3],
    /// Its value in models that do not fit it.
    pub fixed: f64,
}

/// The terms of Models (12), (15), (30) and (31), in the order of every list of parameters.
pub const MODEL_31: [PaperTerm; 6] = [
    PaperTerm {
        name: "lever_arm",
        unit: "m",
        range_key: "",
        seen_in: [Rz; 3],
        fixed: 0.0,
    },
    PaperTerm {
        name: "theta",
        unit: "rad",
        range_key: "theta_deg",
        seen_in: [X, X, Y],
        fixed: 0.0,
    },
    PaperTerm {
        name: "eta",
        unit: "1",
        range_key: "eta",
        seen_in: [Y, Y, X],
        fixed: 1.0,
    },
    PaperTerm {
        name: "a",
        unit: "1/m",
        range_key: "a_per_m",
        seen_in: [Z; 3],
        fixed: 0.0,
    },
    PaperTerm {
        name: "b",
        unit: "1/rad",
        range_key: "b_per_rad",
        seen_in: [Rx; 3],
        fixed: 0.0,
    },
    PaperTerm {
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

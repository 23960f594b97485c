//! Settings that are chosen by name, on the command line and in Python.

use crate::output::pose_file::PoseFormat;
use hallstage_calibration::fit::ModelChoice;
use hallstage_calibration::judge::Zeros;
use hallstage_input::log::BadRows;
use hallstage_simulate::protocol::Protocol;
use hallstage_solver::estimator::draw::Draw;
use hallstage_solver::estimator::model::MODELS;
use hallstage_solver::estimator::robust::Loss;
use hallstage_solver::estimator::update::Change;
use hallstage_solver::solve::{Projection, Solver};

/// A setting that is chosen by name.
pub trait Choice: Clone + Send + Sync + 'static {
    /// Each value, its name and its help, which may be empty.
    fn all() -> Vec<(Self, &'static str, &'static str)>;
}

/// The name of a value.
pub fn name_of<T: Choice + PartialEq>(value: &T) -> &'static str {
    let mut all = T::all().into_iter();
    all.find(|(known, ..)| known == value)
        .map_or("", |(_, name, _)| name)
}

/// Choices for the variants of an enum: name and help of each.
macro_rules! values {
    ($($type:ty { $($variant:ident: $name:literal, $help:literal;)* })*) => {$(
        impl $crate::calibrate::Choice for $type {
            fn all() -> Vec<(Self, &'static str, &'static str)> {
                vec![$((Self::$variant, $name, $help)),*]
            }
        }
    )*};
}
pub(crate) use values;

values! {
    Projection {
        None: "none", "No part: every zero deviation is an unknown of its own, within its range (the paper)";
        Delta: "delta", "The zero deviations";
        Linear: "linear", "Everything linear: the gain G and one offset for each movement. Nine unknowns of model 31 are left";
    }
    Loss {
        Cauchy: "cauchy", "Hardly at all (the default)";
        Huber: "huber", "As rows at the limit of 6 robust standard deviations do";
        None: "none", "As any other: plain least squares";
    }
    Draw {
        Stratified: "stratified", "Each movement gives its share, so that none is missed while N is at least their number";
        Plain: "plain", "As the paper draws: any row with the same chance. Most draws of 200 rows out of 57 movements miss a movement; its zero deviation is then free";
    }
    Zeros<'static> {
        Refit: "fit", "Refit them for each movement";
        None: "zero", "Take none off: the pose of the target without a re-zero";
    }
    Protocol {
        Paper: "paper", "The paper's: at the 19 settings of its Table 6, a sine along Y, X and Rz in turn";
        Combined: "combined", "All six axes at once, 8 movements of 8 s";
        Service: "service", "As combined, other trajectories, interferometers zeroed truly";
        Day: "day", "A working day: 37 pieces of service, one each quarter of an hour, each after 0.4 s at rest";
        Fast: "fast", "Moves of 60 ms between random poses, up to 1.4 m/s2, interferometers zeroed truly";
    }
    BadRows {
        Refuse: "refuse", "Stop at the first and say where it is";
        Skip: "skip", "Leave them out and count them";
    }
    Change {
        Gain: "gain", "One gain for all probes: 2 s of a sine along Y determine it";
        Gains: "gains", "A gain for each probe: 2 s of X, Y and Rz moving at once";
        All: "all", "All parameters, as after a probe was seated anew: 8 s of all six axes moving at once";
        Temperature: "temperature", "The temperature: each run of 8 s at another temperature improves k and h";
    }
    PoseFormat {
        Csv: "csv", "Text";
        Npy: "npy", "A structured array for numpy.load, in SI units, the decoder's words bit for bit";
    }
}

impl Choice for Solver {
    fn all() -> Vec<(Self, &'static str, &'static str)> {
        Self::all().map(|value| (value, value.name(), "")).collect()
    }
}

impl Choice for ModelChoice {
    /// `auto`, and the models of the table.
    fn all() -> Vec<(Self, &'static str, &'static str)> {
        let auto = "The field model where the log can carry it, else 31";
        let named = MODELS
            .iter()
            .map(|model| (Self::Named(model), model.name, model.summary));
        [(Self::Auto, "auto", auto)]
            .into_iter()
            .chain(named)
            .collect()
    }
}

//! Why there is no plan, and why a calibration is not brought up to date.

use super::fit::no_field;
use crate::plan::{PlanError, RATIO_MAX};
use crate::recalibrate::RecalibrateError;
use hallstage_solver::estimator::update::Change;
use std::fmt::{Display, Formatter, Result};

impl Display for PlanError {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match self {
            Self::TooFast { axis, amplitude, seconds } => {
                let unit = if axis.starts_with('r') { "µrad" } else { "µm" };
                let micro = amplitude * 1e6;
                write!(
                    f,
                    "a run of {seconds} s cannot move {axis} by {micro:.1} {unit} to both sides within the limits of its speed and acceleration; make the run longer, or change amplitude or limits in [motion] of stage.toml"
                )
            }
            Self::TooFewFrequencies { seconds } => write!(
                f,
                "a run of {seconds} s is too short for six different frequencies within the limits of speed and acceleration; make it longer, or raise the limits in [motion] of stage.toml"
            ),
            Self::NoPose => f.write_str(
                "the probes as designed do not determine every pose of the service; correct [hall] or the range of service in [motion] of stage.toml",
            ),
            Self::NotDetermined { seconds, ratios: [x, y, rz], short_axes } => {
                let remedy = match short_axes.as_slice() {
                    [] => "make the run longer".to_owned(),
                    axes => format!(
                        "move {} over their whole range of service: raise the amplitude in [motion] of stage.toml, or make the run longer",
                        axes.join(", ")
                    ),
                };
                write!(
                    f,
                    "a run of {seconds} s does not determine the field model: errors predicted for service are {x:.2} / {y:.2} / {rz:.2} times the noise floor in X / Y / Rz, where {RATIO_MAX} is the most; {remedy}"
                )
            }
        }
    }
}

impl Display for RecalibrateError {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match self {
            Self::OtherModel { model } => write!(
                f,
                "the blob is of {model}, and only the field model knows what it has to expect: fit again, with --model field"
            ),
            Self::NothingKnown => {
                f.write_str("without the old posterior nothing but gains can be found: fit again")
            }
            Self::OwnLog(logs) => write!(
                f,
                "the blob was fitted to {}, which shows no change since: record a new log",
                logs.join(", ")
            ),
            Self::NoTemperature(what) => write!(
                f,
                "{what} has no temperatures: name their columns in [temperature] of the stage file, and fit a cold and a warm log together"
            ),
            Self::NotCarried {
                change,
                ratios: [x, y, rz],
            } => {
                let (assumed, recording) = (assumed(*change), recording(*change));
                write!(
                    f,
                    "this log does not tell {assumed}: it leaves errors of {x:.2} / {y:.2} / {rz:.2} times the noise floor in X / Y / Rz in service. Record {recording}"
                )
            }
            Self::NotDescribed {
                change,
                ratio,
                limit,
            } => {
                let (assumed, remedy) = (assumed(*change), remedy(*change));
                write!(
                    f,
                    "{assumed} does not describe this log: its residuals are {ratio:.1} times what noise makes them (chi-square, limit {limit:.2}). Is it the blob of this stage? If it is, {remedy}"
                )
            }
            Self::TooFar {
                change,
                prior,
                limit,
            } => write!(
                f,
                "{} would be one beyond all that probes drift or are moved by (sum of squares {prior:.0} against what the prior allows for, limit {limit:.0}): check that the log is of this stage, and its columns, order and signs; or fit again",
                assumed(*change)
            ),
            Self::Unsolved(error) => f.write_str(&no_field(error)),
            Self::Unusable(error) => {
                write!(
                    f,
                    "the new parameters cannot be used: {error}. Check the log and the stage file"
                )
            }
        }
    }
}

const fn assumed(change: Change) -> &'static str {
    match change {
        Change::Gain => "one gain for all probes",
        Change::Gains => "a gain for each probe",
        Change::All => "a change of all parameters",
        Change::Temperature => "a change of temperature alone",
    }
}

const fn recording(change: Change) -> &'static str {
    match change {
        Change::Gain => "a sine along Y at service amplitude, 2 s",
        Change::Gains => {
            "X, Y and Rz moving at once, each at a frequency of its own, 2 s; or try --what gain"
        }
        Change::All | Change::Temperature => {
            "all six axes moving at once at service amplitude, each at a frequency of its own (host-fit plan --seconds 8); or try --what gains"
        }
    }
}

const fn remedy(change: Change) -> &'static str {
    match change {
        Change::Gain => "try --what gains; if a probe was moved, --what all",
        Change::Gains | Change::Temperature => "something else has changed as well: try --what all",
        Change::All => "check the columns, signs and scales of the log, or fit again",
    }
}

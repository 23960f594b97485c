//! What is wrong with a log, or remarkable about it, in a form that programs can rely on.

use serde::Serialize;

/// What is to be done about a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Nothing: worth knowing.
    Note,
    /// The calibration is good, but less so than it could be, or less certain.
    Warn,
    /// The calibration would be wrong: nothing is written.
    Refuse,
}

/// What was found. Names are stable.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Code {
    /// Two Hall channels stand in each other's place.
    ChannelsSwapped,
    /// A Hall channel has the wrong sign.
    ChannelInverted,
    /// Two beams of the interferometers stand in each other's place.
    BeamsSwapped,
    /// A beam has the wrong sign.
    BeamInverted,
    /// Two capacitive channels, or their places in stage.toml, are exchanged.
    CapacitiveSwapped,
    /// Capacitive channels, or a coordinate of theirs in stage.toml, have the wrong sign.
    CapacitiveInverted,
    /// A scale or a length is wrong by a large factor.
    ScaleWrong,
    /// The reference shows an earlier or later pose than the probes.
    ReferenceLag,
    /// A disturbance of one frequency.
    Hum,
    /// A channel drifts.
    Drift,
    /// The gain of a channel drifts.
    GainDrift,
    /// The reference or a channel steps.
    Step,
    /// A channel stands still while the others move.
    Stuck,
    /// A movement in which nothing moves.
    IdleMovement,
    /// Codes at the end of a converter's range.
    Saturated,
    /// Rows far outside the noise.
    Outliers,
    /// Rows that count less than half in a fit.
    LeftOut,
    /// Movements whose own zero deviations take their errors.
    ShortMovements,
    /// Servo periods without a row.
    RowsMissing,
    /// Rows come at uneven times, or at another rate than the servo's.
    Jitter,
    /// The logs of one fit do not belong to the same stage in the same state.
    LogsDisagree,
    /// Zero deviations beyond their range.
    ZeroClipped,
    /// Parameters at an end of their search range.
    TermsAtLimit,
    /// Poses beyond the range of the calibration.
    OutOfRange,
    /// The log shows more than the model can describe, or cannot carry a better one.
    ModelLacks,
}

/// One finding.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// What was found.
    pub code: Code,
    /// What is to be done about it.
    pub severity: Severity,
    /// A sentence with evidence and remedy.
    pub message: String,
    /// The channel: `hall_a`, `cap_1`, `ifm_y1`, `x`, ...
    pub channel: Option<String>,
    /// The movement, by [`Dataset::movement_name`](crate::input::dataset::Dataset::movement_name).
    pub movement: Option<String>,
    /// When, us in the log.
    pub t_us: Option<i64>,
    /// How large, in `unit`.
    pub value: Option<f64>,
    /// Unit of the value.
    pub unit: Option<&'static str>,
}

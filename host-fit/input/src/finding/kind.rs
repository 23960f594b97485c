//! What a finding measured.

use super::Code;
use crate::channel::Channel;

/// The quantity of a channel that changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Its gain, %.
    Gain,
    /// Its zero, um.
    Zero,
    /// Its time, ms: positive if the channel is late.
    Time,
}

impl Quantity {
    /// The unit of a change.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Gain => "%",
            Self::Zero => "um",
            Self::Time => "ms",
        }
    }
}

/// The course of a change of a channel over the log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TimeCourse {
    /// It is the same in the whole log.
    Constant,
    /// It begins at the place of the finding.
    Onset,
    /// It begins with this log.
    Log(String),
    /// It grows evenly over the logs.
    OverLog,
    /// It grows evenly in each movement; the size is the growth per second.
    OverMovement,
}

/// What sets a log right that does not fit to its stage.
#[derive(Clone, Debug, PartialEq)]
pub enum Correction {
    /// Two channels are exchanged.
    Exchange([Channel; 2]),
    /// All channels of a kind are read in this order.
    Order(Channel, [Channel; 3]),
    /// The scale of these channels is multiplied by the value.
    Scale(Vec<Channel>),
    /// The sign of these channels is turned.
    Sign(Vec<Channel>),
    /// Rz of the reference, 1 / `interferometer.y_baseline_m`, is multiplied by the value.
    BaselineScale,
    /// The distances of the Hall probes from the middle are multiplied by the value.
    HallPlaces,
    /// The distances of the capacitive sensors from the middle are multiplied by the value.
    GapPlaces,
    /// A coordinate of a capacitive sensor in `stage.toml`, "x" or "y", has this value, m.
    GapPlace(Channel, &'static str, f64),
    /// The places of the capacitive sensors are turned by the value, degrees.
    GapsTurned,
    /// The same, after they are mirrored along x.
    GapsMirrored,
}

impl Correction {
    /// The channels that are wrong.
    pub fn channels(&self) -> Vec<Channel> {
        match self {
            Self::Exchange(pair) => pair.to_vec(),
            Self::Order(all, _) => vec![*all],
            Self::Scale(some) | Self::Sign(some) => some.clone(),
            Self::BaselineScale => vec![Channel::Rz],
            Self::HallPlaces => vec![Channel::Halls],
            Self::GapPlace(sensor, ..) => vec![*sensor],
            Self::GapPlaces | Self::GapsTurned | Self::GapsMirrored => vec![Channel::Gaps],
        }
    }

    /// Whether it is the scale of all beams.
    pub fn is_scale_of_beams(&self) -> bool {
        matches!(self, Self::Scale(some) if some[..] == [Channel::Beams])
    }

    /// The unit of the value; empty for a factor.
    pub const fn unit(&self) -> &'static str {
        match self {
            Self::GapsTurned | Self::GapsMirrored => "degrees",
            _ => "",
        }
    }
}

/// A correction with its value, where it has one: the best, the least and the largest that explain the log.
#[derive(Clone, Debug, PartialEq)]
pub struct Cause {
    /// What sets the log right.
    pub correction: Correction,
    /// A factor or an angle, degrees.
    pub values: Option<[f64; 3]>,
}

/// One row for each kind: its fields, its code and, where it has one, its size with the unit that JSON names.
macro_rules! kinds {
    ($($(#[doc = $doc:literal])* $kind:ident { $($field:ident: $type:ty),* } => $code:expr $(, $value:expr, $unit:expr)?;)*) => {
        /// What was measured. A name ends in its unit; `micro` is um or urad, as the axis has it. The channel and the
        /// place stand in the finding.
        #[derive(Clone, Debug, PartialEq)]
        #[expect(missing_docs, reason = "the names of the fields say what they are")]
        pub enum Kind { $($(#[doc = $doc])* $kind { $($field: $type),* },)* }

        impl Kind {
            /// Its code.
            #[expect(unused_variables, reason = "most codes follow from the kind alone")]
            pub const fn code(&self) -> Code {
                match self { $(Self::$kind { $($field),* } => $code,)* }
            }

            /// How large it is, with the unit.
            #[expect(unused_variables, reason = "one of the fields is the size")]
            pub fn size(&self) -> Option<(f64, &'static str)> {
                match self { $(Self::$kind { $($field),* } => None$(.or(Some(($value, $unit))))?,)* }
            }
        }
    };
}

kinds! {
    // Of a file.
    /// Movements of one row; the number of the first.
    SingleRows { file: String, first: i64, movements: usize } => Code::ShortMovements, *movements as f64, "movements";
    /// The last line has no line break.
    FileCut { file: String, line: usize } => Code::FileCut;
    /// Columns that are left out, by name.
    ColumnsLeftOut { file: String, columns: Vec<String> } => Code::ColumnsLeftOut, columns.len() as f64, "columns";
    /// Movements are separated by the time, after a gap of more than `gap_rows` rows and where the time starts again.
    MovementsByTime { file: String, movements: usize, gap_rows: i64 } => Code::MovementsByTime, *movements as f64, "movements";
    /// Beams jump and the probes do not, as where interferometers are reset or slip.
    Resets { resets: usize } => Code::Step, *resets as f64, "resets";
    /// Mean distance of voltages from whole codes.
    BetweenCodes { file: String, mean_codes: f64 } => Code::BetweenCodes, *mean_codes, "codes";
    /// A fit uses `taken` rows in `runs` of rows that follow each other.
    Excerpt { rows: usize, taken: usize, runs: usize } => Code::Excerpt, *taken as f64, "rows";
    /// Rows with the same fault, and the cell of the first.
    RowsSkipped { file: String, reason: &'static str, rows: usize, line: usize, column: usize, name: String } => Code::RowsSkipped, *rows as f64, "rows";
    /// Movements without a row that is kept.
    MovementsSkipped { file: String, movements: Vec<i64>, rows: usize } => Code::RowsSkipped, *rows as f64, "rows";

    // Of the times and the signals of a log.
    /// Servo periods without a row.
    RowsMissing { rows: f64, percent: f64, gaps: usize } => Code::RowsMissing, *rows, "rows";
    /// Distance of the times from an even rate.
    UnevenTimes { rms_us: f64 } => Code::Jitter, *rms_us, "us";
    /// Rows are farther apart than servo periods; `periods` if that is a whole number.
    OtherRate { period_us: f64, servo_us: f64, periods: Option<f64> } => Code::Jitter, *period_us, "us";
    /// Times or temperatures are this many times what the design expects, as where units are read as others.
    OtherUnit { what: &'static str, ratio: f64, units: &'static str } => Code::ScaleWrong, *ratio, "";
    /// Movements without motion.
    IdleMovements { movements: usize, of: usize } => Code::IdleMovement;
    /// A channel repeats a value, which may be its largest or its smallest, or shows its noise alone, while it should move.
    Stands { rows: usize, percent: f64, longest_s: f64, is_end: bool } => if *is_end { Code::Saturated } else { Code::Stuck }, if *is_end { *rows as f64 } else { *longest_s }, if *is_end { "rows" } else { "s" };

    // Of each channel alone.
    /// Rows of a channel far from the rows before and behind.
    OutlierRows { rows: usize, largest_um: f64 } => Code::Outliers, *rows as f64, "rows";
    /// A line in the spectrum of a channel.
    Hum { frequency_hz: f64, amplitude_um: f64 } => Code::Hum, *frequency_hz, "Hz";
    /// The values are whole steps.
    CoarseSteps { step_um: f64, noise_um: f64 } => Code::Coarse, *step_um, "um";
    /// Bits of a code that never change.
    StuckBits { bits: Vec<u32>, step_um: f64 } => Code::StuckBit, *step_um, "um";
    /// The noise over the noise of the other channels of the kind.
    Noisy { noise_um: f64, ratio: f64 } => Code::Noisy, *ratio, "times";
    /// Noise of a kind of channels beyond the noise that each has of its own all the time; the part that all have at once.
    GroupNoise { percent: f64 } => Code::Noisy, *percent, "%";
    /// New values come every few rows, and values between them are held or interpolated.
    SlowRate { rows: usize, is_held: bool } => Code::Slow, *rows as f64, "rows";
    /// The noise falls towards high frequencies by more than a sensor's does.
    LowPass {} => Code::Slow;
    /// A gap in a channel is filled by a line.
    Filled { rows: usize } => Code::Slow, *rows as f64, "rows";
    /// A counter with this number of bits overflows.
    Overflows { bits: u32, times: usize } => Code::Overflow, *times as f64, "times";

    // Of the residuals.
    /// A change of a channel, in the unit of the quantity.
    Change { quantity: Quantity, course: TimeCourse, size: f64 } => code_of_change(*quantity, course), *size, quantity.unit();
    /// From here on other parameters describe the log.
    OtherState { log: Option<String> } => Code::LogsDisagree;
    /// The Hall residuals over their noise, where no fault explains them.
    Inconsistent { ratio: f64 } => Code::ModelLacks, *ratio, "times";
    /// Predicted errors of X, Y, Rz in service over the noise floor, because the log does not determine the parameters.
    NotDetermined { ratios: [f64; 3] } => Code::NotDetermined;
    /// The worst of these ratios, from all faults of the log together.
    FaultsTogether { ratio: f64 } => Code::NotDetermined;
    /// A mistake with channels, scales or places; several causes where the log cannot tell them apart.
    Mistake { code: Code, causes: Vec<Cause>, is_sure: bool, may_be_magnets: bool } => *code, size_of_mistake(causes)?.0, size_of_mistake(causes)?.1;
    /// A Hall signal does not follow the reference: no order, sign, scale or place explains it.
    NotLinear {} => Code::ModelLacks;
    /// The probes are so far from the drawing, in tolerances, and no single mistake explains it.
    OtherProbes { tolerances: f64 } => Code::TermsAtLimit;

    // Of a fit.
    /// Rows of a movement on average, and the part of the errors that its zero deviation hides.
    ShortMovements { mean_rows: f64, hidden_percent: f64 } => Code::ShortMovements, *mean_rows, "rows";
    /// The model is not the field model. Ranges of the errors in service of X, Y, Rz.
    OtherModel { reason: String, in_service_micro: Option<[[f64; 2]; 3]> } => Code::ModelLacks;
    /// Zero deviations beyond their range.
    ZerosClipped { movements: usize, of: usize, largest_um: f64 } => Code::ZeroClipped, *movements as f64, "movements";
    /// Rows that the decoder refuses.
    CodesRefused { rows: usize } => Code::Saturated, *rows as f64, "rows";
    /// The reference is later than the probes, in servo periods, too; beside a latency that is declared, the probes are early.
    LateReference { lag_us: f64, periods: f64, is_declared: bool } => Code::ReferenceLag, *lag_us, "us";
    /// A parameter stands at an end of its search range: its value as reports show it, and in SI.
    AtLimit { parameter: String, shown: (f64, &'static str), value: f64, unit: &'static str } => Code::TermsAtLimit, *value, *unit;
    /// Movements without a row in a draw.
    MovementsMissed { movements: Vec<String> } => Code::RowsMissing, movements.len() as f64, "movements";

    // Of the range and the temperature.
    /// An axis moves otherwise than `[motion]` declares, to either side.
    OtherMotion { micro: f64, service_micro: f64, unit: &'static str, is_scale: bool } => Code::OutOfRange, *micro, *unit;
    /// Predicted errors in the speed and the acceleration that `[motion]` declares for service, over the noise floor of the
    /// worst axis, without and with the correction, the rms motion up to which they are good, and the lags of A, B, C
    /// behind the middle probe.
    InMotion { ratio: f64, corrected_ratio: f64, acceleration_m_s2: f64, speed_mm_s: f64, shows_acceleration: bool, lag_us: [f64; 3] } => Code::Motion, *acceleration_m_s2, "m/s2";
    /// The motion of a log and the motion that `[motion]` declares for service, rms over the axes, and the errors on the log
    /// over the noise floor of the worst axis, without and with the correction.
    FasterLog { acceleration_m_s2: [f64; 2], speed_mm_s: [f64; 2], ratio: f64, corrected_ratio: Option<f64> } => Code::Motion, acceleration_m_s2[0], "m/s2";
    /// Rows beyond the calibrated range of a blob.
    BeyondRange { rows: usize, of: usize } => Code::OutOfRange, *rows as f64, "rows";
    /// k or h of Hall A, B, C with their standard errors, %/K, and where they are from.
    Coefficients { sensor: usize, percent_per_k: [[f64; 2]; 3], zero_c: f64, span_k: f64, is_field: bool, deviations: Option<f64> } => Code::Temperature, *span_k, "K";
    /// The columns of the two temperatures, exchanged, explain the gains better by this logarithm of odds.
    TemperaturesExchanged { log_odds: f64 } => Code::ScaleWrong;
    /// Rows without a temperature, or with one that is farther than `reach_k` from the calibration.
    NoTemperature { rows: usize, of: usize, reach_k: u32 } => Code::Temperature, *rows as f64, "rows";
    /// The temperature changes by more than a zero holds.
    TemperatureChange { sensor: usize, change_k: f64, is_in_movement: bool, rezero_k: f64 } => Code::Temperature, *change_k, "K";
}

const fn code_of_change(quantity: Quantity, course: &TimeCourse) -> Code {
    match (quantity, course) {
        (_, TimeCourse::Log(_)) => Code::LogsDisagree,
        (Quantity::Gain, _) => Code::GainDrift,
        (Quantity::Time, _) => Code::ReferenceLag,
        (Quantity::Zero, TimeCourse::Onset | TimeCourse::Constant) => Code::Step,
        (Quantity::Zero, _) => Code::Drift,
    }
}

/// The value of the only cause.
fn size_of_mistake(causes: &[Cause]) -> Option<(f64, &'static str)> {
    match causes {
        [cause] => Some((cause.values?[0], cause.correction.unit())),
        _ => None,
    }
}

//! The table of codes: what holds for every finding of a code.

use super::Severity;
use serde::{Serialize, Serializer};

/// Whether the predicted errors in service hold beside a finding that is more than a note.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trust {
    /// They hold.
    Kept,
    /// They do not hold: the verdict is at best limited.
    Lost,
    /// They hold if the finding is about beams, which do not exist in service.
    LostOfSensors,
    /// They hold if the finding is about sensors: its cost in service is in them.
    LostOfBeams,
}

/// All that holds for every finding of a code.
#[derive(Debug)]
pub struct Entry {
    /// The code.
    pub code: Code,
    /// Its name in JSON.
    pub name: &'static str,
    /// Severity, unless a size decides.
    pub severity: Severity,
    /// Its meaning.
    pub meaning: &'static str,
    /// Its remedy.
    pub remedy: &'static str,
    /// Findings that are consequences of this code and are hidden beside it.
    pub hides: &'static [Code],
    /// Whether the prediction for service holds beside it.
    pub trust: Trust,
    /// The least severity that explains a failed fit; `None` if no severity does.
    pub explains_from: Option<Severity>,
}

/// The codes and their table, in one order.
macro_rules! codes {
    ($($code:ident, $name:literal, $severity:ident, $meaning:literal, $remedy:literal,
        [$($hidden:ident)*], $trust:ident, $explains:expr;)*) => {
        /// What was found. Names are stable.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        #[expect(missing_docs, reason = "TABLE describes them")]
        pub enum Code { $($code,)* }

        /// One row for each code, in the order of [`Code`].
        pub static TABLE: [Entry; [$($name),*].len()] = [$(Entry {
            code: Code::$code,
            name: $name,
            severity: Severity::$severity,
            meaning: $meaning,
            remedy: $remedy,
            hides: &[$(Code::$hidden),*],
            trust: Trust::$trust,
            explains_from: $explains,
        }),*];
    };
}

const WARN: Option<Severity> = Some(Severity::Warn);
const ALWAYS: Option<Severity> = Some(Severity::Note);

// Code, name, usual severity, meaning, remedy, hidden codes, trust in the prediction, and the least severity that
// explains a failed fit.
#[rustfmt::skip]
codes! {
    ChannelsSwapped, "channels_swapped", Refuse, "two Hall channels are exchanged", "check wires, column order and stage.toml", [], Kept, WARN;
    ChannelInverted, "channel_inverted", Refuse, "a Hall channel has the wrong sign", "check wires, the sensor's direction and stage.toml", [], Kept, WARN;
    BeamsSwapped, "beams_swapped", Refuse, "two beams of the interferometers are exchanged", "check the column order", [], Kept, WARN;
    BeamInverted, "beam_inverted", Refuse, "a beam has the wrong sign", "check the interferometer's direction setting", [], Kept, WARN;
    CapacitiveSwapped, "capacitive_swapped", Refuse, "two capacitive channels, or their places in stage.toml, are exchanged", "check wires, column order and capacitive.probes_m", [], Kept, WARN;
    CapacitiveInverted, "capacitive_inverted", Refuse, "capacitive channels, or coordinates of capacitive sensors in stage.toml, have the wrong sign", "check wires, signs and capacitive.probes_m", [], Kept, WARN;
    ScaleWrong, "scale_wrong", Refuse, "a scale, a unit or a length is wrong", "check units, single or double pass, and the scales in stage.toml", [], Lost, WARN;
    ReferenceLag, "reference_lag", Warn, "the reference or one channel is earlier or later than the others", "set the delay of the channel to zero; in service a late Hall probe or capacitive sensor makes the pose wrong while the stage moves", [], LostOfSensors, WARN;
    Hum, "hum", Warn, "a channel has a disturbance of one frequency", "look for mains (50 or 60 Hz and multiples) in the cable and the supply, or for a vibration", [ReferenceLag], Kept, WARN;
    Drift, "drift", Warn, "the zero of a channel drifts", "let the stage and its electronics warm up", [TermsAtLimit ZeroClipped], Kept, WARN;
    GainDrift, "gain_drift", Warn, "the gain of a channel changes", "let the channel warm up, and check its supply", [TermsAtLimit], Kept, WARN;
    Step, "step", Warn, "the zero of a channel jumps and stays there", "record the movement again", [TermsAtLimit ZeroClipped], Kept, WARN;
    Stuck, "stuck", Warn, "a channel stands still while the others move", "check the cable, the register and the drive, and leave these rows out", [TermsAtLimit ZeroClipped Step], Kept, WARN;
    IdleMovement, "idle_movement", Warn, "nothing moves in a movement", "leave it out, or record it again", [], Kept, WARN;
    Saturated, "saturated", Warn, "codes stand at the end of a converter's range", "reduce the gain or the motion", [TermsAtLimit ZeroClipped LogsDisagree], LostOfSensors, WARN;
    Overflow, "overflow", Refuse, "a counter of a channel overflows", "read the channel with more bits, or unwrap it before the log is written", [ChannelInverted ScaleWrong Step GainDrift], Kept, WARN;
    StuckBit, "stuck_bit", Warn, "a bit of a code never changes, so that steps are missing", "check the converter and its bus; in service the missing steps make the pose wrong", [Hum GainDrift], LostOfBeams, WARN;
    Coarse, "coarse", Warn, "a channel is written in steps that are larger than the noise", "write more digits, or use a converter with more bits", [], LostOfBeams, WARN;
    Slow, "slow", Warn, "a channel is sampled at a lower rate, averaged or low-pass filtered", "record each channel in each servo period, and turn filters and averaging off", [Hum ReferenceLag Step GainDrift Drift Stuck], Lost, WARN;
    Noisy, "noisy", Warn, "a channel has more noise than the others of its kind, or more at times", "check its cable, shield, supply and reading", [], LostOfBeams, WARN;
    Outliers, "outliers", Warn, "rows are far outside the noise", "look for lost pulses, sparks and wrong bits", [], Kept, WARN;
    ShortMovements, "short_movements", Warn, "movements are so short that their own zero deviations hide errors", "check the times and the movement column", [], Kept, WARN;
    RowsMissing, "rows_missing", Warn, "servo periods have no row, or a draw has no row of a movement", "use a recorder that keeps up, or a larger --train", [], Kept, None;
    Jitter, "jitter", Warn, "rows come at uneven times, or at another rate than the servo's", "have one clock start all converters and stamp the rows", [], Kept, None;
    LogsDisagree, "logs_disagree", Refuse, "logs, or parts of a log, are not of one stage in one state", "fit the parts that agree", [], Kept, WARN;
    ZeroClipped, "zero_clipped", Note, "zero deviations are beyond their range", "reset the interferometers nearer to zero, or widen search.delta_m in stage.toml", [TermsAtLimit], Kept, ALWAYS;
    TermsAtLimit, "terms_at_limit", Warn, "parameters stand at an end of their search range", "check the scales and signs of the log; if they are right, widen the range in stage.toml", [], Lost, None;
    OutOfRange, "out_of_range", Warn, "the log covers less than service, or a blob is used beyond its range", "record a log of the full range (host-fit plan)", [], Kept, WARN;
    Motion, "motion", Warn, "speed or acceleration in service makes the pose wrong", "evaluate on your fastest motion, apply the correction (runtime/README.md), or declare a slower service in [motion]", [], Lost, None;
    ModelLacks, "model_lacks", Warn, "the log shows more than the model describes, or cannot carry a better model", "see the other findings; move all six axes at once", [], Lost, WARN;
    NotDetermined, "not_determined", Refuse, "the log does not determine the calibration well enough for service", "record all six axes moving at once over the range of service, for longer (host-fit plan makes such a run)", [], Kept, None;
    RowsSkipped, "rows_skipped", Warn, "rows or movements are left out because a cell is bad", "record them again if they matter", [], Kept, WARN;
    ColumnsLeftOut, "columns_left_out", Note, "columns of the log that have no name, no cells or no known meaning are left out", "name a column that is needed in [log] of stage.toml, and put the others into `ignore`", [], Kept, None;
    MovementsByTime, "movements_by_time", Warn, "there is no column for the movement, so gaps in the times separate movements", "record a movement column", [], Kept, WARN;
    BetweenCodes, "between_codes", Warn, "voltages are not whole codes of the converter", "check volts_per_count, the instrument and rounding", [], Kept, WARN;
    FileCut, "file_cut", Warn, "the last line has no line break", "check whether the file was cut", [], Kept, WARN;
    Excerpt, "excerpt", Warn, "the log has more rows than a fit needs, so a sample is fitted", "nothing", [], Kept, WARN;
    Temperature, "temperature", Note, "the effect of temperature in the logs", "fit a cold and a warm log together, 3 K apart or more", [], Kept, WARN;
}

impl Code {
    /// Its row of [`TABLE`].
    pub fn entry(self) -> &'static Entry {
        &TABLE[self as usize]
    }
}

impl Serialize for Code {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.entry().name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn names_are_unique() {
        for entry in &TABLE {
            assert_eq!(TABLE.iter().filter(|e| e.name == entry.name).count(), 1);
        }
    }

    #[test]
    fn the_reference_shows_the_table() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../REFERENCE.md");
        let text = std::fs::read_to_string(path).expect("a reference");
        let (_, rest) = text.split_once("<!-- findings -->\n").expect("a table");
        let (shown, _) = rest.split_once("<!-- /findings -->").expect("its end");
        let mut table = "| code | severity | what | remedy |\n|---|---|---|---|\n".to_owned();
        for row in &TABLE {
            let severity = format!("{:?}", row.severity).to_lowercase();
            let (meaning, remedy) = (row.meaning, row.remedy);
            table += &format!("| `{}` | {severity} | {meaning} | {remedy} |\n", row.name);
        }
        assert_eq!(shown, table);
    }
}

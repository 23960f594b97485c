//! What is wrong with a log, or remarkable about it, in a form that programs can rely on.
//!
//! Readers, the fit and the diagnosis all emit [`Finding`]s. [`TABLE`] has one row for each [`Code`];
//! the table in REFERENCE.md is printed from it.

use serde::{Serialize, Serializer};

/// What a finding means for the calibration.
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

/// All that holds for every finding of a code.
#[derive(Debug)]
pub struct Entry {
    /// The code.
    pub code: Code,
    /// Its name in JSON.
    pub name: &'static str,
    /// Severity, unless a size decides.
    pub severity: Severity,
    /// What it is.
    pub meaning: &'static str,
    /// What to do about it.
    pub remedy: &'static str,
    /// Findings that follow from this one and are left out beside it.
    suppresses: &'static [Code],
}

/// The codes and their table, in one order.
macro_rules! codes {
    ($($code:ident, $name:literal, $severity:ident, $meaning:literal, $remedy:literal, [$($hidden:ident)*];)*) => {
        /// What was found. Names are stable.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        #[expect(missing_docs, reason = "TABLE says what each one is")]
        pub enum Code { $($code,)* }

        /// One row for each code, in the order of [`Code`].
        pub static TABLE: [Entry; [$($name),*].len()] = [$(Entry {
            code: Code::$code,
            name: $name,
            severity: Severity::$severity,
            meaning: $meaning,
            remedy: $remedy,
            suppresses: &[$(Code::$hidden),*],
        }),*];
    };
}

use Code as C;
use Severity::{Note, Refuse};

// Code, name, usual severity, what it is, what to do, and the codes of consequences that it hides.
#[rustfmt::skip]
codes! {
    ChannelsSwapped, "channels_swapped", Refuse, "two Hall channels are exchanged", "check wires, column order and stage.toml", [];
    ChannelInverted, "channel_inverted", Refuse, "a Hall channel has the wrong sign", "check wires, the sensor's direction and stage.toml", [];
    BeamsSwapped, "beams_swapped", Refuse, "two beams of the interferometers are exchanged", "check the column order", [];
    BeamInverted, "beam_inverted", Refuse, "a beam has the wrong sign", "check the interferometer's direction setting", [];
    CapacitiveSwapped, "capacitive_swapped", Refuse, "two capacitive channels, or their places in stage.toml, are exchanged", "check wires, column order and capacitive.probes_m", [];
    CapacitiveInverted, "capacitive_inverted", Refuse, "capacitive channels, or a coordinate of theirs in stage.toml, have the wrong sign", "check wires, signs and capacitive.probes_m", [];
    ScaleWrong, "scale_wrong", Refuse, "a scale, a unit or a length is wrong", "check units, single or double pass, and the scales in stage.toml", [];
    ReferenceLag, "reference_lag", Warn, "the reference or one channel is earlier or later than the others", "set its delay to zero: a probe or gap that is late at work makes the pose wrong while the stage moves; where all beams are late alike fit with --compensate-lag", [];
    Hum, "hum", Warn, "a channel has a disturbance of one frequency", "look for mains in its cable and supply, or a vibration", [ReferenceLag Outliers];
    Drift, "drift", Warn, "a channel drifts", "let the stage and its electronics warm up", [TermsAtLimit ZeroClipped];
    GainDrift, "gain_drift", Warn, "the gain of a channel changes", "let it warm up; check its supply", [TermsAtLimit];
    Step, "step", Warn, "a channel jumps and stays there", "record the movement again", [TermsAtLimit ZeroClipped Outliers];
    Stuck, "stuck", Warn, "a channel stands still while the others move", "check cable, register and drive; leave the rows out", [TermsAtLimit ZeroClipped Outliers Step LeftOut];
    IdleMovement, "idle_movement", Warn, "a movement in which nothing moves", "record it again", [];
    Saturated, "saturated", Warn, "codes at the end of a converter's range", "less gain, or less motion", [TermsAtLimit ZeroClipped Outliers LogsDisagree LeftOut];
    Outliers, "outliers", Warn, "rows far outside the noise", "leave the rows out", [Outliers];
    LeftOut, "left_out", Warn, "many rows count less than half in the fit", "find out what happened there and record again", [];
    ShortMovements, "short_movements", Warn, "movements whose own zero deviations take their errors", "check the times and the movement column", [];
    RowsMissing, "rows_missing", Warn, "servo periods without a row, or movements that a draw misses", "use a recorder that keeps up; a larger --train", [];
    Jitter, "jitter", Warn, "rows come at uneven times, or at another rate than the servo's", "one clock for all converters; correct servo.period_s", [];
    LogsDisagree, "logs_disagree", Refuse, "logs, or parts of one, are not of one stage in one state", "fit the parts that agree", [];
    ZeroClipped, "zero_clipped", Note, "zero deviations beyond their range", "reset the interferometers nearer to zero, or widen search.delta_m", [TermsAtLimit];
    TermsAtLimit, "terms_at_limit", Warn, "parameters at an end of their search range", "check the log, or widen the range in stage.toml", [];
    OutOfRange, "out_of_range", Warn, "the log covers less than service, or a blob is used beyond its range", "record a log of the full range (host-fit plan)", [];
    ModelLacks, "model_lacks", Warn, "the log shows more than the model describes, or cannot carry a better model", "see the other findings; move all six axes at once", [];
    NotDetermined, "not_determined", Refuse, "the log leaves the calibration too open for service", "record all six axes moving at once over the range of service, for longer (host-fit plan makes such a run)", [];
    RowsSkipped, "rows_skipped", Warn, "rows or movements left out because a cell is bad", "record them again if they matter", [];
    MovementsByTime, "movements_by_time", Warn, "no column for the movement; gaps in the times tell where movements begin", "record a movement column", [];
    BetweenCodes, "between_codes", Warn, "voltages that are no whole codes of the converter", "check volts_per_count and the instrument", [];
    FileCut, "file_cut", Warn, "the last line has no line break", "check whether the file was cut", [];
    Excerpt, "excerpt", Warn, "more rows than a fit needs: it takes some of all", "nothing", [];
    Temperature, "temperature", Note, "the effect of temperature that the logs show", "fit a cold and a warm log together, 3 K apart or more", [];
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

/// One finding.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// What was found.
    pub code: Code,
    /// What it means for the calibration.
    pub severity: Severity,
    /// A sentence with evidence and remedy.
    pub message: String,
    /// The channel: `hall_a`, `cap_1`, `ifm_y1`, `x`, ...
    pub channel: Option<String>,
    /// The movement, by [`Dataset::movement_name`](crate::dataset::Dataset::movement_name).
    pub movement: Option<String>,
    /// When, us in the log.
    pub t_us: Option<i64>,
    /// How large, in `unit`.
    pub value: Option<f64>,
    /// Unit of the value.
    pub unit: Option<&'static str>,
    /// What it costs at work: predicted errors in service over the noise floor, with this alone.
    pub cost: Option<f64>,
}

impl Finding {
    /// A finding of the severity that is usual for its code, without place and size.
    pub fn new(code: Code, message: impl Into<String>) -> Self {
        Self {
            code,
            severity: code.entry().severity,
            message: message.into(),
            channel: None,
            movement: None,
            t_us: None,
            value: None,
            unit: None,
            cost: None,
        }
    }

    /// With a severity of its own.
    #[must_use]
    pub fn severe(self, severity: Severity) -> Self {
        Self { severity, ..self }
    }

    /// On a channel.
    #[must_use]
    pub fn on(self, channel: impl Into<String>) -> Self {
        let channel = Some(channel.into());
        Self { channel, ..self }
    }

    /// In a movement, at a time in the log, us.
    #[must_use]
    pub fn at(self, movement: impl Into<String>, t_us: i64) -> Self {
        Self {
            movement: Some(movement.into()),
            t_us: Some(t_us),
            ..self
        }
    }

    /// Of this size.
    #[must_use]
    pub fn of(self, value: f64, unit: &'static str) -> Self {
        Self {
            value: Some(value),
            unit: Some(unit),
            ..self
        }
    }

    /// With its cost at work.
    #[must_use]
    pub fn costing(self, ratio: f64) -> Self {
        let cost = Some(ratio);
        Self { cost, ..self }
    }

    /// Whether it is about the pose, not about one channel.
    fn is_of_pose(&self) -> bool {
        matches!(self.channel.as_deref(), Some("x" | "y" | "rz"))
    }

    /// Whether `found` only shows what this one names.
    fn suppresses(&self, found: &Self) -> bool {
        if self.severity == Note {
            return false;
        }
        // Any other refusal says more than that the model does not describe the log; and of a log that
        // is refused the whole fit is wrong.
        if self.severity == Refuse && self.code != found.code {
            match found.code {
                C::ModelLacks => return true,
                C::TermsAtLimit if found.severity < Refuse => return true,
                _ => {}
            }
        }
        if !self.code.entry().suppresses.contains(&found.code) {
            return false;
        }
        let same_movement = self.movement == found.movement;
        match found.code {
            // Movements that reach the end of a converter's range look like those of another stage.
            C::LogsDisagree => found.movement.is_some(),
            _ if found.severity > self.severity => false,
            // A wild row of the pose, not rows of a channel.
            C::Outliers => found.is_of_pose() && !self.is_of_pose(),
            // Where a channel stops and goes on, others seem to jump.
            C::Step => same_movement && found.channel != self.channel,
            C::ZeroClipped => self.movement.is_none() || same_movement,
            // A line of the reference looks like a lag.
            C::ReferenceLag => self
                .channel
                .as_deref()
                .is_some_and(|c| c.starts_with("ifm")),
            _ => true,
        }
    }
}

/// Causes without their consequences, the most severe first.
pub fn in_order(findings: Vec<Finding>) -> Vec<Finding> {
    let is_cause = |found: &&Finding| !findings.iter().any(|cause| cause.suppresses(found));
    let mut causes: Vec<Finding> = findings.iter().filter(is_cause).cloned().collect();
    causes.sort_by_key(|finding| std::cmp::Reverse(finding.severity));
    causes
}

/// Whether they name why a log cannot be fitted as it is.
pub fn is_explained(findings: &[Finding]) -> bool {
    let explains = |found: &Finding| found.severity == Refuse || found.code == C::ZeroClipped;
    findings.iter().any(explains)
}

/// The messages of the findings of at least this severity, one after the other.
pub fn messages(findings: &[Finding], least: Severity) -> String {
    let severe = findings.iter().filter(|finding| finding.severity >= least);
    let messages: Vec<&str> = severe.map(|finding| finding.message.as_str()).collect();
    messages.join(". ")
}

#[cfg(test)]
mod tests {
    use super::Severity::Warn;
    use super::*;
    use std::path::Path;

    fn found(code: Code, channel: &str, unit: &'static str) -> Finding {
        Finding::new(code, "")
            .severe(Warn)
            .on(channel)
            .of(1.0, unit)
    }

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

    #[test]
    fn a_cause_stays_and_its_consequences_go() {
        let step = found(Code::Step, "ifm_y1", "um");
        let wild = found(Code::Outliers, "rz", "urad");
        let of_channel = found(Code::Outliers, "hall_a", "rows");
        let lag = found(Code::ReferenceLag, "ifm", "us");
        let all = vec![step.clone(), wild.clone(), of_channel.clone(), lag.clone()];
        assert_eq!(in_order(all), [step, of_channel, lag.clone()]);
        let alone = vec![wild];
        assert_eq!(in_order(alone.clone()), alone);
        let hum = |channel| found(Code::Hum, channel, "Hz");
        assert_eq!(in_order(vec![hum("ifm_x"), lag.clone()]), [hum("ifm_x")]);
        let apart = vec![hum("hall_a"), lag];
        assert_eq!(in_order(apart.clone()), apart);
    }

    #[test]
    fn a_refusal_hides_warnings_and_what_the_model_lacks_but_no_other_refusal() {
        let refused = |code| Finding::new(code, "").severe(Refuse);
        let all = vec![
            refused(Code::ChannelsSwapped),
            Finding::new(Code::TermsAtLimit, ""),
            refused(Code::LogsDisagree),
            refused(Code::ModelLacks),
        ];
        let kept = [refused(Code::ChannelsSwapped), refused(Code::LogsDisagree)];
        assert_eq!(in_order(all), kept);
        let alone = vec![refused(Code::ModelLacks)];
        assert_eq!(in_order(alone.clone()), alone);
    }
}

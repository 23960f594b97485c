//! Why a join was refused.

use super::pairing::JoinCounts;
use crate::output::OutputError;
use hal_adapters::candump::LineError;
use hallstage_input::log::LogError;
use std::path::PathBuf;

/// Why a join was refused. The output is not written.
#[derive(Debug, thiserror::Error)]
pub enum JoinError {
    /// The record or the reference cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A line of the record is broken.
    #[error("{}, line {line}: {fault}; mend the line, or skip such lines with --bad-rows skip", path.display())]
    BadLine {
        /// The record.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// Its fault.
        fault: LineError,
    },
    /// It is not clear which file has the sensors.
    #[error(
        "{} of {} and {} has columns of the Hall probes; name one record of the sensors and one of the reference",
        if *both { "each" } else { "neither" }, a.display(), b.display()
    )]
    Roles {
        /// A file.
        a: PathBuf,
        /// The other file.
        b: PathBuf,
        /// Whether both have such columns.
        both: bool,
    },
    /// The time of a table of the sensors starts again.
    #[error(
        "{}: in movement {movement} the time starts again; log the sensors by a clock that runs through, or join each movement by itself",
        path.display()
    )]
    TimeRestarts {
        /// The table.
        path: PathBuf,
        /// The movement.
        movement: i64,
    },
    /// The samples of the reference do not follow its motion.
    #[error(
        "the reference has a sample in {period_ms:.0} ms, and between them it moves on by {rms_um:.2} um rms that no sample shows; log it faster, \
         or move more slowly"
    )]
    ReferenceTooSlow {
        /// Time from sample to sample, ms.
        period_ms: f64,
        /// What a cubic between the samples misses, um.
        rms_um: f64,
    },
    /// The reference repeats its values.
    #[error(
        "the reference holds each value for {rows:.0} rows; log its new values alone, or each of its samples"
    )]
    ReferenceHeld {
        /// Rows from one new value to the next.
        rows: f64,
    },
    /// Few samples of the reference are far from their neighbours.
    #[error(
        "a few samples of the reference jump away by up to {largest_um:.0} um and back, which is no motion; remove them, or write nothing where a value is missing"
    )]
    ReferenceSpikes {
        /// The largest jump, um.
        largest_um: f64,
    },
    /// A column is not what stage.toml says.
    #[error(
        "with {change} the reference explains {percent:.0} % of the Hall signals' motion, and {without_percent:.0} % without; correct the \
         columns in [log] of stage.toml, or the cables"
    )]
    Columns {
        /// The change.
        change: String,
        /// Share that is explained with it.
        percent: f64,
        /// Share without it.
        without_percent: f64,
    },
    /// The motion of the reference has another size than the motion of the probes.
    #[error(
        "the motion of the Hall probes is {factor:.3} times the motion of the reference; correct the unit of the reference in [log] of stage.toml"
    )]
    Unit {
        /// The factor.
        factor: f64,
    },
    /// The record holds frames of several interfaces.
    #[error(
        "{}, line {line}: a frame of `{other}` after frames of `{interface}`; choose one with --interface",
        path.display()
    )]
    SeveralInterfaces {
        /// The record.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// The interface so far.
        interface: String,
        /// The other interface.
        other: String,
    },
    /// A table has no interface.
    #[error("{}: --interface chooses frames of a record of the bus, and this is a table; leave --interface out", path.display())]
    NoInterface {
        /// The table.
        path: PathBuf,
    },
    /// The record holds no whole ticks that can be timed.
    #[error(
        "{}: no tick can be timed: {frames} frames are {ticks} whole ticks, {saturated} with a code at a rail of its converter; it takes \
         125 ticks, and the sensor node's time frames (0x15A) before and after them, 16 servo periods apart. Is it the right record \
         and interface, does it hold all of the node's frames, and is period_s of stage.toml right?",
        path.display()
    )]
    NoTicks {
        /// The record.
        path: PathBuf,
        /// Frames that it holds.
        frames: usize,
        /// Whole ticks.
        ticks: usize,
        /// Whole ticks that were left out for a code at a rail.
        saturated: usize,
    },
    /// A code is beyond the range of the converter.
    #[error(
        "{}, line {line}: the code {code} of {sensor} is outside the converter's range {code_min} to {code_max}; is it the \
         right record? Then correct code_min and code_max in stage.toml",
        path.display()
    )]
    OutsideConverter {
        /// The record.
        path: PathBuf,
        /// The line that completes the tick, from 1.
        line: usize,
        /// The sensor's key in stage.toml.
        sensor: &'static str,
        /// The code.
        code: i32,
        /// Smallest code of the converter.
        code_min: i32,
        /// Largest code of the converter.
        code_max: i32,
    },
    /// Another record begins.
    #[error(
        "{}, line {line}: the sensor node starts again, and the time goes back by {back_s:.6} s: these are several records; join \
         each by itself",
        path.display()
    )]
    TwoRecords {
        /// The record.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// By how much, s.
        back_s: f64,
    },
    /// A record is too long.
    #[error("{}: more than {most} {what}, two hours; cut both records into parts, and name each log to `fit`", path.display())]
    TooLong {
        /// The record.
        path: PathBuf,
        /// What there are too many of.
        what: &'static str,
        /// The most there may be.
        most: usize,
    },
    /// It holds too few rows.
    #[error("{}: fewer than two rows of reference; record it again or name another file", path.display())]
    NoReference {
        /// The log.
        path: PathBuf,
    },
    /// Most of the two do not belong together.
    #[error(
        "most of the two records do not belong together: {} of {} ticks have a reference, which covers {:.1} s of \
         the reference's {:.1} s. On its clock the ticks lie from {:.0} to {:.0} us, its samples from {:.0} to {:.0} us; {} ticks \
         are outside its time, {} between movements, {} in gaps of the reference of more than --tolerance-us (one and a half of \
         the longer of both periods, if it is not given). Name records of one run; cut what one record has more than the other, or give a larger --tolerance-us",
        .0.rows, .0.ticks, .0.covered_s, .0.reference_s, .0.sensors_us[0], .0.sensors_us[1], .0.reference_us[0], .0.reference_us[1],
        .0.outside, .0.between_movements, .0.too_far
    )]
    Unpaired(JoinCounts),
    /// The reference explains too little of the motion at every offset.
    #[error(
        "no offset between the clocks from {:.1} to {:.1} s: at the best one the reference explains {percent:.0} % of the \
         Hall signals' motion, less than {least_percent:.0} %. Rates, gaps, signs and the order of the columns are not the cause. Are both \
         records of the same run? Then search further (--search-s), or start elsewhere (--offset-us)",
        range_s[0], range_s[1]
    )]
    NoOffset {
        /// The offsets that were tried, s.
        range_s: [f64; 2],
        /// Share that is explained.
        percent: f64,
        /// Share that is asked for.
        least_percent: f64,
    },
    /// The clocks do not run evenly against each other.
    #[error(
        "no steady offset between the clocks makes the reference agree with the Hall signals: they differ in speed by more \
         than {most_ppm} parts in a million, or that of the reference was set during the record; rates, gaps, units, \
         signs and the order of the columns are not the cause. Turn the adjustment of the clock off (NTP), and record again"
    )]
    UnsteadyClocks {
        /// The largest difference that is looked for, parts in a million.
        most_ppm: f64,
    },
    /// The record is too short, or holds too little motion, to find the offset, or its axes move at one
    /// frequency: then a shift in time looks like a rotation.
    #[error(
        "the offset between the clocks is uncertain: its standard error is {standard_error_us:.0} us, more than {most_us:.0} us (a \
         tenth of a servo period); record for longer, with more motion, and each axis at a frequency of its own"
    )]
    UncertainOffset {
        /// Standard error at the end of the record where it is larger, us.
        standard_error_us: f64,
        /// The most it may be, us.
        most_us: f64,
    },
    /// One movement does not agree with the offset of the others.
    #[error(
        "in movement {movement} the reference does not agree with the Hall signals at the offset of the others: a clock was set, or the \
         reference starts its time anew in each movement while the bus ran on between; log both by clocks that run through, \
         or join each movement by itself"
    )]
    Astray {
        /// The movement.
        movement: i64,
    },
    /// The log cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

//! Why an import was refused.

use crate::input::log::{CellPlace, LogError};
use crate::input::source::SourceError;
use crate::input::stage::StageError;
use crate::output::OutputError;
use hal_adapters::candump::LineError;
use std::path::PathBuf;

/// Why an import was refused. Nothing was written.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// The stage file is refused.
    #[error(transparent)]
    Stage(#[from] StageError),
    /// The record of the bus cannot be read.
    #[error(transparent)]
    Bus(#[from] SourceError),
    /// A line of the record is broken.
    #[error("{}, line {line}: {fault}; mend the line, or leave such lines out with --skip-bad-lines", path.display())]
    BadLine {
        /// The record.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong with it.
        fault: LineError,
    },
    /// A line is no text.
    #[error("{}, line {line}: not text; name a log that `record`, `live --record` or `candump -L` wrote", path.display())]
    NotText {
        /// The record.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
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
        /// The other one.
        other: String,
    },
    /// The record holds no whole ticks that can be timed.
    #[error(
        "{}: no tick can be timed: {frames} frames are {ticks} whole ticks, {saturated} with a code at a rail of its converter; it takes \
         125 ticks in a row, and the sensor node's time frames (0x15A) before and after them. Is it the right record, layout and \
         interface, and does it hold all of the node's frames?",
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
         right record and --layout? Then correct code_min and code_max in stage.toml",
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
    /// The clock of the record was set back, or another record begins.
    #[error(
        "{}, line {line}: the time goes back by {back_s:.6} s; import each record by itself if there are several in the file, \
         and if the clock was set, turn its adjustment off (NTP) and record again",
        path.display()
    )]
    ClockBackwards {
        /// The record.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// By how much, s.
        back_s: f64,
    },
    /// The log of the interferometers cannot be read.
    #[error(transparent)]
    Reference(#[from] LogError),
    /// It holds too few rows.
    #[error("{}: fewer than two rows of reference; record it again or name another file", path.display())]
    NoReference {
        /// The log.
        path: PathBuf,
    },
    /// It has more movements than any run.
    #[error(
        "{place}: more than {most} movements; name the column of the movement's number in the [log] table of stage.toml"
    )]
    TooManyMovements {
        /// The cell of the movement.
        place: Box<CellPlace>,
        /// The most there may be.
        most: usize,
    },
    /// The reference has too few samples.
    #[error(
        "{too_far} of {ticks} ticks have no sample of the reference within --tolerance-us (one servo period, if it is not given): \
         log the reference in every servo period, or give a larger tolerance"
    )]
    Sparse {
        /// Ticks too far from a sample.
        too_far: usize,
        /// Ticks.
        ticks: usize,
    },
    /// Most of the two do not belong together.
    #[error(
        "most of the two records do not belong together: {rows} of {ticks} ticks have a reference, which covers {covered_s:.1} s of \
         the reference's {reference_s:.1} s ({outside} ticks are outside its time, {between_movements} between movements, {too_far} \
         further than the tolerance from a sample). Name records of one run, check the offset, cut what one has more than \
         the other, or give a larger --tolerance-us"
    )]
    Unpaired {
        /// Ticks with a reference.
        rows: usize,
        /// Ticks.
        ticks: usize,
        /// For how much of the reference there are rows, s.
        covered_s: f64,
        /// How long its movements are together, s.
        reference_s: f64,
        /// Ticks before, after and at times of others.
        outside: usize,
        /// Ticks between movements.
        between_movements: usize,
        /// Ticks too far from a sample.
        too_far: usize,
    },
    /// The two have no time in common.
    #[error(
        "no tick of the bus lies between two reference samples: the bus has {bus_us:?} us on the clock of the \
         reference, the reference {reference_us:?} us; give --offset-us or --estimate-offset, or a larger --tolerance-us"
    )]
    NoOverlap {
        /// First and last tick, us.
        bus_us: [f64; 2],
        /// First and last sample, us.
        reference_us: [f64; 2],
    },
    /// No offset makes the two agree.
    #[error(
        "the offset between the clocks cannot be found: at the best one the reference explains {percent:.0} % of the \
         Hall signals' motion, less than {least_percent:.0} %; are both of the same run? A larger --search-s may help"
    )]
    NoOffset {
        /// Share that is explained.
        percent: f64,
        /// Share that is asked for.
        least_percent: f64,
    },
    /// The clocks do not run evenly against each other.
    #[error(
        "no steady offset between the clocks makes the reference agree with the Hall signals: they differ in speed by more \
         than {most_ppm} parts in a million, or one of them was set during the record; turn its adjustment off (NTP), and \
         record again"
    )]
    UnsteadyClocks {
        /// The largest difference that is looked for, parts in a million.
        most_ppm: f64,
    },
    /// The record is too short, or holds too little motion, to tell the offset.
    #[error(
        "the offset between the clocks is uncertain: its standard error is {standard_error_us:.0} us, more than {most_us:.0} us (a \
         tenth of a servo period); record for longer, or with more motion"
    )]
    UncertainOffset {
        /// Standard error at the end of the record where it is larger, us.
        standard_error_us: f64,
        /// The most it may be, us.
        most_us: f64,
    },
    /// At the offset that was given the two do not agree.
    #[error(
        "at the given offset the reference does not agree with the Hall signals (it explains {percent:.0} % of their motion): is the offset \
         right, do the clocks run alike, are both of the same run? Let it be found with --estimate-offset"
    )]
    UncheckedOffset {
        /// Share that is explained.
        percent: f64,
    },
    /// The motion shows another offset than the one that was given.
    #[error(
        "the given offset is wrong: by the motion that both records saw it lacks {start_us:.0} us at the start, {middle_us:.0} us in the \
         middle and {end_us:.0} us at the end of the record; use --estimate-offset, which also finds how much faster one clock runs"
    )]
    WrongOffset {
        /// What it lacks in the middle, us.
        middle_us: f64,
        /// At the start, us.
        start_us: f64,
        /// At the end, us.
        end_us: f64,
    },
    /// One movement does not agree with the offset of the others.
    #[error(
        "in movement {movement} the reference does not agree with the Hall signals at the offset of the others: a clock was set, or the \
         reference starts its time anew in each movement while the bus ran on between; log both by clocks that run through, \
         or import each movement by itself"
    )]
    Astray {
        /// The movement.
        movement: i64,
    },
    /// Frames were received too unevenly to tell when their codes were sampled.
    #[error(
        "about {at_s:.1} s after the first tick the receive times leave the even course of the others by {off_us:.0} us, for half a \
         second or more: the clock of the recording computer was set during the record (turn its adjustment off, NTP), or it could \
         not keep up for so long; record again"
    )]
    UnevenTimes {
        /// The smallest distance of those ticks from the course, us.
        off_us: f64,
        /// When, s after the first tick.
        at_s: f64,
    },
    /// The log cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

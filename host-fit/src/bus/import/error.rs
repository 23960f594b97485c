//! Why an import was refused.

use super::reference::Reference;
use crate::input::log::LogError;
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
    /// The record holds no whole tick.
    #[error(
        "{}: no whole tick of sensor frames among {frames} frames; is it the right record, layout and interface?",
        path.display()
    )]
    NoTicks {
        /// The record.
        path: PathBuf,
        /// Frames that it holds.
        frames: usize,
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
         record again, or give --offset-us"
    )]
    UnsteadyClocks {
        /// The largest difference that is looked for, parts in a million.
        most_ppm: f64,
    },
    /// Frames were received too unevenly to tell when their codes were sampled.
    #[error(
        "the receive times of the ticks are {rms_us:.0} us (rms) off an even course, more than a servo period: the clock of \
         the recording computer was set during the record, or it could not keep up; record again"
    )]
    UnevenTimes {
        /// Standard deviation about the course, us.
        rms_us: f64,
    },
    /// The log cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

impl ImportError {
    pub(super) fn no_overlap(times_us: &[f64], reference: &Reference, offset_us: f64) -> Self {
        let ends = |first: Option<f64>, last: Option<f64>| {
            [first, last].map(|t| t.unwrap_or(f64::NAN).round())
        };
        let shifted = |t: Option<&f64>| t.map(|t| t - offset_us);
        let samples = &reference.samples;
        Self::NoOverlap {
            bus_us: ends(shifted(times_us.first()), shifted(times_us.last())),
            reference_us: ends(
                samples.first().map(|s| s.t_us),
                samples.last().map(|s| s.t_us),
            ),
        }
    }
}

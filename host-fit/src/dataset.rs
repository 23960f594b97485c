//! A log as the fit sees it: rows in SI units, grouped by movement.

use runtime::RawFrame;

/// One sampled servo period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Which movement it belongs to: an index into [`Dataset::movements`].
    pub movement: usize,
    /// Time within the log, us.
    pub t_us: i64,
    /// The codes.
    pub frame: RawFrame,
    /// Displacement read by the Hall probes A, B, C at the designed scale, m.
    pub signal_m: [f64; 3],
    /// Z, Rx, Ry by the capacitive sensors: m, rad, rad.
    pub vertical: [f64; 3],
    /// X, Y, Rz by the interferometers: m, m, rad. Zeros in a log without reference.
    pub reference: [f64; 3],
}

/// One movement of one log: between its start and its end the interferometers were not reset.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Movement {
    /// Which of the logs named on the command line, from 0.
    pub log: usize,
    /// Its number in that log's `movement` column.
    pub index: i64,
    /// Its rows in [`Dataset::rows`].
    pub rows: core::ops::Range<usize>,
}

/// All rows of one or more logs, movement after movement.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dataset {
    /// The rows, those of a movement next to each other.
    pub rows: Vec<Row>,
    /// The movements, in the order of their first rows.
    pub movements: Vec<Movement>,
    /// SHA-256 of the decompressed logs, one after the other.
    pub sha256: [u8; 32],
}

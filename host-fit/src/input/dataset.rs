//! A log as the fit sees it: rows in SI units, grouped by movement.

use super::stage::Stage;
use super::whole::Whole;
use super::whole::chunk::{Sample, SampledVertical};
use runtime::capacitive::{vertical_pose, vertical_rows};
use runtime::{AnyDecoder, PlanarPose, RawFrame, Reading, VerticalPose};
use std::path::PathBuf;
use std::sync::Arc;

/// The most rows that a fit works on. Of longer logs it takes runs of rows that tell most of the
/// motion: what more rows would add to a calibration is far below the noise of a pose.
pub const FIT_ROWS_MAX: usize = 250_000;

/// What one servo period of a log gives the decoder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LoggedFrame {
    /// All six codes, as on the target.
    Codes(RawFrame),
    /// Hall codes, and a vertical pose that the log holds in SI units: there are no
    /// capacitive codes, so this goes through [`AnyDecoder::decode_at`].
    HallCodes {
        /// Hall codes of the probes A, B, C.
        hall: [i32; 3],
        /// Z, Rx, Ry rounded to the decoder's words: m, rad, rad.
        vertical: VerticalPose<f32>,
        /// Number of the servo period, wrapping.
        sequence: u32,
        /// When the codes were sampled, in us, wrapping.
        time_us: u32,
    },
}

impl LoggedFrame {
    /// Hall codes of the probes A, B, C.
    pub const fn hall(&self) -> [i32; 3] {
        match self {
            Self::Codes(frame) => frame.hall,
            Self::HallCodes { hall, .. } => *hall,
        }
    }

    /// Codes of the capacitive gaps 1, 2, 3, where the log has them.
    pub const fn capacitive(&self) -> Option<[i32; 3]> {
        match self {
            Self::Codes(frame) => Some(frame.capacitive),
            Self::HallCodes { .. } => None,
        }
    }

    /// Number of the servo period within its movement, from 0: by time, so a gap in the log
    /// shows as frames missed.
    pub const fn sequence(&self) -> u32 {
        match self {
            Self::Codes(frame) => frame.sequence,
            Self::HallCodes { sequence, .. } => *sequence,
        }
    }

    /// The same frame with another sequence number.
    #[must_use]
    pub const fn with_sequence(mut self, number: u32) -> Self {
        match &mut self {
            Self::Codes(frame) => frame.sequence = number,
            Self::HallCodes { sequence, .. } => *sequence = number,
        }
        self
    }

    /// The reading of the runtime's own decoder, less `zero`.
    pub fn decode(&self, decoder: &AnyDecoder, zero: &PlanarPose<f32>) -> Reading {
        match self {
            Self::Codes(frame) => decoder.decode(frame, zero),
            Self::HallCodes { hall, vertical, .. } => decoder.decode_at(*hall, *vertical, zero),
        }
    }
}

/// One sampled servo period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Which movement it belongs to: an index into [`Dataset::movements`].
    pub movement: usize,
    /// Time within the log, us.
    pub t_us: i64,
    /// What the decoder takes.
    pub frame: LoggedFrame,
    /// Displacement read by the Hall probes A, B, C at the designed scale, m.
    pub signal_m: [f64; 3],
    /// Z, Rx, Ry by the capacitive sensors: m, rad, rad.
    pub vertical: [f64; 3],
    /// X, Y, Rz by the interferometers: m, m, rad. Zeros in a log without reference.
    pub reference: [f64; 3],
}

/// What turns codes into rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scales {
    hall_m_per_code: f64,
    capacitive_m_per_code: f64,
    vertical_rows: [[f64; 3]; 3],
}

impl Scales {
    /// The scales of a stage.
    pub fn of(stage: &Stage) -> Self {
        Self {
            hall_m_per_code: stage.hall.m_per_count,
            capacitive_m_per_code: stage.capacitive.m_per_count,
            // A checked stage has its sensors in a triangle.
            vertical_rows: vertical_rows(&stage.capacitive_probes_m).unwrap_or_default(),
        }
    }

    /// The row of a sample in a movement of a dataset; its sequence number is still 0.
    #[inline]
    pub fn row(&self, movement: usize, sample: &Sample) -> Row {
        let vertical = match sample.vertical {
            SampledVertical::Codes(capacitive) => {
                let gaps_m = capacitive.map(|code| f64::from(code) * self.capacitive_m_per_code);
                vertical_pose(&self.vertical_rows, gaps_m).to_array()
            }
            SampledVertical::Pose(vertical) => vertical,
        };
        Row {
            movement,
            t_us: sample.t_us,
            frame: sample.frame(),
            signal_m: sample
                .hall
                .map(|code| f64::from(code) * self.hall_m_per_code),
            vertical,
            reference: sample.reference,
        }
    }
}

/// One movement of one log: between its start and its end the interferometers were not reset.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Movement {
    /// Which of the logs named on the command line, from 0: an index into [`Dataset::logs`].
    pub log: usize,
    /// Its number in that log's `movement` column.
    pub index: i64,
    /// Its rows in [`Dataset::rows`].
    pub rows: core::ops::Range<usize>,
}

/// One log that the rows came from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogSource {
    /// The file, as it was named.
    pub path: PathBuf,
    /// Its rows in [`Dataset::rows`].
    pub rows: core::ops::Range<usize>,
    /// Whether it holds the interferometers' reference; if not, [`Row::reference`] is zero.
    pub has_reference: bool,
}

/// All rows of one or more logs, movement after movement.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dataset {
    /// The rows, those of a movement next to each other.
    pub rows: Vec<Row>,
    /// The movements, in the order of their first rows.
    pub movements: Vec<Movement>,
    /// The logs, in the order in which they were named.
    pub logs: Vec<LogSource>,
    /// SHA-256 of the decompressed logs, one after the other.
    pub sha256: [u8; 32],
    /// All rows of logs of which those above are an excerpt; `None` where they are all.
    pub whole: Option<Arc<Whole>>,
}

impl Dataset {
    /// Rows and movements of the logs named, those included that are not in an excerpt.
    pub fn named(&self) -> (usize, usize) {
        match &self.whole {
            Some(whole) => (whole.rows(), whole.movements().len()),
            None => (self.rows.len(), self.movements.len()),
        }
    }

    /// How to name a movement: its number, after the name of its log where there are several.
    pub fn movement_name(&self, movement: &Movement) -> String {
        match self.logs.get(movement.log) {
            Some(log) if self.logs.len() > 1 => {
                format!("{}:{}", log.path.display(), movement.index)
            }
            _ => movement.index.to_string(),
        }
    }

    /// The name of the movement of a row, and its time, us; of an excerpt a row of the whole.
    pub fn named_place(&self, row: usize) -> Option<(String, i64)> {
        let (movements, t_us) = match &self.whole {
            Some(whole) => (whole.movements(), whole.t_us(row)?),
            None => (&self.movements[..], self.rows.get(row)?.t_us),
        };
        let number = movements.partition_point(|movement| movement.rows.end <= row);
        Some((self.movement_name(movements.get(number)?), t_us))
    }

    /// The movements whose rows `keep` wants, numbered anew; logs and hash stay those of the
    /// whole.
    #[must_use]
    pub fn only(&self, keep: impl Fn(&[Row]) -> bool) -> Self {
        let mut out = Self {
            rows: Vec::new(),
            movements: Vec::new(),
            logs: self.logs.clone(),
            sha256: self.sha256,
            whole: None,
        };
        for movement in &self.movements {
            let rows = &self.rows[movement.rows.clone()];
            if keep(rows) {
                let start = out.rows.len();
                let number = out.movements.len();
                out.rows.extend(rows.iter().map(|row| Row {
                    movement: number,
                    ..*row
                }));
                out.movements.push(Movement {
                    rows: start..out.rows.len(),
                    ..movement.clone()
                });
            }
        }
        out
    }

    /// All rows but some, given in ascending order; movements that lose all of theirs are left out.
    /// Logs and hash stay those of the whole.
    #[must_use]
    pub fn without(&self, rows: &[usize]) -> Self {
        let mut left_out = rows.iter().peekable();
        let mut out = Self {
            rows: Vec::with_capacity(self.rows.len()),
            movements: Vec::new(),
            logs: self.logs.clone(),
            sha256: self.sha256,
            whole: None,
        };
        for movement in &self.movements {
            let (start, number) = (out.rows.len(), out.movements.len());
            for row in movement.rows.clone() {
                if left_out.next_if_eq(&&row).is_none() {
                    out.rows.push(Row {
                        movement: number,
                        ..self.rows[row]
                    });
                }
            }
            let end = out.rows.len();
            if end > start {
                out.movements.push(Movement {
                    rows: start..end,
                    ..movement.clone()
                });
            }
        }
        out
    }
}

//! A log as the fit sees it: rows in SI units, grouped by movement.

use super::stage::{Interferometer, TemperatureTable};
use crate::statistics::median;
use runtime::frame::MISSING_CODE;
use runtime::{AnyDecoder, Decode, PlanarPose, RawFrame, Reading, Temperature, VerticalPose};
use std::borrow::Cow;
use std::ops::Range;
use std::path::PathBuf;

/// Rows are consecutive if the time between them is below this many median times.
pub(crate) const GAP_PERIODS: f64 = 1.5;

/// The most rows that a fit works on. Of longer logs it takes a sample: what more rows would add to
/// a calibration is far below the noise of a pose.
pub const FIT_ROWS_MAX: usize = 125_000;

/// What one servo period of a log gives the decoder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoggedFrame {
    /// All codes, as on the target; without codes of the gaps where the log holds a vertical pose.
    pub codes: RawFrame,
    /// Z, Rx, Ry that the log holds in SI units in place of codes, rounded to the decoder's words: m, rad,
    /// rad. It goes through [`AnyDecoder::decode_at`].
    pub vertical: Option<VerticalPose<f32>>,
}

impl From<RawFrame> for LoggedFrame {
    fn from(codes: RawFrame) -> Self {
        Self {
            codes,
            vertical: None,
        }
    }
}

impl LoggedFrame {
    /// Hall codes of the probes A, B, C.
    pub const fn hall(&self) -> [i32; 3] {
        self.codes.hall
    }

    /// Temperature of mount and body, m degC; [`MISSING_CODE`] where
    /// the log has none.
    pub const fn temperature_mc(&self) -> [i32; 2] {
        self.codes.temperature_mc
    }

    /// All codes, if the log has codes of the gaps.
    pub fn all_codes(&self) -> Option<RawFrame> {
        self.vertical.is_none().then_some(self.codes)
    }

    /// Codes of the capacitive gaps 1, 2, 3, if the log has them.
    pub fn capacitive(&self) -> Option<[i32; 3]> {
        Some(self.all_codes()?.capacitive)
    }

    /// Number of the servo period within its movement, from 0: by time, so a gap in the log
    /// shows as frames missed.
    pub const fn sequence(&self) -> u32 {
        self.codes.sequence
    }

    /// The same frame with another sequence number.
    #[must_use]
    pub const fn with_sequence(mut self, number: u32) -> Self {
        self.codes.sequence = number;
        self
    }

    /// The reading of the runtime's own decoder, less `zero`.
    pub fn decode(&self, decoder: &AnyDecoder, zero: &PlanarPose<f32>) -> Reading {
        match self.vertical {
            None => decoder.decode(&self.codes, zero),
            Some(vertical) => decoder.decode_at(self.hall(), self.temperature_mc(), vertical, zero),
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

impl Row {
    /// The readings of the beams X, Y1, Y2 by the reference, m.
    pub fn beams_m(&self, interferometer: &Interferometer) -> [f64; 3] {
        interferometer.beams_m(self.reference, self.vertical)
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
    /// The path, as the user gave it.
    pub path: PathBuf,
    /// SHA-256 of its decompressed text.
    pub sha256: [u8; 32],
    /// Its rows in [`Dataset::rows`].
    pub rows: core::ops::Range<usize>,
    /// Number of rows that were read, also rows outside the dataset.
    pub rows_read: usize,
    /// Number of movements that were read.
    pub movements_read: usize,
    /// Whether it holds the interferometers' reference; if not, [`Row::reference`] is zero.
    pub has_reference: bool,
}

impl LogSource {
    /// Its name in messages: the path of the user, or the file name of an absolute path, because reports are mailed.
    pub fn name(&self) -> String {
        let file = self.path.file_name().filter(|_| self.path.is_absolute());
        let name = file.unwrap_or(self.path.as_os_str());
        name.to_string_lossy().into_owned()
    }
}

/// Rows of one or more logs, movement after movement: all rows of short logs, and a sample of the rows of long
/// logs. Each run of a sample is a movement.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dataset {
    /// The rows; the rows of a movement are neighbours.
    pub rows: Vec<Row>,
    /// The movements, in the order of their first rows.
    pub movements: Vec<Movement>,
    /// The logs, in the order of the user.
    pub logs: Vec<LogSource>,
    /// SHA-256 of the decompressed logs, one after the other.
    pub sha256: [u8; 32],
    /// Change of the sensitivities with temperature; [`Row::signal_m`] is corrected for it.
    pub temperature: Temperature<f64>,
}

impl Dataset {
    /// Number of rows and of movements that were read.
    pub fn read(&self) -> (usize, usize) {
        let logs = || self.logs.iter();
        (
            logs().map(|log| log.rows_read).sum(),
            logs().map(|log| log.movements_read).sum(),
        )
    }

    /// Ends a log with reference: it has all rows and movements since the end of the log before.
    pub fn end_log(&mut self, path: impl Into<PathBuf>) {
        let start = self.logs.last().map_or(0, |log| log.rows.end);
        let log = self.logs.len();
        let rows = start..self.rows.len();
        self.logs.push(LogSource {
            path: path.into(),
            sha256: [0; 32],
            rows_read: rows.len(),
            movements_read: self.movements.iter().filter(|m| m.log == log).count(),
            rows,
            has_reference: true,
        });
    }

    /// Takes the effect of temperature out of the signals, in place of what was taken out before.
    pub fn compensate(&mut self, temperature: Temperature<f64>) {
        for row in &mut self.rows {
            let temperature_mc = row.frame.temperature_mc();
            let before = self.temperature.gain_at(temperature_mc);
            let gain = temperature.gain_at(temperature_mc);
            for (k, signal) in row.signal_m.iter_mut().enumerate() {
                *signal *= before[k] / gain[k];
            }
        }
        self.temperature = temperature;
    }

    /// The rows with the effect of temperature taken out as a calibration has it.
    pub fn compensated(&self, temperature: Temperature<f64>) -> Cow<'_, Self> {
        if temperature == self.temperature {
            return Cow::Borrowed(self);
        }
        let mut out = self.clone();
        out.compensate(temperature);
        Cow::Owned(out)
    }

    /// The same as is known of the stage before a fit, about the mean temperatures of the rows.
    pub fn compensate_as_expected(&mut self, table: &TemperatureTable) {
        let mut temperature = Temperature::NONE;
        for sensor in 0..2 {
            if let Some(mean) = self.temperature_mean_mc(sensor, 0..self.rows.len()) {
                temperature.zero_mc[sensor] = mean;
                temperature.reach_mk[sensor] = Temperature::<f64>::REACH_MK;
                for probe in &mut temperature.per_mk {
                    probe[sensor] = table.prior_per_k[sensor][0] * 1e-3;
                }
            }
        }
        self.compensate(temperature);
    }

    fn temperatures_mc(&self, sensor: usize, rows: Range<usize>) -> impl Iterator<Item = i32> {
        let rows = self.rows.get(rows).unwrap_or_default();
        let codes = rows
            .iter()
            .map(move |row| row.frame.temperature_mc()[sensor]);
        codes.filter(|code| *code != MISSING_CODE)
    }

    /// Mean temperature of mount or body in these rows, m degC.
    pub fn temperature_mean_mc(&self, sensor: usize, rows: Range<usize>) -> Option<i32> {
        let codes = self.temperatures_mc(sensor, rows).map(i64::from);
        let (count, sum) = codes.fold((0, 0), |(count, sum), code| (count + 1, sum + code));
        (count > 0).then(|| (sum as f64 / f64::from(count)).round() as i32)
    }

    /// Smallest and largest temperature of mount or body in these rows, m degC.
    pub fn temperature_range_mc(&self, sensor: usize, rows: Range<usize>) -> Option<[i32; 2]> {
        let codes = self.temperatures_mc(sensor, rows);
        codes.fold(None, |ends: Option<[i32; 2]>, code| {
            let [low, high] = ends.unwrap_or([code; 2]);
            Some([low.min(code), high.max(code)])
        })
    }

    /// Median time between these rows, within their movements, s; at least a microsecond. `None` where none
    /// follow each other.
    pub fn period_s(&self, rows: Range<usize>) -> Option<f64> {
        let pairs = self.rows.get(rows)?.windows(2);
        let pairs = pairs.filter(|pair| pair[0].movement == pair[1].movement);
        let steps_us = pairs.map(|pair| (pair[1].t_us - pair[0].t_us) as f64);
        let median_us = median(&mut steps_us.collect::<Vec<f64>>())?;
        Some((median_us * 1e-6).max(1e-6))
    }

    /// Name of a movement: its number, after the name of its log if there are several logs.
    pub fn movement_name(&self, movement: &Movement) -> String {
        self.movement_named(movement.log, movement.index)
    }

    /// Name of a movement by its log and its number there.
    pub fn movement_named(&self, log: usize, index: i64) -> String {
        match self.logs.get(log) {
            Some(log) if self.logs.len() > 1 => format!("{}:{index}", log.name()),
            _ => index.to_string(),
        }
    }

    /// A dataset of the movements that `keep` accepts, numbered anew. Logs and hash do not change.
    #[must_use]
    pub fn only(&self, keep: impl Fn(&[Row]) -> bool) -> Self {
        let wanted = |movement: &Movement| keep(&self.rows[movement.rows.clone()]);
        let wanted: Vec<bool> = self.movements.iter().map(wanted).collect();
        self.where_row(|row| wanted[self.rows[row].movement])
    }

    /// A dataset without some rows, and without movements that lose all rows. Logs and hash do not change.
    #[must_use]
    pub fn without(&self, rows: &[usize]) -> Self {
        let mut wanted = vec![true; self.rows.len()];
        for row in rows {
            wanted[*row] = false;
        }
        self.where_row(|row| wanted[row])
    }

    fn where_row(&self, keep: impl Fn(usize) -> bool) -> Self {
        let mut out = Self {
            rows: Vec::new(),
            movements: Vec::new(),
            logs: self.logs.clone(),
            sha256: self.sha256,
            temperature: self.temperature,
        };
        for movement in &self.movements {
            let (start, number) = (out.rows.len(), out.movements.len());
            let kept = movement.rows.clone().filter(|row| keep(*row));
            out.rows.extend(kept.map(|row| Row {
                movement: number,
                ..self.rows[row]
            }));
            let rows = start..out.rows.len();
            if !rows.is_empty() {
                out.movements.push(Movement { rows, ..*movement });
            }
        }
        out
    }
}

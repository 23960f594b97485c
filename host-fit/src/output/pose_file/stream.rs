//! From a log to its pose file, in little memory however long they are.

use super::commanded::Commanded;
use super::{KnownErrors, PoseRow, StatusCounts, npy, text};
use crate::output::{Output, OutputError};
use hallstage_input::log::{LogEnd, LogError, LogRows, ReadOptions, ReferenceUse};
use hallstage_input::stage::Stage;
use hallstage_input::watch::Watch;
use runtime::{AnyDecoder, CommandedMotion, MotionCorrection, OnInvalid, PlanarPose, PoseTracker};
use std::path::Path;

/// Bytes that are written at once.
const PIECE_BYTES: usize = 64 * 1024;

/// How poses are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PoseFormat {
    /// Text.
    #[default]
    Csv,
    /// An array of NumPy's format: half the bytes, and the decoder's own words.
    Npy,
}

/// How a log is decoded.
#[derive(Clone, Copy, Debug)]
pub struct DecodeSettings<'a> {
    /// The decoder.
    pub decoder: &'a AnyDecoder,
    /// What invalid fields read.
    pub on_invalid: OnInvalid,
    /// The correction by commanded motion, for a log that holds the commanded pose.
    pub correction: Option<&'a MotionCorrection>,
    /// What is known of the decoder's errors, where uncertainties are to be written.
    pub known: Option<&'a KnownErrors>,
    /// How poses are written.
    pub format: PoseFormat,
    /// Shows how far the decoding is, and can end it.
    pub watch: Watch<'static>,
}

impl DecodeSettings<'_> {
    fn header(&self, rows: usize) -> Vec<u8> {
        let uncertainties = self.known.map_or(0, KnownErrors::count);
        match self.format {
            PoseFormat::Csv => text::header(uncertainties),
            PoseFormat::Npy => npy::header(rows, uncertainties),
        }
    }

    fn write(&self, row: &PoseRow, bytes: &mut Vec<u8>) {
        let at = self
            .known
            .and_then(|known| known.at(&row.reading))
            .unwrap_or_default();
        let count = self.known.map_or(0, KnownErrors::count);
        let uncertainties = &at.as_flattened()[..count];
        match self.format {
            PoseFormat::Csv => text::line(bytes, row, uncertainties),
            PoseFormat::Npy => npy::record(bytes, row, uncertainties),
        }
    }
}

/// Decodes a log into `out` as a controller would, one servo period after the other. What is invalid is
/// zero or held; nothing is held, and no frame is missed, from one movement to the next. Tells how many rows have which status,
/// and what is odd about the log.
///
/// # Errors
/// Errors of the log, after the rows above its first fault, and errors of the output,
/// which then has not changed. A pipe keeps what was written to it.
pub fn decode_log<E: From<LogError> + From<OutputError>>(
    log: &Path,
    stage: &Stage,
    settings: &DecodeSettings<'_>,
    mut out: Output,
) -> Result<(StatusCounts, LogEnd), E> {
    let decoder = settings.decoder;
    let mut tracker = PoseTracker::new(decoder, settings.on_invalid);
    let mut counts = StatusCounts::default();
    let options = ReadOptions {
        watch: settings.watch,
        reference: match settings.correction {
            Some(_) => ReferenceUse::Commanded,
            None => ReferenceUse::IfPresent,
        },
        ..ReadOptions::DECODE
    };
    let mut log = LogRows::open(log, "decoding", stage, &options)?;
    let correction = settings.correction.filter(|_| log.has_reference());
    let mut commanded = Commanded::new(stage.capacitive.window);
    let mut bytes = settings.header(0);
    let rows = loop {
        let (ready, over) = match log.next_row() {
            Ok(Some(row)) if correction.is_some() => (commanded.take(row), None),
            Ok(Some(row)) => (vec![(row, CommandedMotion::default())], None),
            over => (commanded.known(true), Some(over)),
        };
        for (row, motion) in ready {
            if row.begins {
                tracker.forget();
            }
            let frame = &row.row.frame;
            let mut reading = frame.decode(decoder, &PlanarPose::ZERO);
            if let (Some(correction), Some(pose)) = (correction, reading.planar()) {
                reading.pose.planar = correction.correct(pose, &motion).unwrap_or(pose);
            }
            let pose = PoseRow {
                movement: row.movement,
                t_us: row.row.t_us,
                reading: tracker.tick_with(frame.sequence(), |_| reading),
            };
            counts.add(pose.reading.status);
            settings.write(&pose, &mut bytes);
        }
        if bytes.len() >= PIECE_BYTES {
            out.write(&bytes)?;
            bytes.clear();
        }
        if let Some(over) = over {
            break over;
        }
    };
    out.write(&bytes)?;
    rows?;
    if settings.format == PoseFormat::Npy {
        out.rewrite_start(&settings.header(counts.rows))?;
    }
    let end = log.end()?;
    out.finish()?;
    Ok((counts, end))
}

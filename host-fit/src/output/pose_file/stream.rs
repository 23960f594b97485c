//! From a log to its pose file, in little memory however long they are.

use super::{PoseRow, StatusCounts, npy, text, uncertainty};
use crate::input::log::{self, LogEnd, LogError, LogRow, ReadOptions};
use crate::input::stage::Stage;
use crate::output::OutputError;
use crate::output::streamed_file::StreamedFile;
use crate::solve::field::posterior::Posterior;
use rayon::prelude::*;
use runtime::{AnyDecoder, OnInvalid, PlanarPose, Reading, Servo};
use std::path::Path;

/// How poses are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PoseFormat {
    /// Text, for people and for [`read`](super::read).
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
    /// What is known of the decoder's errors, where uncertainties are to be written.
    pub posterior: Option<&'a Posterior>,
    /// How poses are written.
    pub format: PoseFormat,
}

impl DecodeSettings<'_> {
    fn header(&self, rows: usize) -> Vec<u8> {
        match self.format {
            PoseFormat::Csv => text::header(self.posterior.is_some()),
            PoseFormat::Npy => npy::header(rows, self.posterior.is_some()),
        }
    }

    fn written(&self, rows: &[LogRow<Reading>]) -> Vec<u8> {
        let row_bytes = text::LINE_BYTES.max(npy::RECORD_BYTES);
        let mut bytes = Vec::with_capacity(rows.len() * row_bytes);
        let mut line = text::Line::default();
        for row in rows {
            let known = self.posterior;
            let uncertainty = known.map(|known| uncertainty::uncertainty(&row.item, known));
            let row = PoseRow {
                movement: row.movement,
                t_us: row.t_us,
                reading: row.item,
            };
            match self.format {
                PoseFormat::Csv => bytes.extend_from_slice(line.of(&row, uncertainty)),
                PoseFormat::Npy => npy::record(&mut bytes, &row, uncertainty),
            }
        }
        bytes
    }
}

/// Decodes a log into `out`, as [`decode`](super::decode) does: how many rows have which status,
/// and what is odd about the log. `go_on` is asked now and then and can end it.
///
/// # Errors
/// Those of the log, when the rows above its first fault are done, of `go_on` and of the output,
/// which then is as it was before. A pipe keeps what was written to it.
pub fn decode_log<E: From<LogError> + From<OutputError>>(
    log: &Path,
    stage: &Stage,
    settings: &DecodeSettings<'_>,
    mut out: StreamedFile,
    go_on: impl Fn() -> Result<(), E>,
) -> Result<(StatusCounts, LogEnd), E> {
    let decoder = settings.decoder;
    let mut servo = Servo::new(&**decoder, settings.on_invalid);
    let mut counts = StatusCounts::default();
    // Written while the next rows are turned into bytes.
    let mut pending = vec![settings.header(0)];
    let end = log::stream(
        log,
        "decoding",
        stage,
        &ReadOptions::DECODE,
        |sample| sample.frame().decode(decoder, &PlanarPose::ZERO),
        |batch| {
            go_on()?;
            let mut blocks = batch.blocks;
            for row in blocks.iter_mut().flatten() {
                if row.begins {
                    servo.forget();
                }
                let reading = row.item;
                row.item = servo.tick_with(row.sequence, |_| reading);
                counts.add(row.item.status);
            }
            let mut next = Vec::new();
            rayon::in_place_scope(|scope| {
                scope.spawn(|_| {
                    let written = blocks.par_iter().map(|rows| settings.written(rows));
                    next = written.collect();
                });
                pending.iter().try_for_each(|bytes| out.write(bytes))
            })?;
            pending = next;
            Ok::<(), E>(())
        },
    )?;
    pending.iter().try_for_each(|bytes| out.write(bytes))?;
    if settings.format == PoseFormat::Npy {
        out.rewrite_start(&settings.header(counts.rows))?;
    }
    out.finish()?;
    Ok((counts, end))
}

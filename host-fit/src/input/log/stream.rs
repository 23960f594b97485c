//! A log row by row, in little memory however long it is: read in blocks that are taken apart by all
//! cores, and put together in their order.

use super::blocks::{Block, Blocks};
use super::error::LogError;
use super::header::{self, ReferenceSource};
use super::parse::{self, LogRow, Parsed};
use super::rows::RowReader;
use super::stitch::Stitcher;
use super::table::Head;
use super::warning::LogWarning;
use super::{ReadOptions, SaturatedCodes};
use crate::input::stage::Stage;
use crate::input::text::TextReader;
use crate::input::whole::chunk::Sample;
use crate::progress::Progress;
use rayon::prelude::*;
use sha2::Sha256;
use std::path::{Path, PathBuf};

/// Blocks that are worked on at once, for each core: few enough for the memory, enough for an even
/// share.
const BLOCKS_A_CORE: usize = 4;

/// The most of them, on however many cores: this bounds the memory.
const BLOCKS_MAX: usize = 32;

/// Rows that follow each other.
#[derive(Debug)]
pub struct Batch<T> {
    /// The rows, in pieces.
    pub blocks: Vec<Vec<LogRow<T>>>,
    /// The period of the log: the median time between its first rows, us.
    pub period_us: f64,
}

/// What is known of a log at its end.
#[derive(Debug)]
pub struct LogEnd {
    /// The file, as messages name it.
    pub path: PathBuf,
    /// How many rows were left out; the warnings say why.
    pub skipped_rows: usize,
    /// Whether it holds the interferometers' reference.
    pub has_reference: bool,
    /// What is odd about it.
    pub warnings: Vec<LogWarning>,
    pub(super) hash: Option<Sha256>,
}

/// Reads a log from its start to its end: `make` tells what is wanted of each row, on any core, and
/// `take` gets it row after row. `what` is being done, for the progress.
///
/// Memory does not grow with the log, other than by some bytes for each movement.
///
/// # Errors
/// Those of [`LogError`] but `NoLog` and `SameLog`, the first fault of the log, when the rows above
/// it are done; and the first of `take`.
pub fn stream<T: Send, E: From<LogError>>(
    path: &Path,
    what: &'static str,
    stage: &Stage,
    options: &ReadOptions,
    make: impl Fn(&Sample) -> T + Sync,
    take: impl FnMut(Batch<T>) -> Result<(), E>,
) -> Result<LogEnd, E> {
    let text = TextReader::open(path).map_err(LogError::from)?;
    stream_text(text, what, stage, options, make, take)
}

/// As [`stream`], of a text that is open.
pub(super) fn stream_text<T: Send, E: From<LogError>>(
    text: TextReader<'_>,
    what: &'static str,
    stage: &Stage,
    options: &ReadOptions,
    make: impl Fn(&Sample) -> T + Sync,
    mut take: impl FnMut(Batch<T>) -> Result<(), E>,
) -> Result<LogEnd, E> {
    let path = text.path().to_path_buf();
    let mut blocks = Blocks::new(text);
    let head = Head::read(&mut blocks, &path, |name| stage.log.knows(name))?;
    let columns = header::columns(&head, &stage.log, options.reference)?;
    if columns.movement.is_some() && options.split_s.is_some() {
        return Err(LogError::SplitWithMovements { path }.into());
    }
    let reader = RowReader::new(&columns, stage, options.saturated == SaturatedCodes::Keep);
    let parse = |block: Block, reader: RowReader<'_>| {
        parse::parse(block, &head, reader, options.bad_rows, &make)
    };
    let mut stitcher = Stitcher::new(&head, &columns, options, stage.servo_period_s);
    let progress = Progress::new(what, blocks.file_bytes());
    let mut round = read_round(&mut blocks);
    let mut parsed: Vec<Parsed<T>> = Vec::new();
    while !(round.blocks.is_empty() && parsed.is_empty()) {
        let (unparsed, ended) = (std::mem::take(&mut round.blocks), round.ended);
        let (mut next, mut next_parsed) = (None, Vec::new());
        // While these rows are taken, the next are parsed and those after them are read.
        rayon::in_place_scope(|scope| -> Result<(), E> {
            if !ended {
                scope.spawn(|_| next = Some(read_round(&mut blocks)));
            }
            scope.spawn(|_| {
                let each = unparsed.into_par_iter();
                next_parsed = each.map(|block| parse(block, reader.clone())).collect();
            });
            let mut ready = Vec::new();
            for mut one in std::mem::take(&mut parsed) {
                progress.reach(one.block.file_bytes);
                let (form, own) = (stitcher.clock.form, one.clock.form);
                if form.is_some() && own.is_some() && form != own {
                    // Times are written in another way than above: that is a fault of their cells.
                    let mut reader = reader.clone();
                    reader.clock = stitcher.clock;
                    one = parse(one.block, reader);
                }
                stitcher.take(one, &mut ready)?;
            }
            give(&stitcher, ready, &mut take)
        })?;
        parsed = next_parsed;
        if let Some(next) = next {
            round = next;
        }
    }
    drop(progress);
    if let Some(fault) = round.fault {
        return Err(fault.into());
    }
    let (mut ready, mut warnings) = (Vec::new(), Vec::new());
    let skipped_rows = stitcher.skipped.rows();
    stitcher.finish(&mut ready, &mut warnings)?;
    give(&stitcher, ready, &mut take)?;
    Ok(LogEnd {
        path,
        skipped_rows,
        has_reference: !matches!(columns.reference, ReferenceSource::Absent),
        warnings,
        hash: blocks.into_hash(),
    })
}

fn give<T, E>(
    stitcher: &Stitcher<'_, T>,
    blocks: Vec<Vec<LogRow<T>>>,
    take: &mut impl FnMut(Batch<T>) -> Result<(), E>,
) -> Result<(), E> {
    if blocks.is_empty() {
        return Ok(());
    }
    let period_us = stitcher.period_us();
    take(Batch { blocks, period_us })
}

/// Blocks that follow each other.
struct Round {
    blocks: Vec<Block>,
    /// Whether there are no more: the text is over, or what follows cannot be read.
    ended: bool,
    fault: Option<LogError>,
}

fn read_round(blocks: &mut Blocks<'_>) -> Round {
    let most = (BLOCKS_A_CORE * rayon::current_num_threads()).min(BLOCKS_MAX);
    let mut round = Round {
        blocks: Vec::with_capacity(most),
        ended: false,
        fault: None,
    };
    while round.blocks.len() < most && !round.ended {
        match blocks.next() {
            Ok(Some(block)) => round.blocks.push(block),
            Ok(None) => round.ended = true,
            Err(fault) => (round.ended, round.fault) = (true, Some(fault)),
        }
    }
    round
}

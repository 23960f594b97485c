//! `replay`: plays a log onto a CAN bus as the sensor node of the stage would send it.

mod pace;

use crate::bus::live::{Bus, BusError};
use crate::input::dataset::{Dataset, LoggedFrame};
use crate::input::log::{self, LogError, ReadOptions};
use crate::input::stage::{Stage, StageError};
use crate::interrupt;
use crate::progress::Progress;
use hal_adapters::can::{BusFrame, Layout, sensor};
use pace::Pacer;
use runtime::RawFrame;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// What is played, and how.
#[derive(Clone, Debug)]
pub struct ReplaySettings {
    /// The log; it needs no reference.
    pub log: PathBuf,
    /// The stage file.
    pub stage: PathBuf,
    /// CAN interface, for instance can0.
    pub interface: String,
    /// How many times faster than it was logged.
    pub rate: f64,
    /// How codes are put into frames; the narrowest that holds them if `None`.
    pub layout: Option<Layout>,
    /// Stop after so many rows.
    pub rows: Option<usize>,
}

/// Why a replay ended early.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The stage file is refused.
    #[error(transparent)]
    Stage(#[from] StageError),
    /// The log is refused.
    #[error(transparent)]
    Log(#[from] LogError),
    /// The log has a vertical pose in place of capacitive codes.
    #[error("{}: the log holds Z, Rx, Ry in SI units and no capacitive codes, so there is nothing to send", path.display())]
    NoCodes {
        /// The log.
        path: PathBuf,
    },
    /// The codes of the stage do not fit into a frame.
    #[error(
        "the converters of the stage give codes from {low} to {high}, which do not fit into {bits} bits"
    )]
    CodesTooWide {
        /// Smallest code.
        low: i32,
        /// Largest code.
        high: i32,
        /// Bits of the widest layout that was allowed.
        bits: u8,
    },
    /// The bus cannot be used.
    #[error("{cause}; {rows} rows were sent")]
    Bus {
        /// What is wrong.
        cause: BusError,
        /// Rows that were sent.
        rows: usize,
    },
}

/// How a replay went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Replayed {
    /// Rows that were sent.
    pub rows: usize,
    /// Frames that were sent.
    pub frames: usize,
    /// How long it took, s.
    pub elapsed_s: f64,
    /// Times of the log that were played, s.
    pub logged_s: f64,
    /// The latest that a row was sent after its time, s.
    pub late_max_s: f64,
}

/// Most rows that are sent at once when the replay is late.
const BATCH_ROWS: usize = 20;

/// How long a frame may wait for a place in the transmit queue.
const SEND_DEADLINE: Duration = Duration::from_secs(1);

/// Plays the log; ends early, without an error, on Ctrl-C.
///
/// # Errors
/// See [`ReplayError`].
pub fn run(settings: &ReplaySettings) -> Result<Replayed, ReplayError> {
    let stage = Stage::from_file(&settings.stage)?;
    let layout = choose_layout(settings.layout, &stage)?;
    let log = log::read(
        std::slice::from_ref(&settings.log),
        &stage,
        &ReadOptions::DECODE,
    )?;
    let frames = numbered(&log.dataset).ok_or_else(|| ReplayError::NoCodes {
        path: settings.log.clone(),
    })?;
    let frames = frames
        .get(..settings.rows.unwrap_or(usize::MAX))
        .unwrap_or(&frames);
    let bus =
        Bus::open(&settings.interface, &[]).map_err(|cause| ReplayError::Bus { cause, rows: 0 })?;
    send(frames, layout, settings.rate, &bus, interrupt::watch())
}

/// The layout asked for, or the narrowest; refused if it does not hold the codes of the stage.
fn choose_layout(asked: Option<Layout>, stage: &Stage) -> Result<Layout, ReplayError> {
    let (hall, gaps) = (stage.hall.window, stage.capacitive.window);
    // The rails themselves are sent too: the receiver marks them.
    let low = hall.low.min(gaps.low) - 1;
    let high = hall.high.max(gaps.high) + 1;
    let narrowest = Layout::that_holds(low, high);
    let wide = |bits| ReplayError::CodesTooWide { low, high, bits };
    match (asked, narrowest) {
        (None, Some(layout)) => Ok(layout),
        (Some(Layout::Bits16), Some(Layout::Bits16)) => Ok(Layout::Bits16),
        (Some(Layout::Bits16), _) => Err(wide(16)),
        (Some(Layout::Bits24), Some(_)) => Ok(Layout::Bits24),
        (_, None) => Err(wide(24)),
    }
}

/// A frame of the log and when it is due, us from the start.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Due {
    at_us: u64,
    frame: RawFrame,
}

/// The frames of a log numbered in one row, movement after movement: gaps within a movement
/// stay, those between movements close to one period. `None` if a row has no codes.
fn numbered(dataset: &Dataset) -> Option<Vec<Due>> {
    let mut all: Vec<Due> = Vec::with_capacity(dataset.rows.len());
    let period_us = typical_step_us(dataset);
    for movement in &dataset.movements {
        let rows = dataset.rows.get(movement.rows.clone()).unwrap_or_default();
        let first_us = rows.first().map_or(0, |row| row.t_us);
        let (start_us, start) = all.last().map_or((0, 0), |last| {
            (last.at_us + period_us, last.frame.sequence.wrapping_add(1))
        });
        for row in rows {
            let LoggedFrame::Codes(frame) = &row.frame else {
                return None;
            };
            let since_us = row.t_us.saturating_sub(first_us);
            all.push(Due {
                at_us: start_us.saturating_add(u64::try_from(since_us).unwrap_or(0)),
                frame: RawFrame {
                    sequence: start.wrapping_add(frame.sequence),
                    ..*frame
                },
            });
        }
    }
    Some(all)
}

/// The median time from row to row within movements, us.
fn typical_step_us(dataset: &Dataset) -> u64 {
    let mut steps: Vec<i64> = Vec::with_capacity(dataset.rows.len());
    for movement in &dataset.movements {
        let rows = dataset.rows.get(movement.rows.clone()).unwrap_or_default();
        steps.extend(rows.windows(2).filter_map(|pair| match pair {
            [a, b] => Some(b.t_us - a.t_us),
            _ => None,
        }));
    }
    if steps.is_empty() {
        return 0;
    }
    let middle = steps.len() / 2;
    u64::try_from(*steps.select_nth_unstable(middle).1).unwrap_or(0)
}

fn send(
    frames: &[Due],
    layout: Layout,
    rate: f64,
    bus: &Bus,
    stop: &AtomicBool,
) -> Result<Replayed, ReplayError> {
    let mut done = Replayed::default();
    let started = Instant::now();
    let pacer = Pacer::new(started, rate);
    let mut batch = Vec::with_capacity(BATCH_ROWS * 4);
    let mut left = frames;
    let progress = Progress::new("sending", frames.len() as u64);
    while let [first, ..] = left {
        let (now_us, late_s) = pacer.wait_until(first.at_us, stop);
        if stop.load(Ordering::Relaxed) {
            break;
        }
        done.late_max_s = done.late_max_s.max(late_s);
        // Everything that is due by now goes to the kernel in one call.
        let due = left
            .iter()
            .take(BATCH_ROWS)
            .take_while(|d| d.at_us <= now_us);
        let due = due.count().max(1);
        let (now, later) = left.split_at_checked(due).unwrap_or((left, &[]));
        batch.clear();
        for due in now {
            batch.extend(sensor::frames(layout, &due.frame).map(BusFrame::from));
            done.logged_s = due.at_us as f64 * 1e-6;
        }
        let rows = done.rows;
        bus.send(&batch, SEND_DEADLINE)
            .map_err(|cause| ReplayError::Bus { cause, rows })?;
        done.frames += batch.len();
        done.rows += now.len();
        left = later;
        progress.reach(done.rows as u64);
    }
    done.elapsed_s = started.elapsed().as_secs_f64();
    Ok(done)
}

#[cfg(test)]
#[path = "replay_tests.rs"]
mod tests;

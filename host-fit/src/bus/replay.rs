//! `replay`: plays a log onto a CAN bus as the sensor node of the stage would send it.

mod pace;

use crate::bus::BusAddress;
use crate::bus::live::{Bus, BusError};
use crate::cli::arguments::{between, choice};
use crate::output::is_standard;
use clap::Args;
use hal_adapters::can::sensor::{self, TemperatureSender};
use hal_adapters::can::{BusFrame, Layout};
use hallstage_input::log::{LogError, LogRow, LogRows, ReadOptions};
use hallstage_input::stage::{Stage, StageError};
use hallstage_input::watch::Watch;
use pace::Pacer;
use runtime::RawFrame;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// What is played, and how.
#[derive(Clone, Debug, Args)]
pub struct ReplaySettings {
    /// The log: CSV or CSV.gz, or `-` for standard input; it needs no reference.
    #[arg(value_name = "LOG")]
    pub log: PathBuf,
    /// The stage as designed.
    #[arg(long, value_name = "FILE", default_value = "stage.toml")]
    pub stage: PathBuf,
    /// CAN interface, for instance can0; can0@5 for node 5 of the bus.
    #[arg(long, value_name = "IFACE")]
    pub can: BusAddress,
    /// How many times faster than it was logged.
    #[arg(long, value_name = "X", default_value = "1", value_parser = rate)]
    pub rate: f64,
    /// How codes are put into frames.
    #[arg(long, value_parser = choice::<Option<Layout>>(), default_value = "auto")]
    pub layout: std::option::Option<Layout>,
    /// Stop after so many rows.
    #[arg(long, value_name = "N")]
    pub rows: Option<usize>,
}

fn rate(text: &str) -> Result<f64, String> {
    between(text, 1e-3, 1e6, "a number")
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

/// Rows that are read before they are sent.
const AHEAD_ROWS: usize = 1024;

/// How long a frame may wait for a place in the transmit queue.
const SEND_DEADLINE: Duration = Duration::from_secs(1);

/// Plays the log, which is checked as a whole before the first frame is sent, unless it comes from
/// standard input; ends early, without an error, on Ctrl-C. Memory does not grow with the log.
///
/// # Errors
/// See [`ReplayError`].
pub fn run(settings: &ReplaySettings, watch: Watch<'_>) -> Result<Replayed, ReplayError> {
    let stage = Stage::from_file(&settings.stage)?;
    let layout = choose_layout(settings.layout, &stage)?;
    let most = settings.rows.unwrap_or(usize::MAX);
    // A pipe can be read once only.
    let rows = match std::fs::metadata(&settings.log) {
        Ok(file) if !file.is_file() => 0,
        _ if is_standard(&settings.log) => 0,
        _ => rows_of(&settings.log, &stage)?.min(most),
    };
    let bus = Bus::open(&settings.can.interface, settings.can.node, &[])
        .map_err(|cause| ReplayError::Bus { cause, rows: 0 })?;
    let mut player = Player {
        layout,
        bus,
        stop: watch.stop,
        pacer: Pacer::new(Instant::now(), settings.rate),
        done: Replayed::default(),
        frames: Vec::with_capacity(BATCH_ROWS * 4),
        temperatures: TemperatureSender::START,
    };
    let progress = watch.begin("sending", rows as u64);
    let mut timeline = Timeline::default();
    let mut rows = LogRows::open(&settings.log, "reading", &stage, &ReadOptions::DECODE)?;
    timeline.period_us = rows.period_us() as u64;
    let mut is_over = false;
    while !is_over {
        let mut due = Vec::with_capacity(AHEAD_ROWS);
        while due.len() < AHEAD_ROWS.min(most - player.done.rows) {
            match rows.next_row()? {
                Some(row) => due.push(timeline.due(&row, codes(&row, &settings.log)?)),
                None => break,
            }
        }
        is_over = due.is_empty() || player.play(&due)?;
        progress.reach(player.done.rows as u64);
    }
    if player.done.rows < most && !player.stop.load(Ordering::Relaxed) {
        rows.end()?;
    }
    player.done.elapsed_s = player.pacer.elapsed_s();
    Ok(player.done)
}

/// How many rows a log has that can be played.
fn rows_of(log: &Path, stage: &Stage) -> Result<usize, ReplayError> {
    let mut rows = LogRows::open(log, "checking", stage, &ReadOptions::DECODE)?;
    let mut count = 0;
    while let Some(row) = rows.next_row()? {
        codes(&row, log)?;
        count += 1;
    }
    rows.end()?;
    Ok(count)
}

/// The codes of a row, all six.
fn codes(row: &LogRow, log: &Path) -> Result<RawFrame, ReplayError> {
    let path = || log.to_path_buf();
    (row.row.frame.all_codes()).ok_or_else(|| ReplayError::NoCodes { path: path() })
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
/// stay, those between movements close to one period.
#[derive(Debug, Default)]
struct Timeline {
    /// The time from row to row, us.
    period_us: u64,
    last: Option<Due>,
    /// When the movement starts, us, and the number of its first frame.
    start: (u64, u32),
    /// The time of its first row in the log, us.
    first_us: i64,
}

impl Timeline {
    /// When the next row is due, and as what.
    /// Its frame carries this time, as the clock of a node goes on between movements, too.
    fn due(&mut self, row: &LogRow, frame: RawFrame) -> Due {
        if row.begins {
            self.first_us = row.row.t_us;
            self.start = self.last.map_or((0, 0), |last| {
                let at_us = last.at_us.saturating_add(self.period_us);
                (at_us, last.frame.sequence.wrapping_add(1))
            });
        }
        let (start_us, start) = self.start;
        let since_us = row.row.t_us.saturating_sub(self.first_us);
        let at_us = start_us.saturating_add(u64::try_from(since_us).unwrap_or(0));
        let due = Due {
            at_us,
            frame: RawFrame {
                sequence: start.wrapping_add(frame.sequence),
                // Wraps as the node's clock does.
                time_us: at_us as u32,
                ..frame
            },
        };
        self.last = Some(due);
        due
    }
}

/// Sends frames when they are due.
struct Player<'a> {
    layout: Layout,
    bus: Bus,
    stop: &'a AtomicBool,
    pacer: Pacer,
    done: Replayed,
    frames: Vec<BusFrame>,
    temperatures: TemperatureSender,
}

impl Player<'_> {
    /// Sends the rows; whether the user wants no more.
    fn play(&mut self, rows: &[Due]) -> Result<bool, ReplayError> {
        let mut left = rows;
        while let [first, ..] = left {
            let (now_us, late_s) = self.pacer.wait_until(first.at_us, self.stop);
            if self.stop.load(Ordering::Relaxed) {
                return Ok(true);
            }
            self.done.late_max_s = self.done.late_max_s.max(late_s);
            // Everything that is due by now goes to the kernel in one call.
            let due = left
                .iter()
                .take(BATCH_ROWS)
                .take_while(|d| d.at_us <= now_us);
            let due = due.count().max(1);
            let (now, later) = left.split_at_checked(due).unwrap_or((left, &[]));
            self.frames.clear();
            for due in now {
                let temperatures = self.temperatures.frame(&due.frame).into_iter();
                let frames = temperatures.chain(sensor::frames(self.layout, &due.frame));
                self.frames.extend(frames.map(BusFrame::from));
                self.done.logged_s = due.at_us as f64 * 1e-6;
            }
            let rows = self.done.rows;
            self.bus
                .send_all(&self.frames, SEND_DEADLINE)
                .map_err(|cause| ReplayError::Bus { cause, rows })?;
            self.done.frames += self.frames.len();
            self.done.rows += now.len();
            left = later;
        }
        Ok(false)
    }
}

#[cfg(test)]
#[path = "replay_tests.rs"]
mod tests;

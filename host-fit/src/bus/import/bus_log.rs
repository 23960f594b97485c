//! Lines of a candump log to ticks, by the receiver that a controller has.

use super::{ImportError, ImportSettings};
use crate::input::source;
use hal_adapters::can::{
    BusFault, BusHealth, Layout, Message, SensorReceiver, StampedFrame, Timing,
};
use hal_adapters::candump::{LineError, LogLine};
use runtime::RawFrame;
use runtime::frame::MISSING_CODE;
use std::path::Path;

/// A whole tick of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BusTick {
    /// Its number, lost ticks counted.
    pub sequence: u64,
    /// Whether the sensor node counted on from the tick before.
    pub follows: bool,
    /// When its first frame was received, us.
    pub received_us: u64,
    /// Hall codes of A, B, C.
    pub hall: [i32; 3],
    /// Capacitive codes 1, 2, 3.
    pub capacitive: [i32; 3],
}

/// What a record held.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BusCounts {
    /// Lines with a frame.
    pub frames: usize,
    /// Lines that were left out because they cannot be read.
    pub bad_lines: usize,
    /// Lines that hold no classic data frame: error frames, CAN FD.
    pub other_lines: usize,
    /// Whole ticks.
    pub ticks: usize,
    /// Ticks missing between them, those that were not whole included.
    pub ticks_missing: u64,
    /// Places where ticks are missing.
    pub gaps: usize,
    /// What the receiver noticed.
    pub health: BusHealth,
}

/// The ticks of a record.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BusReading {
    /// Whole ticks, in order.
    pub ticks: Vec<BusTick>,
    /// What else there was.
    pub counts: BusCounts,
}

/// A recorded tick may have been delayed as a whole: what is missing shows by the counters.
const TIMING: Timing = Timing {
    assembly_us: 20_000,
    stale_us: u32::MAX / 4,
};

/// Reads a record.
///
/// # Errors
/// `Bus`, `BadLine`, `NotText`, `SeveralInterfaces`, `NoTicks`.
pub fn read(args: &ImportSettings) -> Result<BusReading, ImportError> {
    let path = args.bus.as_path();
    let bytes = source::read_bytes(path)?;
    let mut collector = Collector::new(args.layout);
    let mut reading = BusReading::default();
    let mut interface = args.interface.clone();
    for (line, bytes) in (1..).zip(bytes.split(|b| *b == b'\n')) {
        let bytes = bytes.trim_ascii();
        if bytes.is_empty() {
            continue;
        }
        let not_text = |_| ImportError::NotText {
            path: path.to_owned(),
            line,
        };
        let parsed = match std::str::from_utf8(bytes) {
            Ok(text) => LogLine::parse(text),
            Err(_) if args.skip_bad_lines => Err(LineError::BadTime),
            Err(error) => return Err(not_text(error)),
        };
        match parsed {
            Ok(found) => {
                if chosen(&mut interface, &found, args, path, line)? {
                    reading.ticks.extend(collector.take(&found.stamped()));
                }
            }
            Err(LineError::ErrorFrame | LineError::FlexibleDataRate) => {
                reading.counts.other_lines += 1;
            }
            Err(_) if args.skip_bad_lines => reading.counts.bad_lines += 1,
            Err(fault) => {
                return Err(ImportError::BadLine {
                    path: path.to_owned(),
                    line,
                    fault,
                });
            }
        }
    }
    reading.counts = BusCounts {
        bad_lines: reading.counts.bad_lines,
        other_lines: reading.counts.other_lines,
        ..collector.counts()
    };
    if reading.ticks.is_empty() {
        return Err(ImportError::NoTicks {
            path: path.to_owned(),
            frames: reading.counts.frames,
        });
    }
    Ok(reading)
}

/// Whether a frame belongs to the interface that is read; the first one's, if none was named.
fn chosen(
    interface: &mut Option<String>,
    found: &LogLine<'_>,
    args: &ImportSettings,
    path: &Path,
    line: usize,
) -> Result<bool, ImportError> {
    match interface {
        None => *interface = Some(found.interface.to_owned()),
        Some(name) if name == found.interface => {}
        Some(_) if args.interface.is_some() => return Ok(false),
        Some(name) => {
            return Err(ImportError::SeveralInterfaces {
                path: path.to_owned(),
                line,
                interface: name.clone(),
                other: found.interface.to_owned(),
            });
        }
    }
    Ok(true)
}

/// Frames to whole ticks, counted.
#[derive(Clone, Debug, Default)]
pub(in crate::bus) struct Collector {
    layout: Option<Layout>,
    receiver: Option<SensorReceiver>,
    counts: BusCounts,
    /// Number of the last whole tick, by the receiver and in the record.
    last: Option<(u32, u64)>,
    restarted: bool,
}

impl Collector {
    /// Takes the layout from the first frame with codes if it is not given.
    pub(in crate::bus) fn new(layout: Option<Layout>) -> Self {
        Self {
            layout,
            ..Self::default()
        }
    }

    /// Takes a frame; gives the tick that it completes.
    pub(in crate::bus) fn take(&mut self, stamped: &StampedFrame) -> Option<BusTick> {
        self.counts.frames += 1;
        if self.layout.is_none() {
            self.layout = Message::from_id(stamped.frame.id).and_then(Layout::carrying);
        }
        let layout = self.layout?;
        let new = || SensorReceiver::new(layout, TIMING);
        let receiver = self.receiver.get_or_insert_with(new);
        // The receiver's times wrap after 71 minutes.
        let taken = receiver.take(&stamped.frame, stamped.time_us as u32);
        self.restarted |= matches!(
            taken.fault,
            Some(
                BusFault::SenderRestarted
                    | BusFault::WrongSequence { .. }
                    | BusFault::TicksLost { .. }
            )
        );
        self.tick(&taken.tick?, stamped.time_us)
    }

    fn tick(&mut self, raw: &RawFrame, now_us: u64) -> Option<BusTick> {
        let codes = raw.hall.iter().chain(&raw.capacitive);
        if codes.clone().any(|c| *c == MISSING_CODE) {
            return None;
        }
        let (ahead, before) = self.last.map_or((0, 0), |(last, before)| {
            (raw.sequence.wrapping_sub(last), before)
        });
        let sequence = before + u64::from(ahead);
        self.last = Some((raw.sequence, sequence));
        self.counts.ticks += 1;
        if ahead > 1 {
            self.counts.gaps += 1;
            self.counts.ticks_missing += u64::from(ahead - 1);
        }
        let age_us = (now_us as u32).wrapping_sub(raw.time_us);
        // The record's clock may step back within a tick.
        let age_us = if age_us > u32::MAX / 2 { 0 } else { age_us };
        Some(BusTick {
            sequence,
            follows: !core::mem::take(&mut self.restarted),
            received_us: now_us.saturating_sub(age_us.into()),
            hall: raw.hall,
            capacitive: raw.capacitive,
        })
    }

    /// What came so far.
    pub(in crate::bus) fn counts(&self) -> BusCounts {
        let health = self.receiver.as_ref().map(SensorReceiver::health);
        BusCounts {
            health: health.copied().unwrap_or_default(),
            ..self.counts
        }
    }

    /// How codes come, once some have.
    pub(in crate::bus) const fn layout(&self) -> Option<Layout> {
        self.layout
    }
}

//! Frames of a bus to ticks, by the receiver of a controller.

use hal_adapters::can::{BusHealth, Layout, Message, SensorReceiver, StampedFrame, Timing};
use runtime::RawFrame;
use runtime::frame::MISSING_CODE;

/// A whole tick of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BusTick {
    /// When its first frame was received, us.
    pub received_us: u64,
    /// All its codes.
    pub codes: RawFrame,
    /// Whether a code is at a rail of its converter.
    pub is_saturated: bool,
}

impl BusTick {
    /// The last four bits of its number.
    pub(crate) const fn counter(&self) -> u32 {
        self.codes.sequence & 0xf
    }
}

/// The contents of a record.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BusCounts {
    /// Lines with a frame.
    pub frames: usize,
    /// Skipped lines that cannot be read.
    pub bad_lines: usize,
    /// Lines without a classic data frame: error frames, CAN FD.
    pub other_lines: usize,
    /// Whole ticks.
    pub ticks: usize,
    /// Skipped whole ticks with a code at a rail of its converter.
    pub saturated: usize,
    /// Skipped whole ticks with an uncertain time, or of a shorter run of the node.
    pub untimed: usize,
    /// Restarts of the node.
    pub restarts: usize,
    /// Missing ticks between them, incomplete ticks included.
    pub ticks_missing: u64,
    /// Places where ticks are missing.
    pub gaps: usize,
    /// Counters of the receiver.
    pub health: BusHealth,
}

/// A whole tick may be recorded late; the counters show missing ticks.
const TIMING: Timing = Timing {
    assembly_us: 20_000,
    stale_us: u32::MAX / 4,
};

/// Frames to whole ticks, counted.
#[derive(Clone, Debug, Default)]
pub(crate) struct Collector {
    /// As the first frame with codes shows.
    layout: Option<Layout>,
    receiver: Option<SensorReceiver>,
    counts: BusCounts,
    /// Number of the last whole tick by the receiver.
    last: Option<u32>,
}

impl Collector {
    /// Takes a frame; gives the tick that it completes.
    pub(crate) fn take(&mut self, stamped: &StampedFrame) -> Option<BusTick> {
        self.counts.frames += 1;
        if self.layout.is_none() {
            self.layout = Message::from_id(stamped.frame.id).and_then(Layout::from_message);
        }
        let layout = self.layout?;
        let new = || SensorReceiver::new(layout, TIMING);
        let receiver = self.receiver.get_or_insert_with(new);
        // The receiver's times wrap after 71 minutes.
        let taken = receiver.take(&stamped.frame, stamped.time_us as u32);
        self.tick(&taken.tick?, stamped.time_us)
    }

    fn tick(&mut self, raw: &RawFrame, now_us: u64) -> Option<BusTick> {
        let codes = raw.hall.iter().chain(&raw.capacitive);
        if codes.clone().any(|c| *c == MISSING_CODE) {
            return None;
        }
        let last = self.last.replace(raw.sequence).unwrap_or(raw.sequence);
        let ahead = raw.sequence.wrapping_sub(last);
        self.counts.ticks += 1;
        if ahead > 1 {
            self.counts.gaps += 1;
            self.counts.ticks_missing += u64::from(ahead - 1);
        }
        let age_us = (now_us as u32).wrapping_sub(raw.time_us);
        // The record's clock may step back within a tick.
        let age_us = if age_us > u32::MAX / 2 { 0 } else { age_us };
        Some(BusTick {
            received_us: now_us.saturating_sub(age_us.into()),
            codes: *raw,
            is_saturated: false,
        })
    }

    /// The counts so far.
    pub(crate) fn counts(&self) -> BusCounts {
        let health = self.receiver.as_ref().map(SensorReceiver::health);
        BusCounts {
            health: health.copied().unwrap_or_default(),
            ..self.counts
        }
    }

    /// The layout of the codes, once known.
    pub(crate) const fn layout(&self) -> Option<Layout> {
        self.layout
    }
}

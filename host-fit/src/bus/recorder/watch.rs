//! The contents of a record so far.

use crate::bus::bus_log::{BusCounts, Collector};
use hal_adapters::can::command::{Content, Mailbox};
use hal_adapters::can::status::{NodeState, NodeStatus};
use hal_adapters::can::{Layout, StampedFrame};

/// Watches the recorded frames: ticks of codes, and the state of the controller.
#[derive(Clone, Debug, Default)]
pub struct Monitor {
    collector: Collector,
    mailbox: Mailbox,
    status: Option<NodeStatus>,
    /// When the first and the last tick of codes came, us.
    first_us: Option<u64>,
    last_us: u64,
}

/// Codes that are absent for longer are missing, us. A record may end a little after its codes.
const SILENT_US: u64 = 1_000_000;

impl Monitor {
    /// Takes a frame.
    pub fn take(&mut self, stamped: &StampedFrame) {
        let before = self.counts().ticks;
        self.collector.take(stamped);
        if self.counts().ticks > before {
            self.first_us.get_or_insert(stamped.time_us);
            self.last_us = stamped.time_us;
        }
        if let Some(Ok(Content::Status(status))) = self.mailbox.take(&stamped.frame) {
            self.status = Some(status);
        }
    }

    /// Ticks missing between the last tick and `end_us`, if that is long: codes that stop make no gap between ticks.
    pub fn missing_at_the_end(&self, end_us: u64) -> u64 {
        let silent_us = end_us.saturating_sub(self.last_us);
        let Some(first_us) = self.first_us.filter(|_| silent_us > SILENT_US) else {
            return 0;
        };
        let ticks = self.counts().ticks as u64;
        silent_us * ticks / self.last_us.saturating_sub(first_us).max(1)
    }

    /// The layout of the codes, once known.
    pub const fn layout(&self) -> Option<Layout> {
        self.collector.layout()
    }

    /// Frames, ticks, gaps and faults of the codes.
    pub fn counts(&self) -> BusCounts {
        self.collector.counts()
    }

    /// The state of the controller.
    pub fn state(&self) -> String {
        let Some(status) = self.status else {
            return "it does not say its state".to_owned();
        };
        let reason = status.reason;
        match status.state {
            Some(NodeState::Running) => "it decodes".to_owned(),
            Some(NodeState::NoParameters) => "it has no parameters yet".to_owned(),
            Some(NodeState::BadParameters) => {
                format!("its parameters are refused (reason {reason:#x})")
            }
            Some(NodeState::NoFrames) => {
                format!("it gets no codes from its converter (reason {reason:#x})")
            }
            Some(NodeState::SensorFault) => {
                format!("a sensor or the converter is faulty (reason {reason:#x})")
            }
            Some(NodeState::SelfTestFailed) => "it failed its own test".to_owned(),
            Some(NodeState::Updating) => "it is getting new parameters".to_owned(),
            Some(NodeState::Stopped) => format!("it has stopped (reason {reason})"),
            Some(NodeState::Starting) => "it is starting".to_owned(),
            None => "its state is one that this version does not know".to_owned(),
        }
    }
}

impl std::fmt::Display for Monitor {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let counts = self.counts();
        let width = match self.layout() {
            None => "no codes".to_owned(),
            Some(Layout::Bits16) => format!("{} ticks of 16-bit codes", counts.ticks),
            Some(Layout::Bits24) => format!("{} ticks of 24-bit codes", counts.ticks),
        };
        let health = &counts.health;
        write!(
            f,
            "{width}, {} missing in {} gaps; {} frames, {} damaged, {} out of sequence; {}",
            counts.ticks_missing,
            counts.gaps,
            counts.frames,
            health.wrong_check + health.wrong_length,
            health.wrong_sequence + health.late + health.repeated,
            self.state()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hal_adapters::can::{BusFrame, Coded, sensor};
    use runtime::RawFrame;

    fn stamped(coded: Coded, sequence: u32) -> StampedFrame {
        StampedFrame {
            time_us: 2_000 * u64::from(sequence),
            frame: BusFrame::from(coded),
        }
    }

    #[test]
    fn ticks_and_gaps_of_either_layout_are_counted() {
        for layout in [Layout::Bits16, Layout::Bits24] {
            let mut watch = Monitor::default();
            for sequence in (0..100).filter(|s| !(20..22).contains(s) && *s != 50) {
                let frame = RawFrame::new([1, 2, sequence as i32], [3; 3], sequence, 0);
                for coded in sensor::frames(layout, &frame) {
                    watch.take(&stamped(coded, sequence));
                }
            }
            assert_eq!(watch.layout(), Some(layout));
            let counts = watch.counts();
            assert_eq!(
                (counts.ticks, counts.gaps, counts.ticks_missing),
                (97, 2, 3)
            );
        }
    }
}

//! The slow frames of the decoding node: its state and its counters.

use super::e2e::Payload;
use runtime::tracker::Health;

numbered! {
    /// State of the decoding node.
    NodeState {
        /// Between reset and the first tick.
        Starting = 0,
        /// It decodes.
        Running = 1,
        /// There is no parameter blob: no pose.
        NoParameters = 2,
        /// The parameter blob is refused: no pose. The reason says why.
        BadParameters = 3,
        /// No frames come from the sensors.
        NoFrames = 4,
        /// A sensor or its converter reports a fault.
        SensorFault = 5,
        /// The node failed its own test at start: no pose.
        SelfTestFailed = 6,
        /// New parameters are being received or stored: no pose.
        Updating = 7,
        /// No parameters run until a host acknowledges: no pose. The reason says why.
        Stopped = 8,
    }
}

/// Flags of [`NodeStatus`], as bits.
pub mod flag {
    /// The last reset came from the watchdog, or from the program on a fault: see page 6 of the
    /// health frames.
    pub const WATCHDOG_RESET: u8 = 1;
    /// The bus was off since start.
    pub const BUS_WAS_OFF: u8 = 1 << 1;
    /// A re-zero is running.
    pub const REZERO_RUNS: u8 = 1 << 2;
    /// A zero deviation is subtracted now.
    pub const ZERO_SET: u8 = 1 << 3;
    /// The last re-zero was refused.
    pub const REZERO_REFUSED: u8 = 1 << 4;
    /// The node shows where it is.
    pub const IDENTIFYING: u8 = 1 << 5;
    /// The core runs on its internal oscillator.
    pub const INTERNAL_OSCILLATOR: u8 = 1 << 6;
    /// The codes of every tick are sent.
    pub const RECORDING: u8 = 1 << 7;
}

/// `bit` if `is`, else 0.
pub const fn bit(bit: u32, is: bool) -> u32 {
    if is { bit } else { 0 }
}

/// A frame of [`super::Message::NodeStatus`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct NodeStatus {
    /// State of the node; `None` for a number that this version does not know.
    pub state: Option<NodeState>,
    /// Detail of the state, defined by the node; 0 for none.
    pub reason: u8,
    /// Bits of [`flag`].
    pub flags: u8,
    /// Ticks that came late or not at all.
    pub missed_ticks: u16,
    /// Times the bus was off.
    pub bus_off: u8,
    /// Version of the protocol.
    pub version: u8,
}

impl NodeStatus {
    /// The 52 bits of the frame. A state of `None` is sent as 15.
    pub const fn payload(&self) -> Payload {
        let state = match self.state {
            Some(state) => state as u32,
            None => 15,
        };
        Payload::new(
            (self.flags as u32) << 12 | (self.reason as u32) << 4 | state,
            (self.version as u32) << 24 | (self.bus_off as u32) << 16 | self.missed_ticks as u32,
        )
    }

    /// From the 52 bits of a frame.
    pub fn from_payload(p: Payload) -> Self {
        let [m0, m1, bus_off, version] = p.long.to_le_bytes();
        Self {
            state: NodeState::ALL.get((p.short & 0xf) as usize).copied(),
            reason: (p.short >> 4) as u8,
            flags: (p.short >> 12) as u8,
            missed_ticks: u16::from_le_bytes([m0, m1]),
            bus_off,
            version,
        }
    }
}

/// Facts about the start and the board of a controller: pages 6 to 11, in this order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BoardFacts {
    /// The last fault that caused a reset since power-on. Bits 0 to 7: 0 none, 1 panic, 2 hard
    /// fault, 3 stack overflow, 4 clock failed, 5 watchdog, 6 parameters in RAM changed. Bits 8 to
    /// 15: the step of the start-up that was running, 0 when ticking.
    pub last_fault: u32,
    /// Program counter of that fault.
    pub fault_address: u32,
    /// CFSR of that fault, or another detail of its kind.
    pub fault_detail: u32,
    /// Resets by faults since power-on.
    pub faults: u32,
    /// The word FLASH_OPTCR.
    pub option_bytes: u32,
    /// Bits of [`board_check`].
    pub board_checks: u32,
}

impl BoardFacts {
    /// The words of the pages, in their order.
    pub const fn words(&self) -> [u32; 6] {
        let (fault, detail) = (self.fault_address, self.fault_detail);
        let (options, checks) = (self.option_bytes, self.board_checks);
        [self.last_fault, fault, detail, self.faults, options, checks]
    }
}

/// Bits of [`BoardFacts::board_checks`].
pub mod board_check {
    /// Chip select has no pull-up on the board.
    pub const NO_PULL_UP_ON_SELECT: u32 = 1;
    /// SYNC/RESET or RST/PD has no pull-up on the board.
    pub const NO_PULL_UP_ON_CONTROL: u32 = 1 << 1;
    /// The brown-out level is below 2.7 V.
    pub const BROWN_OUT_LOW: u32 = 1 << 2;
    /// The core runs on its internal oscillator: the crystal did not start, or the PLL did not lock
    /// to it.
    pub const INTERNAL_OSCILLATOR: u32 = 1 << 3;
    /// The CAN controller did not start, or takes no part in the bus for half a second.
    pub const CAN_NOT_STARTED: u32 = 1 << 4;
    /// A zero deviation that was kept is lost: its record is damaged, or of another blob.
    pub const ZERO_LOST: u32 = 1 << 5;
    /// The supply is below 2.9 V now: nothing is written.
    pub const SUPPLY_LOW: u32 = 1 << 6;
    /// The parameters want temperatures, and one is missing or implausible: poses are as if at the
    /// temperature of the calibration.
    pub const TEMPERATURE_MISSING: u32 = 1 << 7;
    /// The program has no key: whoever can send on the bus may replace its parameters while the servo is off.
    pub const NO_KEY: u32 = 1 << 8;
    /// The program was not sealed: nothing shows at start whether its flash has changed.
    pub const NOT_SEALED: u32 = 1 << 9;
}

/// One counter of [`runtime::tracker::Health`], or one fact of [`BoardFacts`], with its page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HealthPage {
    /// 0 to 5: the counters in their order; 6 to 11: the facts in their order.
    pub page: u8,
    /// Its value.
    pub value: u32,
}

impl HealthPage {
    /// Page `number` modulo the number of pages: the counters, and the facts of a node with a board.
    pub const fn new(health: &Health, board: Option<&BoardFacts>, number: u32) -> Self {
        let counters = [
            health.ticks,
            health.planar_invalid,
            health.vertical_invalid,
            health.held,
            health.frames_missed,
            health.frames_repeated,
        ];
        let pages = if board.is_some() { 12 } else { 6 };
        let page = number % pages;
        let words = match board {
            Some(board) if page >= 6 => board.words(),
            _ => counters,
        };
        let value = words[(page % 6) as usize];
        let page = page as u8;
        Self { page, value }
    }

    /// The 52 bits of the frame.
    pub const fn payload(&self) -> Payload {
        Payload::new(self.page as u32, self.value)
    }

    /// From the 52 bits of a frame.
    pub const fn from_payload(p: Payload) -> Self {
        Self {
            page: (p.short & 0xf) as u8,
            value: p.long,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_status_worked_by_hand() {
        let status = NodeStatus {
            state: Some(NodeState::BadParameters),
            reason: 0x21,
            flags: flag::WATCHDOG_RESET | flag::IDENTIFYING,
            missed_ticks: 0x1234,
            bus_off: 5,
            version: 1,
        };
        let want = Payload::new(0x2_1213, 0x0105_1234);
        assert_eq!(status.payload(), want);
        assert_eq!(NodeStatus::from_payload(want), status);
    }

    #[test]
    fn pages_follow_the_order_of_the_counters_and_of_the_facts() {
        let health = Health {
            ticks: 100,
            planar_invalid: 101,
            vertical_invalid: 102,
            held: 103,
            frames_missed: 104,
            frames_repeated: 105,
        };
        let board = BoardFacts {
            last_fault: 106,
            fault_address: 107,
            fault_detail: 108,
            faults: 109,
            option_bytes: 110,
            board_checks: 111,
        };
        for number in 0..24 {
            let page = HealthPage::new(&health, Some(&board), number);
            let want = number % 12;
            assert_eq!((u32::from(page.page), page.value), (want, 100 + want));
            let page = HealthPage::new(&health, None, number);
            assert_eq!(u32::from(page.page), number % 6);
        }
    }

    proptest! {
        #[test]
        fn any_frame_reads_back_as_it_was_sent(short in 0u32..1 << 20, long: u32) {
            let sent = Payload { short, long };
            let status = NodeStatus::from_payload(sent);
            if status.state.is_some() { prop_assert_eq!(status.payload(), sent); }
            let health = HealthPage::from_payload(Payload { short: short & 0xf, long });
            prop_assert_eq!(health.payload(), Payload { short: short & 0xf, long });
        }
    }
}

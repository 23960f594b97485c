//! The faults of converter, wires and sensors, and how each must show on the bus.

use super::RESTART;
use crate::adc_model::{Adc, AdcFault};
use hal_adapters::adc::stuck::{GAP_PERIODS, HALL_PERIODS};
use hal_adapters::can::status::NodeState;
use runtime::Status;

/// What happens to the converter.
#[derive(Clone, Copy)]
pub(super) enum Event {
    Fault(AdcFault),
    /// Bits of a register change by themselves.
    Flip {
        register: u8,
        bits: u16,
    },
    PowerLoss,
}

impl Event {
    pub(super) fn happen(self, adc: &mut Adc, now_ns: u64) {
        match self {
            Self::Fault(fault) => adc.fault = fault,
            Self::Flip { register, bits } => adc.part.flip(register, bits, now_ns),
            Self::PowerLoss => adc.part.power_up(now_ns),
        }
    }
}

/// A fault, and how it must show on the bus.
pub struct Case {
    /// Its name.
    pub name: String,
    pub(super) event: Event,
    /// The fault lasts until it is taken away, not for one tick.
    pub(super) is_long: bool,
    /// The states and reasons that its status frames may have.
    pub(super) reported: Vec<(NodeState, u8)>,
    /// Ticks after which the fault is reported at the latest.
    pub(super) within: u64,
    /// Bits of the pose's status.
    pub(super) status: Status,
    /// Ticks after which poses must be good again once the fault is gone.
    pub(super) back_within: u64,
    /// Valid poses that may be wrong.
    pub(super) wrong: u64,
}

/// Both the planar and the vertical pose are invalid.
pub(super) const BOTH_INVALID: Status = Status::PLANAR_INVALID.with(Status::VERTICAL_INVALID);

const NOT_READY: (NodeState, u8) = (NodeState::NoFrames, 7);
const SILENT: (NodeState, u8) = (NodeState::NoFrames, 3);

const fn fault(reason: u8) -> (NodeState, u8) {
    (NodeState::SensorFault, reason)
}

impl Case {
    /// A fault that is reported in the next tick and needs a new start of the part.
    fn new(name: &str, fault: AdcFault, reported: &[(NodeState, u8)]) -> Self {
        Self {
            name: name.to_owned(),
            event: Event::Fault(fault),
            is_long: true,
            reported: reported.to_vec(),
            within: 1,
            status: BOTH_INVALID,
            back_within: 1 + RESTART,
            wrong: 0,
        }
    }

    /// An event that loses a setting: the part reports it and is started in the next tick.
    fn lost_setting(name: &str, event: Event) -> Self {
        Self {
            event,
            is_long: false,
            back_within: 1,
            ..Self::new(name, AdcFault::None, &[])
        }
    }

    /// Codes of sensor `k`, or of all, that freeze.
    fn frozen(name: &str, fault_of_codes: AdcFault, k: usize) -> Self {
        let periods = u64::from(if k < 3 { HALL_PERIODS } else { GAP_PERIODS });
        Self {
            within: periods,
            wrong: periods - 1,
            // The noise of a gap is one code: it repeats the frozen code now and then.
            back_within: if k == 1 { 1 } else { 4 },
            ..Self::new(name, fault_of_codes, &[fault(0x20 + k as u8), NOT_READY])
        }
    }

    /// Sensor `k` is open.
    fn open(name: &str, k: usize) -> Self {
        let lost = [Status::PLANAR_INVALID, BOTH_INVALID][usize::from(k >= 3)];
        Self {
            status: Status::from_bits(1 << k).with(lost),
            back_within: 1,
            ..Self::new(name, AdcFault::Rail(k), &[fault(0x10 + k as u8)])
        }
    }
}

/// Every fault.
pub fn cases() -> Vec<Case> {
    let flipped = [fault(6), fault(5), SILENT];
    let stopped = [NOT_READY, fault(5), fault(11)];
    let mut all = vec![
        Case::new("data line low", AdcFault::Line(0x00), &[SILENT]),
        Case::new("data line high", AdcFault::Line(0xff), &[SILENT]),
        Case::new("chip select cut", AdcFault::Select, &[SILENT]),
        Case {
            is_long: false,
            back_within: 1,
            ..Case::new("frames of one tick lost", AdcFault::Select, &[SILENT])
        },
        // A start fails, too, and is followed by a reset that lasts a tick.
        Case::new(
            "a flipped bit in every frame",
            AdcFault::FlippedBit,
            &flipped,
        ),
        Case {
            within: 2,
            ..Case::new("SYNC cut", AdcFault::Control, &[fault(10), fault(5)])
        },
        Case::new("CLKIN stops", AdcFault::Clock, &stopped),
        Case::new("DRDY cut", AdcFault::Ready, &[fault(11)]),
        Case::lost_setting("a short loss of power", Event::PowerLoss),
        Case::frozen("all codes frozen", AdcFault::Stuck, 0),
    ];
    for (k, sensor) in [(1, "Hall B"), (4, "gap 2")] {
        let (frozen, open) = (
            format!("{sensor} frozen"),
            format!("{sensor} open, at its rail"),
        );
        all.extend([
            Case::frozen(&frozen, AdcFault::Frozen(k), k),
            Case::open(&open, k),
        ]);
    }
    for (register, bits, name) in [
        (0x03, 1 << 2, "a bit of CLOCK flips"),
        (0x04, 1 << 12, "a bit of GAIN1 flips"),
        (0x1b, 1, "a bit of CH3_GCAL_MSB flips"),
    ] {
        all.push(Case::lost_setting(name, Event::Flip { register, bits }));
    }
    all
}

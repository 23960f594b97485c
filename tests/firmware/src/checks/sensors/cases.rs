//! The faults of converters, wires and sensors, and what each must look like from the bus.

use super::{RESTART, TICK_NS};
use crate::adc_model::{Adc, AdcFault, Part};
use hal_adapters::adc::ads8688::REFERENCE_US;
use hal_adapters::adc::stuck::{GAP_PERIODS, HALL_PERIODS};
use hal_adapters::can::status::NodeState;
use runtime::Status;

/// What happens to a converter.
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
            Self::Flip { register, bits } => adc.flip(register, bits, now_ns),
            Self::PowerLoss => adc.power_up(now_ns),
        }
    }
}

/// What a fault must look like from the bus.
pub struct Case {
    /// Its name.
    pub name: String,
    pub(super) event: Event,
    /// Until it is taken away, and not for one tick, or until the next start sets it right.
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

/// Neither the planar nor the vertical pose is valid.
pub(super) const NOTHING: Status = Status::PLANAR_INVALID.with(Status::VERTICAL_INVALID);

const SENSORS: [&str; 6] = ["Hall A", "Hall B", "Hall C", "gap 1", "gap 2", "gap 3"];

/// Ticks without codes after a start of the part.
pub const fn ticks_to_settle(part: Part) -> u64 {
    match part {
        Part::Ads131m08 => 0,
        Part::Ads8688 => REFERENCE_US as u64 * 1000 / TICK_NS,
    }
}

/// The part that says so is started in the next tick; of the other one it shows as a wrong input.
const fn back_after_a_lost_setting(part: Part) -> u64 {
    match part {
        Part::Ads131m08 => 1,
        Part::Ads8688 => 1 + RESTART + ticks_to_settle(part),
    }
}

impl Case {
    fn of(name: &str, fault: AdcFault, reported: &[(NodeState, u8)], part: Part) -> Self {
        Self {
            name: name.to_owned(),
            event: Event::Fault(fault),
            is_long: true,
            reported: reported.to_vec(),
            within: 1,
            status: NOTHING,
            back_within: 1 + RESTART + ticks_to_settle(part),
            wrong: 0,
        }
    }

    fn of_register(register: u8, bits: u16, name: &str, part: Part) -> Self {
        // A part whose signature covers the registers reports the wrong input.
        let reported = [
            (NodeState::SensorFault, 5),
            (NodeState::SensorFault, 8),
            NOT_READY,
        ];
        Self {
            event: Event::Flip { register, bits },
            is_long: false,
            back_within: back_after_a_lost_setting(part),
            ..Self::of(name, AdcFault::None, &reported, part)
        }
    }
}

const NOT_READY: (NodeState, u8) = (NodeState::NoFrames, 7);
const SILENT: (NodeState, u8) = (NodeState::NoFrames, 3);

/// Every fault of a part.
pub fn cases(part: Part) -> Vec<Case> {
    let fault = |reason| (NodeState::SensorFault, reason);
    let frozen = |k: usize| {
        let periods = if k < 3 { HALL_PERIODS } else { GAP_PERIODS };
        (0x20 + k as u8, u64::from(periods))
    };
    let mut all = vec![
        Case::of("data line low", AdcFault::Line(0x00), &[SILENT], part),
        Case::of("data line high", AdcFault::Line(0xff), &[SILENT], part),
        Case::of("chip select cut", AdcFault::Select, &[SILENT], part),
        Case {
            is_long: false,
            back_within: 1,
            ..Case::of("frames of one tick lost", AdcFault::Select, &[SILENT], part)
        },
    ];
    // A start fails, too, and is followed by a reset that lasts a tick.
    let flipped = match part {
        Part::Ads131m08 => [fault(6), fault(5), SILENT],
        Part::Ads8688 => [fault(8), fault(4), NOT_READY],
    };
    let name = "a flipped bit in every frame";
    all.push(Case::of(name, AdcFault::FlippedBit, &flipped, part));
    let (reason, periods) = frozen(0);
    all.push(Case {
        within: periods,
        wrong: periods - 1,
        back_within: 1 + ticks_to_settle(part),
        ..Case::of(
            "all codes frozen",
            AdcFault::Stuck,
            &[fault(reason), NOT_READY],
            part,
        )
    });
    for (k, sensor) in SENSORS.iter().enumerate() {
        let (reason, periods) = frozen(k);
        let name = format!("{sensor} frozen");
        all.push(Case {
            within: periods,
            wrong: periods - 1,
            back_within: 1 + ticks_to_settle(part),
            ..Case::of(
                &name,
                AdcFault::Frozen(k),
                &[fault(reason), NOT_READY],
                part,
            )
        });
        let name = format!("{sensor} open, at its rail");
        let lost = if k < 3 {
            Status::PLANAR_INVALID
        } else {
            NOTHING
        };
        let reported = [fault(0x10 + k as u8)];
        all.push(Case {
            status: Status::from_bits(1 << k).with(lost),
            back_within: 1,
            ..Case::of(&name, AdcFault::Rail(k), &reported, part)
        });
    }
    all.push(Case {
        event: Event::PowerLoss,
        is_long: false,
        back_within: back_after_a_lost_setting(part),
        reported: vec![fault(5), fault(8), NOT_READY],
        ..Case::of("a short loss of power", AdcFault::None, &[], part)
    });
    match part {
        Part::Ads131m08 => {
            let reported = [fault(10), fault(5)];
            all.push(Case {
                within: 2,
                back_within: 1 + RESTART,
                ..Case::of("SYNC cut", AdcFault::Control, &reported, part)
            });
            let reported = [NOT_READY, fault(5)];
            all.push(Case::of("CLKIN stops", AdcFault::Clock, &reported, part));
            for (register, bits, name) in [
                (0x03, 1 << 2, "a bit of CLOCK flips"),
                (0x04, 1 << 12, "a bit of GAIN1 flips"),
                (0x1b, 1, "a bit of CH3_GCAL_MSB flips"),
            ] {
                all.push(Case::of_register(register, bits, name, part));
            }
        }
        Part::Ads8688 => {
            for (register, bits, name) in [
                (0x01, 1 << 2, "a bit of AUTO_SEQ_EN flips"),
                (0x02, 1 << 3, "a bit of Channel Power Down flips"),
                (0x03, 2, "a bit of Feature Select flips"),
                (0x05, 1, "bit 0 of a range flips"),
                (0x0a, 2, "bit 1 of a range flips"),
            ] {
                all.push(Case::of_register(register, bits, name, part));
            }
            // It is found when its register is read back, or when the thermometer is read.
            all.push(Case {
                within: 13,
                back_within: 14 + ticks_to_settle(part),
                ..Case::of_register(0x0c, 1, "the range of a thermometer's input flips", part)
            });
        }
    }
    all
}

//! State and reason of the status frame (every 16 ticks, and at once after the bus was off):
//!
//! | state | reason |
//! |---|---|
//! | 1 running | 0; or 0x80 + reason of the other slot, if that is damaged |
//! | 2 no parameters | 2: both slots are erased |
//! | 3 bad parameters | slot * 16 + kind: 1 cut short, 3 no blob at all, 4 newer layout, 5 bad header, 7 wrong check (torn), 8 bad payload, 9 unusable values, 10 another stage's |
//! | 4 no frames | 3 silent converter (line at 0 or 1), 7 no new codes |
//! | 5 sensor fault | 1 SPI, 2 pin, 4 wrong part, 5 wrong setting or unexpected reset, 6 wrong check, 8 wrong input, 10 SYNC does not arrive; 0x10 + channel: code at a rail, 0x20 + channel: code that never changes (0 to 2 Hall A to C, 3 to 5 gaps 1 to 3) |
//! | 6 self-test failed | 1: arithmetic is not that of the host, or the core would not restore the FPU's settings |
//! | 7 updating | 0: new parameters are coming or being stored, and every pose is invalid; no frame comes for up to half a second |
//! | 8 stopped | until it is activated, or power-on: 1 the program faulted twice in its first second, 2 what ran before the reset is not known, 3 it is no longer in flash |

use super::Parameters;
use crate::records::Refusal;
use hal_adapters::adc::AdcError;
use hal_adapters::can::status::NodeState;
use runtime::{RawFrame, Reading, Status};

/// Reasons of [`NodeState::SensorFault`] from here on: a code at a rail or implausible, with
/// its channel (0 to 2 Hall A to C, 3 to 5 gaps 1 to 3). Below: [`AdcError::number`].
pub const REASON_CHANNEL: u8 = 0x10;
/// Reasons of [`NodeState::Running`] with this bit: the other slot is damaged; below it
/// [`crate::records::Refusal::reason`].
pub const REASON_OTHER_SLOT: u8 = 0x80;
/// Reason of [`NodeState::SelfTestFailed`]: arithmetic is not that of the host, or the core
/// would not restore the FPU's settings for interrupts.
pub const REASON_FPU: u8 = 1;

/// A fault of the converter in one byte, and whether it gave nothing at all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SampleFault {
    reason: u8,
    silent: bool,
}

impl<B> From<&AdcError<B>> for SampleFault {
    fn from(error: &AdcError<B>) -> Self {
        Self {
            reason: error.number(),
            silent: matches!(error, AdcError::Silent { .. } | AdcError::NotReady { .. }),
        }
    }
}

/// State and reason of a tick that took this sample and made this reading of it.
pub(super) fn state_of(
    parameters: &Parameters<'_>,
    is_updating: bool,
    sample: &Result<RawFrame, SampleFault>,
    reading: &Reading,
) -> (NodeState, u8) {
    let other_slot = match parameters {
        Parameters::SelfTestFailed => return (NodeState::SelfTestFailed, REASON_FPU),
        _ if is_updating => return (NodeState::Updating, 0),
        Parameters::Stopped(stop) => return (NodeState::Stopped, *stop as u8),
        Parameters::None { refusal } if *refusal == Refusal::NEITHER => {
            return (NodeState::NoParameters, refusal.reason);
        }
        Parameters::None { refusal } => return (NodeState::BadParameters, refusal.reason),
        Parameters::Usable { other_slot, .. } => other_slot,
    };
    let bad_codes = reading.status.bits() & Status::HALL.with(Status::CAPACITIVE).bits();
    match sample {
        Err(fault) if fault.silent => (NodeState::NoFrames, fault.reason),
        Err(fault) => (NodeState::SensorFault, fault.reason),
        Ok(_) if bad_codes != 0 => {
            let channel = bad_codes.trailing_zeros() as u8;
            (NodeState::SensorFault, REASON_CHANNEL + channel)
        }
        Ok(_) => {
            let reason = other_slot.map_or(0, |slot| REASON_OTHER_SLOT | slot.reason);
            (NodeState::Running, reason)
        }
    }
}

//! State and reason of the status frame (every 16 ticks, and at once after the bus was off):
//!
//! | state | reason |
//! |---|---|
//! | 1 running | 0; or 0x80 + reason of the other slot, if that is damaged |
//! | 2 no parameters | 2: both slots are erased |
//! | 3 bad parameters | slot * 16 + kind: 1 cut short, 3 no blob at all, 4 newer layout, 5 bad header, 7 wrong check (torn), 8 bad payload, 9 unusable values, 10 another stage's |
//! | 4 no frames | 3 silent converter (line at 0 or 1), 7 no new codes |
//! | 5 sensor fault | 1 SPI, 2 pin, 4 wrong part, 5 wrong setting or unexpected reset, 6 wrong check, 8 wrong input, 10 SYNC does not arrive, 11 the instant of the sample is not known (DRDY); 0x10 + channel: code at a rail, 0x20 + channel: code that never changes (0 to 2 Hall A to C, 3 to 5 gaps 1 to 3) |
//! | 6 self-test failed | 1: the arithmetic differs from the host's, or the core would not restore the FPU's settings |
//! | 7 updating | 0: new parameters arrive or are stored; poses are invalid, and no frame comes for up to 0.55 s |
//! | 8 stopped, until an activation or power-on | 1 the program faulted twice in its first second, 2 the record of the run before the reset is damaged, 3 the blob of that run is no longer in flash, 4 the program in flash differs from its check |

use crate::start_up::Stop;
use hal_adapters::adc::AdcError;
use hal_adapters::can::status::NodeState;
use runtime::{AnyDecoder, OnInvalid, PoseTracker, RawFrame, Reading, Status};

/// First reason of [`NodeState::SensorFault`] for a code at a rail; its channel is added (0 to 2 Hall A to C, 3 to 5
/// gaps 1 to 3). Reasons below: [`AdcError::number`].
const REASON_CHANNEL: u8 = 0x10;
/// Bit of a reason of [`NodeState::Running`]: the other slot is damaged; its reason is below the bit.
const REASON_OTHER_SLOT: u8 = 0x80;
/// Reason of [`NodeState::NoParameters`].
const REASON_BOTH_ERASED: u8 = 2;
/// Reason of [`NodeState::SelfTestFailed`].
const REASON_FPU: u8 = 1;

/// A fault of the converter: the state and the reason of its tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SampleFault(NodeState, u8);

impl<B> From<AdcError<B>> for SampleFault {
    fn from(error: AdcError<B>) -> Self {
        let state = match error {
            AdcError::Silent { .. } | AdcError::NotReady { .. } => NodeState::NoFrames,
            _ => NodeState::SensorFault,
        };
        Self(state, error.number())
    }
}

/// The parameters of a node.
#[derive(Clone, Debug)]
pub struct Parameters {
    /// The decoder; none if the node must not decode.
    pub(super) servo: Option<PoseTracker>,
    /// State and reason of a tick without faults.
    state: (NodeState, u8),
}

impl Parameters {
    /// At start-up: the decoder of the loaded parameters, the reason why a slot is refused, and the reason to stop. `is_sound`: the
    /// arithmetic equals the host's; else the node decodes nothing.
    pub fn at_start(
        decoder: Option<AnyDecoder>,
        refusal: Option<u8>,
        stop: Option<Stop>,
        is_sound: bool,
    ) -> Self {
        let decoder = decoder.filter(|_| is_sound && stop.is_none());
        let servo = decoder.map(|decoder| PoseTracker::new(decoder, OnInvalid::Zero));
        let state = match (stop, refusal) {
            _ if !is_sound => (NodeState::SelfTestFailed, REASON_FPU),
            (Some(stop), _) => (NodeState::Stopped, stop as u8),
            (None, Some(reason)) if servo.is_some() => {
                (NodeState::Running, REASON_OTHER_SLOT | reason)
            }
            (None, Some(reason)) => (NodeState::BadParameters, reason),
            (None, None) if servo.is_some() => (NodeState::Running, 0),
            (None, None) => (NodeState::NoParameters, REASON_BOTH_ERASED),
        };
        Self { servo, state }
    }

    /// State and reason of a tick with this sample and reading.
    pub(super) fn state(
        &self,
        is_updating: bool,
        sample: &Result<RawFrame, SampleFault>,
        reading: &Reading,
    ) -> (NodeState, u8) {
        let bad_codes = reading.status.bits() & Status::HALL.with(Status::CAPACITIVE).bits();
        match sample {
            _ if self.state.0 == NodeState::SelfTestFailed => self.state,
            _ if is_updating => (NodeState::Updating, 0),
            _ if self.servo.is_none() => self.state,
            Err(SampleFault(state, reason)) => (*state, *reason),
            Ok(_) if bad_codes != 0 => {
                let channel = bad_codes.trailing_zeros() as u8;
                (NodeState::SensorFault, REASON_CHANNEL + channel)
            }
            Ok(_) => self.state,
        }
    }
}

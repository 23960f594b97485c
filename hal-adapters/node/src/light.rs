//! What the LED shows: the state of the controller at a glance.
//!
//! | LED | state |
//! |---|---|
//! | one flash a second | decoding |
//! | four flashes a second | as one or two flashes, on the internal oscillator |
//! | five flashes a second | as one or two flashes, but CAN takes no part in the bus |
//! | two flashes a second | no parameters, bad ones, new ones that are coming, or stopped |
//! | three flashes a second | no codes from the converter, or a sensor fault |
//! | steadily on | the controller failed its own test |
//! | blinking fast, on as long as off | asked to show where it is |
//! | off | no power, or between reset and the first tick |

use crate::schedule::Period;
use hal_adapters::can::status::{NodeState, board_check};

/// Time of a flash, and of the pause after it, ms.
const FLASH_MS: u32 = 100;
/// Half a period while identifying, ms.
const FAST_MS: u32 = 62;

/// Whether the LED is on in this tick. `board_checks` are the bits of [`board_check`].
pub fn is_on(
    state: NodeState,
    board_checks: u32,
    identifying: bool,
    tick: u32,
    period: Period,
) -> bool {
    let ms = period.ms_in_second(tick);
    if identifying {
        return (ms / FAST_MS).is_multiple_of(2);
    }
    let flashes = match state {
        NodeState::Starting => return false,
        NodeState::SelfTestFailed => return true,
        NodeState::NoFrames | NodeState::SensorFault => 3,
        _ if board_checks & board_check::CAN_NOT_STARTED != 0 => 5,
        _ if board_checks & board_check::INTERNAL_OSCILLATOR != 0 => 4,
        NodeState::NoParameters
        | NodeState::BadParameters
        | NodeState::Updating
        | NodeState::Stopped => 2,
        NodeState::Running => 1,
    };
    let slot = ms / FLASH_MS;
    slot.is_multiple_of(2) && slot / 2 < flashes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_state_has_its_number_of_flashes() {
        let flashes = |state, checks, identifying| {
            let period = Period::from_us(2000).expect("a period");
            let on = |tick| is_on(state, checks, identifying, tick, period);
            (1..=period.ticks_per_s())
                .filter(|&tick| on(tick) && !on(tick - 1))
                .count()
        };
        assert_eq!(flashes(NodeState::Running, 0, false), 1);
        assert_eq!(flashes(NodeState::BadParameters, 0, false), 2);
        assert_eq!(flashes(NodeState::SensorFault, 0, false), 3);
        let (internal, no_can) = (
            board_check::INTERNAL_OSCILLATOR,
            board_check::CAN_NOT_STARTED,
        );
        assert_eq!(flashes(NodeState::Running, internal, false), 4);
        assert_eq!(flashes(NodeState::Running, internal | no_can, false), 5);
        assert_eq!(flashes(NodeState::NoParameters, internal, false), 4);
        assert_eq!(flashes(NodeState::NoParameters, no_can, false), 5);
        assert_eq!(flashes(NodeState::SensorFault, internal, false), 3);
        assert_eq!(flashes(NodeState::SelfTestFailed, 0, false), 0);
        assert!(flashes(NodeState::Running, 0, true) >= 8);
    }
}

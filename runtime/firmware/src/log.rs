//! The log of a start, over the probe: feature `defmt-rtt`.

use hal_adapters::can::status::BoardFacts;

#[cfg(feature = "defmt-rtt")]
use defmt_rtt as _;

/// Logs the facts of the board, and what is to be done about them.
#[cfg(feature = "defmt-rtt")]
pub fn start(facts: &BoardFacts) {
    use hal_adapters::can::status::board_check as check;

    defmt::info!("start: {}", facts);
    for (bit, what) in [
        (
            check::NO_KEY,
            "no key: whoever can send on the bus may replace the parameters",
        ),
        (
            check::NOT_SEALED,
            "not sealed: a change of the program in flash is not noticed",
        ),
        (check::NO_PULL_UP_ON_SELECT, "no pull-up on chip select"),
        (
            check::NO_PULL_UP_ON_CONTROL,
            "no pull-up on the control pin",
        ),
        (check::BROWN_OUT_LOW, "the brown-out level is below 2.7 V"),
        (check::INTERNAL_OSCILLATOR, "the crystal does not run"),
        (check::CAN_NOT_STARTED, "CAN takes no part in the bus"),
        (check::ZERO_LOST, "the zero deviation is lost"),
    ] {
        if facts.board_checks & bit != 0 {
            defmt::warn!("{=str}", what);
        }
    }
}

/// Without the feature nothing is logged.
#[cfg(not(feature = "defmt-rtt"))]
pub const fn start(_: &BoardFacts) {}

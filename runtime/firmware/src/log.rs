//! The log of a start, over the probe: feature `defmt-rtt`.

use hal_adapters::can::status::BoardFacts;

#[cfg(feature = "defmt-rtt")]
use {defmt_rtt as _, hal_adapters::can::status::board_check};

#[cfg(feature = "defmt-rtt")]
#[rustfmt::skip]
const NOTES: [(u32, &str); 8] = [
    (board_check::NO_KEY, "no key: whoever can send on the bus may replace the parameters"),
    (board_check::NOT_SEALED, "not sealed: a change of the program in flash is not noticed"),
    (board_check::NO_PULL_UP_ON_SELECT, "no pull-up on chip select"),
    (board_check::NO_PULL_UP_ON_CONTROL, "no pull-up on the control pin"),
    (board_check::BROWN_OUT_LOW, "the brown-out level is below 2.7 V"),
    (board_check::INTERNAL_OSCILLATOR, "the crystal does not run"),
    (board_check::CAN_NOT_STARTED, "CAN takes no part in the bus"),
    (board_check::ZERO_LOST, "the zero deviation is lost"),
];

/// Logs the facts of the board, and what is to be done about them.
#[cfg(feature = "defmt-rtt")]
pub fn start(facts: &BoardFacts) {
    defmt::info!("start: {}", facts);
    let noted = NOTES
        .iter()
        .filter(|(bit, _)| facts.board_checks & bit != 0);
    noted.for_each(|(_, what)| defmt::warn!("{=str}", what));
}

/// Without the feature nothing is logged.
#[cfg(not(feature = "defmt-rtt"))]
pub const fn start(_: &BoardFacts) {}

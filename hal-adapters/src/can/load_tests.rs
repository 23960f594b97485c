//! How much of a classic CAN bus the protocol takes.

use super::sensor::Layout;
use super::table::SLOW_TICKS;
use super::tables_tests::{Rate, Row, rows};

/// Bits from start of frame to the end of the CRC of a standard data frame with eight bytes:
/// 1 start, 11 identifier, 1 RTR, 1 IDE, 1 reserved, 4 length, 64 data, 15 CRC. Only these
/// are stuffed.
pub(super) const STUFFED_PART_BITS: u32 = 1 + 11 + 1 + 1 + 1 + 4 + 64 + 15;

/// Bits after the CRC: 1 delimiter, 2 acknowledge, 7 end of frame, 3 between frames.
pub(super) const FIXED_PART_BITS: u32 = 1 + 2 + 7 + 3;

/// The longest that a frame of eight bytes can be: one stuff bit after the first five equal
/// bits, and then, since a stuff bit opens the next run, one for every four: 24 of them.
pub(super) const FRAME_BITS_MAX: u32 =
    STUFFED_PART_BITS + (STUFFED_PART_BITS - 1) / 4 + FIXED_PART_BITS;

/// Frames in [`SLOW_TICKS`] ticks, requests and answers aside: codes in a layout, or none when the
/// converters are on the decoding node, and each vertical axis every so many ticks, 0 for never.
pub(super) fn frames_in_slow_ticks(layout: Option<Layout>, vertical_ticks: u8) -> u32 {
    let every = |ticks: u8| u32::from(SLOW_TICKS.checked_div(ticks).unwrap_or(0));
    let of_row = |row: &Row| match (row.sender, row.rate) {
        ("Sensor", rate) => match (layout, rate) {
            (None, _) | (_, Rate::OnRequest) => 0,
            (Some(layout), Rate::Ticks(1)) if !layout.messages().contains(&row.spec.message) => 0,
            (_, Rate::Ticks(ticks) | Rate::Decimated(ticks)) => every(ticks),
            // Two thermometers that change: 0.64 frames.
            (_, Rate::Held) => 1,
        },
        (_, Rate::Ticks(ticks)) => every(ticks),
        (_, Rate::Decimated(_)) => every(vertical_ticks),
        (_, Rate::OnRequest | Rate::Held) => 0,
    };
    rows().iter().map(of_row).sum()
}

/// The largest share of a bus of so many bits per second that this takes at 500 ticks per second: every
/// frame with the most stuff bits.
pub(super) fn worst_load(layout: Option<Layout>, vertical_ticks: u8, bits_per_s: u32) -> f32 {
    let bits = frames_in_slow_ticks(layout, vertical_ticks) as f32 * FRAME_BITS_MAX as f32;
    bits * 500.0 / f32::from(SLOW_TICKS) / bits_per_s as f32
}

#[test]
fn the_longest_frame_of_eight_bytes_has_135_bits() {
    assert_eq!((STUFFED_PART_BITS, FRAME_BITS_MAX), (98, 135));
}

#[test]
fn the_load_worked_by_hand() {
    let (narrow, wide) = (Some(Layout::Bits16), Some(Layout::Bits24));
    // In 16 ticks: 2 x 16 codes, 1 time, 1 of temperatures, 3 x 16 planar, 3 x 4 vertical, 1 time, status, health.
    assert_eq!(frames_in_slow_ticks(narrow, 4), 32 + 2 + 48 + 12 + 3);
    assert!((worst_load(narrow, 4, 1_000_000) - 0.409_22).abs() < 1e-5);
    // On half the rate the vertical pose goes to every 16th tick.
    assert!((worst_load(narrow, 16, 500_000) - 0.742_5).abs() < 1e-5);
    assert_eq!(frames_in_slow_ticks(wide, 16), 48 + 2 + 48 + 3 + 3);
    assert!(worst_load(wide, 16, 500_000) < 0.88);
    assert_eq!(frames_in_slow_ticks(None, 0), 48 + 3);
}

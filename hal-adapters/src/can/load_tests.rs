//! How much of a classic CAN bus the protocol takes.

use super::sensor::Layout;
use super::table::SLOW_TICKS;
use super::tables_tests::{Rate, rows};

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

/// What is sent on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Traffic {
    /// Ticks per second.
    pub(super) ticks_per_s: u32,
    /// How the codes are sent; `None` when the converters are on the decoding node.
    pub(super) layout: Option<Layout>,
    /// Every how many ticks each vertical axis is sent; 0 for never.
    pub(super) vertical_ticks: u8,
}

impl Traffic {
    /// Frames in [`SLOW_TICKS`] ticks, requests and answers aside.
    pub(super) fn frames_in_slow_ticks(&self) -> u32 {
        let every = |ticks: u8| u32::from(SLOW_TICKS.checked_div(ticks).unwrap_or(0));
        rows()
            .iter()
            .map(|row| match (row.sender, row.rate) {
                ("Sensor", rate) => {
                    let Some(layout) = self.layout else { return 0 };
                    match rate {
                        Rate::Ticks(1) if !layout.messages().contains(&row.spec.message) => 0,
                        Rate::Ticks(ticks) | Rate::Decimated(ticks) => every(ticks),
                        // Two thermometers that change: 0.64 frames.
                        Rate::Held => 1,
                        Rate::OnRequest => 0,
                    }
                }
                (_, Rate::Ticks(ticks)) => every(ticks),
                (_, Rate::Decimated(_)) => every(self.vertical_ticks),
                (_, Rate::OnRequest | Rate::Held) => 0,
            })
            .sum()
    }

    /// The largest share of a bus of so many bits per second that the traffic can take: every
    /// frame with the most stuff bits, requests and answers aside.
    pub(super) fn worst_load(&self, bits_per_s: u32) -> f32 {
        let bits = self.frames_in_slow_ticks() as f32 * FRAME_BITS_MAX as f32;
        bits * self.ticks_per_s as f32 / f32::from(SLOW_TICKS) / bits_per_s as f32
    }
}

#[test]
fn the_longest_frame_of_eight_bytes_has_135_bits() {
    assert_eq!((STUFFED_PART_BITS, FRAME_BITS_MAX), (98, 135));
}

#[test]
fn the_load_worked_by_hand() {
    let traffic = |layout, vertical_ticks| Traffic {
        ticks_per_s: 500,
        layout,
        vertical_ticks,
    };
    // In 16 ticks: 2 x 16 codes, 1 time, 1 of temperatures, 3 x 16 planar, 3 x 4 vertical, 1 time, status, health.
    let usual = traffic(Some(Layout::Bits16), 4);
    assert_eq!(usual.frames_in_slow_ticks(), 32 + 2 + 48 + 12 + 3);
    assert!((usual.worst_load(1_000_000) - 0.409_22).abs() < 1e-5);
    // On half the rate the vertical pose goes to every 16th tick.
    let slow = traffic(Some(Layout::Bits16), 16);
    assert!((slow.worst_load(500_000) - 0.742_5).abs() < 1e-5);
    let wide = traffic(Some(Layout::Bits24), 16);
    assert_eq!(wide.frames_in_slow_ticks(), 48 + 2 + 48 + 3 + 3);
    assert!(wide.worst_load(500_000) < 0.88);
    assert_eq!(traffic(None, 0).frames_in_slow_ticks(), 48 + 3);
}

use super::*;
use proptest::prelude::*;

/// Worked with an independent implementation of Profile 2 (the Python package autosar-e2e):
/// counter 4, data 01 .. 06, data ID list 0, 1, .. 15.
#[test]
fn the_check_equals_profile_2() {
    let (low, high) = (0x0201_0432, 0x0605_0403);
    assert_eq!(check_byte(low, high, 4), 0x32);
}

#[test]
fn a_frame_worked_by_hand() {
    // Payload short = 0xABCDE above counter 0x7 in bytes 1 to 3, long in bytes 4 to 7.
    let payload = Payload::new(0xabcde, 0x1234_5678);
    let bytes = protect(0x5a, 7, payload);
    assert_eq!(bytes[1..], [0xe7, 0xcd, 0xab, 0x78, 0x56, 0x34, 0x12]);
    let mut sent = [0; 8];
    sent[..7].copy_from_slice(&bytes[1..]);
    sent[7] = BASE_LIST[7] ^ 0x5a;
    assert_eq!(bytes[0], Crc::<u8>::new(&CRC_8_AUTOSAR).checksum(&sent));
    assert_eq!(unprotect(0x5a, &bytes), Some((7, payload)));
}

proptest! {
    #[test]
    fn coding_and_checking_undo_each_other(key: u8, counter in 0u8..16, short in 0u32..1 << 20, long: u32) {
        let payload = Payload { short, long };
        prop_assert_eq!(unprotect(key, &protect(key, counter, payload)), Some((counter, payload)));
    }

    /// The check is linear, so what passes at one payload passes at all: this is why the
    /// exhaustive test may use one.
    #[test]
    fn whether_a_pattern_passes_does_not_depend_on_the_payload(
        key: u8, counter in 0u8..16, a: (u32, u32), b: (u32, u32), flip: u64,
    ) {
        let pass = |(short, long): (u32, u32)| {
            let bytes = protect(key, counter, Payload { short, long });
            unprotect(key, &(u64::from_be_bytes(bytes) ^ flip).to_be_bytes()).is_some()
        };
        prop_assert_eq!(pass(a), pass(b));
    }
}

/// Every pattern of one to three flipped bits and every burst of up to eight, as masks over the 64 data bits in
/// their order on the bus.
pub(crate) fn small_patterns() -> impl Iterator<Item = u64> {
    let bit = |k: u32| 1u64 << k;
    let flips = (0..64).flat_map(move |i| {
        (i..64).flat_map(move |j| (j..64).map(move |k| bit(i) | bit(j) | bit(k)))
    });
    let bursts =
        (1u64..256).flat_map(|pattern| (0..=pattern.leading_zeros()).map(move |up| pattern << up));
    flips.chain(bursts)
}

#[test]
fn no_three_flipped_bits_and_no_burst_of_eight_pass_at_any_counter() {
    let mut tried = 0u32;
    for counter in 0..16 {
        let bytes = protect(0, counter, Payload::default());
        for pattern in small_patterns() {
            let damaged = (u64::from_be_bytes(bytes) ^ pattern).to_be_bytes();
            assert_eq!(unprotect(0, &damaged), None, "{counter} {pattern:016x}");
            tried += 1;
        }
    }
    assert_eq!(tried, 16 * (64 * 65 * 66 / 6 + bursts()));
}

/// Bursts of 1 to 8 bits, with both ends set, that fit into 64 bits, counted by length; a
/// pattern of length w with trailing zeros is a shorter burst and is tried again.
fn bursts() -> u32 {
    (1u32..256).map(|p| u64::from(p).leading_zeros() + 1).sum()
}

#[test]
fn the_base_list_holds_sixteen_different_ids() {
    for (k, id) in BASE_LIST.iter().enumerate() {
        assert!(!BASE_LIST[..k].contains(id));
    }
}

#[test]
fn gaps_repeats_and_late_frames_are_distinguished_and_the_counter_wraps() {
    use Verdict::{First, Lost, Next, Repeated, Resumed, WrongSequence};
    let (one, two) = (Lost { frames: 1 }, Lost { frames: 2 });
    let ahead = |ahead| WrongSequence { ahead };
    for (counters, verdicts) in [
        (&[14, 15, 0, 1, 2][..], &[First, Next, Next, Next, Next][..]),
        (&[3, 3, 5, 4, 6], &[First, Repeated, one, ahead(15), Next]),
        (&[6, 9, 13, 14, 15], &[First, two, ahead(4), Resumed, Next]),
        // Two late frames that are not successive resume nothing.
        (&[10, 4, 2, 11], &[First, ahead(10), ahead(8), Next]),
    ] {
        let mut sequence = Sequence::START;
        let found = counters.iter().map(|counter| sequence.judge(*counter));
        assert!(found.eq(verdicts.iter().copied()), "{counters:?}");
    }
}

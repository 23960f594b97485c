//! Range checks that leave a bit each, in the few instructions that a Cortex-M needs.
//!
//! "Shift a bit into a mask if a word is too large" is a comparison that sets the carry and
//! an addition that takes it. Compilers don't find that, and spend about 50 of a tick's
//! instructions more. The portable form of each function defines it and runs on every other
//! machine and on soft-float cores; the other form stands for hard-float ARM. Floating-point
//! arithmetic is not touched here.
//!
//! A limit is given as the room above it, `u32::MAX - limit`, so that "larger than the limit"
//! is a carry of `word + room`.
//!
//! The assembly works on registers only and leaves the flags clobbered. It does not promise
//! `nomem`, so that loads stay on their side of it: the phases of a tick then don't compete
//! for registers.

/// Shifts three bits into `mask` from below, that of `words[0]` last: 1 for each word that
/// lies more than `u32::MAX - room` above `low`, modulo 2^32.
#[inline(always)]
pub(crate) fn shift_in_outside(mask: u32, words: [u32; 3], low: u32, room: u32) -> u32 {
    #[cfg(all(target_arch = "arm", target_abi = "eabihf"))]
    {
        let mut mask = mask;
        // SAFETY: registers and flags only; see the module's text.
        unsafe {
            core::arch::asm!(
                "sub {t}, {c}, {low}", "cmn {t}, {room}", "adc {mask}, {mask}, {mask}",
                "sub {t}, {b}, {low}", "cmn {t}, {room}", "adc {mask}, {mask}, {mask}",
                "sub {t}, {a}, {low}", "cmn {t}, {room}", "adc {mask}, {mask}, {mask}",
                a = in(reg) words[0], b = in(reg) words[1], c = in(reg) words[2],
                low = in(reg) low, room = in(reg) room, t = out(reg) _,
                mask = inout(reg) mask, options(nostack));
        }
        mask
    }
    #[cfg(not(all(target_arch = "arm", target_abi = "eabihf")))]
    {
        let outside = |word: u32| word.wrapping_sub(low).overflowing_add(room).1 as u32;
        (mask << 3) | (outside(words[2]) << 2) | (outside(words[1]) << 1) | outside(words[0])
    }
}

/// [`shift_in_outside`] of twice each word: of the bits of a number this leaves out the sign.
#[inline(always)]
pub(crate) fn shift_in_outside_doubled(mask: u32, words: [u32; 3], low: u32, room: u32) -> u32 {
    #[cfg(all(target_arch = "arm", target_abi = "eabihf"))]
    {
        let mut mask = mask;
        // SAFETY: registers and flags only; see the module's text.
        unsafe {
            core::arch::asm!(
                "rsb {c}, {low}, {c}, lsl #1", "cmn {c}, {room}", "adc {mask}, {mask}, {mask}",
                "rsb {b}, {low}, {b}, lsl #1", "cmn {b}, {room}", "adc {mask}, {mask}, {mask}",
                "rsb {a}, {low}, {a}, lsl #1", "cmn {a}, {room}", "adc {mask}, {mask}, {mask}",
                a = inout(reg) words[0] => _, b = inout(reg) words[1] => _,
                c = inout(reg) words[2] => _, low = in(reg) low, room = in(reg) room,
                mask = inout(reg) mask, options(nostack));
        }
        mask
    }
    #[cfg(not(all(target_arch = "arm", target_abi = "eabihf")))]
    {
        let doubled = [words[0] << 1, words[1] << 1, words[2] << 1];
        shift_in_outside(mask, doubled, low, room)
    }
}

/// Shifts one bit into `mask` from below: 1 if twice any of the words is larger than
/// `u32::MAX` minus its room.
#[inline(always)]
pub(crate) fn shift_in_any_beyond(mask: u32, words: [u32; 3], room: [u32; 3]) -> u32 {
    #[cfg(all(target_arch = "arm", target_abi = "eabihf"))]
    {
        let mut mask = mask;
        // SAFETY: registers and flags only; see the module's text. The second and third
        // comparison do nothing once the carry is set, and take their time all the same.
        unsafe {
            core::arch::asm!(
                "cmn {p}, {a}, lsl #1", "itt cc",
                "cmncc {q}, {b}, lsl #1", "cmncc {r}, {c}, lsl #1",
                "adc {mask}, {mask}, {mask}",
                a = in(reg) words[0], b = in(reg) words[1], c = in(reg) words[2],
                p = in(reg) room[0], q = in(reg) room[1], r = in(reg) room[2],
                mask = inout(reg) mask, options(nostack));
        }
        mask
    }
    #[cfg(not(all(target_arch = "arm", target_abi = "eabihf")))]
    {
        let beyond = |k: usize| (words[k] << 1).overflowing_add(room[k]).1;
        (mask << 1) | (beyond(0) | beyond(1) | beyond(2)) as u32
    }
}

/// `mask` with `BIT` set if twice any of the words is larger than `u32::MAX - room`. As an
/// immediate of the instruction, `BIT` must be a single bit.
#[inline(always)]
pub(crate) fn with_bit_if_any_beyond<const BIT: u32>(mask: u32, words: [u32; 3], room: u32) -> u32 {
    #[cfg(all(target_arch = "arm", target_abi = "eabihf"))]
    {
        let mut mask = mask;
        // SAFETY: registers and flags only; see the module's text.
        unsafe {
            core::arch::asm!(
                "cmn {room}, {a}, lsl #1", "itt cc",
                "cmncc {room}, {b}, lsl #1", "cmncc {room}, {c}, lsl #1",
                "it cs", "orrcs {mask}, {mask}, #{bit}",
                a = in(reg) words[0], b = in(reg) words[1], c = in(reg) words[2],
                room = in(reg) room, mask = inout(reg) mask, bit = const BIT, options(nostack));
        }
        mask
    }
    #[cfg(not(all(target_arch = "arm", target_abi = "eabihf")))]
    {
        mask | (shift_in_any_beyond(0, words, [room, room, room]) * BIT)
    }
}

/// All ones if `faults` is zero, else zero.
#[inline(always)]
pub(crate) fn keep_without(faults: u32) -> u32 {
    #[cfg(all(target_arch = "arm", target_abi = "eabihf"))]
    {
        let mut keep = faults;
        // SAFETY: registers and flags only; see the module's text.
        unsafe {
            core::arch::asm!("cmp {keep}, #1", "sbc {keep}, {keep}, {keep}",
                keep = inout(reg) keep, options(nostack));
        }
        keep
    }
    #[cfg(not(all(target_arch = "arm", target_abi = "eabihf")))]
    ((faults == 0) as u32).wrapping_neg()
}

/// Shifts one bit into `mask` from below, 1 if `faults` is not zero, and gives
/// [`keep_without`] these faults beside it.
#[inline(always)]
pub(crate) fn shift_in_faulty(mask: u32, faults: u32) -> (u32, u32) {
    #[cfg(all(target_arch = "arm", target_abi = "eabihf"))]
    {
        let (mut mask, mut keep) = (mask, faults);
        // SAFETY: registers and flags only; see the module's text.
        unsafe {
            core::arch::asm!(
                "cmp {keep}, #1", "adc {mask}, {mask}, {mask}", "sbc {keep}, {keep}, {keep}",
                keep = inout(reg) keep, mask = inout(reg) mask, options(nostack));
        }
        (mask, keep)
    }
    #[cfg(not(all(target_arch = "arm", target_abi = "eabihf")))]
    {
        ((mask << 1) | (faults != 0) as u32, keep_without(faults))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Room above 4, and words around a limit of 4 above 10.
    const ROOM: u32 = u32::MAX - 4;

    #[test]
    fn words_outside_leave_their_bits_lowest_first() {
        assert_eq!(shift_in_outside(0, [10, 14, 12], 10, ROOM), 0);
        assert_eq!(shift_in_outside(0b1, [15, 14, 9], 10, ROOM), 0b1101);
        assert_eq!(shift_in_outside(0, [0, 15, u32::MAX], 10, ROOM), 0b111);
        // Twice the word, so that 2^31 counts as nothing.
        let words = [5, 7 + (1 << 31), 8];
        assert_eq!(shift_in_outside_doubled(0, words, 10, ROOM), 0b100);
    }

    #[test]
    fn any_word_beyond_its_own_limit_leaves_one_bit() {
        let room = [u32::MAX - 2, u32::MAX - 4, u32::MAX - 6];
        assert_eq!(shift_in_any_beyond(0b1, [1, 2, 3], room), 0b10);
        for words in [[2, 2, 3], [1, 3, 3], [1, 2, 4], [9, 9, 9]] {
            assert_eq!(shift_in_any_beyond(0b1, words, room), 0b11);
        }
        assert_eq!(with_bit_if_any_beyond::<8>(0b1, [1, 2, 2], ROOM), 0b1);
        assert_eq!(with_bit_if_any_beyond::<8>(0b1, [1, 2, 3], ROOM), 0b1001);
    }

    #[test]
    fn nothing_is_kept_with_a_fault() {
        assert_eq!(shift_in_faulty(0b10, 0), (0b100, u32::MAX));
        for fault in [1, 1 << 31, u32::MAX] {
            assert_eq!(shift_in_faulty(0b10, fault), (0b101, 0));
        }
    }
}

//! Byte sequences worked out from the data sheet. Their checks are computed here bit by bit,
//! polynomial 0x1021 from 0xFFFF, independently of the code under test.

extern crate std;

use super::super::testing::{Frames, Line, keeps_the_error_of_the_bus, on_part, transfer};
use super::*;
use embedded_hal::spi::ErrorKind;
use embedded_hal_mock::eh1::digital::State::{self, High, Low};
use std::vec;
use std::vec::Vec;

/// CRC-16 one bit at a time, as the data sheet draws it.
fn check(bytes: &[u8]) -> [u8; 3] {
    let mut register = 0xffffu16;
    for byte in bytes {
        for bit in (0..8).rev() {
            let carry = (register >> 15) as u8 ^ (byte >> bit & 1);
            register = register << 1 ^ if carry == 1 { 0x1021 } else { 0 };
        }
    }
    let [high, low] = register.to_be_bytes();
    [high, low, 0]
}

/// A frame of the part: response, eight codes, check.
fn answer(response: u16, codes: [i32; 8]) -> Vec<u8> {
    let [high, low] = response.to_be_bytes();
    let mut bytes = vec![high, low, 0];
    for code in codes {
        bytes.extend(&code.to_be_bytes()[1..]);
    }
    let check = check(&bytes);
    bytes.extend(check);
    bytes
}

fn frame(command: u16, data: u16, back: Vec<u8>) -> Frames {
    let ([c0, c1], [d0, d1]) = (command.to_be_bytes(), data.to_be_bytes());
    let mut sent = vec![0; FRAME_BYTES];
    sent[..6].copy_from_slice(&[c0, c1, 0, d0, d1, 0]);
    transfer(sent, back)
}

const FRAME_BYTES: usize = WORDS * WORD_BYTES;
const QUIET: [i32; 8] = [0; 8];

type Sampled = Result<RawFrame, AdcError<ErrorKind>>;

fn try_start(expected: &[Frames], levels: &[State]) -> Result<(), AdcError<ErrorKind>> {
    on_part(
        Ads131m08::new,
        Line::every(8),
        &expected.concat(),
        levels,
        |adc| adc.start(),
    )
}

/// The samples of `count` ticks. Their frames must be `expected`.
fn ticks(count: usize, expected: &[Frames]) -> Vec<Sampled> {
    on_part(
        Ads131m08::new,
        Line::every(7),
        &expected.concat(),
        &[],
        |adc| {
            // As a start measures it.
            (adc.period_ns, adc.place_ns) = (64_000, 21_000);
            (0..count).map(|_| adc.sample(7)).collect()
        },
    )
}

/// The frames of a tick that reads `register` back: the STATUS, the register, the STATUS again.
fn tick(status: u16, register: u16, found: u16, back: Vec<u8>) -> Frames {
    [
        frame(0xa000 | register << 7, 0, answer(status, QUIET)),
        frame(0, 0, answer(found, QUIET)),
        frame(0, 0, back),
    ]
    .concat()
}

/// The first tick after a start: its first frame answers another command.
fn try_sample(back: Vec<u8>) -> Sampled {
    ticks(1, &[tick(0x2110, 0x02, 0x2110, back)])[0]
}

/// The frames of a good start, one per entry.
fn started() -> Vec<Frames> {
    vec![
        frame(0x0011, 0, answer(0x0500, QUIET)),
        frame(0xa000, 0, answer(0xff28, QUIET)),
        frame(0x6180, 0x3f06, answer(0x2804, QUIET)),
        frame(0x6100, 0x2110, answer(0x4180, QUIET)),
        frame(0xa180, 0, answer(0x4100, QUIET)),
        frame(0xa100, 0, answer(0x3f06, QUIET)),
        frame(0x0000, 0, answer(0x2110, QUIET)),
    ]
}

#[test]
fn the_check_is_that_of_the_data_sheet() {
    assert_eq!(check(b"123456789"), [0x29, 0xb1, 0]);
    assert_eq!(CRC.checksum(b"123456789"), 0x29b1);
}

#[test]
fn a_part_that_does_not_confirm_its_reset_or_has_other_channels_is_refused() {
    for (place, command, data, found, expected) in [
        (1, 0xa000, 0, 0xff24, 0xff28),
        (2, 0x6180, 0x3f06, 0x2401, 0x2800),
    ] {
        let mut all = started()[..=place].to_vec();
        all[place] = frame(command, data, answer(found, QUIET));
        assert_eq!(
            try_start(&all, &[High]),
            Err(AdcError::WrongId { found, expected })
        );
    }
}

#[test]
fn a_setting_that_does_not_read_back_is_named() {
    for (read, register, found, wanted) in [(5, 0x03, 0xff0e, 0x3f06), (6, 0x02, 0x0510, 0x2110)] {
        let mut all = started()[..=read].to_vec();
        let (command, data) = [(0xa100, 0), (0, 0)][read - 5];
        all[read] = frame(command, data, answer(found, QUIET));
        let error = AdcError::WrongSetting {
            register,
            found,
            wanted,
        };
        assert_eq!(try_start(&all, &[High]), Err(error));
    }
}

/// Every byte is written out: this test alone defines what a frame is.
#[test]
fn a_good_frame_gives_signed_codes_of_24_bits() {
    #[rustfmt::skip]
    let bytes = vec![
        0x01, 0x3f, 0x00,
        0x00, 0x03, 0xe8, 0xff, 0xf8, 0x30, 0x00, 0x0b, 0xb8, 0xff, 0xff, 0xff,
        0x00, 0x00, 0x00, 0x7f, 0xff, 0xff, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
        0x0a, 0x99, 0x00,
    ];
    let want = RawFrame::new([1000, -2000, 3000], [-1, 0, 8_388_607], 7, 14_000);
    assert_eq!(try_sample(bytes), Ok(want));
}

#[test]
fn every_flipped_bit_of_a_frame_is_noticed() {
    let good = answer(0x013f, [1000, -2000, 3000, -1, 0, 77, 0, 0]);
    // The last eight bits pad the check's word and carry nothing.
    for bit in 0..8 * (FRAME_BYTES - 1) {
        let mut bytes = good.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        let result = try_sample(bytes);
        assert!(
            matches!(result, Err(AdcError::WrongCheck { .. })),
            "bit {bit}: {result:?}"
        );
    }
}

#[test]
fn a_part_that_was_reset_locked_or_changed_meanwhile_is_not_read() {
    for found in [0x053f, 0x813f, 0x113f, 0x033f, 0x213f] {
        let error = AdcError::WrongSetting {
            register: 0x01,
            found,
            wanted: 0x0100,
        };
        assert_eq!(try_sample(answer(found, QUIET)), Err(error));
        // In the first frame of a tick, too, after a tick that was read to its end.
        let good = || answer(0x413f, QUIET);
        let both = [
            tick(0, 0x02, 0x2110, good()),
            tick(found, 0x03, 0x3f06, good()),
        ];
        assert_eq!(ticks(2, &both)[1], Err(error));
    }
}

#[test]
fn a_conversion_that_is_not_there_yet_gets_more_frames() {
    let (late, new) = (answer(0x011f, QUIET), answer(0x013f, [5; 8]));
    let and_then = |back: &[&Vec<u8>]| {
        let first = tick(0, 0x02, 0x2110, late.clone());
        let more = back
            .iter()
            .map(|back| frame(0, 0, back.to_vec()))
            .collect::<Vec<_>>();
        ticks(1, &[first, more.concat()])[0]
    };
    assert_eq!(and_then(&[&new]).map(|frame| frame.hall), Ok([5; 3]));
    let (ready, read) = (0x1f, 0x3f);
    assert_eq!(
        and_then(&[&late, &late, &late]),
        Err(AdcError::NotReady { ready, read })
    );
}

/// The values after a reset come from the data sheet's table 8-12.
#[test]
fn every_register_is_read_back_in_turn() {
    let at_reset = |register: u16| match register {
        0x02 => 0x2110,
        0x03 => 0x3f06,
        0x06 => 0x0600,
        0x0c | 0x11 | 0x16 | 0x1b | 0x20 | 0x25 | 0x2a | 0x2f => 0x8000,
        _ => 0,
    };
    let tick = |k: u16, flip: u16| {
        let register = 0x02 + k % 47;
        let status = if k == 0 { 0 } else { 0x413f };
        let found = at_reset(register) ^ flip;
        tick(status, register, found, answer(0x013f, QUIET))
    };
    let good = ticks(95, &(0..95).map(|k| tick(k, 0)).collect::<Vec<_>>());
    assert!(good.iter().all(Result::is_ok));
    for wrong in 0..47 {
        let flip = 1 << (wrong % 16);
        let all: Vec<_> = (0..=wrong)
            .map(|k| tick(k, if k == wrong { flip } else { 0 }))
            .collect();
        let read = ticks(all.len(), &all);
        let (last, before) = read.split_last().expect("one tick at least");
        assert!(before.iter().all(Result::is_ok));
        let wanted = at_reset(0x02 + wrong);
        let error = AdcError::WrongSetting {
            register: 0x02 + wrong as u8,
            found: wanted ^ flip,
            wanted,
        };
        assert_eq!(*last, Err(error));
    }
}

#[test]
fn a_start_that_fails_is_followed_by_a_reset_that_lasts_a_period() {
    let mut all = frame(0x0011, 0, answer(0, QUIET));
    all.extend(frame(0xa000, 0, answer(0x0011, QUIET)));
    all.extend(started().concat());
    let levels = [High, Low, Low, High, High, Low, High, Low, High];
    on_part(Ads131m08::new, Line::every(8), &all, &levels, |adc| {
        assert!(adc.start().is_err());
        assert_eq!(adc.trigger(), Ok(()));
        assert_eq!(adc.trigger(), Ok(()));
        assert_eq!(adc.start(), Ok(()));
        assert_eq!(adc.trigger(), Ok(()));
    });
}

#[test]
fn the_error_of_the_bus_is_kept() {
    keeps_the_error_of_the_bus(Ads131m08::new);
}

#[test]
fn a_damaged_frame_before_the_reset_does_not_matter() {
    let mut all = started();
    all[0] = frame(0x0011, 0, vec![0x55; FRAME_BYTES]);
    assert_eq!(try_start(&all, &[High, Low, High]), Ok(()));
}

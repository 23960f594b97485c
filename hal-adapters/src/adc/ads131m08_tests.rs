//! Byte sequences worked out from the data sheet. Their checks are computed here bit by bit,
//! polynomial 0x1021 from 0xFFFF, independently of the code under test.

extern crate std;

use super::super::testing::Broken;
use super::*;
use embedded_hal::spi::ErrorKind;
use embedded_hal_mock::eh1::delay::NoopDelay;
use embedded_hal_mock::eh1::digital::{Mock as PinMock, State, Transaction as PinTransaction};
use embedded_hal_mock::eh1::spi::{Mock, Transaction};
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

fn frame(command: u16, data: u16, back: Vec<u8>) -> Vec<Transaction<u8>> {
    let ([c0, c1], [d0, d1]) = (command.to_be_bytes(), data.to_be_bytes());
    let mut sent = vec![0; FRAME_BYTES];
    sent[..6].copy_from_slice(&[c0, c1, 0, d0, d1, 0]);
    vec![
        Transaction::transaction_start(),
        Transaction::transfer_in_place(sent, back),
        Transaction::transaction_end(),
    ]
}

const FRAME_BYTES: usize = WORDS * WORD_BYTES;
const QUIET: [i32; 8] = [0; 8];

fn try_start(expected: &[Transaction<u8>]) -> Result<(), AdcError<ErrorKind>> {
    let mut pin = PinMock::new(&[PinTransaction::set(State::High)]);
    let mut bus = Mock::new(expected);
    let mut adc = Ads131m08::new(bus.clone(), pin.clone(), Channels::IN_ORDER);
    let result = adc.start(&mut NoopDelay::new());
    bus.done();
    pin.done();
    result
}

/// What ticks give whose frames are `expected`.
fn ticks<const N: usize>(
    expected: &[Transaction<u8>],
) -> [Result<RawFrame, AdcError<ErrorKind>>; N] {
    let mut pin = PinMock::new(&[]);
    let mut bus = Mock::new(expected);
    let mut adc = Ads131m08::new(bus.clone(), pin.clone(), Channels::IN_ORDER);
    let results = [(); N].map(|()| adc.sample(7, 14_000));
    bus.done();
    pin.done();
    results
}

/// The frames of a tick that reads `register` back: the STATUS, the register, the STATUS again.
fn tick(status: u16, register: u16, found: u16, back: Vec<u8>) -> Vec<Transaction<u8>> {
    [
        frame(0xa000 | register << 7, 0, answer(status, QUIET)),
        frame(0, 0, answer(found, QUIET)),
        frame(0, 0, back),
    ]
    .concat()
}

/// The first tick after a start, in which the first frame answers something else.
fn try_sample(back: Vec<u8>) -> Result<RawFrame, AdcError<ErrorKind>> {
    let [result] = ticks(&tick(0x2110, 0x02, 0x2110, back));
    result
}

/// The frames of a good start, one per entry.
fn started() -> Vec<Vec<Transaction<u8>>> {
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
fn a_damaged_frame_before_the_reset_does_not_matter() {
    let mut all = started();
    all[0] = frame(0x0011, 0, vec![0x55; FRAME_BYTES]);
    assert_eq!(try_start(&all.concat()), Ok(()));
}

#[test]
fn a_part_that_does_not_confirm_its_reset_or_has_other_channels_is_refused() {
    let mut all = started()[..2].to_vec();
    all[1] = frame(0xa000, 0, answer(0xff24, QUIET));
    let (found, expected) = (0xff24, 0xff28);
    assert_eq!(
        try_start(&all.concat()),
        Err(AdcError::WrongId { found, expected })
    );

    let mut all = started()[..3].to_vec();
    all[2] = frame(0x6180, 0x3f06, answer(0x2401, QUIET));
    let (found, expected) = (0x2401, 0x2800);
    assert_eq!(
        try_start(&all.concat()),
        Err(AdcError::WrongId { found, expected })
    );
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
        assert_eq!(try_start(&all.concat()), Err(error));
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
fn a_resynchronisation_is_no_fault_and_rails_stay_rails() {
    let codes = [-8_388_608, 8_388_607, 0, 0, 0, 0, 0, 0];
    let frame = try_sample(answer(0x413f, codes)).expect("a good frame");
    assert_eq!(frame.hall, [-8_388_608, 8_388_607, 0]);
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
        // In the first frame of a tick, too, unless the one before it was not read to its end.
        let good = || answer(0x413f, QUIET);
        let both = [
            tick(0, 0x02, 0x2110, good()),
            tick(found, 0x03, 0x3f06, good()),
        ];
        assert_eq!(ticks::<2>(&both.concat())[1], Err(error));
    }
}

#[test]
fn a_conversion_that_is_not_there_yet_gets_one_more_frame() {
    let (late, new) = (answer(0x011f, QUIET), answer(0x013f, [5; 8]));
    let mut all = tick(0, 0x02, 0x2110, late.clone());
    all.extend(frame(0, 0, new));
    let [result] = ticks(&all);
    assert_eq!(result.map(|frame| frame.hall), Ok([5; 3]));

    let mut all = tick(0, 0x02, 0x2110, late.clone());
    all.extend(frame(0, 0, late));
    let (ready, read) = (0x1f, 0x3f);
    assert_eq!(ticks(&all), [Err(AdcError::NotReady { ready, read })]);
}

/// The values after a reset are those of the data sheet's table 8-12.
#[test]
fn every_register_is_read_back_in_turn() {
    let at_reset = |register: u16| match register {
        0x02 => 0x2110,
        0x03 => 0x3f06,
        0x06 => 0x0600,
        0x0c | 0x11 | 0x16 | 0x1b | 0x20 | 0x25 | 0x2a | 0x2f => 0x8000,
        _ => 0,
    };
    let good = |k: u16| {
        let register = 0x02 + k % 47;
        let status = if k == 0 { 0 } else { 0x413f };
        tick(status, register, at_reset(register), answer(0x013f, QUIET))
    };
    assert!(
        ticks::<95>(&(0..95).flat_map(good).collect::<Vec<_>>())
            .iter()
            .all(Result::is_ok)
    );
    for wrong in 0..47 {
        let mut all: Vec<_> = (0..wrong).flat_map(good).collect();
        let (register, wanted) = (0x02 + wrong, at_reset(0x02 + wrong));
        let status = if wrong == 0 { 0 } else { 0x413f };
        let found = wanted ^ 1 << (wrong % 16);
        all.extend(tick(status, register, found, answer(0x013f, QUIET)));
        let mut bus = Mock::new(&all);
        let mut pin = PinMock::new(&[]);
        let mut adc = Ads131m08::new(bus.clone(), pin.clone(), Channels::IN_ORDER);
        assert!((0..wrong).all(|_| adc.sample(0, 0).is_ok()));
        let register = register as u8;
        assert_eq!(
            adc.sample(0, 0),
            Err(AdcError::WrongSetting {
                register,
                found,
                wanted
            })
        );
        bus.done();
        pin.done();
    }
}

#[test]
fn a_start_that_fails_is_followed_by_a_reset_that_lasts_a_period() {
    let mut all = frame(0x0011, 0, answer(0, QUIET));
    all.extend(frame(0xa000, 0, answer(0x0011, QUIET)));
    all.extend(started().concat());
    let mut bus = Mock::new(&all);
    let (low, high) = (
        PinTransaction::set(State::Low),
        PinTransaction::set(State::High),
    );
    let starts = [high.clone(), low.clone(), low.clone(), high.clone()];
    let mut pin = PinMock::new(&[&starts[..], &[high.clone(), low, high]].concat());
    let mut adc = Ads131m08::new(bus.clone(), pin.clone(), Channels::IN_ORDER);
    let mut delay = NoopDelay::new();
    assert!(adc.start(&mut delay).is_err());
    assert_eq!(adc.trigger(&mut delay), Ok(()));
    assert_eq!(adc.trigger(&mut delay), Ok(()));
    assert_eq!(adc.start(&mut delay), Ok(()));
    assert_eq!(adc.trigger(&mut delay), Ok(()));
    bus.done();
    pin.done();
}

#[test]
fn the_error_of_the_bus_is_kept() {
    let mut pin = PinMock::new(&[PinTransaction::set(State::High)]);
    let mut adc = Ads131m08::new(Broken, pin.clone(), Channels::IN_ORDER);
    let error = AdcError::Bus(ErrorKind::ModeFault);
    assert_eq!(adc.start(&mut NoopDelay::new()), Err(error));
    assert_eq!(adc.sample(0, 0), Err(error));
    pin.done();
}

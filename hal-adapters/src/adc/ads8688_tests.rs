//! Byte sequences worked out from the data sheet: command tables and SDO format of the part.

extern crate std;

use super::super::testing::{self, Frames, Line, keeps_the_error_of_the_bus, transfer};
use super::*;
use embedded_hal::spi::ErrorKind;
use embedded_hal_mock::eh1::digital::{Mock as PinMock, State};
use embedded_hal_mock::eh1::spi::Mock;
use std::vec;
use std::vec::Vec;

/// Runs `work` on a settled part. Its bus must carry exactly `expected`.
fn on_part<T>(
    expected: &Frames,
    work: impl FnOnce(&mut Ads8688<Mock<u8>, PinMock, Line>) -> T,
) -> T {
    testing::on_part(Ads8688::new, Line::every(4), expected, &[], |adc| {
        adc.is_settled = true;
        work(adc)
    })
}

fn frame(out: [u8; 2], back: [u8; 3]) -> Frames {
    frame_of_41_bits(out, back, 0)
}

fn frame_of_41_bits(out: [u8; 2], back: [u8; 3], last: u8) -> Frames {
    let (mut sent, mut read) = (out.to_vec(), vec![0, 0]);
    sent.extend([0; 4]);
    read.extend(back);
    read.push(last);
    transfer(sent, read)
}

/// Register n is addressed by the upper seven bits; the bit after them writes.
fn written(register: u8, value: u8) -> Frames {
    let write = frame([register << 1 | 1, value], [value, 0, 0]);
    [write, frame([register << 1, 0], [value, 0, 0])].concat()
}

fn started() -> Frames {
    let mut all = frame([0x85, 0x00], [0, 0, 0]);
    all.extend(frame([0x02, 0x00], [0xff, 0, 0]));
    all.extend(written(0x01, 0x3f));
    all.extend(written(0x02, 0xc0));
    all.extend(written(0x03, 0x43));
    (0x05..=0x0a).for_each(|range| all.extend(written(range, 0)));
    all
}

/// The sequence is started, then each channel gives its code, its number and the device's.
fn sampled(codes: [[u8; 2]; 6]) -> Frames {
    let mut all = frame([0xa0, 0x00], [0x12, 0x34, 0x54]);
    for (k, [high, low]) in codes.into_iter().enumerate() {
        all.extend(frame(
            [0, 0],
            [high, low, [0x04, 0x14, 0x24, 0x34, 0x44, 0x54][k]],
        ));
    }
    all
}

const ZERO: [[u8; 2]; 6] = [[0x80, 0]; 6];

fn try_start(expected: Frames) -> Result<(), AdcError<ErrorKind>> {
    testing::on_part(
        Ads8688::new,
        Line::every(4),
        &expected,
        &[State::High],
        |adc| adc.start(),
    )
}

fn try_sample(expected: Frames) -> Result<RawFrame, AdcError<ErrorKind>> {
    on_part(&expected, |adc| adc.sample(7))
}

/// A clock that runs on by 5 us from look to look makes 25 us of the frames of the probes.
#[test]
fn hall_codes_that_take_too_long_have_no_instant() {
    let slow = testing::on_part(
        Ads8688::new,
        Line::every(5),
        &tick(0x01, 0x3f),
        &[],
        |adc| {
            adc.is_settled = true;
            adc.sample(7)
        },
    );
    assert_eq!(slow, Err(AdcError::UnknownInstant));
}

/// Codes, and the register that is read back after them.
fn tick(register: u8, value: u8) -> Frames {
    [sampled(ZERO), frame([register << 1, 0], [value, 0, 0])].concat()
}

#[test]
fn every_register_is_read_back_in_turn() {
    let settings = [(0x01, 0x3f), (0x02, 0xc0), (0x03, 0x43)];
    let ranges_and_reset = (0x05..=0x0c).map(|register| (register, 0));
    let wanted: Vec<_> = settings.into_iter().chain(ranges_and_reset).collect();
    for (wrong, &(register, value)) in wanted.iter().enumerate() {
        let good = wanted.iter().cycle().take(11 + wrong);
        let mut all: Vec<_> = good.flat_map(|(r, v)| tick(*r, *v)).collect();
        all.extend(tick(register, value ^ 1));
        on_part(&all, |adc| {
            assert!((0..11 + wrong).all(|_| adc.sample(0).is_ok()));
            let (found, wanted) = (u16::from(value ^ 1), u16::from(value));
            let error = AdcError::WrongSetting {
                register,
                found,
                wanted,
            };
            assert_eq!(adc.sample(0), Err(error));
        });
    }
}

#[test]
fn codes_are_signed_around_half_scale_and_rails_stay_rails() {
    let codes = [
        [0x80, 0x01],
        [0x7f, 0xff],
        [0x00, 0x00],
        [0xff, 0xff],
        [0x83, 0xe8],
        [0x80, 0],
    ];
    let want = RawFrame::new([1, -1, -32768], [32767, 1000, 0], 7, 14_000);
    let all = [sampled(codes), frame([0x02, 0], [0x3f, 0, 0])].concat();
    assert_eq!(try_sample(all), Ok(want));
}

#[test]
fn registers_that_are_not_at_reset_belong_to_another_part() {
    let mut all = frame([0x85, 0x00], [0, 0, 0]);
    all.extend(frame([0x02, 0x00], [0x3f, 0, 0]));
    let (found, expected) = (0x3f, 0xff);
    assert_eq!(try_start(all), Err(AdcError::WrongId { found, expected }));
}

#[test]
fn a_setting_that_does_not_read_back_is_named() {
    let mut all = started();
    let last = frame([0x14, 0x00], [0x01, 0, 0]);
    all.splice(all.len() - last.len().., last);
    let error = AdcError::WrongSetting {
        register: 0x0a,
        found: 1,
        wanted: 0,
    };
    assert_eq!(try_start(all), Err(error));
}

#[test]
fn a_code_of_another_channel_or_device_is_refused() {
    for found in [0x24, 0x10, 0x18, 0x1c] {
        let mut all = sampled(ZERO);
        let wrong = frame([0, 0], [0x80, 0, found]);
        all.truncate(6);
        all.splice(6.., wrong);
        let expected = 0x14;
        assert_eq!(
            try_sample(all),
            Err(AdcError::WrongInput { found, expected })
        );
    }
}

#[test]
fn a_code_of_another_range_is_refused() {
    // The range is the last three of 41 bits.
    for (range, signature, last) in [(1, 0x14, 0x80), (2, 0x15, 0), (6, 0x17, 0)] {
        let mut all = sampled(ZERO);
        all.truncate(6);
        all.extend(frame_of_41_bits([0, 0], [0x80, 0, signature], last));
        let error = AdcError::WrongSetting {
            register: 0x06,
            found: range,
            wanted: 0,
        };
        assert_eq!(try_sample(all), Err(error));
    }
}

#[test]
fn the_error_of_the_bus_is_kept() {
    keeps_the_error_of_the_bus(Ads8688::new);
}

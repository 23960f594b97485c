//! Texas Instruments ADS8688: eight channels of 16 bits, one after the other (data sheet
//! SBAS582C).
//!
//! SPI mode 1, up to 17 MHz. A frame starts with 16 bits of command, and the part's answer
//! follows them. The part samples one channel when chip select falls and returns its code in
//! the same frame; the previous frame's command selected the channel.
//!
//! | command | bits | here |
//! |---|---|---|
//! | NO_OP | 0x0000 | next channel of the sequence |
//! | RST | 0x8500 | registers as after power-up |
//! | AUTO_RST | 0xA000 | the next frame starts the sequence with its lowest channel |
//! | write, read | address (7 bits), 1 or 0, value | the answer is the value written or read |
//!
//! | register | address | value after reset | here |
//! |---|---|---|---|
//! | AUTO_SEQ_EN | 0x01 | 0xFF | channels that are read |
//! | Channel Power Down | 0x02 | 0x00 | channels that are not read |
//! | Feature Select | 0x03 | 0x00 | 0x43: channel, device address and input range follow each code, device address 1 |
//! | Channel n Input Range | 0x05 + n | 0x00 | 0: +-2.5 times the reference |
//!
//! **Power-up.** The internal reference needs 15 ms until codes are right, and the part does not
//! tell. A start cannot know whether the power has just come: samples are
//! [`NotReady`](AdcError::NotReady) for [`REFERENCE_US`] after every start. RST/PD is
//! held high: low for 40 to 100 ns it is a reset, for more than 400 ns it switches the part off,
//! reference included.
//!
//! **Check.** The part has neither an identification register nor a CRC. At start, reset
//! values that read back correctly show that it is there. Later each code is followed by its
//! channel (4 bits), the device address (2 bits, here 01: a line stuck at 0 or at 1 fails) and
//! its input range (3 bits), and all three are checked. A flipped bit in the code itself goes
//! unnoticed: prefer the [ADS131M08](super::ads131m08) on long cables. After the codes each tick
//! reads one register back: all registers in turn, in 24 ms. (It comes last because only the AUTO_RST of the
//! next tick starts the sequence again.) This driver reads no thermometers.
//!
//! **Timing.** Eight frames of 48 bits: 37 us at 10.5 MHz, 50 us with the gaps between bytes. From
//! sample to sample it takes one frame, about 6 us; the part needs 2 us. The time of a sample is the middle of the frames
//! of the Hall codes. If they take more than 20 us together, the sample is refused
//! ([`AdcError::UnknownInstant`]): by an interruption, inputs that are not neighbours, or SPI below 9.5 MHz.
//!
//! **Skew.** Channels are sampled one frame apart, about 6 us. Put the three Hall probes on
//! neighbouring inputs: A and C are then 12 us apart, which at the fastest motion of a service
//! log (4.8 mm/s) is 58 nm, a tenth of the Hall noise. The first and the last channel are 30 us
//! apart, at the fastest vertical motion (1.4 mm/s) 42 nm of Z; this changes a sensitivity by
//! 8 parts per million and the planar pose by 6 nm.
//!
//! **Range.** +-10.24 V with the internal reference of 4.096 V, 312.5 uV per code, straight
//! binary: 0 is the lower rail. Codes here are signed, -32768 to 32767, as in `stage.toml`. The
//! inputs have 1 MOhm: an open input reads a code like any other. A resistor of 220 kOhm to +15 V makes it read
//! a rail.

use super::channels::INPUTS;
use super::{AdcError, Channels, Clock, FrameSampler, check_id, compare, silent};
use embedded_hal::digital::{Error as _, OutputPin};
use embedded_hal::spi::{MODE_1, Mode, SpiDevice};
use runtime::RawFrame;

/// Bytes of a frame: command, code, signature and range. The last bit of the range is in the sixth byte.
const FRAME_BYTES: usize = 6;

const NO_OP: u16 = 0x0000;
const RST: u16 = 0x8500;
const AUTO_RST: u16 = 0xa000;

const AUTO_SEQ_EN: u8 = 0x01;
const AUTO_SEQ_EN_AT_RESET: u16 = 0xff;
const POWER_DOWN: u8 = 0x02;
const FEATURES: u8 = 0x03;
const RANGE_0: u8 = 0x05;
const LAST_REGISTER: u8 = 0x0c;

/// Bits 7..6: device address 1. Bits 2..0: code, channel, device address and range on SDO.
const FEATURES_WANTED: u16 = 0x43;
const DEVICE_SIGNATURE: u8 = 0b01_00;
const SIGNATURE_MASK: u8 = 0b1111_1100;
const RANGE_10_24_V: u16 = 0;

/// 15 ms for the reference with 22 uF, and 9 ms of margin.
pub const REFERENCE_US: u32 = 24_000;

/// From before the first Hall code until after the last one, at most, us: all are within 10 us of its middle.
const SPAN_US: u32 = 20;

/// Straight binary to signed.
const ZERO_VOLT: i32 = 0x8000;

/// The part on its bus, with its pin RST/PD.
#[derive(Debug)]
pub struct Ads8688<SPI, RST, CLOCK> {
    spi: SPI,
    reset: RST,
    clock: CLOCK,
    channels: Channels,
    /// Register that the next tick reads back.
    turn: u8,
    /// Time of the first sample since the start, us, and whether the reference has settled since.
    first_us: Option<u32>,
    is_settled: bool,
}

impl<SPI: SpiDevice, RST: OutputPin, CLOCK: Clock> Ads8688<SPI, RST, CLOCK> {
    /// A part that is not started yet; `reset` drives RST/PD, which is held high.
    pub const fn new(spi: SPI, reset: RST, clock: CLOCK, channels: Channels) -> Self {
        Self {
            spi,
            reset,
            clock,
            channels,
            turn: AUTO_SEQ_EN,
            first_us: None,
            is_settled: false,
        }
    }

    /// The bus, the pin and the clock, for another use.
    pub fn release(self) -> (SPI, RST, CLOCK) {
        (self.spi, self.reset, self.clock)
    }

    /// One frame: 16 bits of command out, the answer in the bytes behind them.
    fn exchange(&mut self, command: u16) -> Result<[u8; FRAME_BYTES], AdcError<SPI::Error>> {
        let [c0, c1] = command.to_be_bytes();
        let mut bytes = [c0, c1, 0, 0, 0, 0];
        self.spi
            .transfer_in_place(&mut bytes)
            .map_err(AdcError::Bus)?;
        Ok(bytes)
    }

    fn read(&mut self, register: u8) -> Result<u16, AdcError<SPI::Error>> {
        let bytes = self.exchange(u16::from(register) << 9)?;
        if bytes == [0xff; FRAME_BYTES] {
            return Err(AdcError::Silent { level: 0xff });
        }
        let [_, _, value, ..] = bytes;
        Ok(value.into())
    }

    /// The value that a register must have: 0x01 to 0x0c.
    const fn wanted(&self, register: u8) -> u16 {
        match register {
            AUTO_SEQ_EN => self.channels.mask() as u16,
            POWER_DOWN => !self.channels.mask() as u16,
            FEATURES => FEATURES_WANTED,
            _ => RANGE_10_24_V,
        }
    }

    /// The code of an input that the previous frame has selected.
    fn code(&mut self, input: u8) -> Result<i32, AdcError<SPI::Error>> {
        let bytes = self.exchange(NO_OP)?;
        let [_, _, high, low, signature, last] = bytes;
        let (found, expected) = (signature & SIGNATURE_MASK, input << 4 | DEVICE_SIGNATURE);
        if found != expected {
            return Err(match silent(&bytes) {
                Some(level) => AdcError::Silent { level },
                None => AdcError::WrongInput { found, expected },
            });
        }
        let range = (signature & !SIGNATURE_MASK) << 1 | last >> 7;
        compare(RANGE_0 + input, range.into(), RANGE_10_24_V)?;
        Ok(i32::from(u16::from_be_bytes([high, low])) - ZERO_VOLT)
    }

    /// Reads a register and compares it.
    fn check(&mut self, register: u8) -> Result<(), AdcError<SPI::Error>> {
        compare(register, self.read(register)?, self.wanted(register))
    }

    /// Writes a register and reads it back.
    fn set(&mut self, register: u8) -> Result<(), AdcError<SPI::Error>> {
        self.exchange(u16::from(register) << 9 | 1 << 8 | self.wanted(register))?;
        self.check(register)
    }
}

impl<SPI: SpiDevice, RST: OutputPin, CLOCK: Clock> FrameSampler for Ads8688<SPI, RST, CLOCK> {
    type Bus = SPI::Error;

    const SPI_MODE: Mode = MODE_1;
    const SPI_HZ_MAX: u32 = 17_000_000;

    /// The part converts while it is read.
    const SETTLE_US: u32 = 0;

    const CODE_BITS: u32 = 16;

    fn start(&mut self) -> Result<(), AdcError<SPI::Error>> {
        (self.first_us, self.is_settled) = (None, false);
        self.turn = AUTO_SEQ_EN;
        self.reset.set_high().map_err(|e| AdcError::Pin(e.kind()))?;
        self.exchange(RST)?;
        let found = self.read(AUTO_SEQ_EN)?;
        check_id(found, u16::MAX, AUTO_SEQ_EN_AT_RESET)?;
        for register in [AUTO_SEQ_EN, POWER_DOWN, FEATURES] {
            self.set(register)?;
        }
        let read = self.channels.mask();
        for input in (0..8).filter(|input| read & 1 << input != 0) {
            self.set(RANGE_0 + input)?;
        }
        Ok(())
    }

    fn trigger(&mut self) -> Result<(), AdcError<SPI::Error>> {
        Ok(())
    }

    fn sample(&mut self, sequence: u32) -> Result<RawFrame, AdcError<SPI::Error>> {
        self.exchange(AUTO_RST)?;
        let mut codes = [0; INPUTS];
        let read = self.channels.mask();
        let slots = (0u8..).zip(codes.iter_mut());
        let (mut from_us, mut to_us) = (None, 0);
        for (input, code) in slots.filter(|(input, _)| read & 1 << input != 0) {
            let now_us = self.clock.now_us();
            *code = self.code(input)?;
            if self.channels.hall.contains(&input) {
                from_us.get_or_insert(now_us);
                to_us = self.clock.now_us();
            }
        }
        let span_us = to_us.wrapping_sub(from_us.unwrap_or_default());
        let time_us = to_us.wrapping_sub(span_us / 2);
        let register = self.turn;
        self.turn = match register {
            LAST_REGISTER.. => AUTO_SEQ_EN,
            FEATURES => RANGE_0,
            _ => register + 1,
        };
        self.check(register)?;
        let first_us = *self.first_us.get_or_insert(time_us);
        self.is_settled |= time_us.wrapping_sub(first_us) >= REFERENCE_US;
        if !self.is_settled {
            return Err(AdcError::NotReady { ready: 0, read });
        }
        if span_us > SPAN_US {
            return Err(AdcError::UnknownInstant);
        }
        Ok(self.channels.frame(&codes, sequence, time_us))
    }
}

#[cfg(test)]
#[path = "ads8688_tests.rs"]
mod tests;

//! Texas Instruments ADS8688: eight channels of 16 bits, one after the other (data sheet
//! SBAS582C).
//!
//! SPI mode 1, up to 17 MHz. A frame starts with 16 bits of command; the part's answer follows
//! them. The part samples one channel as chip select falls and gives its code in the same
//! frame; which one, the frame before said.
//!
//! | command | bits | here |
//! |---|---|---|
//! | NO_OP | 0x0000 | next channel of the sequence |
//! | RST | 0x8500 | registers as after power-up |
//! | AUTO_RST | 0xA000 | the next frame starts the sequence with its lowest channel |
//! | write, read | address (7 bits), 1 or 0, value | the value written or read follows |
//!
//! | register | address | value after reset | here |
//! |---|---|---|---|
//! | AUTO_SEQ_EN | 0x01 | 0xFF | channels that are read |
//! | Channel Power Down | 0x02 | 0x00 | channels that are not |
//! | Feature Select | 0x03 | 0x00 | 0x42: channel and device address follow each code, device address 1 |
//! | Channel n Input Range | 0x05 + n | 0x00 | 0: +-2.5 times the reference |
//!
//! **Check.** The part has neither an identification nor a CRC. Reset values that read back
//! tell that it is there at start; later each code is followed by its channel (4 bits) and
//! the device address (2 bits, here 01, so that neither a line at 0 nor one at 1 passes) and
//! two zeros, which are checked. A flipped bit of the code itself passes: prefer the
//! [ADS131M08](super::ads131m08) on long cables.
//!
//! **Timing.** Seven frames of 40 bits: 28 us at 10.5 MHz, and chip select between them. The
//! sample-to-sample time is that of a frame, 3.8 us and up, above the 2 us that the part asks for.
//!
//! **Skew.** Channels are sampled a frame apart, at about 5 us. Put the three Hall probes
//! on neighbouring inputs: A to C are 10 us apart, which at the fastest motion of a service log
//! (4.8 mm/s) is 48 nm, a tenth of the Hall noise; from the first to the last channel 25 us,
//! at the fastest vertical motion (1.4 mm/s) 34 nm of Z, which changes a sensitivity by
//! 7 parts per million and the planar pose by 5 nm.
//!
//! **Range.** +-10.24 V with the internal reference of 4.096 V, 312.5 uV a code, straight binary:
//! 0 is the lower rail. Codes here are signed, -32768 to 32767, as in `stage.toml`.

use super::channels::INPUTS;
use super::{AdcError, Channels, FrameSampler, silent};
use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{MODE_1, Mode, SpiDevice};
use runtime::RawFrame;

/// SPI mode of the part.
pub const MODE: Mode = MODE_1;
/// Fastest SPI clock, Hz.
pub const SPI_HZ_MAX: u32 = 17_000_000;
/// Bytes of a frame: command, code, signature.
pub const FRAME_BYTES: usize = 5;

const NO_OP: u16 = 0x0000;
const RST: u16 = 0x8500;
const AUTO_RST: u16 = 0xa000;

const AUTO_SEQ_EN: u8 = 0x01;
const AUTO_SEQ_EN_AT_RESET: u8 = 0xff;
const POWER_DOWN: u8 = 0x02;
const FEATURES: u8 = 0x03;
const RANGE_0: u8 = 0x05;

/// Bits 7..6: device address 1. Bits 2..0: code, channel and device address on SDO.
const FEATURES_WANTED: u8 = 0x42;
const DEVICE_SIGNATURE: u8 = 0b01_00;
const RANGE_10_24_V: u8 = 0;

/// Straight binary to signed.
const ZERO_VOLT: i32 = 0x8000;

/// The part on its bus.
#[derive(Debug)]
pub struct Ads8688<SPI> {
    spi: SPI,
    channels: Channels,
}

impl<SPI: SpiDevice> Ads8688<SPI> {
    /// A part that is not started yet.
    pub const fn new(spi: SPI, channels: Channels) -> Self {
        Self { spi, channels }
    }

    /// Gives back the bus.
    pub fn release(self) -> SPI {
        self.spi
    }

    /// One frame: 16 bits of command out, everything that came meanwhile in.
    fn exchange(&mut self, command: u16) -> Result<[u8; FRAME_BYTES], AdcError<SPI::Error>> {
        let [c0, c1] = command.to_be_bytes();
        let mut bytes = [c0, c1, 0, 0, 0];
        self.spi
            .transfer_in_place(&mut bytes)
            .map_err(AdcError::Bus)?;
        Ok(bytes)
    }

    fn read(&mut self, register: u8) -> Result<u8, AdcError<SPI::Error>> {
        let bytes = self.exchange(u16::from(register) << 9)?;
        if bytes == [0xff; FRAME_BYTES] {
            return Err(AdcError::Silent { level: 0xff });
        }
        let [_, _, value, _, _] = bytes;
        Ok(value)
    }

    /// Writes a register and reads it back.
    fn set(&mut self, register: u8, wanted: u8) -> Result<(), AdcError<SPI::Error>> {
        self.exchange(u16::from(register) << 9 | 1 << 8 | u16::from(wanted))?;
        let found = self.read(register)?;
        if found != wanted {
            return Err(AdcError::WrongSetting {
                register,
                found: found.into(),
                wanted: wanted.into(),
            });
        }
        Ok(())
    }
}

impl<SPI: SpiDevice> FrameSampler for Ads8688<SPI> {
    type Bus = SPI::Error;

    /// Reading is converting.
    const SETTLE_US: u32 = 0;

    fn start(&mut self, _delay: &mut impl DelayNs) -> Result<(), AdcError<SPI::Error>> {
        self.exchange(RST)?;
        let found = self.read(AUTO_SEQ_EN)?;
        if found != AUTO_SEQ_EN_AT_RESET {
            return Err(AdcError::WrongId {
                found: found.into(),
                expected: AUTO_SEQ_EN_AT_RESET.into(),
            });
        }
        let read = self.channels.mask();
        self.set(AUTO_SEQ_EN, read)?;
        self.set(POWER_DOWN, !read)?;
        self.set(FEATURES, FEATURES_WANTED)?;
        for input in (0..8).filter(|input| read & 1 << input != 0) {
            self.set(RANGE_0 + input, RANGE_10_24_V)?;
        }
        Ok(())
    }

    fn trigger(&mut self, _delay: &mut impl DelayNs) -> Result<(), AdcError<SPI::Error>> {
        Ok(())
    }

    fn sample(&mut self, sequence: u32, time_us: u32) -> Result<RawFrame, AdcError<SPI::Error>> {
        self.exchange(AUTO_RST)?;
        let mut codes = [0; INPUTS];
        let read = self.channels.mask();
        let slots = (0u8..).zip(codes.iter_mut());
        for (input, code) in slots.filter(|(input, _)| read & 1 << input != 0) {
            let bytes = self.exchange(NO_OP)?;
            let [_, _, high, low, found] = bytes;
            let expected = input << 4 | DEVICE_SIGNATURE;
            if found != expected {
                return Err(match silent(&bytes) {
                    Some(level) => AdcError::Silent { level },
                    None => AdcError::WrongInput { found, expected },
                });
            }
            *code = i32::from(u16::from_be_bytes([high, low])) - ZERO_VOLT;
        }
        let (hall, capacitive) = self.channels.pick(&codes);
        Ok(RawFrame {
            hall,
            capacitive,
            sequence,
            time_us,
        })
    }
}

#[cfg(test)]
#[path = "ads8688_tests.rs"]
mod tests;

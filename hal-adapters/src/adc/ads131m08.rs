//! Texas Instruments ADS131M08: eight channels of 24 bits, sampled at once (data sheet
//! SBAS950).
//!
//! Every exchange is a frame of ten words of 24 bits, most significant bit first, SPI mode 1,
//! up to 25 MHz: command, seven words and a check from here; the response to the *previous*
//! frame's command, eight codes in two's complement and a CRC-16 (CCITT, polynomial 0x1021,
//! start 0xFFFF) from the part, 16-bit values in the upper 16 bits of their word. The
//! response to no command is the STATUS register.
//!
//! | register | address | value after reset | here |
//! |---|---|---|---|
//! | ID | 0x00 | 0x28xx | upper byte checked: eight channels |
//! | STATUS | 0x01 | 0x0500 | in every frame: upper byte 0x01, apart from the bit that marks a resynchronisation; lower byte one ready bit per channel |
//! | MODE | 0x02 | 0x0510 | 0x0110: the reset flag is cleared, so a later reset shows |
//! | CLOCK | 0x03 | 0xFF0E | channels that are read, oversampling 128, high resolution |
//!
//! **Timing.** CLKIN must be 8.000 MHz: the modulators run at 4 MHz and a conversion takes
//! 32 us. The part stores up to two conversions that were not read, so a plain read returns
//! data from before the tick. A pulse on SYNC/RESET at the trigger empties that store and
//! restarts the sinc3 filters: the code that is ready [`SETTLE_US`](FrameSampler::SETTLE_US)
//! later is the weighted mean of the 96 us after the trigger, in every tick. (The part ignores
//! a pulse that coincides with the end of a conversion. At 8 MHz 2 ms are 62.5 conversions, so
//! that does not happen; at 8.192 MHz they would be 64 and it would.) The pulse must be shorter
//! than 2048 periods of CLKIN, 256 us; a longer one is a reset.
//!
//! **Skew.** None: the channels share one trigger. What remains is a delay common to all six
//! codes, 48 us from the trigger to the middle of the filter: 0.23 um at the fastest motion
//! of a service log (4.8 mm/s), known and the same for every axis. The time stamp
//! of a frame does not include it.
//!
//! **Range.** +-1.2 V at gain 1, 143 nV per code: a Hall amplifier of +-10.24 V needs a divider
//! by 8.53. The rails are -8388608 and 8388607; declare them as `code_min` and `code_max` of
//! the stage file and the decoder refuses them.

use super::channels::INPUTS;
use super::{AdcError, Channels, FrameSampler, silent};
use crc::{CRC_16_IBM_3740, Crc};
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{Error as _, OutputPin};
use embedded_hal::spi::{MODE_1, Mode, SpiDevice};
use runtime::RawFrame;

/// Words of a frame: response, eight codes, check.
const WORDS: usize = 2 + INPUTS;
const WORD_BYTES: usize = 3;

/// What the data sheet calls CCITT.
const CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_IBM_3740);

const NULL: u16 = 0x0000;
const RESET: u16 = 0x0011;
/// Response to a reset: 0xFF20 and the number of channels.
const RESET_DONE: u16 = 0xff28;
const READ: u16 = 0xa000;
const WRITE: u16 = 0x6000;
const WRITTEN: u16 = 0x4000;

const ID: u8 = 0x00;
const STATUS: u8 = 0x01;
const MODE_REGISTER: u8 = 0x02;
const CLOCK: u8 = 0x03;

const ID_MASK: u16 = 0xff00;
const ID_WANTED: u16 = 0x2800;
/// 24-bit words, timeout on, no CRC on commands, reset flag cleared.
const MODE_WANTED: u16 = 0x0110;
/// Oversampling 128 (bits 4..2 = 0), high resolution (bits 1..0 = 2).
const CLOCK_SPEED: u16 = 0x0002;
/// All bits except the ready bits and F_RESYNC, which every pulse on SYNC sets.
const STATUS_MASK: u16 = 0xbf00;
/// 24-bit words, nothing locked, no reset, no error.
const STATUS_WANTED: u16 = 0x0100;

/// A pulse on SYNC lasts 1 to 2047 periods of CLKIN: 0.125 to 256 us.
const SYNC_US: u32 = 1;

/// The registers can be accessed 5 us after a reset.
const RESET_US: u32 = 10;

/// The part on its bus, with its pin SYNC/RESET.
#[derive(Debug)]
pub struct Ads131m08<SPI, SYNC> {
    spi: SPI,
    sync: SYNC,
    channels: Channels,
}

/// What the part sent in one frame.
struct Frame {
    response: u16,
    codes: [i32; INPUTS],
}

impl<SPI: SpiDevice, SYNC: OutputPin> Ads131m08<SPI, SYNC> {
    /// A part that is not started yet; `sync` drives SYNC/RESET.
    pub const fn new(spi: SPI, sync: SYNC, channels: Channels) -> Self {
        Self {
            spi,
            sync,
            channels,
        }
    }

    /// One frame: a command and at most one word of data out, the previous command's response in.
    fn exchange(&mut self, command: u16, data: u16) -> Result<Frame, AdcError<SPI::Error>> {
        let mut words = [[0; WORD_BYTES]; WORDS];
        let ([c0, c1], [d0, d1]) = (command.to_be_bytes(), data.to_be_bytes());
        [words[0], words[1]] = [[c0, c1, 0], [d0, d1, 0]];
        self.spi
            .transfer_in_place(words.as_flattened_mut())
            .map_err(AdcError::Bus)?;
        if let Some(level) = silent(words.as_flattened()) {
            return Err(AdcError::Silent { level });
        }
        let [head, codes @ .., [k0, k1, _]] = words;
        let mut digest = CRC.digest();
        digest.update(&head);
        digest.update(codes.as_flattened());
        let (received, computed) = (u16::from_be_bytes([k0, k1]), digest.finalize());
        if received != computed {
            return Err(AdcError::WrongCheck { received, computed });
        }
        let [r0, r1, _] = head;
        let mut frame = Frame {
            response: u16::from_be_bytes([r0, r1]),
            codes: [0; INPUTS],
        };
        for (code, [high, middle, low]) in frame.codes.iter_mut().zip(codes) {
            *code = i32::from_be_bytes([high, middle, low, 0]) >> 8;
        }
        Ok(frame)
    }

    /// Sends a command and fetches its response with the next frame.
    fn ask(&mut self, command: u16, data: u16) -> Result<u16, AdcError<SPI::Error>> {
        self.exchange(command, data)?;
        Ok(self.exchange(NULL, 0)?.response)
    }

    /// Writes a register and reads it back.
    fn set(&mut self, register: u8, wanted: u16) -> Result<(), AdcError<SPI::Error>> {
        let address = u16::from(register) << 7;
        let written = self.ask(WRITE | address, wanted)?;
        let found = self.ask(READ | address, 0)?;
        if written != WRITTEN | address || found != wanted {
            return Err(AdcError::WrongSetting {
                register,
                found,
                wanted,
            });
        }
        Ok(())
    }
}

impl<SPI: SpiDevice, SYNC: OutputPin> FrameSampler for Ads131m08<SPI, SYNC> {
    type Bus = SPI::Error;

    const SPI_MODE: Mode = MODE_1;
    const SPI_HZ_MAX: u32 = 25_000_000;

    /// Three conversions of 32 us for the sinc3 filter, 6 us for the part's own start and
    /// 8 us of margin.
    const SETTLE_US: u32 = 110;

    fn start(&mut self, delay: &mut impl DelayNs) -> Result<(), AdcError<SPI::Error>> {
        self.sync.set_high().map_err(|e| AdcError::Pin(e.kind()))?;
        // This frame answers an earlier command, so neither its content nor its check matters.
        match self.exchange(RESET, 0) {
            Err(AdcError::Bus(error)) => return Err(AdcError::Bus(error)),
            Ok(_) | Err(_) => delay.delay_us(RESET_US),
        }
        let response = self.exchange(READ | u16::from(ID) << 7, 0)?.response;
        if response != RESET_DONE {
            return Err(AdcError::WrongId {
                found: response,
                expected: RESET_DONE,
            });
        }
        let found = self.exchange(NULL, 0)?.response;
        if found & ID_MASK != ID_WANTED {
            return Err(AdcError::WrongId {
                found,
                expected: ID_WANTED,
            });
        }
        self.set(CLOCK, u16::from(self.channels.mask()) << 8 | CLOCK_SPEED)?;
        self.set(MODE_REGISTER, MODE_WANTED)
    }

    fn trigger(&mut self, delay: &mut impl DelayNs) -> Result<(), AdcError<SPI::Error>> {
        self.sync.set_low().map_err(|e| AdcError::Pin(e.kind()))?;
        delay.delay_us(SYNC_US);
        self.sync.set_high().map_err(|e| AdcError::Pin(e.kind()))
    }

    fn sample(&mut self, sequence: u32, time_us: u32) -> Result<RawFrame, AdcError<SPI::Error>> {
        let frame = self.exchange(NULL, 0)?;
        if frame.response & STATUS_MASK != STATUS_WANTED {
            return Err(AdcError::WrongSetting {
                register: STATUS,
                found: frame.response,
                wanted: STATUS_WANTED,
            });
        }
        let [_, ready] = frame.response.to_be_bytes();
        let read = self.channels.mask();
        if ready & read != read {
            return Err(AdcError::NotReady { ready, read });
        }
        Ok(self.channels.frame(&frame.codes, sequence, time_us))
    }
}

#[cfg(test)]
#[path = "ads131m08_tests.rs"]
mod tests;

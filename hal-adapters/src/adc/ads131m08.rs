//! Texas Instruments ADS131M08: eight channels of 24 bits, sampled at once (data sheet
//! SBAS950B).
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
//! | STATUS | 0x01 | 0x0500 | twice a tick: upper byte 0x01, apart from the bit that marks a resynchronisation; lower byte one ready bit per channel |
//! | MODE | 0x02 | 0x0510 | 0x2110: the reset flag is cleared, so a later reset shows; the part checks its registers |
//! | CLOCK | 0x03 | 0xFF0E | channels that are read, oversampling 256, high resolution |
//! | the others | 0x04 to 0x30 | | as after reset |
//!
//! **Which conversion is read, and when it was sampled.** CLKIN is 8.000 MHz: the modulators run at 4 MHz and a
//! conversion takes 64 us. DRDY falls as a conversion ends, while no frame is on the bus (8.5.1.5).
//!
//! 1. A pulse on SYNC/RESET at the trigger restarts the filters of all channels.
//! 2. [`SETTLE_US`](FrameSampler::SETTLE_US) = 207 us later the last edge of DRDY gives the ends of all conversions, those
//!    to come as well. The period between edges and their place behind the trigger are measured at the start. An edge that
//!    is more than 3 us off its place is a disturbance, and the sample is refused.
//! 3. Frames empty the store of two conversions. The driver follows the store by the times of frames and conversions
//!    (`conversions.rs`), and returns the first codes with a known conversion, settled in any case: 3.5 periods
//!    after the trigger. (By table 8-3 a filter may begin 75 us after a resynchronisation; 8.5.2 wants three periods.)
//!
//! The codes are the mean, weighted by the sinc3 filter, of the three periods before. The sheet does not say whether an edge
//! comes up to 44 periods of the modulators (11 us) after its last sample, as in equation 9: the time of a sample is in the
//! middle of both, and right to 6 us and the jitter of the clock. A sample that is not known to 10 us is refused
//! ([`AdcError::UnknownInstant`]): DRDY is not wired, CLKIN is not within 6 % of 8 MHz by the clock of the controller,
//! a frame was interrupted or is too slow. So the controller's own oscillator may be 4 % off, and CLKIN may be 8.192 MHz.
//!
//! A frame of a full store must lie between two conversions: it may take 58 us with the gap between the look at the clock and
//! chip select. **So the least SPI clock is 4.2 MHz**; below it every sample is refused. Frames that take longer than
//! 45 us wait for the end of a conversion first, for one frame at most.
//!
//! By the model of the part, in all eight behaviours where the sheet is silent: the largest error of the time of a sample,
//! and the samples that are refused, with one interruption of this length in a ms (`cargo test -p bench driver -- --nocapture`):
//!
//! | SPI, gap before each frame | never interrupted | 10 us | 30 us | 100 us |
//! |---|---|---|---|---|
//! | 1 MHz, any; 4 MHz, any | all refused | all refused | all refused | all refused |
//! | 5.25 MHz, 1 us | 5.9 us, 0 % | 5.9 us, 1 % | 5.9 us, 6 % | 5.9 us, 9 % |
//! | 5.25 MHz, 5 us | 5.9 us, 0 % | 5.9 us, 4 % | 5.9 us, 7 % | 5.9 us, 11 % |
//! | 5.25 MHz, 20 and 50 us | all refused | all refused | all refused | all refused |
//! | 10 MHz, 1 us | 5.9 us, 0 % | 5.9 us, 0 % | 5.9 us, 1 % | 5.9 us, 9 % |
//! | 10 MHz, 5 us | 5.9 us, 0 % | 5.9 us, 0 % | 5.9 us, 1 % | 5.9 us, 8 % |
//! | 10 MHz, 20 us | 5.9 us, 0 % | 5.9 us, 2 % | 5.9 us, 3 % | 5.9 us, 9 % |
//! | 10 MHz, 50 us | all refused | all refused | all refused | all refused |
//!
//! A pulse must be shorter than 2048 periods of CLKIN, 256 us; a longer one is a reset. The part
//! ignores a pulse that coincides with the end of a conversion, which then is settled anyway. At
//! 8.192 MHz 2 ms are 32 conversions, and a part that is in step would ignore all pulses: one that
//! comes after an ignored pulse comes 2 us late, which restarts the filters.
//!
//! **Checks.** Each frame has a CRC, and besides codes the three of a tick carry
//! - the STATUS: a reset, a locked interface, a register that changed (REG_CRC_EN makes the part
//!   compare its registers' CRC every 94 us; a change in the 0.2 ms before the codes are read is
//!   reported a tick later), and whether SYNC arrived. Two ticks in a row without a resynchronisation
//!   mean that its wire is broken;
//! - one register, read back and compared: all of 0x02 to 0x30 in turn, in 94 ms.
//!
//! The trigger after a failed start holds SYNC/RESET low for one period: a reset that also helps
//! a part that ignores commands because its interface is locked or its word length changed. After
//! power-up the part ignores the SPI for 250 us (typical): a start in that time fails, too.
//!
//! **Skew.** None: the channels share one trigger.
//!
//! **Range.** +-1.2 V at gain 1, 143 nV per code: a Hall amplifier of +-10.24 V needs a divider
//! by 8.53. The rails are -8388608 and 8388607; declare them as `code_min` and `code_max` of
//! the stage file and the decoder refuses them. An input that is not connected reads about 0, which
//! is a code like any other: see the wiring table of the firmware for the resistor that makes it
//! read a rail.

mod conversions;
mod timing;

use super::channels::INPUTS;
use super::thermometer::{AnalogInput, Held};
use super::{AdcError, Channels, DataReady, FrameSampler, check_id, compare, silent};
use conversions::Conversions;
use crc::{CRC_16_IBM_3740, Crc};
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

const ID: u8 = 0x00;
const STATUS: u8 = 0x01;
const MODE_REGISTER: u8 = 0x02;
const CLOCK: u8 = 0x03;
const CFG: u8 = 0x06;
const GAIN_0: u8 = 0x0c;
/// From each channel's gain register to the next one's.
const CHANNEL_REGISTERS: u8 = 5;
const LAST_REGISTER: u8 = 0x30;

const ID_MASK: u16 = 0xff00;
const ID_WANTED: u16 = 0x2800;
/// CRC of the registers on, 24-bit words, timeout on, no CRC on commands, reset flag cleared.
const MODE_WANTED: u16 = 0x2110;
/// Chopping off: value after reset.
const CFG_WANTED: u16 = 0x0600;
/// Gain correction 1, upper 16 bits: value after reset.
const GAIN_WANTED: u16 = 0x8000;
/// Oversampling 256 (bits 4..2 = 1), high resolution (bits 1..0 = 2).
const CLOCK_SPEED: u16 = 0x0006;
/// All bits except the ready bits and F_RESYNC, which every pulse on SYNC sets.
const STATUS_MASK: u16 = 0xbf00;
/// 24-bit words, nothing locked, no reset, no register changed, no error.
const STATUS_WANTED: u16 = 0x0100;
const F_RESYNC: u16 = 0x4000;
/// So many ticks in a row without a resynchronisation are a fault.
const UNSYNCED_TICKS: u8 = 2;

/// By this much a pulse comes later that follows an ignored one.
const SHIFT_US: u32 = 2;

/// The registers can be accessed 5 us (typical) after a reset.
const RESET_US: u32 = 10;

/// Frames of a sample, at most.
const FRAMES_MAX: usize = 6;
/// The part on its bus, with its pins SYNC/RESET and DRDY.
#[derive(Debug)]
pub struct Ads131m08<SPI, SYNC, READY> {
    spi: SPI,
    sync: SYNC,
    ready: READY,
    channels: Channels,
    /// Register that the next tick reads back.
    turn: u8,
    /// Whether the next response is the STATUS: the last tick was read to its end.
    status_is_next: bool,
    unsynced_ticks: u8,
    start_failed: bool,
    temperatures: Held,
    triggered_us: u32,
    /// From edge to edge of DRDY; 0 until it is measured.
    period_ns: u32,
    /// Of the edges behind the trigger and whole periods.
    place_ns: u32,
    /// Length of the last frame.
    frame_us: u32,
}

/// What the part sent in one frame, and when.
struct Frame {
    response: u16,
    codes: [i32; INPUTS],
    from_us: u32,
    to_us: u32,
}

impl<SPI: SpiDevice, SYNC: OutputPin, READY: DataReady> Ads131m08<SPI, SYNC, READY> {
    /// An input, as the source of its voltage sees it.
    pub const INPUT: AnalogInput = AnalogInput {
        codes_per_v: 8_388_608.0 / 1.2,
        ohm: 330e3,
    };

    /// A part that is not started yet; `sync` drives SYNC/RESET, `ready` sees DRDY.
    pub const fn new(spi: SPI, sync: SYNC, ready: READY, channels: Channels) -> Self {
        Self {
            spi,
            sync,
            ready,
            channels,
            turn: MODE_REGISTER,
            status_is_next: false,
            unsynced_ticks: 0,
            start_failed: false,
            temperatures: Held::MISSING,
            triggered_us: 0,
            period_ns: 0,
            place_ns: 0,
            frame_us: 0,
        }
    }

    /// The bus, the pin and the line, for another use.
    pub fn release(self) -> (SPI, SYNC, READY) {
        (self.spi, self.sync, self.ready)
    }

    /// One frame: a command and at most one word of data out, the previous command's response in.
    fn exchange(&mut self, command: u16, data: u16) -> Result<Frame, AdcError<SPI::Error>> {
        let mut words = [[0; WORD_BYTES]; WORDS];
        let ([c0, c1], [d0, d1]) = (command.to_be_bytes(), data.to_be_bytes());
        [words[0], words[1]] = [[c0, c1, 0], [d0, d1, 0]];
        let from_us = self.ready.now_us();
        self.spi
            .transfer_in_place(words.as_flattened_mut())
            .map_err(AdcError::Bus)?;
        let to_us = self.ready.now_us();
        self.frame_us = to_us.wrapping_sub(from_us);
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
            from_us,
            to_us,
        };
        for (code, [high, middle, low]) in frame.codes.iter_mut().zip(codes) {
            *code = i32::from_be_bytes([high, middle, low, 0]) >> 8;
        }
        Ok(frame)
    }

    /// The value that a register must have: 0x02 to 0x30.
    const fn wanted(&self, register: u8) -> u16 {
        match register {
            MODE_REGISTER => MODE_WANTED,
            CLOCK => (self.channels.read as u16) << 8 | CLOCK_SPEED,
            CFG => CFG_WANTED,
            GAIN_0.. if (register - GAIN_0).is_multiple_of(CHANNEL_REGISTERS) => GAIN_WANTED,
            _ => 0,
        }
    }

    fn try_start(&mut self) -> Result<(), AdcError<SPI::Error>> {
        self.sync.set_high().map_err(|e| AdcError::Pin(e.kind()))?;
        // This frame answers an earlier command, so neither its content nor its check matters.
        match self.exchange(RESET, 0) {
            Err(AdcError::Bus(error)) => return Err(AdcError::Bus(error)),
            Ok(_) | Err(_) => self.wait_us(RESET_US),
        }
        // Each frame answers the previous command.
        let (read, write) = (|r: u8| READ | address(r), |r: u8| WRITE | address(r));
        let found = self.exchange(read(ID), 0)?.response;
        check_id(found, u16::MAX, RESET_DONE)?;
        let found = self.exchange(write(CLOCK), self.wanted(CLOCK))?.response;
        check_id(found, ID_MASK, ID_WANTED)?;
        self.exchange(write(MODE_REGISTER), MODE_WANTED)?;
        self.exchange(read(CLOCK), 0)?;
        let found = self.exchange(read(MODE_REGISTER), 0)?.response;
        compare(CLOCK, found, self.wanted(CLOCK))?;
        let found = self.exchange(NULL, 0)?.response;
        compare(MODE_REGISTER, found, MODE_WANTED)?;
        self.measure_edges()
    }
}

/// Where commands have the address of a register.
const fn address(register: u8) -> u16 {
    (register as u16) << 7
}

fn check_status<B>(found: u16) -> Result<(), AdcError<B>> {
    if found & STATUS_MASK == STATUS_WANTED {
        return Ok(());
    }
    Err(AdcError::WrongSetting {
        register: STATUS,
        found,
        wanted: STATUS_WANTED,
    })
}

impl<SPI: SpiDevice, SYNC: OutputPin, READY: DataReady> FrameSampler
    for Ads131m08<SPI, SYNC, READY>
{
    type Bus = SPI::Error;

    const SPI_MODE: Mode = MODE_1;
    const SPI_HZ_MAX: u32 = 25_000_000;
    /// 4 us after the third conversion, whether it ends 192 or 203 us after the trigger.
    const SETTLE_US: u32 = 207;
    const CODE_BITS: u32 = 24;

    fn start(&mut self) -> Result<(), AdcError<SPI::Error>> {
        // What was set raises the flag of changed registers: the next STATUS is not looked at.
        self.status_is_next = false;
        self.temperatures = Held::MISSING;
        self.turn = MODE_REGISTER;
        self.period_ns = 0;
        let result = self.try_start();
        // A reset is no help where DRDY shows no conversion.
        self.start_failed = !matches!(result, Ok(()) | Err(AdcError::UnknownInstant));
        result
    }

    fn trigger(&mut self) -> Result<(), AdcError<SPI::Error>> {
        if self.unsynced_ticks > 0 {
            self.wait_us(SHIFT_US);
        }
        if core::mem::take(&mut self.start_failed) {
            return self.sync.set_low().map_err(|e| AdcError::Pin(e.kind()));
        }
        self.pulse()
    }

    fn sample(&mut self, sequence: u32) -> Result<RawFrame, AdcError<SPI::Error>> {
        let (register, read) = (self.turn, self.channels.read);
        self.turn = if register < LAST_REGISTER {
            register + 1
        } else {
            MODE_REGISTER
        };
        let status_is_first = core::mem::take(&mut self.status_is_next);
        let mut conversions = self.conversions().unwrap_or(Conversions::LOST);

        // Both carry conversions of the full store.
        let first = self.next_frame(READ | address(register), &mut conversions)?;
        conversions.read(&first, true);
        let second = self.next_frame(NULL, &mut conversions)?;
        conversions.read(&second, true);
        // A status reports each event once: every one of them counts.
        let mut statuses = 0;
        let mut status = Ok(());
        if status_is_first {
            (statuses, status) = (first.response, check_status(first.response));
        }
        let (mut ready, mut found) = (0, None);
        for _ in 2..FRAMES_MAX {
            let frame = self.next_frame(NULL, &mut conversions)?;
            statuses |= frame.response;
            status = status.and(check_status(frame.response));
            ready = frame.response as u8 & read;
            let number = conversions.read(&frame, ready == read);
            let instant = number.and_then(|number| self.instant_us(&conversions, number));
            found = instant.map(|us| (us, frame.codes));
            let in_vain = ready == read && conversions.is_lost;
            if found.is_some() || in_vain {
                break;
            }
        }
        self.status_is_next = true;

        status?;
        compare(register, second.response, self.wanted(register))?;
        if ready != read {
            return Err(AdcError::NotReady { ready, read });
        }
        self.unsynced_ticks = match statuses & F_RESYNC {
            0 => self.unsynced_ticks.saturating_add(1),
            _ => 0,
        };
        if self.unsynced_ticks >= UNSYNCED_TICKS {
            return Err(AdcError::NoSync);
        }
        let (time_us, codes) = found.ok_or(AdcError::UnknownInstant)?;
        let sampled = self.channels.frame(&codes, sequence, time_us);
        let thermometers = &self.channels.thermometers;
        let temperature_mc = (self.temperatures).at(thermometers, &codes, time_us);
        Ok(sampled.with_temperature_mc(temperature_mc))
    }
}

#[cfg(test)]
#[path = "ads131m08_tests.rs"]
mod tests;

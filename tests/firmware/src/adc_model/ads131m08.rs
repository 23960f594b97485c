//! TI ADS131M08 (SBAS950B) with CLKIN 8 MHz: modulators at 4 MHz, sinc3 filters, a store of two
//! conversions, frames of ten words of 24 bits, DRDY. A [`Variant`] decides where the sheet is silent.
//!
//! DRDY (8.5.1.5, DRDY_FMT 0) falls when a conversion is ready, not while a frame is on the bus. When a frame has ended and
//! another conversion is stored, it falls once more at once (figure 8-21).
//!
//! Not modelled: word lengths other than 24 bits, oversampling above 1024, phases, gains, offsets,
//! global chop, the fast-settling filter of the first two conversions after a reset, standby, current detection, LOCK, the CRC of commands, t_REGACQ (waits of the
//! program take no time here). Unknown commands are answered as NULL, like invalid ones.

mod frames;
mod variant;

pub use variant::Variant;

use super::Row;
use super::filter::{Conversion, T_MOD_NS};
use std::collections::VecDeque;

/// Period of CLKIN, ns.
const T_CLKIN_NS: u64 = 125;
/// t_POR: from the supply until commands are taken, ns.
const POWER_ON_NS: u64 = 250_000;
/// From a reset until the modulators sample (8.4.2), in their periods.
const INITIAL_WAIT: u64 = 256 + 44;
/// A longer low on SYNC/RESET is a reset, in periods of CLKIN.
const RESET_CLKIN: u64 = 2048;

const CLOCK: usize = 0x03;

/// The part. It works from its first supply on.
#[derive(Default)]
pub struct Ads131m08 {
    /// The behaviour where the sheet is silent.
    pub variant: Variant,
    registers: Vec<u16>,
    ready_ns: u64,
    low_since_ns: Option<u64>,
    /// Whether CLKIN stands.
    stands: bool,
    /// Since when the filters take data, and how many conversions ended since.
    from_ns: u64,
    conversions: u64,
    store: VecDeque<Conversion>,
    shown: Option<Conversion>,
    codes: Row,
    /// When DRDY fell last, and whether a frame keeps it from falling.
    fell_ns: Option<u64>,
    is_selected: bool,
    resynchronised: bool,
    map_flag: bool,
    map_crc: u16,
    map_changed_ns: Option<u64>,
    /// The response of the next frame; `None`: the status.
    response: Option<u16>,
    listens: bool,
    received: Vec<u8>,
    reply: Vec<u8>,
}

impl Ads131m08 {
    /// The supply comes.
    pub fn power_up(&mut self, now_ns: u64) {
        self.reset(now_ns + POWER_ON_NS);
        self.response = None;
        self.ready_ns = now_ns + POWER_ON_NS;
    }

    fn reset(&mut self, now_ns: u64) {
        self.registers = vec![0; 64];
        self.registers[..7].copy_from_slice(&[0x2804, 0x0500, 0x0510, 0xff0e, 0, 0, 0x0600]);
        for channel in 0..8 {
            self.registers[0x0c + 5 * channel] = 0x8000;
        }
        self.map_crc = 0;
        self.map_flag = false;
        self.map_changed_ns = None;
        self.resynchronised = false;
        self.restart(now_ns + INITIAL_WAIT * T_MOD_NS);
    }

    fn restart(&mut self, from_ns: u64) {
        self.from_ns = from_ns;
        self.conversions = 0;
        self.store.clear();
    }

    /// Bits of a register change by themselves.
    pub fn flip(&mut self, register: u8, bits: u16, now_ns: u64) {
        self.registers[usize::from(register)] ^= bits;
        self.map_changed_ns = Some(now_ns);
    }

    /// Whether CLKIN runs.
    pub fn set_clock(&mut self, runs: bool, now_ns: u64) {
        if runs && self.stands {
            self.restart(now_ns);
        }
        self.stands = !runs;
    }

    fn osr(&self) -> u64 {
        128 << (self.registers[CLOCK] >> 2 & 7).min(3)
    }

    /// When the filters of the next conversion have all samples, ns.
    fn next_end_ns(&self) -> u64 {
        self.from_ns + (self.conversions + 1) * self.osr() * T_MOD_NS
    }

    /// When the next conversion is ready, ns.
    fn next_ready_ns(&self) -> u64 {
        self.next_end_ns() + self.variant.delay * T_MOD_NS
    }

    /// When DRDY fell last, ns.
    pub fn fell_ns(&mut self, now_ns: u64) -> Option<u64> {
        self.advance(now_ns);
        self.fell_ns
    }

    /// Stores the conversions until now.
    fn advance(&mut self, now_ns: u64) {
        let since_ns = now_ns.saturating_sub(self.from_ns + self.variant.delay * T_MOD_NS);
        let ended = since_ns / (self.osr() * T_MOD_NS);
        if !self.stands && self.store.len() == 2 && self.conversions >= 3 {
            // A full store keeps none of them.
            self.conversions = self.conversions.max(ended.saturating_sub(1));
        }
        while !self.stands && self.next_ready_ns() <= now_ns {
            let conversion = Conversion {
                end_ns: self.next_end_ns(),
                from_ns: self.from_ns,
                osr: self.osr(),
            };
            if !self.is_selected {
                self.fell_ns = Some(self.next_ready_ns());
            }
            self.conversions += 1;
            if self.store.len() < 2 {
                self.store.push_back(conversion);
            }
        }
    }

    /// The level of SYNC/RESET.
    pub fn sync(&mut self, high: bool, now_ns: u64) {
        match self.low_since_ns {
            None if !high => {
                self.low_since_ns = Some(now_ns);
                self.advance(now_ns);
                let period_ns = self.osr() * T_MOD_NS;
                let clock_ns = self.from_ns + self.variant.delay * T_MOD_NS;
                let aligned = now_ns >= clock_ns
                    && (now_ns - clock_ns) % period_ns < T_CLKIN_NS
                    && self.conversions > 0;
                if !self.stands && !aligned {
                    self.restart(now_ns + self.variant.wait * T_MOD_NS);
                    self.resynchronised = true;
                }
            }
            Some(since) if high => {
                self.low_since_ns = None;
                if !self.stands && now_ns - since >= RESET_CLKIN * T_CLKIN_NS {
                    self.reset(now_ns);
                    self.response = None;
                }
            }
            _ => {}
        }
    }

    fn is_in_reset(&self, now_ns: u64) -> bool {
        let low = self.low_since_ns.map_or(0, |since| now_ns - since);
        now_ns < self.ready_ns || low >= RESET_CLKIN * T_CLKIN_NS
    }
}

#[cfg(test)]
#[path = "ads131m08_tests.rs"]
mod tests;

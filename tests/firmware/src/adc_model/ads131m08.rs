//! TI ADS131M08 (SBAS950B) with CLKIN 8 MHz: modulators at 4 MHz, sinc3 filters, a store of two
//! conversions, frames of ten words of 24 bits, DRDY. A [`Variant`] decides where the sheet is silent.
//!
//! DRDY (8.5.1.5, DRDY_FMT 0) falls when a conversion is ready, not while a frame is on the bus. When a frame has ended and
//! another conversion is stored, it falls once more at once (figure 8-21).
//!
//! Not modelled: word lengths other than 24 bits, oversampling above 1024, phases, gains, offsets,
//! global chop, standby, current detection, LOCK, the CRC of commands, t_REGACQ (waits of the
//! program take no time here). Unknown commands are answered as NULL, like invalid ones.

use super::filter::{Conversion, T_MOD_NS, codes};
use super::{Input, Row};
use std::collections::VecDeque;

/// Period of CLKIN, ns.
const T_CLKIN_NS: u64 = 125;
/// t_POR: from the supply until commands are taken, ns.
const POWER_ON_NS: u64 = 250_000;
/// From a reset until the modulators sample (8.4.2), in their periods.
const INITIAL_WAIT: u64 = 256 + 44;
/// A longer low on SYNC/RESET is a reset, in periods of CLKIN.
const RESET_CLKIN: u64 = 2048;
/// The CRC of the registers takes one period of CLKIN a bit: a change shows after two passes.
const MAP_CRC_NS: u64 = 2 * 16 * (LAST as u64 - MODE as u64 + 1) * T_CLKIN_NS;

const ID: usize = 0x00;
const STATUS: usize = 0x01;
const MODE: usize = 0x02;
const CLOCK: usize = 0x03;
const LAST: usize = 0x30;
const REGMAP_CRC: usize = 0x3e;

const REG_CRC_EN: u16 = 1 << 13;

/// Behaviour where the sheet is silent; times in periods of the modulators.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Variant {
    /// From a resynchronisation until the filters take data: none by 8.5.2, 44 by equation 9, 300 by table 8-3.
    pub wait: u64,
    /// From the last sample of a conversion until it is ready: the 44 of equation 9 may lie here.
    pub delay: u64,
    /// A conversion is removed when its frame ends, not when it begins.
    pub late_pop: bool,
}

impl Variant {
    /// All plausible behaviours, the plainest first.
    pub const ALL: [Self; 8] = {
        let times = [(44, 0), (0, 0), (0, 44), (INITIAL_WAIT, 0)];
        let mut all = [Self {
            wait: 44,
            delay: 0,
            late_pop: false,
        }; 8];
        let mut k = 0;
        while k < 8 {
            let (wait, delay) = times[k / 2];
            all[k] = Self {
                wait,
                delay,
                late_pop: k % 2 == 1,
            };
            k += 1;
        }
        all
    };
}

/// The part.
pub struct Ads131m08 {
    /// The behaviour where the sheet is silent.
    pub variant: Variant,
    registers: [u16; 64],
    ready_ns: u64,
    low_since_ns: Option<u64>,
    clocked: bool,
    /// Since when the filters take data, how many conversions ended since, and whether the first
    /// two come from the fast-settling filter.
    from_ns: u64,
    conversions: u64,
    fast: bool,
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

impl Default for Ads131m08 {
    fn default() -> Self {
        let mut new = Self {
            variant: Variant::ALL[0],
            registers: [0; 64],
            ready_ns: POWER_ON_NS,
            low_since_ns: None,
            clocked: true,
            from_ns: 0,
            conversions: 0,
            fast: true,
            store: VecDeque::new(),
            shown: None,
            codes: [0; 6],
            fell_ns: None,
            is_selected: false,
            resynchronised: false,
            map_flag: false,
            map_crc: 0,
            map_changed_ns: None,
            response: None,
            listens: false,
            received: Vec::new(),
            reply: Vec::new(),
        };
        new.power_up(0);
        new
    }
}

/// CRC-16 (CCITT) of the sheet, a byte at a time.
fn crc(bytes: impl IntoIterator<Item = u8>) -> u16 {
    const TABLE: [u16; 256] = {
        let mut table = [0; 256];
        let mut k = 0;
        while k < 256 {
            let (mut crc, mut bit) = ((k as u16) << 8, 0);
            while bit < 8 {
                crc = crc << 1 ^ if crc >> 15 == 1 { 0x1021 } else { 0 };
                bit += 1;
            }
            table[k] = crc;
            k += 1;
        }
        table
    };
    bytes.into_iter().fold(0xffff, |crc, byte| {
        crc << 8 ^ TABLE[usize::from((crc >> 8) as u8 ^ byte)]
    })
}

impl Ads131m08 {
    /// The supply comes.
    pub fn power_up(&mut self, now_ns: u64) {
        self.reset(now_ns + POWER_ON_NS);
        self.response = None;
        self.ready_ns = now_ns + POWER_ON_NS;
    }

    fn reset(&mut self, now_ns: u64) {
        self.registers = [0; 64];
        self.registers[..7].copy_from_slice(&[0x2804, 0x0500, 0x0510, 0xff0e, 0, 0, 0x0600]);
        for channel in 0..8 {
            self.registers[0x0c + 5 * channel] = 0x8000;
        }
        self.map_crc = 0;
        self.map_flag = false;
        self.map_changed_ns = None;
        self.resynchronised = false;
        self.restart(now_ns + INITIAL_WAIT * T_MOD_NS, true);
    }

    fn restart(&mut self, from_ns: u64, fast: bool) {
        self.from_ns = from_ns;
        self.conversions = 0;
        self.fast = fast;
        self.store.clear();
    }

    /// Bits of a register change by themselves.
    pub fn flip(&mut self, register: u8, bits: u16, now_ns: u64) {
        self.registers[usize::from(register)] ^= bits;
        self.map_changed_ns = Some(now_ns);
    }

    /// Whether CLKIN runs.
    pub fn set_clock(&mut self, runs: bool, now_ns: u64) {
        if runs && !self.clocked {
            self.restart(now_ns, false);
        }
        self.clocked = runs;
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
        if self.clocked && self.store.len() == 2 && self.conversions >= 3 {
            // A full store keeps none of them.
            self.conversions = self.conversions.max(ended.saturating_sub(1));
        }
        while self.clocked && self.next_ready_ns() <= now_ns {
            let conversion = Conversion {
                end_ns: self.next_end_ns(),
                from_ns: self.from_ns,
                fast: self.fast && self.conversions < 2,
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
                if self.clocked && !aligned {
                    self.restart(now_ns + self.variant.wait * T_MOD_NS, false);
                    self.resynchronised = true;
                }
            }
            Some(since) if high => {
                self.low_since_ns = None;
                if self.clocked && now_ns - since >= RESET_CLKIN * T_CLKIN_NS {
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

    /// CRC of the registers 0x02 to 0x30.
    fn registers_crc(&self) -> u16 {
        let covered = &self.registers[MODE..=LAST];
        crc(covered.iter().flat_map(|value| value.to_be_bytes()))
    }

    fn check_registers(&mut self, now_ns: u64) {
        let changed = self.map_changed_ns;
        if self.registers[MODE] & REG_CRC_EN != 0
            && changed.is_some_and(|at| now_ns - at >= MAP_CRC_NS)
        {
            self.map_changed_ns = None;
            let now = self.registers_crc();
            self.map_flag |= now != self.map_crc;
            self.map_crc = now;
            self.registers[REGMAP_CRC] = now;
        }
    }

    fn status(&self) -> u16 {
        let ready = if self.store.is_empty() {
            0
        } else {
            self.registers[CLOCK] >> 8
        };
        u16::from(self.resynchronised) << 14
            | u16::from(self.map_flag) << 13
            | self.registers[MODE] & 0x0f00
            | ready
    }

    /// Chip select falls: the frame is fixed.
    pub fn select(
        &mut self,
        now_ns: u64,
        input: &Input,
        faulty: impl FnOnce(Row) -> [i32; 8],
        flipped: bool,
    ) {
        self.received.clear();
        self.reply.clear();
        self.listens = !self.is_in_reset(now_ns);
        if !self.listens {
            return;
        }
        self.advance(now_ns);
        self.is_selected = true;
        self.check_registers(now_ns);
        let status = self.status();
        let response = self.response.unwrap_or_else(|| {
            (self.resynchronised, self.map_flag) = (false, false);
            status
        });
        self.shown = self.store.front().copied();
        if let Some(conversion) = self.shown {
            self.codes = codes(conversion, input);
            if !self.variant.late_pop {
                self.store.pop_front();
            }
        }
        let codes = faulty(self.codes);
        let word = |value: u16| {
            let [high, low] = value.to_be_bytes();
            [high, low, 0]
        };
        self.reply.extend(word(response));
        let enabled = self.registers[CLOCK] >> 8;
        for (channel, code) in codes.into_iter().enumerate() {
            let code = if enabled >> channel & 1 == 1 { code } else { 0 };
            self.reply.extend(&code.to_be_bytes()[1..]);
        }
        self.reply.extend(word(crc(self.reply.iter().copied())));
        if flipped {
            self.reply[8] ^= 0x10;
        }
    }

    /// One byte each way.
    pub fn exchange(&mut self, out: u8) -> u8 {
        self.received.push(out);
        let at = self.received.len() - 1;
        self.reply.get(at).copied().unwrap_or(0)
    }

    /// Chip select rises: the command is executed.
    pub fn deselect(&mut self, now_ns: u64) {
        if !self.listens {
            return;
        }
        self.advance(now_ns);
        if self.variant.late_pop
            && self.shown.is_some()
            && self.store.front() == self.shown.as_ref()
        {
            self.store.pop_front();
        }
        self.is_selected = false;
        if !self.store.is_empty() {
            self.fell_ns = Some(now_ns);
        }
        let word = |k: usize| match self.received.get(k..k + 2) {
            Some(&[high, low]) => u16::from_be_bytes([high, low]),
            _ => 0,
        };
        let (command, data) = (word(0), word(3));
        let register = usize::from(command >> 7 & 0x3f);
        self.response = None;
        match (command >> 13, command & 0x7f) {
            (0, 0x11) if command == 0x0011 => {
                let whole = self.received.len() >= 30;
                self.response = Some(if whole { 0xff28 } else { 0x0011 });
                if whole {
                    self.reset(now_ns);
                }
            }
            (0b101, 0) => {
                self.response = Some(match register {
                    STATUS => self.status(),
                    _ => self.registers[register],
                });
            }
            (0b011, 0) => {
                if !matches!(register, ID | STATUS | REGMAP_CRC) && register <= LAST {
                    let osr = self.osr();
                    self.registers[register] = data;
                    self.map_changed_ns = Some(now_ns);
                    if self.osr() != osr {
                        self.restart(now_ns, false);
                    }
                }
                self.response = Some(0x4000 | command & 0x1f80);
            }
            _ => {}
        }
    }
}

#[cfg(test)]
#[path = "ads131m08_tests.rs"]
mod tests;

//! Frames of the ADS131M08: status, codes, commands, and their checks.

use super::super::filter::codes;
use super::super::{Input, Row};
use super::{Ads131m08, CLOCK, T_CLKIN_NS};

const ID: usize = 0x00;
const STATUS: usize = 0x01;
const MODE: usize = 0x02;
const LAST: usize = 0x30;
const REGMAP_CRC: usize = 0x3e;

const REG_CRC_EN: u16 = 1 << 13;

/// The CRC of the registers takes one period of CLKIN a bit: a change shows after two passes.
const MAP_CRC_NS: u64 = 2 * 16 * (LAST as u64 - MODE as u64 + 1) * T_CLKIN_NS;

/// CRC-16 (CCITT) of the sheet, a byte at a time.
pub(super) fn crc(bytes: impl IntoIterator<Item = u8>) -> u16 {
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
                        self.restart(now_ns);
                    }
                }
                self.response = Some(0x4000 | command & 0x1f80);
            }
            _ => {}
        }
    }
}

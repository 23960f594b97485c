//! Models of the converters, after their data sheets: bytes out for bytes in, registers, a
//! trigger. They play the rows of a log, row k in the kth period after the first tick.

/// Hall codes A, B, C and capacitive codes 1, 2, 3.
pub type Row = [i32; 6];

/// What is wrong with the converter or its wires.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AdcFault {
    /// Nothing.
    None,
    /// The data line always reads this byte.
    Line(u8),
    /// The codes stay as they were when the fault began.
    Stuck,
    /// One bit of every frame of codes is wrong.
    FlippedBit,
    /// One channel, 0 to 5, is at its upper rail.
    Rail(usize),
}

/// Which part is modelled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// TI ADS131M08.
    Ads131m08,
    /// TI ADS8688.
    Ads8688,
}

/// Time from SYNC until the first code of the ADS131M08: three conversions and its own start.
const SETTLE_NS: u64 = 102_000;

/// A converter.
pub struct Adc {
    part: Part,
    /// What is wrong.
    pub fault: AdcFault,
    registers: [u16; 64],
    received: Vec<u8>,
    reply: Vec<u8>,
    /// What the next frame says; `None` for the status.
    response: Option<u16>,
    synced_ns: u64,
    fresh: bool,
    codes: Row,
    frozen: Option<Row>,
    sequence: Vec<u8>,
}

fn crc(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0xffff, |crc, byte| {
        (0..8).fold(crc ^ u16::from(*byte) << 8, |c, _| {
            c << 1 ^ if c >> 15 == 1 { 0x1021 } else { 0 }
        })
    })
}

impl Adc {
    /// A part after power-up.
    pub fn new(part: Part) -> Self {
        let mut adc = Self {
            part,
            fault: AdcFault::None,
            registers: [0; 64],
            received: Vec::new(),
            reply: Vec::new(),
            response: None,
            synced_ns: 0,
            fresh: false,
            codes: [0; 6],
            frozen: None,
            sequence: Vec::new(),
        };
        adc.reset();
        adc
    }

    /// Registers as after power-up: the effect of a reset or of a short loss of power.
    pub fn reset(&mut self) {
        self.registers = [0; 64];
        match self.part {
            Part::Ads131m08 => {
                self.registers[..4].copy_from_slice(&[0x2804, 0x0500, 0x0510, 0xff0e]);
                self.response = Some(0xff28);
            }
            Part::Ads8688 => self.registers[1] = 0xff,
        }
    }

    fn codes(&mut self, row: Row) -> Row {
        let mut codes = match (self.fault, self.frozen) {
            (AdcFault::Stuck, Some(frozen)) => frozen,
            _ => row,
        };
        self.frozen = Some(codes);
        if let AdcFault::Rail(channel) = self.fault {
            codes[channel] = match self.part {
                Part::Ads131m08 => 0x7f_ffff,
                Part::Ads8688 => 0x7fff,
            };
        }
        codes
    }

    /// The rising edge of SYNC at `now_ns`.
    pub fn sync(&mut self, now_ns: u64, row: Row) {
        if self.part == Part::Ads131m08 {
            self.synced_ns = now_ns;
            self.fresh = true;
            self.codes = self.codes(row);
        }
    }

    /// Chip select falls at `now_ns`.
    pub fn select(&mut self, now_ns: u64, row: Row) {
        self.received.clear();
        match self.part {
            Part::Ads131m08 => self.reply = self.frame_of_24_bit_words(now_ns),
            Part::Ads8688 => self.codes = self.codes(row),
        }
    }

    fn frame_of_24_bit_words(&mut self, now_ns: u64) -> Vec<u8> {
        let word = |value: u16| {
            let [high, low] = value.to_be_bytes();
            [high, low, 0]
        };
        let ready = self.fresh && now_ns >= self.synced_ns + SETTLE_NS;
        let on = self.registers[3] >> 8;
        let status = 0x0100 | (self.registers[2] & 0x0400) | 0x4000 | if ready { on } else { 0 };
        let mut bytes = word(self.response.unwrap_or(status)).to_vec();
        for channel in 0..8 {
            let code = self.codes.get(channel).copied().unwrap_or(0);
            let code = if on >> channel & 1 == 1 { code } else { 0 };
            bytes.extend(&code.to_be_bytes()[1..]);
        }
        bytes.extend(word(crc(&bytes)));
        if ready && self.response.is_none() {
            self.fresh = false;
            if self.fault == AdcFault::FlippedBit {
                bytes[8] ^= 0x10;
            }
        }
        bytes
    }

    /// One byte each way.
    pub fn exchange(&mut self, out: u8) -> u8 {
        self.received.push(out);
        if let AdcFault::Line(level) = self.fault {
            return level;
        }
        let at = self.received.len() - 1;
        match self.part {
            Part::Ads131m08 => self.reply.get(at).copied().unwrap_or(0),
            Part::Ads8688 => self.byte_behind_the_command(at),
        }
    }

    fn byte_behind_the_command(&mut self, at: usize) -> u8 {
        if at == 2 {
            let (head, value) = (self.received[0], self.received[1]);
            let register = usize::from(head >> 1);
            self.reply = if head == 0 && value == 0 {
                let channel = if self.sequence.is_empty() {
                    0
                } else {
                    self.sequence.remove(0)
                };
                self.sequence.push(channel);
                let code = self.codes.get(usize::from(channel)).copied().unwrap_or(0);
                let [high, mut low] = ((code + 0x8000) as u16).to_be_bytes();
                let features = self.registers[3];
                let mut sign = (channel << 4) | ((features >> 6 & 3) as u8 * 4);
                if features & 7 != 2 {
                    sign = 0;
                }
                if self.fault == AdcFault::FlippedBit {
                    sign ^= 0x10;
                    low ^= 1;
                }
                vec![high, low, sign]
            } else if register < 0x40 && head < 0x80 {
                if head & 1 == 1 {
                    self.registers[register] = value.into();
                }
                vec![self.registers[register] as u8, 0, 0]
            } else {
                vec![0, 0, 0]
            };
        }
        at.checked_sub(2)
            .and_then(|k| self.reply.get(k))
            .copied()
            .unwrap_or(0)
    }

    /// Chip select rises.
    pub fn deselect(&mut self) {
        let word = |k: usize| match self.received.get(k..k + 2) {
            Some(&[high, low]) => u16::from_be_bytes([high, low]),
            _ => 0,
        };
        match self.part {
            Part::Ads131m08 => {
                let (command, data) = (word(0), word(3));
                let register = usize::from(command >> 7 & 0x3f);
                self.response = None;
                match command >> 13 {
                    _ if command == 0x0011 && self.received.len() >= 30 => self.reset(),
                    0b101 => self.response = Some(self.registers[register]),
                    0b011 => {
                        self.registers[register] = data;
                        self.response = Some(0x4000 | command & 0x1f80);
                    }
                    _ => {}
                }
            }
            Part::Ads8688 => match word(0) {
                0x8500 => self.reset(),
                0xa000 => {
                    let on = self.registers[1];
                    self.sequence = (0..8).filter(|k| on >> k & 1 == 1).collect();
                }
                _ => {}
            },
        }
    }
}

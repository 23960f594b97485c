//! TI ADS8688 (SBAS582C): a frame's answer follows 16 bits of command; the channel that the
//! previous frame selected is sampled when chip select falls.

/// From power-up until the reference is right, ns.
const REFERENCE_NS: u64 = 15_000_000;
/// RST/PD: low for as long is power-down, for less a reset, ns.
const POWER_DOWN_NS: u64 = 400;

const AUTO_SEQ_EN: usize = 0x01;
const POWER_DOWN: usize = 0x02;
const FEATURES: usize = 0x03;
const REGISTERS: usize = 0x40;

/// The part.
pub struct Ads8688 {
    powered_ns: u64,
    low_since_ns: Option<u64>,
    registers: [u8; REGISTERS],
    /// Channel that the next frame samples; `None` outside of its conversion modes.
    next: Option<u8>,
    /// Whether that was chosen by MAN_Ch_n, and stays.
    is_manual: bool,
    /// Channel and code of this frame.
    sampled: Option<(u8, i32)>,
    received: Vec<u8>,
}

impl Ads8688 {
    /// A part whose supply came at time 0.
    pub fn new() -> Self {
        let mut new = Self {
            powered_ns: 0,
            low_since_ns: None,
            registers: [0; REGISTERS],
            next: None,
            is_manual: false,
            sampled: None,
            received: Vec::new(),
        };
        new.reset();
        new
    }

    fn reset(&mut self) {
        self.registers = [0; REGISTERS];
        self.registers[AUTO_SEQ_EN] = 0xff;
        self.next = None;
    }

    /// The supply comes.
    pub fn power_up(&mut self, now_ns: u64) {
        self.reset();
        self.powered_ns = now_ns;
    }

    /// Bits of a register change by themselves.
    pub fn flip(&mut self, register: u8, bits: u16) {
        self.registers[usize::from(register)] ^= bits as u8;
    }

    /// The level of RST/PD.
    pub fn reset_pin(&mut self, high: bool, now_ns: u64) {
        match self.low_since_ns {
            None if !high => self.low_since_ns = Some(now_ns),
            Some(since) if high => {
                self.low_since_ns = None;
                if now_ns - since >= POWER_DOWN_NS {
                    self.power_up(now_ns);
                } else {
                    self.reset();
                }
            }
            _ => {}
        }
    }

    /// Chip select falls; `input` is what the inputs have now.
    pub fn select(
        &mut self,
        now_ns: u64,
        input: [i32; 8],
        faulty: impl FnOnce([i32; 8]) -> [i32; 8],
    ) {
        self.received.clear();
        self.sampled = self.next.map(|channel| {
            let settled = (now_ns - self.powered_ns).min(REFERENCE_NS) as f64 / REFERENCE_NS as f64;
            // A reference that is too low gives codes that are too large.
            let codes = input.map(|code| (f64::from(code) / settled.max(1e-3)).round() as i32);
            let code = faulty(codes)[usize::from(channel)];
            // A channel that is powered down is not sampled.
            let code = code * i32::from(self.registers[POWER_DOWN] >> channel & 1 == 0);
            // Ranges of +-2.5, 1.25 and 0.625 times the reference; unipolar ones from 0.
            let code = match self.range(channel) {
                range @ 0..=2 => code << range,
                range => (code << (range & 3)) - 0x8000,
            };
            (channel, code.clamp(-32768, 32767))
        });
    }

    fn range(&self, channel: u8) -> u8 {
        self.registers[0x05 + usize::from(channel)] & 7
    }

    /// One byte each way.
    pub fn exchange(&mut self, out: u8, flipped: bool) -> u8 {
        self.received.push(out);
        let at = self.received.len() - 1;
        let (Some(k), &[head, value, ..]) = (at.checked_sub(2), self.received.as_slice()) else {
            return 0;
        };
        if self.low_since_ns.is_some() {
            return 0;
        }
        let register = usize::from(head >> 1);
        if (1..REGISTERS).contains(&register) {
            if head & 1 == 1 {
                self.registers[register] = value;
            }
            return if k == 0 { self.registers[register] } else { 0 };
        }
        let Some((channel, code)) = self.sampled else {
            return 0;
        };
        let [high, mut low] = ((code + 0x8000) as u16).to_be_bytes();
        let features = self.registers[FEATURES];
        // Bits 8 to 5, 4 to 3 and 2 to 0 of what follows 16 bits of code.
        let fields = [channel, features >> 6, self.range(channel)];
        let count = usize::from(features & 7).min(3);
        let bits = [5, 3, 0];
        let signature: u16 = (0..count)
            .map(|k| u16::from(fields[k]) << bits[k])
            .fold(0, |all, field| all | field);
        let [mut first, last] = (signature << 7).to_be_bytes();
        if flipped {
            first ^= 0x10;
            low ^= 1;
        }
        [high, low, first, last].get(k).copied().unwrap_or(0)
    }

    /// Chip select rises: the command is executed.
    pub fn deselect(&mut self) {
        let &[head, value, ..] = self.received.as_slice() else {
            return;
        };
        let on = self.registers[AUTO_SEQ_EN] & !self.registers[POWER_DOWN];
        let sequence = |after: Option<u8>| {
            let later = |k: &u8| after.is_none_or(|after| *k > after);
            let enabled = || (0..8u8).filter(|k| on >> k & 1 == 1);
            enabled().find(later).or_else(|| enabled().next())
        };
        let command = u16::from_be_bytes([head, value]);
        let was_manual = std::mem::take(&mut self.is_manual);
        match command {
            0x0000 if was_manual => self.is_manual = true,
            0xc000..=0xdc00 if command & 0x3ff == 0 => {
                self.next = Some((command >> 10 & 7) as u8);
                self.is_manual = true;
            }
            0x0000 => self.next = self.next.and_then(|channel| sequence(Some(channel))),
            0x8500 => self.reset(),
            0xa000 => self.next = sequence(None),
            // Registers: back to a conversion only by AUTO_RST.
            _ => self.next = None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(part: &mut Ads8688, now_ns: u64, command: u16) -> [u8; 4] {
        part.select(now_ns, [10, -20, 30, -40, 50, -60, 70, -80], |codes| codes);
        let [high, low] = command.to_be_bytes();
        let read = [high, low, 0, 0, 0, 0].map(|out| part.exchange(out, false));
        part.deselect();
        [read[2], read[3], read[4], read[5]]
    }

    const LATER_NS: u64 = 20_000_000;

    #[test]
    fn registers_have_the_values_of_the_sheet_and_keep_what_is_written() {
        let mut part = Ads8688::new();
        let read = |part: &mut _, register: u16| frame(part, LATER_NS, register << 9)[0];
        let at_reset = [0xff, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        for (register, value) in (1..).zip(at_reset) {
            assert_eq!(read(&mut part, register), value);
        }
        assert_eq!(
            frame(&mut part, LATER_NS, 0x03 << 9 | 1 << 8 | 0x42)[0],
            0x42
        );
        assert_eq!(read(&mut part, 0x03), 0x42);
        frame(&mut part, LATER_NS, 0x8500);
        assert_eq!(read(&mut part, 0x03), 0);
    }

    #[test]
    fn a_sequence_samples_its_channels_one_frame_after_the_command() {
        let mut part = Ads8688::new();
        frame(&mut part, LATER_NS, 0x01 << 9 | 1 << 8 | 0b101);
        frame(&mut part, LATER_NS, 0x03 << 9 | 1 << 8 | 0x42);
        frame(&mut part, LATER_NS, 0xa000);
        assert_eq!(frame(&mut part, LATER_NS, 0), [0x80, 10, 0x04, 0]);
        assert_eq!(frame(&mut part, LATER_NS, 0), [0x80, 30, 0x24, 0]);
        assert_eq!(frame(&mut part, LATER_NS, 0), [0x80, 10, 0x04, 0]);
        // With its range: bit 0 of it is the 41st of the frame.
        frame(&mut part, LATER_NS, 0x03 << 9 | 1 << 8 | 0x43);
        frame(&mut part, LATER_NS, 0x05 << 9 | 1 << 8 | 0b001);
        frame(&mut part, LATER_NS, 0xa000);
        assert_eq!(frame(&mut part, LATER_NS, 0), [0x80, 20, 0x04, 0x80]);
        // A register access ends the sequence.
        frame(&mut part, LATER_NS, 0x01 << 9);
        assert_eq!(frame(&mut part, LATER_NS, 0), [0; 4]);
    }

    #[test]
    fn a_channel_chosen_by_hand_stays_until_a_sequence_starts() {
        let mut part = Ads8688::new();
        frame(&mut part, LATER_NS, 0x01 << 9 | 1 << 8 | 0b101);
        frame(&mut part, LATER_NS, 0x03 << 9 | 1 << 8 | 0x42);
        frame(&mut part, LATER_NS, 0xa000);
        assert_eq!(frame(&mut part, LATER_NS, 0xd800), [0x80, 10, 0x04, 0]);
        assert_eq!(frame(&mut part, LATER_NS, 0), [0x80, 70, 0x64, 0]);
        assert_eq!(frame(&mut part, LATER_NS, 0xa000), [0x80, 70, 0x64, 0]);
        assert_eq!(frame(&mut part, LATER_NS, 0), [0x80, 10, 0x04, 0]);
    }

    #[test]
    fn codes_are_wrong_until_the_reference_has_settled() {
        let mut part = Ads8688::new();
        let code = |part: &mut _, now_ns| {
            frame(part, now_ns, 0xa000);
            frame(part, now_ns, 0)[1]
        };
        assert_eq!(code(&mut part, REFERENCE_NS / 2), 20);
        assert_eq!(code(&mut part, REFERENCE_NS), 10);
        part.reset_pin(false, LATER_NS);
        part.reset_pin(true, LATER_NS + 100);
        assert_eq!(code(&mut part, LATER_NS + 200), 10);
        part.reset_pin(false, LATER_NS);
        part.reset_pin(true, LATER_NS + 400);
        assert_eq!(code(&mut part, LATER_NS + REFERENCE_NS / 2 + 400), 20);
    }
}

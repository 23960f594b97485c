//! The independent watchdog, from RM0090 section 21: it counts down from 0xfff once started; its
//! divider and reload value can be written after 0x5555 only, and are taken over five periods of
//! its oscillator later; 0xaaaa loads the reload value.

/// Nominal frequency of its oscillator, Hz.
const LSI_HZ: u64 = 32_000;
const S: u64 = 1_000_000_000;
/// Periods of the oscillator until a written value is taken over.
const UPDATE_PERIODS: u64 = 5;

/// The watchdog.
#[derive(Clone, Copy)]
pub struct Watchdog {
    unlocked: bool,
    divider: u64,
    reload: u64,
    new_divider: Option<(u64, u64)>,
    new_reload: Option<(u64, u64)>,
    /// The count at a time, once it runs.
    count: Option<(u64, u64)>,
    /// How often it was fed.
    pub fed: u64,
}

impl Watchdog {
    /// As after a reset.
    pub const fn new() -> Self {
        Self {
            unlocked: false,
            divider: 4,
            reload: 0xfff,
            new_divider: None,
            new_reload: None,
            count: None,
            fed: 0,
        }
    }

    fn period_ns(&self) -> u64 {
        self.divider * S / LSI_HZ
    }

    /// When it bites, if it runs.
    pub fn bites_ns(&self) -> Option<u64> {
        let (count, at_ns) = self.count?;
        Some(at_ns + (count + 1) * self.period_ns())
    }

    /// Takes over what was written.
    pub fn advance(&mut self, now_ns: u64) {
        if self.count.is_none() {
            return;
        }
        if let Some((divider, at)) = self.new_divider.filter(|(_, at)| *at <= now_ns) {
            if let Some((count, since)) = self.count {
                let passed = (at - since) / self.period_ns();
                self.count = Some((count.saturating_sub(passed), at));
            }
            self.divider = divider;
            self.new_divider = None;
        }
        if let Some((reload, _)) = self.new_reload.filter(|(_, at)| *at <= now_ns) {
            self.reload = reload;
            self.new_reload = None;
        }
    }

    /// A register.
    pub fn read(&mut self, offset: usize, now_ns: u64) -> u32 {
        self.advance(now_ns);
        match offset {
            0x0c => {
                u32::from(self.new_divider.is_some()) | u32::from(self.new_reload.is_some()) << 1
            }
            _ => 0,
        }
    }

    /// Writes a register.
    pub fn write(&mut self, offset: usize, value: u32, now_ns: u64) {
        self.advance(now_ns);
        let value = u64::from(value);
        // Without the oscillator nothing is taken over.
        let taken_over = now_ns + UPDATE_PERIODS * S / LSI_HZ;
        match offset {
            0x00 => {
                self.unlocked = value == 0x5555;
                match value {
                    0xcccc => self.start(now_ns),
                    0xaaaa => {
                        self.fed += 1;
                        self.count = self.count.map(|_| (self.reload, now_ns));
                    }
                    _ => {}
                }
            }
            0x04 if self.unlocked => self.new_divider = Some((4 << (value & 7).min(6), taken_over)),
            0x08 if self.unlocked => self.new_reload = Some((value & 0xfff, taken_over)),
            _ => {}
        }
    }

    fn start(&mut self, now_ns: u64) {
        let after = now_ns + UPDATE_PERIODS * S / LSI_HZ;
        self.count = Some(self.count.unwrap_or((0xfff, now_ns)));
        self.new_divider = self
            .new_divider
            .map(|(divider, at)| (divider, at.max(after)));
        self.new_reload = self.new_reload.map(|(reload, at)| (reload, at.max(after)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn the_first_period_is_512_ms_and_the_written_one_counts_once_it_is_fed() {
        let mut watchdog = Watchdog::new();
        watchdog.write(0, 0xcccc, 0);
        assert_eq!(watchdog.bites_ns(), Some(512 * MS));
        watchdog.write(0, 0x5555, 0);
        watchdog.write(4, 1, 0);
        watchdog.write(8, 79, 0);
        assert_eq!(watchdog.read(0xc, 0), 0b11);
        assert_eq!(watchdog.read(0xc, MS), 0);
        assert!(watchdog.bites_ns() > Some(500 * MS));
        watchdog.write(0, 0xaaaa, MS);
        assert_eq!(watchdog.bites_ns(), Some(21 * MS));
    }
}

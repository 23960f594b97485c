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
    /// Written values, and when they are taken over: divider and reload.
    new: [Option<(u64, u64)>; 2],
    /// The count at a time, once it runs.
    count: Option<(u64, u64)>,
    /// How often it was fed.
    pub fed: u64,
}

impl Default for Watchdog {
    fn default() -> Self {
        Self {
            unlocked: false,
            divider: 4,
            reload: 0xfff,
            new: [None; 2],
            count: None,
            fed: 0,
        }
    }
}

impl Watchdog {
    /// Stops and resets the registers.
    pub fn reset(&mut self) {
        *self = Self {
            fed: self.fed,
            ..Self::default()
        };
    }

    fn period_ns(&self) -> u64 {
        self.divider * S / LSI_HZ
    }

    /// When it bites, if it runs.
    pub fn bites_ns(&self) -> Option<u64> {
        let (count, at_ns) = self.count?;
        Some(at_ns + (count + 1) * self.period_ns())
    }

    /// Takes over what was written. Without the oscillator nothing is taken over.
    pub fn advance(&mut self, now_ns: u64) {
        let Some((count, since)) = self.count else {
            return;
        };
        let is_due = |new: &mut (u64, u64)| new.1 <= now_ns;
        if let Some((divider, at)) = self.new[0].take_if(is_due) {
            let passed = (at - since) / self.period_ns();
            self.count = Some((count.saturating_sub(passed), at));
            self.divider = divider;
        }
        if let Some((reload, _)) = self.new[1].take_if(is_due) {
            self.reload = reload;
        }
    }

    /// A register.
    pub fn read(&mut self, offset: usize, now_ns: u64) -> u32 {
        self.advance(now_ns);
        match (offset, self.new.map(|new| u32::from(new.is_some()))) {
            (0x0c, [divider, reload]) => divider | reload << 1,
            _ => 0,
        }
    }

    /// Writes a register.
    pub fn write(&mut self, offset: usize, value: u32, now_ns: u64) {
        self.advance(now_ns);
        let value = u64::from(value);
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
            0x04 if self.unlocked => self.new[0] = Some((4 << (value & 7).min(6), taken_over)),
            0x08 if self.unlocked => self.new[1] = Some((value & 0xfff, taken_over)),
            _ => {}
        }
    }

    fn start(&mut self, now_ns: u64) {
        let after = now_ns + UPDATE_PERIODS * S / LSI_HZ;
        self.count = Some(self.count.unwrap_or((0xfff, now_ns)));
        for (_, at) in self.new.iter_mut().flatten() {
            *at = after.max(*at);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn the_first_period_is_512_ms_and_the_written_one_counts_once_it_is_fed() {
        let mut watchdog = Watchdog::default();
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

//! Oscillators, PLL and clock security, from RM0090 section 7 and DS8626; and the core's system
//! timer, from PM0214.

/// Lock time of the PLL, at most (DS8626, table of the main PLL).
const PLL_LOCK_NS: u64 = 300_000;

const HSE_ON: u32 = 1 << 16;
const CSS_ON: u32 = 1 << 19;
const PLL_ON: u32 = 1 << 24;
const PLL_FROM_HSE: u32 = 1 << 22;
const CSS_FLAG: u32 = 1 << 7;
const CSS_CLEAR: u32 = 1 << 23;

/// What the PLL locks to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pll {
    /// Any source.
    Sound,
    /// The internal oscillator only: the crystal has a wrong frequency.
    NotToCrystal,
    /// No source.
    Dead,
}

/// The clocks.
pub struct Clocks {
    cr: u32,
    pllcfgr: u32,
    cfgr: u32,
    cir: u32,
    hse_since: u64,
    /// When the PLL was switched on.
    pub pll_since: u64,
    /// How long a crystal takes to start, ns; typically 2 ms (DS8626, table of the HSE oscillator).
    pub crystal_start_ns: u64,
    /// Whether the crystal oscillates once it is switched on.
    pub crystal: bool,
    /// The PLL.
    pub pll: Pll,
    /// The system timer: control, reload, and when it was started.
    timer: (u32, u32, u64),
}

impl Default for Clocks {
    fn default() -> Self {
        Self {
            cr: 0x83,
            pllcfgr: 0x2400_3010,
            cfgr: 0,
            cir: 0,
            hse_since: 0,
            pll_since: 0,
            crystal_start_ns: 2_000_000,
            crystal: true,
            pll: Pll::Sound,
            timer: (0, 0, 0),
        }
    }
}

impl Clocks {
    /// Resets the registers.
    pub fn reset(&mut self) {
        let Self { crystal, pll, .. } = *self;
        *self = Self {
            crystal,
            pll,
            ..Self::default()
        };
    }

    fn hse_ready(&self, now_ns: u64) -> bool {
        self.crystal && self.cr & HSE_ON != 0 && now_ns >= self.hse_since + self.crystal_start_ns
    }

    fn pll_ready(&self, now_ns: u64) -> bool {
        let by_crystal = self.pllcfgr & PLL_FROM_HSE != 0;
        let locks = match self.pll {
            Pll::Sound => !by_crystal || self.hse_ready(now_ns),
            Pll::NotToCrystal => !by_crystal,
            Pll::Dead => false,
        };
        locks && self.cr & PLL_ON != 0 && now_ns >= self.pll_since + PLL_LOCK_NS
    }

    fn runs_by_pll(&self, now_ns: u64) -> bool {
        self.cfgr & 3 == 2 && self.pll_ready(now_ns)
    }

    /// Whether the core has lost its clock: its crystal stopped, and nothing watches it.
    pub fn stands(&self, now_ns: u64) -> bool {
        self.cfgr & 3 == 2 && !self.pll_ready(now_ns)
    }

    /// Whether the clock security asks for the non-maskable interrupt.
    pub const fn interrupts(&self) -> bool {
        self.cir & CSS_FLAG != 0
    }

    /// The crystal stops. With clock security the core goes on by the internal oscillator.
    pub fn stop_crystal(&mut self, now_ns: u64) {
        let watched = self.cr & CSS_ON != 0 && self.hse_ready(now_ns);
        self.crystal = false;
        if watched {
            self.cir |= CSS_FLAG;
            self.cr &= !(HSE_ON | CSS_ON);
            if self.pllcfgr & PLL_FROM_HSE != 0 {
                self.cr &= !PLL_ON;
            }
            self.cfgr &= !3;
        }
    }

    /// A register of RCC.
    pub fn read(&self, offset: usize, now_ns: u64) -> u32 {
        let on = |bit, is| if is { bit } else { 0 };
        match offset {
            0x00 => {
                self.cr
                    | on(HSE_ON << 1, self.hse_ready(now_ns))
                    | on(PLL_ON << 1, self.pll_ready(now_ns))
            }
            0x04 => self.pllcfgr,
            0x08 => self.cfgr | on(2 << 2, self.runs_by_pll(now_ns)),
            _ => self.cir,
        }
    }

    /// Writes a register of RCC.
    pub fn write(&mut self, offset: usize, value: u32, now_ns: u64) {
        const WRITABLE: u32 = 1 | 0x1f << 3 | HSE_ON | 1 << 18 | CSS_ON | PLL_ON | 1 << 26;
        match offset {
            0x00 => {
                let rises = value & !self.cr;
                if rises & HSE_ON != 0 {
                    self.hse_since = now_ns;
                }
                if rises & PLL_ON != 0 {
                    self.pll_since = now_ns;
                }
                self.cr = self.cr & !WRITABLE | value & WRITABLE;
            }
            // Written only while the PLL is off.
            0x04 if self.cr & PLL_ON == 0 => self.pllcfgr = value,
            0x04 => {}
            0x08 => self.cfgr = value & !0xc,
            _ => {
                let kept = if value & CSS_CLEAR == 0 { CSS_FLAG } else { 0 };
                self.cir &= kept;
            }
        }
    }

    /// A register of the system timer, by its distance from the control register.
    pub fn read_timer(&mut self, offset: usize, now_ns: u64) -> u32 {
        let (control, reload, since) = self.timer;
        let mhz = if self.runs_by_pll(now_ns) { 168 } else { 16 };
        let wraps_ns = since + u64::from(reload + 1) * 1000 / mhz;
        let wrapped = control & 1 != 0 && now_ns >= wraps_ns;
        match offset {
            0 if wrapped => {
                self.timer.2 = wraps_ns;
                control | 1 << 16
            }
            0 => control,
            _ => reload,
        }
    }

    /// Writes a register of the system timer.
    pub fn write_timer(&mut self, offset: usize, value: u32, now_ns: u64) {
        match offset {
            0 => {
                if value & 1 != 0 && self.timer.0 & 1 == 0 {
                    self.timer.2 = now_ns;
                }
                self.timer.0 = value & 7;
            }
            4 => self.timer.1 = value & 0xff_ffff,
            _ => self.timer.2 = now_ns,
        }
    }
}

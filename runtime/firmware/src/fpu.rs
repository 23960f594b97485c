//! The rounding mode that the decoder's bits depend on.
//!
//! FPSCR must be as after a reset: round to nearest, subnormal numbers kept. An interrupt of
//! some library may change it and not restore it. The core sets it for each interrupt that uses
//! the FPU, but only while FPCCR.ASPEN is set, and from FPDSCR. So these two are checked at
//! start, and FPSCR before and after each decoding.

/// AHP, DN, FZ and RMode: what changes results.
pub const SETTINGS: u32 = 0b1_1111 << 22;

/// Restores the settings.
pub trait FpuSettings {
    /// Sets them as after a reset, and says whether they were different.
    fn restore(&mut self) -> bool;
}

/// The FPU of a Cortex-M4F.
#[derive(Clone, Copy, Debug, Default)]
pub struct Fpu;

#[cfg(target_os = "none")]
impl FpuSettings for Fpu {
    #[inline(always)]
    fn restore(&mut self) -> bool {
        let fpscr: u32;
        // SAFETY: reads a register of the FPU, which the start-up code has switched on. The compiler
        // must assume that it touches memory, so it moves no call past it.
        unsafe {
            core::arch::asm!("vmrs {}, fpscr", out(reg) fpscr, options(nostack, preserves_flags))
        };
        let changed = fpscr & SETTINGS != 0;
        if changed {
            // SAFETY: the settings that every function of this program assumes.
            unsafe {
                core::arch::asm!("vmsr fpscr, {}", in(reg) 0u32, options(nostack, preserves_flags))
            };
        }
        changed
    }
}

#[cfg(target_os = "none")]
impl Fpu {
    /// Whether the core sets FPSCR for interrupts, and sets it as after a reset.
    pub fn defaults_are_sound() -> bool {
        const FPCCR: *const u32 = 0xe000_ef34 as *const u32;
        const FPDSCR: *const u32 = 0xe000_ef3c as *const u32;
        const ASPEN: u32 = 1 << 31;
        // SAFETY: two registers that every Cortex-M4F has; reading them changes nothing.
        let (fpccr, fpdscr) = unsafe { (FPCCR.read_volatile(), FPDSCR.read_volatile()) };
        fpccr & ASPEN != 0 && fpdscr & SETTINGS == 0
    }
}

//! The rounding mode that the decoder's bits depend on.
//!
//! FPSCR must be as after a reset: round to nearest, subnormal numbers kept. An interrupt of
//! some library may change it and not restore it. The core sets it for each interrupt that uses
//! the FPU, but only while FPCCR.ASPEN is set, and from FPDSCR. So these two are checked at
//! start, and FPSCR before and after each decoding.

/// AHP, DN, FZ and RMode: the settings that change results.
#[cfg(all(target_arch = "arm", target_abi = "eabihf"))]
const SETTINGS: u32 = 0b1_1111 << 22;

/// Sets the FPU as after a reset. Returns whether its settings were different.
#[cfg(all(target_arch = "arm", target_abi = "eabihf"))]
#[inline(always)]
pub fn restore() -> bool {
    let fpscr: u32;
    // SAFETY: reads a register of the FPU, which the start-up code has switched on. The compiler must assume
    // that it touches memory, so it moves no call past it.
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

/// A core without FPU has no settings, and a host's settings never change.
#[cfg(not(all(target_arch = "arm", target_abi = "eabihf")))]
pub const fn restore() -> bool {
    false
}

/// Whether the core sets FPSCR for interrupts, and sets it as after a reset.
#[cfg(all(target_arch = "arm", target_abi = "eabihf"))]
pub fn defaults_are_sound() -> bool {
    const FPCCR: *const u32 = 0xe000_ef34 as *const u32;
    const FPDSCR: *const u32 = 0xe000_ef3c as *const u32;
    const ASPEN: u32 = 1 << 31;
    // SAFETY: two registers that every Cortex-M4F has; reading them changes nothing.
    let (fpccr, fpdscr) = unsafe { (FPCCR.read_volatile(), FPDSCR.read_volatile()) };
    fpccr & ASPEN != 0 && fpdscr & SETTINGS == 0
}

/// There is nothing to set.
#[cfg(not(all(target_arch = "arm", target_abi = "eabihf")))]
pub const fn defaults_are_sound() -> bool {
    true
}

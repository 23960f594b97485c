//! What the images share: the way to the host through semihosting, the check of the FPU's
//! settings, and the panic handler that does not exist.
//!
//! [`panic`] calls a function that no object file has. If the linker finds it needed, some
//! panic can be reached, and there is no image: so every image that links is free of panics.
#![no_std]

#[path = "../../src/job.rs"]
pub mod job;
pub mod semihost;

unsafe extern "C" {
    fn a_panic_can_be_reached() -> !;
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    // SAFETY: never executed: an image with this call does not link.
    unsafe { a_panic_can_be_reached() }
}

/// Whether the FPU rounds to nearest and keeps subnormal numbers, as after a reset. Always
/// so without an FPU.
pub fn fpu_at_reset() -> bool {
    #[cfg(target_abi = "eabihf")]
    {
        // AHP, DN, FZ, RMode.
        const SETTINGS: u32 = 0b11111 << 22;
        let fpscr: u32;
        // SAFETY: reads a register of the FPU, which the start-up code has switched on.
        unsafe {
            core::arch::asm!("vmrs {}, fpscr", out(reg) fpscr, options(nomem, nostack, preserves_flags));
        }
        fpscr & SETTINGS == 0
    }
    #[cfg(not(target_abi = "eabihf"))]
    true
}

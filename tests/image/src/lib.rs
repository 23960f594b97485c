//! What the images share: the way to the host through semihosting, the check of the FPU's
//! settings, and the panic handler that does not exist.
//!
//! [`panic`] calls a function that no object file has. If the linker finds it needed, some
//! panic can be reached, and there is no image: so every image that links is free of panics.
#![no_std]

#[cfg(feature = "tasks")]
pub mod example;
#[path = "../../src/job.rs"]
pub mod job;
pub mod semihost;

#[cfg(not(feature = "tasks"))]
unsafe extern "C" {
    fn a_panic_can_be_reached() -> !;
}

/// The examples of tasks link code of others, which may panic.
#[cfg(feature = "tasks")]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    semihost::exit(false)
}

#[cfg(not(feature = "tasks"))]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    // SAFETY: never executed: an image with this call does not link.
    unsafe { a_panic_can_be_reached() }
}

/// The bits of FPSCR that change results: AHP, DN, FZ, RMode. Zero without an FPU.
pub fn fpu_settings() -> u32 {
    #[cfg(target_abi = "eabihf")]
    {
        let fpscr: u32;
        // SAFETY: reads a register of the FPU, which the start-up code has switched on.
        unsafe {
            core::arch::asm!("vmrs {}, fpscr", out(reg) fpscr, options(nomem, nostack, preserves_flags));
        }
        fpscr & (0b11111 << 22)
    }
    #[cfg(not(target_abi = "eabihf"))]
    0
}

/// Whether the FPU is set as after a reset, by its register and by what it computes.
pub fn fpu_at_reset() -> bool {
    fpu_settings() == 0 && runtime::arithmetic::check().is_ok()
}

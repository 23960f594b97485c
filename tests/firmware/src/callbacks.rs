//! What the emulator calls: accesses to what is no plain memory, and hooks at addresses of the program.

use crate::peripherals::Peripherals;
use crate::unicorn::{Handle, Register, Stop};
use std::ffi::{c_uint, c_void};

/// What a callback needs.
pub struct Context {
    /// The chip, which lives as long as the emulator.
    pub chip: *mut Peripherals,
    /// Where the range of addresses begins.
    pub start: u64,
    /// Ends a run of the core.
    pub stop: Stop,
    /// Writes a register of the core.
    pub write: Register,
}

impl Context {
    /// Calls `access` with the chip, and ends the run if the core executes nothing more.
    fn access<T>(&self, handle: Handle, access: impl FnOnce(&mut Peripherals) -> T) -> T {
        // SAFETY: the chip is a box that `Machine` keeps, and touches only between two runs.
        let chip = unsafe { &mut *self.chip };
        let result = access(chip);
        if chip.stops() || chip.memory_fault {
            // SAFETY: the function of the library that ends a run of this emulator.
            unsafe { (self.stop)(handle) };
        }
        result
    }
}

/// The context that `Machine` has given.
fn context<'c>(user: *mut c_void) -> &'c Context {
    // SAFETY: `user` is a `Context` that `Machine` has leaked.
    unsafe { &*user.cast::<Context>() }
}

/// A read of 1 to 4 bytes.
pub extern "C" fn read(handle: Handle, offset: u64, bytes: c_uint, user: *mut c_void) -> u64 {
    let context = context(user);
    context.access(handle, |chip| chip.load(context.start + offset, bytes))
}

/// A write of 1 to 4 bytes.
pub extern "C" fn write(handle: Handle, offset: u64, bytes: c_uint, value: u64, user: *mut c_void) {
    let context = context(user);
    context.access(handle, |chip| {
        chip.store(context.start + offset, bytes, value as u32);
    });
}

/// Counts an instruction.
pub extern "C" fn count(_: Handle, _: u64, _: u32, user: *mut c_void) {
    // SAFETY: as in `Context::access`.
    unsafe { (*context(user).chip).instructions += 1 };
}

/// Changes the registers of the core that [`Peripherals::inject`] has.
pub extern "C" fn inject(handle: Handle, _: u64, _: u32, user: *mut c_void) {
    let context = context(user);
    // SAFETY: as in `Context::access`.
    for (register, mut value) in unsafe { (*context.chip).injected() } {
        // SAFETY: the registers that are changed have 32 bits.
        unsafe { (context.write)(handle, register, (&raw mut value).cast()) };
    }
}

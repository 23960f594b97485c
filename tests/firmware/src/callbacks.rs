//! What the emulator calls: accesses to registers and to memory that is not there, and hooks at
//! addresses of the program.

use crate::peripherals::Peripherals;
use crate::random_model;
use crate::unicorn::{Handle, Register, register};
use std::ffi::{c_uint, c_void};

/// Between the return address of interrupts and RAM: accesses do nothing, unless the memory
/// protection makes them faults.
pub const BELOW_RAM: (u64, u64) = (0x1fff_1000, 0xf000);

/// A register of a peripheral.
pub extern "C" fn read(handle: Handle, offset: u64, _: c_uint, user: *mut c_void) -> u64 {
    // SAFETY: `user` is the `Peripherals` that `Machine` keeps in its box.
    let chip = unsafe { &mut *user.cast::<Peripherals>() };
    let word = chip.read(offset as usize & !3);
    stop_if_it_stops(handle, chip);
    u64::from(word >> (8 * (offset & 3)))
}

/// Memory that is not there.
pub extern "C" fn read_below_ram(handle: Handle, offset: u64, _: c_uint, user: *mut c_void) -> u64 {
    fault_if_protected(handle, offset, false, user);
    0
}

/// See [`read_below_ram`].
pub extern "C" fn write_below_ram(
    handle: Handle,
    offset: u64,
    _: c_uint,
    _: u64,
    user: *mut c_void,
) {
    fault_if_protected(handle, offset, true, user);
}

fn fault_if_protected(handle: Handle, offset: u64, is_write: bool, user: *mut c_void) {
    // SAFETY: as in `read`.
    let chip = unsafe { &mut *user.cast::<Peripherals>() };
    if let Some(stop) = chip.stop_run
        && chip.is_protected((BELOW_RAM.0 + offset) as u32, is_write)
    {
        chip.memory_fault = true;
        // SAFETY: as in `stop_if_it_stops`.
        unsafe { stop(handle) };
    }
}

/// Ends the run once the core executes nothing more.
fn stop_if_it_stops(handle: Handle, chip: &Peripherals) {
    if let Some(stop) = chip.stop_run.filter(|_| chip.stops()) {
        // SAFETY: the function of the library that ends a run of this emulator.
        unsafe { stop(handle) };
    }
}

/// Writes a register of a peripheral.
pub extern "C" fn write(handle: Handle, offset: u64, bytes: c_uint, value: u64, user: *mut c_void) {
    // SAFETY: as in `read`.
    let chip = unsafe { &mut *user.cast::<Peripherals>() };
    let value = value as u32 & (u32::MAX >> (32 - 8 * bytes.min(4)));
    // The converter's and the watchdog's data registers are written in parts of words.
    chip.write(offset as usize & !3, value << (8 * (offset & 3)));
    stop_if_it_stops(handle, chip);
}

/// A register of the generator of random numbers.
pub extern "C" fn read_random(_: Handle, offset: u64, _: c_uint, user: *mut c_void) -> u64 {
    // SAFETY: as in `read`.
    let chip = unsafe { &mut *user.cast::<Peripherals>() };
    chip.read_random((offset as usize).wrapping_sub(random_model::FIRST))
        .into()
}

/// Writes one of them.
pub extern "C" fn write_random(_: Handle, offset: u64, _: c_uint, value: u64, user: *mut c_void) {
    // SAFETY: as in `read`.
    let chip = unsafe { &mut *user.cast::<Peripherals>() };
    chip.write_random(
        (offset as usize).wrapping_sub(random_model::FIRST),
        value as u32,
    );
}

/// The parameter sectors.
pub extern "C" fn read_flash(_: Handle, offset: u64, bytes: c_uint, user: *mut c_void) -> u64 {
    // SAFETY: as in `read`.
    let chip = unsafe { &*user.cast::<Peripherals>() };
    chip.flash.read(offset as usize, bytes as usize)
}

/// A write to the parameter sectors.
pub extern "C" fn write_flash(
    handle: Handle,
    offset: u64,
    bytes: c_uint,
    value: u64,
    user: *mut c_void,
) {
    // SAFETY: as in `read`.
    let chip = unsafe { &mut *user.cast::<Peripherals>() };
    let now_ns = chip.now_ns;
    chip.flash
        .write(offset as usize, bytes as usize, value as u32, now_ns);
    stop_if_it_stops(handle, chip);
}

/// A bit of a register, by its own word.
pub extern "C" fn read_bit(_: Handle, offset: u64, _: c_uint, user: *mut c_void) -> u64 {
    // SAFETY: as in `read`.
    let chip = unsafe { &mut *user.cast::<Peripherals>() };
    let (at, bit) = (offset as usize / 32, offset / 4 % 8 + 8 * (offset / 32 % 4));
    u64::from(chip.read(at & !3) >> bit & 1)
}

/// Writes a bit of a register, by its own word.
pub extern "C" fn write_bit(_: Handle, offset: u64, _: c_uint, value: u64, user: *mut c_void) {
    // SAFETY: as in `read`.
    let chip = unsafe { &mut *user.cast::<Peripherals>() };
    let (at, bit) = (
        (offset as usize / 32) & !3,
        offset / 4 % 8 + 8 * (offset / 32 % 4),
    );
    let word = chip.read(at) & !(1 << bit) | (value as u32 & 1) << bit;
    chip.write(at, word);
}

/// A register of the core.
pub extern "C" fn read_core(handle: Handle, offset: u64, _: c_uint, user: *mut c_void) -> u64 {
    // SAFETY: as in `read`.
    let chip = unsafe { &mut *user.cast::<Peripherals>() };
    let word = chip.read_core(offset as usize & !3);
    stop_if_it_stops(handle, chip);
    u64::from(word >> (8 * (offset & 3)))
}

/// Writes a register of the core.
pub extern "C" fn write_core(
    handle: Handle,
    offset: u64,
    bytes: c_uint,
    value: u64,
    user: *mut c_void,
) {
    // SAFETY: as in `read`.
    let chip = unsafe { &mut *user.cast::<Peripherals>() };
    let (shift, mask) = (8 * (offset & 3), u32::MAX >> (32 - 8 * bytes.min(4)));
    let at = offset as usize & !3;
    let enables = (0xe100..0xe120).contains(&at);
    let kept = if enables {
        0
    } else {
        chip.read_core(at) & !(mask << shift)
    };
    chip.write_core(at, kept | (value as u32 & mask) << shift);
    stop_if_it_stops(handle, chip);
}

/// Changes registers of the core once; see [`JumpHook`].
pub extern "C" fn jump(handle: Handle, _: u64, _: u32, user: *mut c_void) {
    // SAFETY: `user` is a `JumpHook` that is never freed, and the chip lives as long as the emulator
    // that calls this.
    let (hook, chip) = unsafe {
        let hook = &*user.cast::<JumpHook>();
        (hook, &mut *hook.chip)
    };
    for Injected {
        register,
        mut value,
    } in std::mem::take(&mut chip.inject)
    {
        // SAFETY: the registers that are changed have 32 bits.
        unsafe { (hook.write)(handle, register, (&raw mut value).cast()) };
    }
}

/// What a hook needs to change a register of the core.
pub struct JumpHook {
    /// The chip.
    pub chip: *mut Peripherals,
    /// Writes a register of the core.
    pub write: Register,
}

/// A register of the core that is changed once, where a hook is.
#[derive(Clone, Copy, Debug)]
pub struct Injected {
    /// The register, of [`register`].
    pub register: i32,
    /// Its value.
    pub value: u32,
}

/// Counts an instruction.
pub extern "C" fn count(_: Handle, _: u64, _: u32, user: *mut c_void) {
    // SAFETY: as in `read`.
    unsafe { (*user.cast::<Peripherals>()).instructions += 1 };
}

/// Changes FPSCR; see [`FpscrHook`].
pub extern "C" fn set_fpscr(handle: Handle, _: u64, _: u32, user: *mut c_void) {
    // SAFETY: `user` is a `FpscrHook` that is never freed.
    let hook = unsafe { &*user.cast::<FpscrHook>() };
    // SAFETY: the chip lives as long as the emulator that calls this.
    let chip = unsafe { &*hook.chip };
    if chip.fpscr_to_write != 0 {
        let mut value = chip.fpscr_to_write;
        // SAFETY: FPSCR has 32 bits.
        unsafe { (hook.write)(handle, register::FPSCR, (&raw mut value).cast()) };
    }
}

/// What a hook needs to change FPSCR.
pub struct FpscrHook {
    /// The chip.
    pub chip: *const Peripherals,
    /// Writes a register of the core.
    pub write: Register,
}

//! A fault is noted in RAM that survives a reset, and the core is reset. The next start reports the fault, see
//! [`stage_node::retained`].

use core::panic::PanicInfo;
use cortex_m::peripheral::{MPU, SCB};
use stage_node::retained::{FaultKind, RetainedRam};
use stm32f4xx_hal::pac::RCC;

/// The start-up code neither clears nor sets it.
#[unsafe(link_section = ".uninit.RETAINED")]
pub static RETAINED: RetainedRam = RetainedRam::new();

/// Notes a fault and resets.
fn reset_by(kind: FaultKind, address: u32, detail: u32) -> ! {
    RETAINED.update(|record| record.note(kind, address, detail));
    SCB::sys_reset()
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    cortex_m::interrupt::disable();
    let place =
        |place: &core::panic::Location<'_>| (core::ptr::from_ref(place) as u32, place.line());
    let (address, line) = info.location().map_or((0, 0), place);
    reset_by(FaultKind::Panic, address, line)
}

/// Makes every write to the 1 MiB below the stack a fault. System memory and reserved addresses lie there; the manual is
/// silent about writes to them. The chip's identity and the one-time area there stay readable.
pub fn guard_stack(mpu: &mut MPU) {
    const BYTES_LOG2: u32 = 20;
    /// AP of the region: privileged code may read (ARMv7-M Architecture Reference Manual, B3.5).
    const READ_ONLY: u32 = 0b101;
    const ENABLE: u32 = 1;
    /// Elsewhere the map of the core holds.
    const DEFAULT_MAP: u32 = 1 << 2;
    let below = (&raw const _stack_end as u32).wrapping_sub(1 << BYTES_LOG2);
    // SAFETY: the program uses nothing in this region, and the rest of the map stays.
    unsafe {
        mpu.rnr.write(0);
        mpu.rbar.write(below);
        mpu.rasr
            .write(READ_ONLY << 24 | (BYTES_LOG2 - 1) << 1 | ENABLE);
        mpu.ctrl.write(DEFAULT_MAP | ENABLE);
    }
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}

/// The crystal stopped: the core runs on its internal oscillator, slower than all else assumes.
#[cortex_m_rt::exception]
unsafe fn NonMaskableInt() {
    // SAFETY: this handler does not return to what it interrupts.
    let rcc = unsafe { &*RCC::PTR };
    // Otherwise the interrupt would come again at once after the reset.
    rcc.cir().modify(|_, w| w.cssc().set_bit());
    reset_by(FaultKind::ClockFailed, 0, 0)
}

/// The stack pointer may be anywhere: puts it back before anything else and passes its value on. Clears LSPACT, bit 0 of
/// FPCCR, so that no registers of the FPU are stacked late, where the stack was.
#[unsafe(naked)]
#[unsafe(no_mangle)]
unsafe extern "C" fn HardFault() -> ! {
    core::arch::naked_asm!(
        "mrs r0, msp",
        "movw r1, #:lower16:_stack_start",
        "movt r1, #:upper16:_stack_start",
        "msr msp, r1",
        "movw r1, #0xef34",
        "movt r1, #0xe000",
        "ldr r2, [r1]",
        "bic r2, r2, #1",
        "str r2, [r1]",
        "b {handler}",
        handler = sym hard_fault,
    )
}

unsafe extern "C" {
    static _stack_end: u32;
    static _stack_start: u32;
}

/// `frame` is where the core stacked R0 to R3, R12, LR, PC and xPSR, if there was RAM.
extern "C" fn hard_fault(frame: u32) -> ! {
    const PC: u32 = 6 * 4;
    const FRAME_BYTES: u32 = 8 * 4;
    let (end, start) = (&raw const _stack_end as u32, &raw const _stack_start as u32);
    // SAFETY: reading this register changes nothing.
    let cfsr = unsafe { (*SCB::PTR).cfsr.read() };
    if (end..=start - FRAME_BYTES).contains(&frame) {
        // SAFETY: within the stack, aligned by the core.
        let pc = unsafe { ((frame + PC) as *const u32).read_volatile() };
        reset_by(FaultKind::HardFault, pc, cfsr)
    }
    reset_by(FaultKind::StackOverflow, frame, cfsr)
}

//! Exceptions: what the core stacks, how a handler runs and returns, and what it costs.

use super::{Machine, RETURN};
use crate::image::RAM;
use crate::peripherals::IRQ_TIM2;
use crate::unicorn::register;

/// The core's register of faults, and bits of it (PM0214): a precise bus error; an access that the
/// memory protection forbids, and then the stacking, too.
const CFSR: usize = 0xed28;
const PRECISE: u32 = 1 << 9;
/// See [`PRECISE`].
pub const ACCESS_AND_STACKING: u32 = 1 << 1 | 1 << 4;
/// The control register of the FPU's context, and its bit of what is still to be stacked.
const FPCCR: usize = 0xef34;
const LSPACT: u32 = 1;
/// Its number in the vector table.
const HARD_FAULT: usize = 3;
/// The integer registers that the core stacks, in this order.
const STACKED: [i32; 8] = [
    register::R0,
    register::R0 + 1,
    register::R0 + 2,
    register::R0 + 3,
    register::R12,
    register::LR,
    register::PC,
    register::XPSR,
];

/// The cost of an interrupt.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cost {
    /// Instructions up to the last mailbox that it filled, or all if it filled none.
    pub instructions: u64,
    /// All instructions.
    pub all_instructions: u64,
    /// Bytes over the SPI.
    pub spi_bytes: u64,
    /// Mailboxes filled.
    pub mailboxes: u64,
}

impl Machine {
    /// An exception, by its number in the vector table: the core stacks its registers, runs the
    /// handler and takes them back.
    pub(super) fn interrupt(&mut self, exception: u32) {
        let sp = self.core.get(register::SP);
        let saved = self.stack_registers();
        let is_tick = exception == 16 + IRQ_TIM2;
        let before = self.chip.instructions;
        self.chip.instructions_timed = before;
        let (spi_before, filled_before) = (self.chip.spi_bytes, self.chip.can.filled);
        self.chip.instructions_at_mailbox = before;
        self.go(self.vectors[exception as usize], RETURN);
        if is_tick && self.chip.instructions != before {
            let upto = match self.chip.instructions_at_mailbox {
                at if at != before => at,
                _ => self.chip.instructions,
            };
            self.costs.push(Cost {
                instructions: upto - before,
                all_instructions: self.chip.instructions - before,
                spi_bytes: self.chip.spi_bytes - spi_before,
                mailboxes: self.chip.can.filled - filled_before,
            });
        }
        if self.chip.stops() {
            return;
        }
        for (k, word) in saved.into_iter().enumerate() {
            match k {
                0..6 => self.core.set(STACKED[k], word),
                8..24 => self.core.set(register::S0 + k as i32 - 8, word),
                24 => self.core.set(register::FPSCR, word),
                _ => {}
            }
        }
        self.core.set(register::SP, sp);
    }

    /// What the core does before a handler: it stacks 26 words, floating-point registers included.
    /// Where there is no RAM nothing is stacked (ARM DDI 0403, STKERR).
    fn stack_registers(&mut self) -> [u32; 26] {
        let mut saved = [0; 26];
        for (k, to) in saved.iter_mut().enumerate() {
            *to = match k {
                0..8 => self.core.get(STACKED[k]),
                8..24 => self.core.get(register::S0 + k as i32 - 8),
                24 => self.core.get(register::FPSCR),
                _ => 0,
            };
        }
        let sp = self.core.get(register::SP);
        let frame = sp.wrapping_sub(4 * saved.len() as u32) & !7;
        let at = frame.wrapping_sub(RAM) as usize;
        if let Some(ram) = self
            .chip
            .ram
            .0
            .get_mut(at..at.saturating_add(4 * saved.len()))
        {
            for (bytes, word) in ram.chunks_exact_mut(4).zip(saved) {
                bytes.copy_from_slice(&word.to_le_bytes());
            }
        }
        self.core.set(register::SP, frame);
        self.core.set(register::LR, RETURN | 1);
        saved
    }

    /// Runs until `until` or until the chip is reset. An access to missing or protected memory leads into the handler of
    /// hard faults.
    pub(super) fn go(&mut self, from: u32, until: u32) {
        let mut ran = self.core.run(from, until);
        let protected = std::mem::take(&mut self.chip.memory_fault);
        if (ran.is_err() || protected) && !self.chip.stops() {
            let cause = [PRECISE, ACCESS_AND_STACKING][usize::from(protected)];
            self.chip.write_core(CFSR, cause);
            self.stack_registers();
            let settings = self.chip.read_core(FPCCR);
            self.chip.write_core(FPCCR, settings | LSPACT);
            ran = self.core.run(self.vectors[HARD_FAULT], RETURN);
            self.lazy_left |= self.chip.read_core(FPCCR) & LSPACT != 0;
        }
        let pc = self.core.get(register::PC);
        assert!(
            self.chip.stops() || ran.is_ok() && pc & !1 == until,
            "the program stopped at {pc:#010x}, not at {until:#010x}: {ran:?}"
        );
    }
}

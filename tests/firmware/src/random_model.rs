//! The random number generator, from RM0090 section 24: ready at once, unless it has a fault.

use tests::flash_model::Words;

/// Bits of RNG_SR: a number is there; the clock or the seed is wrong, and was.
const READY: u32 = 1;
const SEED: u32 = 1 << 6 | 1 << 2;

/// The generator.
#[derive(Default)]
pub struct RandomModel {
    /// Whether it is switched on.
    pub on: bool,
    /// Whether the seed is wrong from now on.
    pub broken: bool,
    words: Words,
    latched: bool,
}

impl RandomModel {
    /// A register.
    pub fn read(&mut self, offset: usize) -> u32 {
        match offset {
            4 if !self.on => 0,
            4 if self.broken || self.latched => {
                self.latched = true;
                SEED
            }
            4 => READY,
            8 if self.on => self.words.draw(),
            _ => 0,
        }
    }

    /// Writes a register: a latched error is cleared by writing 0.
    pub const fn write(&mut self, offset: usize, value: u32) {
        match offset {
            0 => self.on = value & 4 != 0,
            4 => self.latched &= value & 1 << 6 != 0,
            _ => {}
        }
    }
}

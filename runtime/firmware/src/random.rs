//! The random number generator of the STM32F405 (RM0090 rev. 21, section 24).

use hal_adapters::can::update::Nonce;
use stm32f4xx_hal::pac::RNG;
use stm32f4xx_hal::rcc::{Enable, Rcc};

/// Looks until a number is given up. A new one takes 40 periods of 48 MHz (section 24.3.1), 140
/// of the core; a look takes four at least.
const LOOKS: u32 = 100;

/// The generator.
pub struct Random {
    registers: RNG,
    /// The last word: one that comes twice is an error (section 24.3.1, FIPS 140-2).
    last: Option<u32>,
}

impl Random {
    /// Switches it on. Its clock, the PLL's 48 MHz, runs with the core's.
    pub fn new(registers: RNG, rcc: &mut Rcc) -> Self {
        RNG::enable(rcc);
        registers.cr().write(|w| w.rngen().set_bit());
        Self {
            registers,
            last: None,
        }
    }

    /// A number that was never given before; `None` after an error.
    pub fn nonce(&mut self) -> Option<Nonce> {
        if self.last.is_none() {
            // The first number after the start is not to be used.
            self.last = self.word();
        }
        let mut nonce = [0; 4];
        for word in &mut nonce {
            let drawn = self.word()?;
            if self.last.replace(drawn) == Some(drawn) {
                return None;
            }
            *word = drawn;
        }
        Some(nonce)
    }

    fn word(&mut self) -> Option<u32> {
        for _ in 0..LOOKS {
            let status = self.registers.sr().read();
            if status.seis().bit_is_set() || status.ceis().bit_is_set() {
                self.restart();
                return None;
            }
            if status.drdy().bit_is_set() {
                return Some(self.registers.dr().read().rndata().bits());
            }
        }
        None
    }

    /// After an error of the seed: clears the flags, and off and on again (section 24.3.2).
    fn restart(&mut self) {
        self.last = None;
        self.registers
            .sr()
            .write(|w| w.seis().clear_bit().ceis().clear_bit());
        self.registers.cr().write(|w| w.rngen().clear_bit());
        self.registers.cr().write(|w| w.rngen().set_bit());
    }
}

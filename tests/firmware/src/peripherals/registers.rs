//! Reads and writes of registers.

use super::{
    BELOW_RAM, BIT_BAND, CORE, Dma, Peripherals, RANDOM, RANDOM_FIRST, RANGE, Request, SECTORS,
    Transfer, US, WINDOWS,
};

/// The blocks of registers, from the start of the range, and the bytes that each takes.
const BLOCK: usize = 0x400;
pub(super) const TIM2: usize = 0x0_0000;
const IWDG: usize = 0x0_3000;
const CAN1: usize = 0x0_6400;
const PWR: usize = 0x0_7000;
const SPI1: usize = 0x1_3000;
const GPIOA: usize = 0x2_0000;
const GPIOB: usize = 0x2_0400;
const GPIOC: usize = 0x2_0800;
const RCC: usize = 0x2_3800;
const FLASH: usize = 0x2_3c00;
const AHB1ENR: usize = RCC + 0x30;
const AHB2ENR: usize = RCC + 0x34;
const DMA2: usize = 0x2_6400;
/// Bit of DMA2 in the registers of its bus.
const DMA2_BIT: u32 = 1 << 22;
/// Bits of SPI_CR1 and SPI_CR2 (RM0090 28.5.1 and 28.5.2): on; requests to receive and to send.
const SPI_ON: u32 = 1 << 6;
const SPI_REQUESTS: u32 = 0b11;
/// A look at the flags of DMA2 or at the timer: four cycles, ns.
const LOOK_NS: u64 = 24;
/// Time of 21 instructions of two cycles, ns.
const OF_21_INSTRUCTIONS_NS: u64 = 250;
/// The core's system timer, and the register of a reset by the program.
const SYSTICK: usize = 0xe010;
const AIRCR: usize = 0xed0c;
/// Registers that ignore zeros.
const INTERRUPT_ENABLES: std::ops::Range<usize> = 0xe100..0xe120;
/// Memory protection: control, base and attributes of the region that was written last.
pub(super) const MPU_CTRL: usize = 0xed94;
pub(super) const MPU_RBAR: usize = 0xed9c;
pub(super) const MPU_RASR: usize = 0xeda0;

const SELECT_PIN: u32 = 4;
const SYNC_PIN: u32 = 0;
const LED_PIN: u32 = 1;
const SERVO_PIN: u32 = 1;

/// From a trigger to the alarm for its codes, as it is set, us.
const SETTLES_US: std::ops::RangeInclusive<u32> = 150..=207;

/// Clock of the bus that SPI1 is on.
const BUS_2_HZ: u64 = 84_000_000;
/// Time of a read of a register that a program polls: loops that wait take time.
const POLL_NS: u64 = US;

/// Thresholds of the voltage detector, mV, by PLS (RM0090 5.4.1).
const THRESHOLDS_MV: [u32; 8] = [2000, 2100, 2300, 2500, 2600, 2700, 2800, 2900];
/// A supply that is low, mV: only the highest threshold tells.
const LOW_MV: u32 = 2850;

/// The window of an address, and how far it is from its start, or from the first register.
fn window(address: u64) -> ((u64, u64), usize) {
    let is_in = |window: &(u64, u64)| (window.0..window.0 + window.1).contains(&address);
    let window = WINDOWS.into_iter().find(is_in).unwrap_or(RANGE);
    let first = window.0 + u64::from(window == RANDOM) * RANDOM_FIRST;
    (window, address.wrapping_sub(first) as usize)
}

/// The word and the bit of a word of the bit band.
const fn in_band(offset: usize) -> (usize, usize) {
    ((offset / 32) & !3, offset / 4 % 8 + 8 * (offset / 32 % 4))
}

impl Peripherals {
    /// PVDO (RM0090 5.4.2): valid only while the detector and its clock are on.
    fn detects_low_supply(&self) -> bool {
        let (control, clocked) = (self.words[PWR / 4], self.words[(RCC + 0x40) / 4] >> 28 & 1);
        let threshold_mv = THRESHOLDS_MV[control as usize >> 5 & 0b111];
        let is_on = clocked == 1 && control >> 4 & 1 == 1;
        is_on && self.is_supply_low() && LOW_MV < threshold_mv
    }

    /// Lets the time of the instructions pass that were executed.
    fn pass_instructions(&mut self) {
        let since = (self.instructions - self.instructions_timed) / 21;
        self.instructions_timed += since * 21;
        self.now_ns += since * OF_21_INSTRUCTIONS_NS;
    }

    /// Begins a transfer if all that it needs is on.
    fn start_transfer(&mut self) {
        let word = |offset: usize| self.words[offset / 4];
        let is_on = word(SPI1) & SPI_ON != 0
            && word(SPI1 + 4) & SPI_REQUESTS == SPI_REQUESTS
            && word(AHB1ENR) & DMA2_BIT != 0
            && self.transfer.is_none();
        if !is_on {
            return;
        }
        if self.dma_stands {
            // Bytes are sent, and nobody takes what comes in their place.
            self.overrun |= self.dma.serves(Request::Spi1Tx).is_some();
            return;
        }
        if self.overrun {
            return;
        }
        let sides = (
            self.dma.serves(Request::Spi1Tx),
            self.dma.serves(Request::Spi1Rx),
        );
        if let (Some(from), Some(into)) = sides {
            let byte_ns = self.spi_byte_ns.unwrap_or(8_000_000_000 / self.spi_hz());
            let end_ns = self.now_ns + byte_ns * from.count.min(into.count) as u64;
            self.transfer = Some(Transfer { end_ns, from, into });
        }
    }

    /// Who looks for the end of a transfer waits until it is there.
    fn end_transfer(&mut self) {
        self.now_ns += LOOK_NS;
        let Some(Transfer { end_ns, from, into }) = self.transfer.take() else {
            return;
        };
        self.now_ns = self.now_ns.max(end_ns);
        // The converter needs mode 1: in another mode bits are shifted.
        let mode_1 = self.words[SPI1 / 4] & 3 == 1;
        let count = from.count.min(into.count);
        for k in 0..count {
            let byte = self.adc.exchange(self.ram.0[from.at(k)]);
            self.ram.0[into.at(k)] = if mode_1 { byte } else { byte >> 1 };
        }
        self.spi_bytes += count as u64;
        self.dma.transferred(&from, count);
        self.dma.transferred(&into, count);
    }

    /// A read of the core, where it sees no plain memory.
    pub fn load(&mut self, address: u64, bytes: u32) -> u64 {
        let (window, offset) = window(address);
        let word = match window {
            SECTORS => return self.flash.read(offset, bytes as usize),
            BIT_BAND => return u64::from(self.read(in_band(offset).0) >> in_band(offset).1 & 1),
            BELOW_RAM => {
                self.memory_fault |= self.is_protected(address as u32, false);
                return 0;
            }
            RANDOM => self.read_random(offset),
            CORE => self.read_core(offset & !3),
            _ => self.read(offset & !3),
        };
        u64::from(word >> (8 * (address & 3)))
    }

    /// A write of the core. The converter's and the watchdog's data registers are written in parts of
    /// words.
    pub fn store(&mut self, address: u64, bytes: u32, value: u32) {
        let (window, offset) = window(address);
        let (shift, mask) = (8 * (address & 3), u32::MAX >> (32 - 8 * bytes.min(4)));
        let value = value & mask;
        match window {
            SECTORS => self.flash.write(offset, bytes as usize, value, self.now_ns),
            BIT_BAND => {
                let (at, bit) = in_band(offset);
                let word = self.read(at) & !(1 << bit) | (value & 1) << bit;
                self.write(at, word);
            }
            BELOW_RAM => self.memory_fault |= self.is_protected(address as u32, true),
            RANDOM => self.write_random(offset, value),
            CORE => {
                let at = offset & !3;
                let kept = match INTERRUPT_ENABLES.contains(&at) {
                    true => 0,
                    false => self.read_core(at) & !(mask << shift),
                };
                self.write_core(at, kept | value << shift);
            }
            _ => self.write(offset & !3, value << shift),
        }
    }

    /// A register, by its distance from the start of the range.
    fn read(&mut self, offset: usize) -> u32 {
        self.pass_instructions();
        let word = self.words[offset / 4];
        match (offset / BLOCK * BLOCK, offset % BLOCK) {
            (RCC, at @ 0..0x10) => {
                self.now_ns += POLL_NS;
                self.clocks.read(at, self.now_ns)
            }
            (RCC, 0x70) => word | (word & 1) << 1,
            (RCC, 0x74) => word & 1 | (word & 1) << 1 | self.reset_flags,
            (PWR, 4) => {
                self.now_ns += POLL_NS;
                1 << 14 | word | u32::from(self.detects_low_supply()) << 2
            }
            (FLASH, at @ 4..0x14) => self.flash.read_register(at, &mut self.now_ns),
            (FLASH, 0x14) => self.option_bytes,
            (GPIOA, 0x10) => self.level(GPIOA, SELECT_PIN, self.pulled_up[0]),
            (GPIOB, 0x10) => {
                self.level(GPIOB, SYNC_PIN, self.pulled_up[1])
                    | self.level(GPIOB, SERVO_PIN, false) & u32::from(self.servo_on) << SERVO_PIN
            }
            (TIM2, 0x10) => {
                self.advance();
                self.timer_flags
            }
            (TIM2, 0x24) => {
                self.now_ns += LOOK_NS;
                self.timer_us()
            }
            (TIM2, 0x3c) => self.capture(),
            (DMA2, at) => {
                if at == 0 {
                    self.end_transfer();
                }
                self.dma.read(at)
            }
            // Transmit buffer empty, and an overrun: a read of DR and then of SR clears it, and until then nothing is
            // received (RM0090 rev. 18, section 28.3.10).
            (SPI1, 0x08) => {
                let state = 2 | u32::from(self.overrun) << 6;
                self.overrun &= !self.data_read;
                state
            }
            (SPI1, 0x0c) => {
                self.data_read = true;
                word
            }
            (CAN1, at) => {
                self.can.advance(self.now_ns);
                self.can.read(at, self.now_ns)
            }
            (IWDG, at) => self.watchdog.read(at, self.now_ns),
            _ => word,
        }
    }

    /// Writes a register.
    fn write(&mut self, offset: usize, value: u32) {
        self.pass_instructions();
        self.words[offset / 4] = value;
        match (offset / BLOCK * BLOCK, offset % BLOCK) {
            (RCC, at @ 0..0x10) => self.clocks.write(at, value, self.now_ns),
            (RCC, 0x10) if value & DMA2_BIT != 0 => {
                (self.dma, self.transfer) = (Dma::default(), None);
            }
            (RCC, 0x74) if value & 1 << 24 != 0 => self.reset_flags = 0,
            (TIM2, 0) if value & 1 != 0 && self.timer_started_ns.is_none() => {
                self.timer_started_ns = Some(self.now_ns);
                // The counter starts at what the compare register holds after a reset: it matches, though no alarm was
                // set.
                self.timer_flags |= 2;
            }
            (TIM2, 0x10) => self.timer_flags &= value,
            (TIM2, 0x14) => {
                self.timer_flags |= value & 2;
                self.alarm_ns = self.alarm_ns.filter(|_| value & 2 == 0);
            }
            (TIM2, 0x34) => self.set_alarm(value),
            (FLASH, at @ 0..0x14) => self.flash.write_register(at, value, self.now_ns),
            (IWDG, at) => self.watchdog.write(at, value, self.now_ns),
            (DMA2, at) => {
                self.dma.write(at, value);
                self.start_transfer();
            }
            (SPI1, 4) => {
                self.data_read = false;
                self.start_transfer();
            }
            (GPIOA | GPIOB | GPIOC, 0x18) => self.set_pins(offset - 0x18, value),
            (CAN1, at) => {
                let filled = self.can.filled;
                self.can.write(at, value, self.now_ns);
                if self.can.filled != filled {
                    self.instructions_at_mailbox = self.instructions;
                }
            }
            _ => {}
        }
    }

    /// A register of the generator of random numbers.
    fn read_random(&mut self, offset: usize) -> u32 {
        self.now_ns += POLL_NS;
        self.random.read(offset)
    }

    /// Writes a register of the generator, which takes nothing without its clock.
    fn write_random(&mut self, offset: usize, value: u32) {
        if self.words[AHB2ENR / 4] & 1 << 6 != 0 {
            self.random.write(offset, value);
        }
    }

    /// Clock of SPI1, Hz.
    pub fn spi_hz(&self) -> u64 {
        BUS_2_HZ >> (1 + (self.words[SPI1 / 4] >> 3 & 7))
    }

    fn set_alarm(&mut self, compare: u32) {
        let left = compare.wrapping_sub(self.timer_us());
        let start = self.timer_started_ns.unwrap_or(self.now_ns);
        let us = (self.now_ns - start) / US + u64::from(left);
        self.alarm_settles = SETTLES_US.contains(&left);
        let late_ns = i64::from(self.alarm_settles) * self.settled_jitter_ns;
        self.alarm_ns = (left > 0).then_some((start + us * US).saturating_add_signed(late_ns));
    }

    /// Channel 3 of TIM2 (RM0090 rev. 18, sections 18.3.5, 18.4.8, 18.4.9): it captures the timer when its input falls, if the
    /// input is its own, on, and connected to PA2 by alternate function 1 (DS8626, table 9).
    fn capture(&mut self) -> u32 {
        let word = |offset: usize| self.words[offset / 4];
        let is_on = word(TIM2 + 0x1c) & 0b11 == 0b01 && word(TIM2 + 0x20) >> 8 & 0b1011 == 0b0011;
        let is_connected = word(GPIOA) >> 4 & 0b11 == 0b10 && word(GPIOA + 0x20) >> 8 & 0xf == 1;
        let fell_ns = self.adc.ready_fell_ns(self.now_ns);
        if let Some(ns) = fell_ns.filter(|_| is_on && is_connected)
            && self.timer_started_ns.is_some_and(|start| ns >= start)
        {
            self.captured_us = self.timer_us_at(ns);
        }
        self.captured_us
    }

    /// The bit of an input, by its resistors on the board and inside.
    fn level(&self, port: usize, pin: u32, pulled_up: bool) -> u32 {
        let inside = self.words[(port + 0x0c) / 4] >> (2 * pin) & 3;
        u32::from(pulled_up || inside == 1) << pin
    }

    fn set_pins(&mut self, port: usize, value: u32) {
        let pin = [(GPIOA, SELECT_PIN), (GPIOB, SYNC_PIN), (GPIOC, LED_PIN)];
        let pin = pin
            .iter()
            .find(|(of, _)| *of == port)
            .map_or(0, |(_, pin)| *pin);
        let high = value >> pin & 1 == 1;
        if !high && value >> (16 + pin) & 1 == 0 {
            return;
        }
        match port {
            GPIOA if high == self.selected => {
                self.selected = !high;
                if high {
                    // What is not through by now is lost.
                    self.transfer = None;
                    self.adc.deselect(self.now_ns);
                } else {
                    self.adc.select(self.now_ns);
                }
            }
            GPIOB => self.adc.control(high, self.now_ns),
            GPIOC => self.led = high,
            _ => {}
        }
    }

    /// A register of the core.
    pub fn read_core(&mut self, offset: usize) -> u32 {
        if (SYSTICK..SYSTICK + 0xc).contains(&offset) {
            self.now_ns += POLL_NS;
            return self.clocks.read_timer(offset - SYSTICK, self.now_ns);
        }
        self.core_words[offset / 4]
    }

    /// Writes a register of the core.
    pub fn write_core(&mut self, offset: usize, value: u32) {
        if (SYSTICK..SYSTICK + 0xc).contains(&offset) {
            self.clocks
                .write_timer(offset - SYSTICK, value, self.now_ns);
        }
        // The key and SYSRESETREQ.
        self.reset_asked |= offset == AIRCR && value & 0xffff_0004 == 0x05fa_0004;
        let enable = INTERRUPT_ENABLES.contains(&offset);
        let word = &mut self.core_words[offset / 4];
        *word = if enable { *word | value } else { value };
    }
}

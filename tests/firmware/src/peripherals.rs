//! The peripherals of an STM32F405 that the program uses. Time passes between interrupts and while bytes cross the
//! SPI; instructions take time only where they are counted.

mod registers;

use crate::adc_model::{Adc, Input, Row};
use crate::can_model::CanModel;
use crate::clock_model::Clocks;
use crate::dma_model::{Dma, Request, Side};
use crate::flash_model::{BYTES, FIRST, FlashModel};
use crate::image::RAM_BYTES;
use crate::memory::Memory;
use crate::random_model::RandomModel;
use crate::watchdog_model::Watchdog;
use registers::{MPU_CTRL, MPU_RASR, MPU_RBAR, TIM2};

/// The peripherals: start and bytes.
const RANGE: (u64, u64) = (0x4000_0000, 0x8_0000);
/// The same, one word a bit.
const BIT_BAND: (u64, u64) = (0x4200_0000, 0x100_0000);
/// The core's own peripherals.
const CORE: (u64, u64) = (0xe000_0000, 0x10_0000);
/// The parameter sectors.
const SECTORS: (u64, u64) = (FIRST as u64, BYTES as u64);
/// The page of the generator of random numbers, and where in it its registers begin.
const RANDOM: (u64, u64) = (0x5006_0000, 0x1000);
const RANDOM_FIRST: u64 = 0x800;
/// Between the return address of interrupts and RAM: accesses do nothing, unless the memory
/// protection makes them faults.
const BELOW_RAM: (u64, u64) = (0x1fff_1000, 0xf000);
/// All that is no plain memory.
pub const WINDOWS: [(u64, u64); 6] = [RANGE, BIT_BAND, CORE, SECTORS, RANDOM, BELOW_RAM];

/// Numbers of the interrupts.
pub const IRQ_CAN1_TX: u32 = 19;
/// Numbers of the interrupts.
pub const IRQ_TIM2: u32 = 28;

const US: u64 = 1000;
/// From the supply until the program runs: the chip's own reset, at least (DS8626, tRSTTEMPO). The
/// converter has the same supply.
const BOOT_NS: u64 = 500_000;
/// Flags of RCC_CSR.
pub mod cause {
    /// The pin NRST, which every reset pulls low.
    pub const PIN: u32 = 1 << 26;
    /// Power-on, with the brown-out flag.
    pub const POWER_ON: u32 = 1 << 27 | 1 << 25 | PIN;
    /// A supply that dropped below the brown-out level, and not so far that the power was gone.
    pub const BROWN_OUT: u32 = 1 << 25 | PIN;
    /// The program.
    pub const SOFTWARE: u32 = 1 << 28 | PIN;
    /// The watchdog.
    pub const WATCHDOG: u32 = 1 << 29 | PIN;
}

/// All of them.
#[derive(Default)]
pub struct Peripherals {
    /// Now, ns since the chip got its power.
    pub now_ns: u64,
    /// Time of one byte on the SPI, ns, in place of the time by its registers.
    pub spi_byte_ns: Option<u64>,
    /// Bytes that went over the SPI.
    pub spi_bytes: u64,
    /// The converter.
    pub adc: Adc,
    /// RAM, which DMA reaches.
    pub ram: Box<Memory<RAM_BYTES>>,
    /// By how much the alarm after a trigger comes late, ns.
    pub settled_jitter_ns: i64,
    /// Whether DMA takes no byte that comes over the SPI.
    pub dma_stands: bool,
    /// The CAN controller.
    pub can: CanModel,
    /// What the timer reads when it is started, us: 0 on the chip.
    pub timer_offset_us: u32,
    /// When row 0 is played, ns: the first tick.
    pub first_tick_ns: Option<u64>,
    /// The watchdog.
    pub watchdog: Watchdog,
    /// Oscillators and PLL.
    pub clocks: Clocks,
    /// The parameter sectors and how they are written.
    pub flash: FlashModel,
    /// Whether the generator of random numbers gives any.
    pub random: RandomModel,
    /// FLASH_OPTCR: the option bytes.
    pub option_bytes: u32,
    /// The supply is below 2.9 V until this time, ns, and from this operation of the flash on.
    pub supply_low_until_ns: u64,
    /// See above.
    pub supply_drops_at: Option<usize>,
    /// Whether chip select and the control pin have pull-ups on the board.
    pub pulled_up: [bool; 2],
    /// Whether nothing drives the service pin low: the servo is on, or the line is open.
    pub servo_on: bool,
    /// Whether the program accessed memory that is protected.
    pub memory_fault: bool,
    /// Whether the program has asked for a reset.
    pub reset_asked: bool,
    /// Registers of the core that the hook changes to these values,
    pub inject: Vec<(i32, u32)>,
    /// once or each time.
    pub injects_again: bool,
    /// Instructions executed, where they are counted.
    pub instructions: u64,
    /// Instructions after their time has passed.
    pub instructions_timed: u64,
    /// Instructions at the last filling of a mailbox.
    pub instructions_at_mailbox: u64,
    /// Whether the LED is on.
    pub led: bool,
    words: Vec<u32>,
    core_words: Vec<u32>,
    reset_flags: u32,
    alarm_ns: Option<u64>,
    timer_flags: u32,
    timer_started_ns: Option<u64>,
    /// Whether the alarm is for the codes of a tick, not for its trigger.
    alarm_settles: bool,
    /// Whether a tick has come since the reset.
    ticked: bool,
    /// What the timer read when DRDY fell, us.
    captured_us: u32,
    dma: Dma,
    transfer: Option<Transfer>,
    /// OVR of the SPI, and whether DR was read since the last transfer was asked for.
    overrun: bool,
    data_read: bool,
    selected: bool,
}

/// A transfer over the SPI: when it ends, what is sent, where what is received goes.
struct Transfer {
    end_ns: u64,
    from: Side,
    into: Side,
}

impl Peripherals {
    /// A chip after power-up.
    pub fn new(rows: Vec<Row>) -> Self {
        let mut new = Self {
            now_ns: BOOT_NS,
            adc: Adc::new(Input::held(rows)),
            // As delivered, but with the highest brown-out level.
            option_bytes: 0x0fff_aae1,
            pulled_up: [true; 2],
            ..Self::default()
        };
        new.reset(cause::POWER_ON);
        new
    }

    /// Resets the chip; `flags` of RCC_CSR are the cause. Time, converter and stage go on.
    pub fn reset(&mut self, flags: u32) {
        self.words = vec![0; RANGE.1 as usize / 4];
        self.core_words = vec![0; CORE.1 as usize / 4];
        self.core_words[0xef34 / 4] = 0xc000_0000; // FPCCR: ASPEN, LSPEN
        self.clocks.reset();
        self.reset_asked = false;
        self.flash.reset();
        self.random.on = false;
        self.reset_flags |= flags;
        (self.alarm_ns, self.timer_flags) = (None, 0);
        (self.timer_started_ns, self.captured_us) = (None, 0);
        (self.alarm_settles, self.ticked) = (false, false);
        (self.dma, self.transfer, self.overrun) = (Dma::default(), None, false);
        self.watchdog.reset();
        self.can.reset(self.now_ns);
    }

    /// Whether the supply is below 2.9 V.
    fn is_supply_low(&self) -> bool {
        let drops = self
            .supply_drops_at
            .is_some_and(|at| self.flash.sectors.operations >= at);
        drops || self.now_ns < self.supply_low_until_ns
    }

    fn timer_us(&self) -> u32 {
        self.timer_us_at(self.now_ns)
    }

    /// What the timer reads at a time.
    pub fn timer_us_at(&self, ns: u64) -> u32 {
        let since = (self.timer_started_ns).map_or(0, |start| ns.saturating_sub(start));
        ((since / US) as u32).wrapping_add(self.timer_offset_us)
    }

    /// Time of the next event, ns.
    pub fn next_event_ns(&self) -> Option<u64> {
        let events = [
            self.alarm_ns,
            self.can.next_event_ns(),
            self.watchdog.bites_ns(),
        ];
        events.into_iter().flatten().min()
    }

    /// Does what is due by now.
    pub fn advance(&mut self) {
        let now_ns = self.now_ns;
        if let Some(at) = self.alarm_ns.take_if(|at| *at <= now_ns) {
            self.timer_flags |= 2;
            if !self.alarm_settles {
                self.first_tick_ns.get_or_insert(at);
                if !std::mem::replace(&mut self.ticked, true) {
                    self.adc.input.join(at);
                }
            }
        }
        self.can.advance(now_ns);
        self.watchdog.advance(now_ns);
    }

    /// Whether the watchdog has bitten.
    pub fn watchdog_bites(&self) -> bool {
        self.watchdog.bites_ns().is_some_and(|at| at <= self.now_ns)
    }

    /// The crystal stops.
    pub fn stop_crystal(&mut self) {
        self.clocks.stop_crystal(self.now_ns);
    }

    /// Whether the memory protection forbids privileged code an access (PM0214, MPU access permission
    /// attributes, AP): one region, over the map of the core.
    pub fn is_protected(&self, address: u32, is_write: bool) -> bool {
        let word = |offset: usize| self.core_words[offset / 4];
        let (control, attributes) = (word(MPU_CTRL), word(MPU_RASR));
        let is_on = control & 0b101 == 0b101 && attributes & 1 == 1;
        let forbids = match attributes >> 24 & 0b111 {
            0b000 => true,
            0b101..=0b111 => is_write,
            _ => false,
        };
        let bytes_log2 = (attributes >> 1 & 0x1f) + 1;
        is_on && forbids && (address ^ word(MPU_RBAR)) >> bytes_log2 == 0
    }

    /// Whether the chip is reset, and the program executes nothing more.
    pub fn stops(&self) -> bool {
        self.reset_asked || self.flash.sectors.is_off() || self.watchdog_bites()
    }

    /// What the hook changes now.
    pub fn injected(&mut self) -> Vec<(i32, u32)> {
        match self.injects_again {
            true => self.inject.clone(),
            false => std::mem::take(&mut self.inject),
        }
    }

    /// Whether the alarm of a tick is pending.
    pub fn tick_is_due(&self) -> bool {
        self.timer_flags & 2 != 0 && !self.alarm_settles
    }

    /// The interrupt that is taken next.
    pub fn pending_interrupt(&self) -> Option<u32> {
        let enabled =
            |irq: u32| self.core_words[0xe100 / 4 + irq as usize / 32] >> (irq % 32) & 1 == 1;
        let armed = self.words[(TIM2 + 0x0c) / 4];
        if self.can.transmit_interrupt() && enabled(IRQ_CAN1_TX) {
            Some(IRQ_CAN1_TX)
        } else if self.timer_flags & armed & 2 != 0 && enabled(IRQ_TIM2) {
            Some(IRQ_TIM2)
        } else {
            None
        }
    }
}

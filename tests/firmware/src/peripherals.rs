//! The peripherals of an STM32F405, as far as the program uses them. Time is that of the bench:
//! it passes between interrupts and while bytes cross the SPI, and instructions take none.

use crate::adc_model::{Adc, Input, Part, Row};
use crate::callbacks::Injected;
use crate::can_model::CanModel;
use crate::clock_model::{Clocks, Pll};
use crate::flash_model::FlashModel;
use crate::random_model::RandomModel;
use crate::unicorn::Stop;
use crate::watchdog_model::Watchdog;

/// Address range of the peripherals: start and bytes.
pub const RANGE: (u64, u64) = (0x4000_0000, 0x8_0000);
/// The same, one word a bit.
pub const BIT_BAND: (u64, u64) = (0x4200_0000, 0x100_0000);
/// The core's own peripherals.
pub const CORE: (u64, u64) = (0xe000_0000, 0x10_0000);

const TIM2: usize = 0x0_0000;
const IWDG: usize = 0x0_3000;
const CAN1: usize = 0x0_6400;
const PWR: usize = 0x0_7000;
const SPI1: usize = 0x1_3000;
const GPIOA: usize = 0x2_0000;
const GPIOB: usize = 0x2_0400;
const GPIOC: usize = 0x2_0800;
const RCC: usize = 0x2_3800;
const FLASH: usize = 0x2_3c00;
const OPTCR: usize = FLASH + 0x14;
const AHB2ENR: usize = RCC + 0x34;
/// The core's system timer, and the register by which a program resets it.
const SYSTICK: usize = 0xe010;
const AIRCR: usize = 0xed0c;
/// Memory protection: control, base and attributes of the region that was written last.
const MPU_CTRL: usize = 0xed94;
const MPU_RBAR: usize = 0xed9c;
const MPU_RASR: usize = 0xeda0;

const SELECT_PIN: u32 = 4;
const SYNC_PIN: u32 = 0;
const LED_PIN: u32 = 1;

/// Numbers of the interrupts.
pub const IRQ_CAN1_TX: u32 = 19;
/// Numbers of the interrupts.
pub const IRQ_TIM2: u32 = 28;

const SERVO_PIN: u32 = 1;

const US: u64 = 1000;
/// From the supply until the program runs: the chip's own reset, at least (DS8626, tRSTTEMPO). The
/// converter has the same supply.
const BOOT_NS: u64 = 500_000;
/// Clock of the bus that SPI1 is on.
const BUS_2_HZ: u64 = 84_000_000;
/// What the program takes between two bytes, ns.
const SPI_GAP_NS: u64 = 150;
/// Time of a read of a register that a program polls: loops that wait take time.
const POLL_NS: u64 = US;

/// Flags of RCC_CSR.
pub mod cause {
    /// The pin NRST, which every reset pulls low.
    pub const PIN: u32 = 1 << 26;
    /// Power-on, with the brown-out flag.
    pub const POWER_ON: u32 = 1 << 27 | 1 << 25 | PIN;
    /// The program.
    pub const SOFTWARE: u32 = 1 << 28 | PIN;
    /// The watchdog.
    pub const WATCHDOG: u32 = 1 << 29 | PIN;
}

/// One of the two alarms of the timer.
#[derive(Clone, Copy, Default)]
struct Alarm {
    at_ns: Option<u64>,
}

/// All of them.
pub struct Peripherals {
    /// Now, ns since the chip got its power.
    pub now_ns: u64,
    /// Time of one byte on the SPI in place of what its registers say, ns.
    pub spi_byte_ns: Option<u64>,
    /// Bytes that went over the SPI.
    pub spi_bytes: u64,
    /// The converter.
    pub adc: Adc,
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
    /// Whether chip select and the control pin have pull-ups on the board.
    pub pulled_up: [bool; 2],
    /// Whether the service pin is pulled low: the servo is on.
    pub servo_on: bool,
    /// Whether the program accessed memory that is protected.
    pub memory_fault: bool,
    /// Whether the program has asked for a reset.
    pub reset_asked: bool,
    /// What a hook changes once.
    pub inject: Vec<Injected>,
    /// Ends a run of the core.
    pub stop_run: Option<Stop>,
    /// Instructions executed, where they are counted.
    pub instructions: u64,
    /// Instructions at the last filling of a mailbox.
    pub instructions_at_mailbox: u64,
    /// Whether the LED is on.
    pub led: bool,
    /// Value written to FPSCR by a hook, and whether it is armed.
    pub fpscr_to_write: u32,
    words: Vec<u32>,
    core_words: Vec<u32>,
    reset_flags: u32,
    alarms: [Alarm; 2],
    timer_flags: u32,
    timer_started_ns: Option<u64>,
    spi_in: u8,
    spi_full: bool,
    selected: bool,
}

impl Peripherals {
    /// A chip after power-up.
    pub fn new(part: Part, rows: Vec<Row>) -> Self {
        let mut new = Self {
            now_ns: BOOT_NS,
            spi_byte_ns: None,
            spi_bytes: 0,
            adc: Adc::new(part, Input::held(rows)),
            can: CanModel::new(),
            timer_offset_us: 0,
            first_tick_ns: None,
            watchdog: Watchdog::new(),
            clocks: Clocks::new(true, Pll::Sound),
            flash: FlashModel::new(),
            random: RandomModel::new(),
            // As delivered, but with the highest brown-out level.
            option_bytes: 0x0fff_aae1,
            pulled_up: [true; 2],
            servo_on: false,
            memory_fault: false,
            reset_asked: false,
            inject: Vec::new(),
            stop_run: None,
            instructions: 0,
            instructions_at_mailbox: 0,
            led: false,
            fpscr_to_write: 0,
            words: Vec::new(),
            core_words: Vec::new(),
            reset_flags: 0,
            alarms: [Alarm::default(); 2],
            timer_flags: 0,
            timer_started_ns: None,
            spi_in: 0,
            spi_full: false,
            selected: false,
        };
        new.reset(cause::POWER_ON);
        new
    }

    /// Resets everything on the chip; `flags` tell why in RCC_CSR. Time, the converter and
    /// the stage go on.
    pub fn reset(&mut self, flags: u32) {
        self.words = vec![0; RANGE.1 as usize / 4];
        self.core_words = vec![0; CORE.1 as usize / 4];
        self.core_words[0xef34 / 4] = 0xc000_0000; // FPCCR: ASPEN, LSPEN
        self.clocks = Clocks::new(self.clocks.crystal, self.clocks.pll);
        self.reset_asked = false;
        self.flash.reset();
        self.random.on = false;
        self.reset_flags |= flags;
        self.alarms = [Alarm::default(); 2];
        self.timer_flags = 0;
        self.timer_started_ns = None;
        let fed = self.watchdog.fed;
        self.watchdog = Watchdog::new();
        self.watchdog.fed = fed;
        let acknowledges = self.can.acknowledges;
        let bus = self.can.bus();
        let (sent, filled) = (std::mem::take(&mut self.can.sent), self.can.filled);
        self.can = CanModel::new();
        (self.can.sent, self.can.filled) = (sent, filled);
        self.can.acknowledges = acknowledges;
        self.can.set_bus(bus, self.now_ns);
    }

    fn timer_us(&self) -> u32 {
        let since = self.timer_started_ns.map_or(0, |start| self.now_ns - start);
        ((since / US) as u32).wrapping_add(self.timer_offset_us)
    }

    /// What the timer showed when the input's first row was there, us.
    pub fn motion_start_us(&self) -> Option<u32> {
        let since = self.adc.input.start_ns? - self.timer_started_ns?;
        Some(((since / US) as u32).wrapping_add(self.timer_offset_us))
    }

    /// Time of the next event, ns.
    pub fn next_event_ns(&self) -> Option<u64> {
        let alarms = self.alarms.iter().filter_map(|alarm| alarm.at_ns);
        alarms
            .chain(self.can.next_event_ns())
            .chain(self.watchdog.bites_ns())
            .min()
    }

    /// Does what is due by now.
    pub fn advance(&mut self) {
        let now_ns = self.now_ns;
        for (k, alarm) in self.alarms.iter_mut().enumerate() {
            if let Some(at) = alarm.at_ns.filter(|at| *at <= now_ns) {
                alarm.at_ns = None;
                self.timer_flags |= 2 << k;
                if k == 0 {
                    let first_ns = *self.first_tick_ns.get_or_insert(at);
                    self.adc.input.start(first_ns);
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

    /// Whether the memory protection forbids an access (PM0214, MPU): one region without
    /// access, over the map of the core.
    pub fn is_protected(&self, address: u32) -> bool {
        let word = |offset: usize| self.core_words[offset / 4];
        let (control, attributes) = (word(MPU_CTRL), word(MPU_RASR));
        let is_on = control & 0b101 == 0b101 && attributes & 1 == 1;
        let no_access = attributes >> 24 & 0b111 == 0;
        let bytes_log2 = (attributes >> 1 & 0x1f) + 1;
        is_on && no_access && (address ^ word(MPU_RBAR)) >> bytes_log2 == 0
    }

    /// Whether the chip is reset, and the program executes nothing more.
    pub fn stops(&self) -> bool {
        self.reset_asked || self.flash.power_lost || self.watchdog_bites()
    }

    /// Whether a tick's alarm (the first one) is what is pending.
    pub fn tick_is_due(&self) -> bool {
        self.timer_flags & 2 != 0
    }

    /// The interrupt that is taken next.
    pub fn pending_interrupt(&self) -> Option<u32> {
        let enabled =
            |irq: u32| self.core_words[0xe100 / 4 + irq as usize / 32] >> (irq % 32) & 1 == 1;
        let armed = self.words[(TIM2 + 0x0c) / 4];
        if self.can.transmit_interrupt() && enabled(IRQ_CAN1_TX) {
            Some(IRQ_CAN1_TX)
        } else if self.timer_flags & armed & 6 != 0 && enabled(IRQ_TIM2) {
            Some(IRQ_TIM2)
        } else {
            None
        }
    }

    /// A register, by its distance from the start of the range.
    pub fn read(&mut self, offset: usize) -> u32 {
        let word = self.words[offset / 4];
        match offset {
            o if (RCC..RCC + 0x10).contains(&o) => {
                self.now_ns += POLL_NS;
                self.clocks.read(o - RCC, self.now_ns)
            }
            o if o == RCC + 0x70 => word | (word & 1) << 1,
            o if o == RCC + 0x74 => word & 1 | (word & 1) << 1 | self.reset_flags,
            o if o == PWR + 4 => 1 << 14 | word,
            o if o == OPTCR => self.option_bytes,
            o if (FLASH + 4..OPTCR).contains(&o) => {
                self.flash.read_register(o - FLASH, &mut self.now_ns)
            }
            o if o == GPIOA + 0x10 => self.level(GPIOA, SELECT_PIN, self.pulled_up[0]),
            o if o == GPIOB + 0x10 => {
                self.level(GPIOB, SYNC_PIN, self.pulled_up[1])
                    | self.level(GPIOB, SERVO_PIN, false) & u32::from(!self.servo_on) << SERVO_PIN
            }
            o if o == TIM2 + 0x10 => {
                self.advance();
                self.timer_flags
            }
            o if o == TIM2 + 0x24 => self.timer_us(),
            o if o == SPI1 + 0x08 => 2 | u32::from(self.spi_full),
            o if o == SPI1 + 0x0c => {
                self.spi_full = false;
                self.spi_in.into()
            }
            o if (CAN1..CAN1 + 0x400).contains(&o) => {
                self.can.advance(self.now_ns);
                self.can.read(o - CAN1, self.now_ns)
            }
            o if (IWDG..IWDG + 0x10).contains(&o) => self.watchdog.read(o - IWDG, self.now_ns),
            _ => word,
        }
    }

    /// Writes a register.
    pub fn write(&mut self, offset: usize, value: u32) {
        self.words[offset / 4] = value;
        match offset {
            o if o == RCC + 0x74 && value & 1 << 24 != 0 => self.reset_flags = 0,
            o if o == TIM2 && value & 1 != 0 && self.timer_started_ns.is_none() => {
                self.timer_started_ns = Some(self.now_ns);
                // The counter starts at what the compare registers hold after a reset: both
                // match, though no alarm was set.
                self.timer_flags |= 6;
            }
            o if o == TIM2 + 0x10 => self.timer_flags &= value,
            o if o == TIM2 + 0x14 => {
                self.timer_flags |= value & 6;
                if value & 2 != 0 {
                    self.alarms[0].at_ns = None;
                }
            }
            o if o == TIM2 + 0x34 => self.set_alarm(0, value),
            o if o == TIM2 + 0x38 => self.set_alarm(1, value),
            o if (FLASH..OPTCR).contains(&o) => {
                self.flash.write_register(o - FLASH, value, self.now_ns)
            }
            o if (RCC..RCC + 0x10).contains(&o) => self.clocks.write(o - RCC, value, self.now_ns),
            o if (IWDG..IWDG + 0x10).contains(&o) => {
                self.watchdog.write(o - IWDG, value, self.now_ns)
            }
            o if o == SPI1 + 0x0c => {
                let byte = self.adc.exchange(value as u8);
                // Both converters need mode 1: in another one bits are shifted.
                let mode_1 = self.words[SPI1 / 4] & 3 == 1;
                self.spi_in = if mode_1 { byte } else { byte >> 1 };
                self.spi_full = true;
                self.spi_bytes += 1;
                let bits_ns = 8 * 1_000_000_000 / self.spi_hz();
                self.now_ns += self.spi_byte_ns.unwrap_or(bits_ns + SPI_GAP_NS);
            }
            o if o == GPIOA + 0x18 || o == GPIOB + 0x18 || o == GPIOC + 0x18 => {
                self.set_pins(o, value)
            }
            o if (CAN1..CAN1 + 0x400).contains(&o) => {
                let filled = self.can.filled;
                self.can.write(o - CAN1, value, self.now_ns);
                if self.can.filled != filled {
                    self.instructions_at_mailbox = self.instructions;
                }
            }
            _ => {}
        }
    }

    /// A register of the generator of random numbers.
    pub fn read_random(&mut self, offset: usize) -> u32 {
        self.now_ns += POLL_NS;
        self.random.read(offset)
    }

    /// Writes a register of the generator, which takes nothing without its clock.
    pub fn write_random(&mut self, offset: usize, value: u32) {
        if self.words[AHB2ENR / 4] & 1 << 6 != 0 {
            self.random.write(offset, value);
        }
    }

    /// Clock of SPI1, Hz.
    pub fn spi_hz(&self) -> u64 {
        BUS_2_HZ >> (1 + (self.words[SPI1 / 4] >> 3 & 7))
    }

    fn set_alarm(&mut self, k: usize, compare: u32) {
        let left = compare.wrapping_sub(self.timer_us());
        let start = self.timer_started_ns.unwrap_or(self.now_ns);
        let us = (self.now_ns - start) / US + u64::from(left);
        let at_ns = (left > 0).then_some(start + us * US);
        self.alarms[k] = Alarm { at_ns };
    }

    /// The bit of an input, by its resistor on the board and the one inside.
    fn level(&self, port: usize, pin: u32, pulled_up: bool) -> u32 {
        let inside = self.words[(port + 0x0c) / 4] >> (2 * pin) & 3;
        u32::from(pulled_up || inside == 1) << pin
    }

    fn set_pins(&mut self, register: usize, value: u32) {
        let level = |pin: u32| match (value >> pin & 1, value >> (16 + pin) & 1) {
            (1, _) => Some(true),
            (_, 1) => Some(false),
            _ => None,
        };
        match register {
            o if o == GPIOA + 0x18 => match level(SELECT_PIN) {
                Some(false) if !self.selected => {
                    self.selected = true;
                    self.adc.select(self.now_ns);
                }
                Some(true) if self.selected => {
                    self.selected = false;
                    self.adc.deselect(self.now_ns);
                }
                _ => {}
            },
            o if o == GPIOB + 0x18 => {
                if let Some(high) = level(SYNC_PIN) {
                    self.adc.control(high, self.now_ns);
                }
            }
            _ => self.led = level(LED_PIN).unwrap_or(self.led),
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
        let enable = (0xe100..0xe120).contains(&offset);
        let word = &mut self.core_words[offset / 4];
        *word = if enable { *word | value } else { value };
    }
}

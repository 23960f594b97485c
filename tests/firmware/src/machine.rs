//! The chip: core, memory, peripherals, interrupts.

mod exceptions;

pub use exceptions::{ACCESS_AND_STACKING, Cost};

use crate::adc_model::Row;
use crate::callbacks::{Context, count, inject, read, write};
use crate::can_model::BusState;
use crate::flash_model::{BYTES, FIRST};
use crate::image::{FLASH, FLASH_BYTES, Image, RAM, RAM_BYTES};
use crate::memory::Memory;
use crate::peripherals::{IRQ_TIM2, Peripherals, WINDOWS, cause};
use crate::unicorn::{Unicorn, register};
use std::ffi::{OsStr, c_void};
use tests::flash_model::Words;

/// Return address of interrupts. No program is there.
const RETURN: u32 = 0x1fff_0000;
/// Content of unused RAM.
const PAINT: u8 = 0xa5;
const WFI: u16 = 0xbf30;
/// Its number in the vector table.
const NMI: u32 = 2;

/// Content of RAM after power-on.
fn fill_with_noise(ram: &mut [u8]) {
    let mut words = Words(1);
    ram.fill_with(|| words.draw() as u8);
}

/// A controller with a program in flash.
pub struct Machine {
    core: Unicorn,
    /// Everything around the core.
    pub chip: Box<Peripherals>,
    flash: Box<Memory<FLASH_BYTES>>,
    _returns: Box<Memory<4096>>,
    vectors: [u32; 48],
    waits_at: u32,
    /// Address of the static that a debugger reads.
    pub stage_at: u32,
    /// Bytes of RAM below the statics, where the stack lies.
    stack_bytes: usize,
    asleep: bool,
    started: bool,
    /// Resets that the program asked for, after a panic, another fault or a lost crystal.
    pub panics: u32,
    /// Times the power was lost in an operation of the flash.
    pub power_cuts: u32,
    /// Whether such a cut is a brown-out, and RAM keeps its content.
    pub cuts_are_short: bool,
    /// Delay of the next tick's interrupt, ns.
    pub hold_ns: u64,
    /// Whether a handler of faults left registers of the FPU to be stacked late, where the stack had
    /// been (LSPACT; ARM DDI 0403, B1.5.7).
    pub lazy_left: bool,
    /// Resets by the watchdog.
    pub watchdog_resets: u32,
    /// What each interrupt of the timer took, where instructions are counted.
    pub costs: Vec<Cost>,
}

impl Machine {
    /// A chip with the program and two parameter slots in flash, before its first instruction.
    pub fn new(library: &OsStr, image: &Image, rows: Vec<Row>, slots: [&[u8]; 2]) -> Self {
        let core = Unicorn::open(library);
        let mut flash = Box::<Memory<FLASH_BYTES>>::default();
        flash.0.copy_from_slice(&image.flash);
        let mut returns = Box::<Memory<4096>>::default();
        let mut chip = Box::new(Peripherals::new(rows));
        chip.ram.0[..image.stack_bytes].fill(PAINT);
        fill_with_noise(&mut chip.ram.0[image.stack_bytes..]);
        for (slot, contents) in (0..).zip(slots) {
            chip.flash.sectors.load(slot, contents);
        }
        let (before, behind) = ((FIRST - FLASH) as usize, (FIRST - FLASH) as usize + BYTES);
        // SAFETY: flash and chip are boxes that the machine keeps as long as the core, and that are
        // touched only between two runs of it or by its callbacks.
        unsafe {
            let memory = flash.0.as_mut_ptr();
            core.map_memory(FLASH.into(), memory, before);
            let (from, rest) = (u64::from(FLASH) + behind as u64, FLASH_BYTES - behind);
            core.map_memory(from, memory.add(behind), rest);
            core.map_memory(RAM.into(), chip.ram.0.as_mut_ptr(), RAM_BYTES);
            core.map_memory(RETURN.into(), returns.0.as_mut_ptr(), 4096);
        }
        for window in WINDOWS {
            let context = context(&core, &mut chip, window.0);
            // SAFETY: as above; the context is leaked.
            unsafe { core.map_io(window, read, write, context) };
        }
        let mut vectors = [0; 48];
        for (k, vector) in vectors.iter_mut().enumerate() {
            *vector = image.word(FLASH + 4 * k as u32);
        }
        Self {
            core,
            chip,
            flash,
            _returns: returns,
            vectors,
            waits_at: waits_at(image),
            stage_at: image.address("STAGE"),
            stack_bytes: image.stack_bytes,
            asleep: false,
            started: false,
            panics: 0,
            power_cuts: 0,
            cuts_are_short: false,
            hold_ns: 0,
            lazy_left: false,
            watchdog_resets: 0,
            costs: Vec::new(),
        }
    }

    /// Counts instructions from now on. Call it before the first run.
    pub fn count_instructions(&mut self) {
        let context = context(&self.core, &mut self.chip, 0);
        // SAFETY: as in `new`.
        unsafe { self.core.hook_code(count, context, (1, 0)) };
    }

    /// Changes the registers that `chip.inject` says whenever the core comes to `address`. Call it
    /// before the first run.
    pub fn hook_injection(&mut self, address: u32) {
        let context = context(&self.core, &mut self.chip, 0);
        let at = u64::from(address);
        // SAFETY: as in `new`.
        unsafe { self.core.hook_code(inject, context, (at, at)) };
    }

    /// Changes FPSCR while the core sleeps, like an interrupt that does not restore it.
    pub fn set_fpscr(&self, value: u32) {
        self.core.set(register::FPSCR, value);
    }

    /// Takes the power away and gives it back: RAM holds noise then.
    pub fn power_cycle(&mut self) {
        self.chip.flash.power_on();
        fill_with_noise(&mut self.chip.ram.0[self.stack_bytes..]);
        self.reset(cause::POWER_ON);
    }

    /// The supply drops for a moment: RAM keeps its content.
    pub fn brown_out(&mut self) {
        self.chip.flash.power_on();
        self.reset(cause::BROWN_OUT);
    }

    /// Pulls the pin NRST low.
    pub fn reset_by_pin(&mut self) {
        self.reset(cause::PIN);
    }

    fn reset(&mut self, cause: u32) {
        self.chip.reset(cause);
        self.asleep = false;
    }

    /// Resets if the watchdog bit or the program asked for it, and says whether.
    fn reset_if_due(&mut self) -> bool {
        if self.chip.flash.sectors.is_off() {
            self.power_cuts += 1;
            match self.cuts_are_short {
                true => self.brown_out(),
                false => self.power_cycle(),
            }
        } else if self.chip.watchdog_bites() {
            self.watchdog_resets += 1;
            self.reset(cause::WATCHDOG);
        } else if self.chip.reset_asked {
            self.panics += 1;
            self.reset(cause::SOFTWARE);
        } else {
            return false;
        }
        true
    }

    /// Runs for `ns`. The start-up after power-on comes on top.
    pub fn run_ns(&mut self, ns: u64) {
        if !self.started {
            self.started = true;
            self.boot();
        }
        let end_ns = self.chip.now_ns + ns;
        loop {
            if self.chip.now_ns <= end_ns && (self.reset_if_due() || !self.asleep) {
                self.boot();
                continue;
            }
            if self.chip.clocks.interrupts() && self.chip.now_ns <= end_ns {
                self.interrupt(NMI);
                continue;
            }
            let stands = self.chip.clocks.stands(self.chip.now_ns);
            while let Some(irq) = self.chip.pending_interrupt().filter(|_| !stands) {
                if irq == IRQ_TIM2 && self.chip.tick_is_due() && self.hold_ns > 0 {
                    self.chip.now_ns += std::mem::take(&mut self.hold_ns);
                    self.chip.advance();
                }
                if self.chip.stops() {
                    break;
                }
                self.interrupt(16 + irq);
                self.chip.advance();
            }
            if self.chip.stops() && self.chip.now_ns <= end_ns {
                continue;
            }
            match self.chip.next_event_ns() {
                Some(at) if at.max(self.chip.now_ns) <= end_ns => {
                    self.chip.now_ns = self.chip.now_ns.max(at)
                }
                _ => {
                    self.chip.now_ns = self.chip.now_ns.max(end_ns);
                    return;
                }
            }
            self.chip.advance();
        }
    }

    /// Runs for `ticks` of 2 ms.
    pub fn run_ticks(&mut self, ticks: u64) {
        self.run_ns(ticks * 2_000_000);
    }

    /// From now on the bus is so.
    pub fn set_bus(&mut self, bus: BusState) {
        self.chip.can.set_bus(bus, self.chip.now_ns);
    }

    /// From the reset vector until the program sleeps or the chip is reset.
    fn boot(&mut self) {
        if !self.asleep {
            self.core.set(register::SP, self.vectors[0]);
            self.core.set(register::FPSCR, 0);
            self.go(self.vectors[1], self.waits_at);
            self.asleep = true;
        }
    }

    /// Flips a bit of RAM.
    pub fn flip(&mut self, address: u32, bit: u32) {
        let (memory, start): (&mut [u8], _) = match address < RAM {
            true => (&mut self.flash.0, FLASH),
            false => (&mut self.chip.ram.0, RAM),
        };
        if let Some(byte) = memory.get_mut((address - start + bit / 8) as usize) {
            *byte ^= 1 << (bit % 8);
        }
    }

    /// A word of RAM.
    pub fn word(&self, address: u32) -> u32 {
        let at = (address - RAM) as usize;
        let ram = &self.chip.ram.0;
        ram.get(at..at + 4)
            .map_or(0, |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
    }

    /// Bytes of stack that were ever used.
    pub fn stack_bytes(&self) -> usize {
        let stack = &self.chip.ram.0[..self.stack_bytes];
        let untouched = stack.iter().take_while(|&&b| b == PAINT).count();
        stack.len() - untouched
    }

    /// Bytes of flash outside the parameter sectors.
    pub fn flash(&self) -> &[u8] {
        &self.flash.0
    }
}

/// The one place where the program sleeps.
fn waits_at(image: &Image) -> u32 {
    let start = image.range("_stext").or_else(|| image.range("__stext"));
    let start = start.expect("its instructions").start;
    let end = image.address("__etext");
    let code = &image.flash[(start - FLASH) as usize..(end - FLASH) as usize];
    let halves = (0u32..).zip(code.as_chunks::<2>().0);
    let found: Vec<_> = halves
        .filter(|(_, half)| u16::from_le_bytes(**half) == WFI)
        .collect();
    assert_eq!(found.len(), 1, "places that look like WFI");
    start + 2 * found[0].0
}

/// What a callback is given. It is leaked, so that it lives as long as the emulator.
fn context(core: &Unicorn, chip: &mut Peripherals, start: u64) -> *mut c_void {
    let (stop, write) = (core.stop, core.write);
    let context = Context {
        chip,
        start,
        stop,
        write,
    };
    (&raw mut *Box::leak(Box::new(context))).cast()
}

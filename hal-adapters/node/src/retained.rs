//! The record in RAM that survives a reset: the step of the start-up, the last fault, the running parameters and the zero
//! deviation.
//!
//! After power-on the RAM holds noise and is not read. After any other reset it is used only if its check is right.

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
use runtime::PlanarPose;
use runtime::blob::CRC;

/// Words of the record with its check.
pub const WORDS: usize = 10;

/// Marks a record of this layout.
const MAGIC: u32 = 0x5354_4733;
/// Bits of the first word besides the step.
const CRASHED_BIT: u32 = 8;
const PROVEN_BIT: u32 = 9;
const ACTIVATED_BIT: u32 = 10;
const EARLY_SHIFT: u32 = 16;
/// Early faults in a row that stop the program.
const EARLY_MAX: u8 = 2;

/// The step of the program.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Step {
    /// The start-up is done.
    #[default]
    Ticking = 0,
    /// Starts crystal and PLL.
    Clocks = 1,
    /// Starts the PLL from the internal oscillator.
    InternalClock = 2,
    /// Sets up pins and CAN.
    Peripherals = 3,
    /// Reads the parameter slots.
    Parameters = 4,
    /// Sets up the converter.
    Converter = 5,
}

impl Step {
    const ALL: [Self; 6] = [
        Self::Ticking,
        Self::Clocks,
        Self::InternalClock,
        Self::Peripherals,
        Self::Parameters,
        Self::Converter,
    ];
}

/// A cause of a reset that a healthy controller never has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum FaultKind {
    /// The program panicked. Address: its `core::panic::Location`; detail: the line.
    Panic = 1,
    /// A fault of the core. Address: the program counter; detail: CFSR.
    HardFault = 2,
    /// The stack left the RAM. Address: the stack pointer; detail: CFSR.
    StackOverflow = 3,
    /// The crystal stopped. Address and detail: 0.
    ClockFailed = 4,
    /// The watchdog was not fed. Address and detail: 0.
    Watchdog = 5,
    /// The parameters in RAM changed. Address and detail: 0.
    Constants = 6,
}

/// The last fault, as words.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Fault {
    /// The [`FaultKind`] in bits 0 to 7, 0 for none; the [`Step`] in bits 8 to 15.
    pub kind_and_step: u32,
    /// See [`FaultKind`].
    pub address: u32,
    /// See [`FaultKind`].
    pub detail: u32,
}

impl Fault {
    const fn new(kind: FaultKind, step: Step, address: u32, detail: u32) -> Self {
        Self {
            kind_and_step: kind as u32 | (step as u32) << 8,
            address,
            detail,
        }
    }

    /// Whether the crystal stopped, or the PLL never locked to it, where only the watchdog ends
    /// the wait.
    pub fn is_of_the_crystal(&self) -> bool {
        let hung = Self::new(FaultKind::Watchdog, Step::Clocks, 0, 0);
        *self == hung || self.kind_and_step & 0xff == FaultKind::ClockFailed as u32
    }
}

/// The record.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Retained {
    /// The step that runs.
    pub step: Step,
    /// The last fault since power-on.
    pub fault: Fault,
    /// Resets by faults since power-on. Saturates.
    pub faults: u32,
    /// Whether the last fault is the cause of this start.
    pub crashed: bool,
    /// Faults in a row in the first second. Saturates.
    pub early_faults: u8,
    /// Whether the program has run for a second since this start.
    pub proven: bool,
    /// Whether the newest parameters are to run.
    pub activated: bool,
    /// CRC of the blob that runs, or ran last; 0: none since power-on.
    pub running: u32,
    /// The zero deviation that was measured with it, m and rad; zero before a re-zero.
    pub zero: PlanarPose<f32>,
}

impl Retained {
    /// In place of a damaged record. The running blob is unknown, and so is the zero deviation: it is not a number, which
    /// [`crate::node::Node::restore_zero`] refuses.
    pub fn damaged() -> Self {
        let zero = PlanarPose {
            x_m: f32::NAN,
            ..PlanarPose::ZERO
        };
        Self {
            zero,
            ..Self::default()
        }
    }

    /// Whether it stands in place of a damaged record.
    pub const fn is_damaged(&self) -> bool {
        self.zero.x_m.is_nan()
    }

    /// Notes a fault in the running step. A fault of the crystal has its own remedy.
    pub fn note(&mut self, kind: FaultKind, address: u32, detail: u32) {
        self.fault = Fault::new(kind, self.step, address, detail);
        self.faults = self.faults.saturating_add(1);
        self.crashed = true;
        if !self.proven && !self.fault.is_of_the_crystal() {
            self.early_faults = self.early_faults.saturating_add(1);
        }
    }

    /// The newest parameters run from the next start on; earlier faults are acknowledged.
    pub fn activate(&mut self) {
        self.activated = true;
        self.early_faults = 0;
        if self.is_damaged() {
            self.zero = PlanarPose::ZERO;
        }
    }

    /// The blob of this CRC runs, with this zero deviation.
    pub const fn runs(&mut self, crc: u32, zero: PlanarPose<f32>) {
        (self.running, self.zero, self.activated) = (crc, zero, false);
    }

    /// Whether the program faulted twice in a row in its first second.
    pub const fn has_faulted_twice(&self) -> bool {
        self.early_faults >= EARLY_MAX
    }

    /// The program has run for a second. A stopped program stays stopped.
    pub const fn prove(&mut self) {
        self.proven = true;
        if !self.has_faulted_twice() {
            self.early_faults = 0;
        }
    }

    /// The words, the check last.
    pub fn to_words(&self) -> [u32; WORDS] {
        let zero = self.zero;
        let content = [
            MAGIC
                ^ (self.step as u32
                    | (self.crashed as u32) << CRASHED_BIT
                    | (self.proven as u32) << PROVEN_BIT
                    | (self.activated as u32) << ACTIVATED_BIT
                    | (self.early_faults as u32) << EARLY_SHIFT),
            self.fault.kind_and_step,
            self.fault.address,
            self.fault.detail,
            self.faults,
            self.running,
            zero.x_m.to_bits(),
            zero.y_m.to_bits(),
            zero.rz_rad.to_bits(),
        ];
        let [a, b, c, d, e, f, g, h, i] = content;
        [a, b, c, d, e, f, g, h, i, check(&content)]
    }

    /// The record in the words, if its check is right.
    pub fn from_words(words: &[u32; WORDS]) -> Option<Self> {
        let [content @ .., stored] = words;
        let [state, kind_and_step, address, detail, rest @ ..] = *content;
        let [faults, running, zero @ ..] = rest;
        let state = state ^ MAGIC;
        let step = *Step::ALL.get(usize::from(state as u8))?;
        (check(content) == *stored).then_some(Self {
            step,
            fault: Fault {
                kind_and_step,
                address,
                detail,
            },
            faults,
            crashed: state >> CRASHED_BIT & 1 == 1,
            proven: state >> PROVEN_BIT & 1 == 1,
            activated: state >> ACTIVATED_BIT & 1 == 1,
            early_faults: (state >> EARLY_SHIFT) as u8,
            running,
            zero: PlanarPose::from_array(zero.map(f32::from_bits)),
        })
    }
}

fn check(content: &[u32; WORDS - 1]) -> u32 {
    let mut digest = CRC.digest();
    content
        .iter()
        .for_each(|word| digest.update(&word.to_le_bytes()));
    digest.finalize()
}

/// RAM for a record. A program puts it where the start-up code neither clears nor sets it:
///
/// ```
/// use stage_node::retained::RetainedRam;
///
/// #[unsafe(link_section = ".uninit.RETAINED")]
/// static RETAINED: RetainedRam = RetainedRam::new();
/// # RETAINED.update(|record| record.faults += 1);
/// # assert_eq!(RETAINED.read().map(|record| record.faults), Some(1));
/// ```
#[derive(Debug)]
pub struct RetainedRam([AtomicU32; WORDS]);

impl Default for RetainedRam {
    fn default() -> Self {
        Self::new()
    }
}

impl RetainedRam {
    /// RAM without a record.
    pub const fn new() -> Self {
        Self([const { AtomicU32::new(0) }; WORDS])
    }

    /// The record, if its check is right.
    pub fn read(&self) -> Option<Retained> {
        let words = core::array::from_fn(|k| self.0.get(k).map_or(0, |word| word.load(Relaxed)));
        Retained::from_words(&words)
    }

    /// Replaces the record.
    pub fn write(&self, record: &Retained) {
        for (to, word) in self.0.iter().zip(record.to_words()) {
            to.store(word, Relaxed);
        }
    }

    /// Changes the record.
    pub fn update(&self, change: impl FnOnce(&mut Retained)) {
        let mut record = self.read().unwrap_or_else(Retained::damaged);
        change(&mut record);
        self.write(&record);
    }

    /// Notes that a step of the start-up begins.
    pub fn begin(&self, step: Step) {
        self.update(|record| record.step = step);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record() -> Retained {
        let mut record = Retained {
            step: Step::Converter,
            faults: 3,
            early_faults: 1,
            proven: true,
            activated: true,
            running: 0x1234_5678,
            zero: PlanarPose {
                x_m: 1.5e-6,
                y_m: -2e-7,
                rz_rad: 3e-6,
            },
            ..Retained::default()
        };
        record.note(FaultKind::HardFault, 0x0800_c124, 0x400);
        record
    }

    #[test]
    fn a_record_reads_back_and_no_changed_bit_is_accepted() {
        let record = record();
        let words = record.to_words();
        assert_eq!(Retained::from_words(&words), Some(record));
        for bit in 0..32 * WORDS {
            let mut changed = words;
            changed[bit / 32] ^= 1 << (bit % 32);
            assert_eq!(Retained::from_words(&changed), None, "bit {bit}");
        }
        for random in [[0; WORDS], [u32::MAX; WORDS], [0xa5a5_a5a5; WORDS]] {
            assert_eq!(Retained::from_words(&random), None);
        }
    }

    #[test]
    fn the_crystal_is_blamed_for_its_own_faults_only() {
        let of = |kind, step| Fault::new(kind, step, 0, 0).is_of_the_crystal();
        assert!(of(FaultKind::Watchdog, Step::Clocks));
        assert!(of(FaultKind::ClockFailed, Step::Ticking));
        assert!(!of(FaultKind::Watchdog, Step::InternalClock));
        assert!(!of(FaultKind::Watchdog, Step::Ticking));
        assert!(!of(FaultKind::HardFault, Step::Clocks));
    }
}

//! What survives a reset in RAM that the start-up code leaves alone: the step of the start-up
//! that was running, the last fault, and the zero deviation.
//!
//! After power-on that RAM holds anything, and its content is not read. After any other reset
//! it is used only if its check is right.

use crc::{CRC_32_ISCSI, Crc, NoTable};
use runtime::PlanarPose;

/// Words of the record with its check.
pub const WORDS: usize = 11;

/// Marks a record of this layout.
const MAGIC: u32 = 0x5354_4732;
/// Bits of the first word besides the step.
const CRASHED_BIT: u32 = 8;
const PROVEN_BIT: u32 = 9;
const EARLY_SHIFT: u32 = 16;
/// After so many early faults in a row the parameters are blamed.
const EARLY_MAX: u8 = 2;
const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISCSI);

/// What the program was doing.
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
}

/// Parameters that made the program fault twice in a row at its start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blamed {
    /// Those that it used.
    Newest,
    /// Those that it had begun to check.
    Blob {
        /// CRC of the blob.
        crc: u32,
    },
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

/// A zero deviation and the blob that it was measured with.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct KeptZero {
    /// CRC of that blob.
    pub blob: u32,
    /// The zero deviation, m and rad.
    pub zero: PlanarPose<f32>,
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
    /// Faults in a row that came while the parameters were read, or in the first ticks with them.
    /// Saturates.
    pub early_faults: u8,
    /// CRC of the blob that is being checked; 0: none.
    pub checked_blob: u32,
    /// Whether the ticks since this start are enough to say that the parameters are not at fault.
    pub proven: bool,
    /// The zero deviation; that of an unmoved stage is zero.
    pub zero: KeptZero,
}

impl Retained {
    /// In place of a record that is damaged: whether a zero deviation was set is not known, so
    /// it is not a number, which [`crate::node::Node::restore_zero`] does not take.
    pub fn damaged() -> Self {
        let zero = PlanarPose {
            x_m: f32::NAN,
            ..PlanarPose::ZERO
        };
        Self {
            zero: KeptZero { blob: 0, zero },
            ..Self::default()
        }
    }

    /// Notes a fault in the step that runs.
    pub const fn note(&mut self, kind: FaultKind, address: u32, detail: u32) {
        self.fault = Fault::new(kind, self.step, address, detail);
        self.faults = self.faults.saturating_add(1);
        self.crashed = true;
        let by_core = matches!(
            kind,
            FaultKind::Panic | FaultKind::HardFault | FaultKind::StackOverflow
        );
        // Late ticks are the converter's or the bus's: decoding takes a bounded number of steps,
        // whatever the parameters are. Blamed for them, sound parameters would be passed over.
        let early = match self.step {
            Step::Parameters => by_core || matches!(kind, FaultKind::Watchdog),
            Step::Ticking => by_core && !self.proven,
            _ => false,
        };
        if early {
            self.early_faults = self.early_faults.saturating_add(1);
        }
    }

    /// What made the program fault twice in a row at its start. Asked once in a start: the next
    /// parameters begin anew.
    pub const fn blames(&mut self) -> Option<Blamed> {
        self.proven = false;
        let checked = core::mem::replace(&mut self.checked_blob, 0);
        if self.early_faults < EARLY_MAX {
            return None;
        }
        self.early_faults = 0;
        Some(match checked {
            0 => Blamed::Newest,
            crc => Blamed::Blob { crc },
        })
    }

    /// The program has run long enough with its parameters.
    pub const fn prove(&mut self) {
        self.proven = true;
        self.early_faults = 0;
    }

    /// The words, the check last.
    pub fn to_words(&self) -> [u32; WORDS] {
        let zero = self.zero.zero;
        let content = [
            MAGIC
                ^ (self.step as u32
                    | (self.crashed as u32) << CRASHED_BIT
                    | (self.proven as u32) << PROVEN_BIT
                    | (self.early_faults as u32) << EARLY_SHIFT),
            self.fault.kind_and_step,
            self.fault.address,
            self.fault.detail,
            self.faults,
            self.checked_blob,
            self.zero.blob,
            zero.x_m.to_bits(),
            zero.y_m.to_bits(),
            zero.rz_rad.to_bits(),
        ];
        let [a, b, c, d, e, f, g, h, i, j] = content;
        [a, b, c, d, e, f, g, h, i, j, check(&content)]
    }

    /// The record of these words, if its check is right.
    pub fn from_words(words: &[u32; WORDS]) -> Option<Self> {
        let [content @ .., stored] = words;
        let [
            state,
            kind_and_step,
            address,
            detail,
            faults,
            checked_blob,
            blob,
            x,
            y,
            rz,
        ] = *content;
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
            checked_blob,
            crashed: state >> CRASHED_BIT & 1 == 1,
            proven: state >> PROVEN_BIT & 1 == 1,
            early_faults: (state >> EARLY_SHIFT) as u8,
            zero: KeptZero {
                blob,
                zero: PlanarPose {
                    x_m: f32::from_bits(x),
                    y_m: f32::from_bits(y),
                    rz_rad: f32::from_bits(rz),
                },
            },
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

#[cfg(test)]
mod tests {
    use super::*;

    fn record() -> Retained {
        let mut record = Retained {
            step: Step::Converter,
            faults: 3,
            early_faults: 1,
            checked_blob: 0x89ab_cdef,
            proven: true,
            zero: KeptZero {
                blob: 0x1234_5678,
                zero: PlanarPose {
                    x_m: 1.5e-6,
                    y_m: -2e-7,
                    rz_rad: 3e-6,
                },
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
    fn a_fault_is_noted_with_its_kind_and_step() {
        let record = record();
        assert_eq!(record.fault.kind_and_step, 0x0502);
        assert_eq!((record.fault.address, record.faults), (0x0800_c124, 4));
        assert!(record.crashed);
    }

    #[test]
    fn parameters_are_blamed_for_two_faults_in_a_row_at_their_start() {
        let mut record = Retained::default();
        let mut fault = |kind, step, proves| {
            record.step = step;
            if proves {
                record.prove();
            }
            record.note(kind, 0, 0);
            record.blames().is_some()
        };
        assert!(!fault(FaultKind::HardFault, Step::Ticking, true));
        assert!(!fault(FaultKind::Watchdog, Step::Clocks, false));
        assert!(!fault(FaultKind::Panic, Step::Ticking, false));
        assert!(!fault(FaultKind::Watchdog, Step::Ticking, false));
        assert!(!fault(FaultKind::HardFault, Step::Converter, false));
        assert!(!fault(FaultKind::HardFault, Step::Ticking, true));
        assert!(!fault(FaultKind::Watchdog, Step::Parameters, false));
        assert!(fault(FaultKind::StackOverflow, Step::Ticking, false));
        // Those that are used in their place begin anew.
        assert!(!fault(FaultKind::Panic, Step::Ticking, false));
        assert!(fault(FaultKind::Panic, Step::Ticking, false));
        assert!(!fault(FaultKind::Panic, Step::Ticking, true));
    }

    #[test]
    fn a_blob_is_blamed_if_the_second_fault_came_while_it_was_checked() {
        let mut record = Retained::default();
        for (first, second, blamed) in [
            (7, 7, Blamed::Blob { crc: 7 }),
            (0, 7, Blamed::Blob { crc: 7 }),
            (7, 0, Blamed::Newest),
        ] {
            for (checked, expected) in [(first, None), (second, Some(blamed))] {
                record.step = Step::Parameters;
                record.checked_blob = checked;
                record.note(FaultKind::HardFault, 0, 0);
                assert_eq!(record.blames(), expected);
                assert_eq!(record.checked_blob, 0);
            }
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

    #[test]
    fn every_step_has_the_number_of_its_place() {
        for (number, step) in (0u8..).zip(Step::ALL) {
            assert_eq!(step as u8, number);
        }
    }
}

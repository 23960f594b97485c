//! The record in RAM that survives a reset: the step of the start-up, the last fault, the running parameters and the zero
//! deviation.
//!
//! After power-on the RAM holds noise and is not read. After any other reset it is used only if its check is right.

use core::sync::atomic::{AtomicU8, Ordering::Relaxed};
use hal_adapters::can::status::BoardFacts;
use runtime::PlanarPose;
use runtime::blob::{CRC, CRC_BYTES};
use serde::{Deserialize, Serialize};

/// Bytes of the record with its check.
const BYTES: usize = 52;
/// Marks a record of this layout.
const MAGIC: u32 = 0x5354_4734;

/// Early faults in a row that stop the program.
const EARLY_MAX: u8 = 2;

/// The step of the program.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
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

    /// The bytes, the check last.
    fn to_bytes(self) -> [u8; BYTES] {
        let mut bytes = [0; BYTES];
        if let Some((content, check)) = bytes.split_last_chunk_mut() {
            // The longest record fits.
            let _ = postcard::to_slice(&(MAGIC, self), content);
            *check = CRC.checksum(content).to_le_bytes();
        }
        bytes
    }

    /// The record in the bytes, if its check is right.
    fn from_bytes(bytes: &[u8; BYTES]) -> Option<Self> {
        let (content, check) = bytes.split_last_chunk::<CRC_BYTES>()?;
        let (magic, record) = postcard::from_bytes::<(u32, Self)>(content).ok()?;
        let is_sound = magic == MAGIC && CRC.checksum(content).to_le_bytes() == *check;
        is_sound.then_some(record)
    }

    /// The facts of a controller with these option bytes and checks of its board.
    pub const fn facts(&self, option_bytes: u32, board_checks: u32) -> BoardFacts {
        BoardFacts {
            last_fault: self.fault.kind_and_step,
            fault_address: self.fault.address,
            fault_detail: self.fault.detail,
            faults: self.faults,
            option_bytes,
            board_checks,
        }
    }
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
pub struct RetainedRam([AtomicU8; BYTES]);

impl Default for RetainedRam {
    fn default() -> Self {
        Self::new()
    }
}

impl RetainedRam {
    /// RAM without a record.
    pub const fn new() -> Self {
        Self([const { AtomicU8::new(0) }; BYTES])
    }

    /// The record, if its check is right.
    pub fn read(&self) -> Option<Retained> {
        Retained::from_bytes(&self.0.each_ref().map(|byte| byte.load(Relaxed)))
    }

    /// Replaces the record.
    pub fn write(&self, record: &Retained) {
        for (to, byte) in self.0.iter().zip(record.to_bytes()) {
            to.store(byte, Relaxed);
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
        let bytes = record.to_bytes();
        assert_eq!(Retained::from_bytes(&bytes), Some(record));
        for bit in 0..8 * BYTES {
            let mut changed = bytes;
            changed[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(Retained::from_bytes(&changed), None, "bit {bit}");
        }
        for random in [[0; BYTES], [0xff; BYTES], [0xa5; BYTES]] {
            assert_eq!(Retained::from_bytes(&random), None);
        }
    }

    #[test]
    fn the_longest_record_fits() {
        let longest = Retained {
            fault: Fault {
                kind_and_step: u32::MAX,
                address: u32::MAX,
                detail: u32::MAX,
            },
            faults: u32::MAX,
            early_faults: u8::MAX,
            running: u32::MAX,
            ..record()
        };
        assert_eq!(Retained::from_bytes(&longest.to_bytes()), Some(longest));
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

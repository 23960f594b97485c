//! The start-up, apart from the chip: what is known of the run that a reset ended.

use crate::node::Node;
use crate::retained::{Blamed, FaultKind, KeptZero, Retained};
use crate::store::Check;

/// After so many ticks, 1 s, parameters are not blamed for a fault.
pub const PROVEN_TICKS: u32 = 500;

/// The cause of this start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// The power came back: what is in RAM means nothing.
    PowerOn,
    /// The watchdog was not fed.
    Watchdog,
    /// The program asked for it, or the pin did.
    Reset,
}

/// What was before this start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Before {
    /// The cause of this start.
    pub cause: Cause,
    /// Whether the watchdog or the program itself caused it, on a fault.
    pub by_fault: bool,
    /// The parameters that made the program fault twice in a row.
    pub blames: Option<Blamed>,
    /// The record that survived; after power-on an empty one. It is to be retained again.
    pub record: Retained,
}

impl Before {
    /// What the record in RAM says, `None` if its check is wrong.
    pub fn of(cause: Cause, kept: Option<Retained>) -> Self {
        let mut record = match cause {
            Cause::PowerOn => Retained::default(),
            Cause::Watchdog | Cause::Reset => kept.unwrap_or_else(Retained::damaged),
        };
        if cause == Cause::Watchdog {
            record.note(FaultKind::Watchdog, 0, 0);
        }
        let by_fault = core::mem::take(&mut record.crashed);
        let blames = record.blames();
        Self {
            cause,
            by_fault,
            blames,
            record,
        }
    }

    /// Whether the parameters that it used are to blame.
    pub fn blames_newest(&self) -> bool {
        self.blames == Some(Blamed::Newest)
    }

    /// What blobs are checked for at start-up; a fault in a check is blamed on its blob, whose CRC
    /// goes to `note`.
    pub const fn check(&self, serial: Option<&'static str>, note: fn(Option<u32>)) -> Check {
        let suspect = match self.blames {
            Some(Blamed::Blob { crc }) => Some(crc),
            Some(Blamed::Newest) | None => None,
        };
        Check {
            serial,
            suspect,
            note,
        }
    }

    /// Restores the zero deviation if it was measured with the blob of this CRC. Says whether one
    /// may have been lost.
    pub fn restore_zero(&self, node: &mut Node<'_>, blob: u32) -> bool {
        let KeptZero { blob: of, zero } = self.record.zero;
        if of == blob {
            node.restore_zero(zero);
        }
        node.zero() != zero
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ram_is_not_believed_after_power_on() {
        let mut kept = Retained::default();
        kept.note(FaultKind::HardFault, 1, 2);
        let before = Before::of(Cause::PowerOn, Some(kept));
        assert_eq!(before.record, Retained::default());
        assert!(!before.by_fault && before.blames.is_none());
    }

    #[test]
    fn a_fault_is_the_cause_of_one_start_only() {
        let mut kept = Retained::default();
        kept.note(FaultKind::Panic, 1, 2);
        let first = Before::of(Cause::Reset, Some(kept));
        let second = Before::of(Cause::Reset, Some(first.record));
        assert_eq!((first.by_fault, second.by_fault), (true, false));
        assert_eq!((first.record.faults, second.record.faults), (1, 1));
    }

    #[test]
    fn a_bite_of_the_watchdog_is_noted() {
        let before = Before::of(Cause::Watchdog, Some(Retained::default()));
        assert!(before.by_fault);
        assert_eq!(before.record.faults, 1);
    }

    #[test]
    fn of_a_damaged_record_a_zero_may_have_been_lost() {
        let before = Before::of(Cause::Reset, None);
        assert!(before.record.zero.zero.x_m.is_nan());
        assert!(!before.by_fault);
    }
}

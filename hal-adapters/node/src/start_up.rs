//! The start-up, apart from the chip: the run before the reset decides which parameters run.

use crate::node::Node;
use crate::records::Choice;
use crate::retained::{FaultKind, Retained, RetainedRam};

/// The cause of this start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// The power came back: RAM holds noise.
    PowerOn,
    /// The watchdog was not fed.
    Watchdog,
    /// The program asked for it, the pin did, or the supply dropped for a moment.
    Reset,
}

/// Why the controller runs no parameters until an activation or power-on: the reason of its state in the status
/// frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Stop {
    /// The program faulted twice in its first second.
    FaultedTwice = 1,
    /// The record in RAM is damaged.
    NotKnown = 2,
    /// The blob that ran before the reset is no longer in flash.
    Gone = 3,
    /// The program in flash differs from its check.
    ProgramChanged = 4,
}

/// The state before this start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Before {
    /// Whether the watchdog or the program itself caused it, on a fault.
    pub by_fault: bool,
    /// Why no parameters run.
    pub stop: Option<Stop>,
    /// The blob that runs. A reset alone never changes it under a servo.
    pub choice: Choice,
    /// The record that survived, to be retained again; empty after power-on.
    pub record: Retained,
}

impl Before {
    /// Evaluates the record in RAM, `None` if its check is wrong.
    pub fn new(cause: Cause, kept: Option<Retained>) -> Self {
        let mut record = match cause {
            Cause::PowerOn => Retained::default(),
            Cause::Watchdog | Cause::Reset => kept.unwrap_or_else(Retained::damaged),
        };
        // A fault that was noted may have waited for the watchdog.
        if cause == Cause::Watchdog && !record.crashed {
            record.note(FaultKind::Watchdog, 0, 0);
        }
        let by_fault = core::mem::take(&mut record.crashed);
        record.proven = false;
        let stop = if record.is_damaged() {
            Some(Stop::NotKnown)
        } else {
            Some(Stop::FaultedTwice).filter(|_| record.has_faulted_twice())
        };
        let choice = match record.running {
            _ if stop.is_some() => Choice::Nothing,
            0 => Choice::Newest,
            _ if record.activated => Choice::Newest,
            crc => Choice::Blob(crc),
        };
        Self {
            by_fault,
            stop,
            choice,
            record,
        }
    }

    /// Evaluates the record in this RAM, and keeps it there.
    pub fn of_ram(cause: Cause, ram: &RetainedRam) -> Self {
        let before = Self::new(cause, ram.read());
        ram.write(&before.record);
        before
    }

    /// Runs nothing, whatever ran before.
    pub const fn stop_by(&mut self, stop: Stop) {
        (self.stop, self.choice) = (Some(stop), Choice::Nothing);
    }

    /// Why nothing runs, after the attempt to load the parameters.
    pub fn stop(&self, is_loaded: bool) -> Option<Stop> {
        let is_gone = !is_loaded && matches!(self.choice, Choice::Blob(_));
        self.stop.or(is_gone.then_some(Stop::Gone))
    }

    /// Restores the zero deviation if it belongs to the blob of this CRC. Returns whether a zero deviation may have been
    /// lost.
    pub fn restore_zero(&self, node: &mut Node<'_>, blob: u32) -> bool {
        if self.record.running == blob {
            node.restore_zero(self.record.zero);
        }
        node.zero() != self.record.zero
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::retained::Step;

    /// A run with the parameters that ended with a fault, or a reset without one.
    fn run(crc: u32, fault: Option<FaultKind>) -> Retained {
        let mut record = Retained {
            running: crc,
            ..Retained::default()
        };
        if let Some(kind) = fault {
            record.note(kind, 1, 2);
        }
        record
    }

    #[test]
    fn ram_is_not_believed_after_power_on() {
        let kept = run(7, Some(FaultKind::HardFault));
        let before = Before::new(Cause::PowerOn, Some(kept));
        assert_eq!(before.record, Retained::default());
        assert_eq!((before.by_fault, before.choice), (false, Choice::Newest));
        assert_eq!(before.stop(false), None);
    }

    #[test]
    fn a_fault_is_the_cause_of_one_start_only() {
        let first = Before::new(Cause::Reset, Some(run(7, Some(FaultKind::Panic))));
        let second = Before::new(Cause::Reset, Some(first.record));
        assert_eq!((first.by_fault, second.by_fault), (true, false));
        assert_eq!((first.record.faults, second.record.faults), (1, 1));
        let bitten = Before::new(Cause::Watchdog, Some(run(7, None)));
        assert_eq!((bitten.by_fault, bitten.record.faults), (true, 1));
        // The handler of the panic waits for the watchdog.
        let panic = run(7, Some(FaultKind::Panic));
        let bitten = Before::new(Cause::Watchdog, Some(panic));
        assert_eq!(
            (bitten.record.fault, bitten.record.faults),
            (panic.fault, 1)
        );
        assert_eq!(bitten.stop, None);
    }

    #[test]
    fn a_reset_runs_what_ran_or_stops_and_activation_alone_changes_it() {
        for (cause, kept, choice, stop) in [
            (Cause::Reset, Some(run(7, None)), Choice::Blob(7), None),
            (Cause::Watchdog, Some(run(7, None)), Choice::Blob(7), None),
            // No blob ran since power-on.
            (Cause::Reset, Some(run(0, None)), Choice::Newest, None),
            (Cause::Reset, None, Choice::Nothing, Some(Stop::NotKnown)),
        ] {
            let before = Before::new(cause, kept);
            assert_eq!((before.choice, before.stop(true)), (choice, stop));
            // And again at the next reset.
            let before = Before::new(Cause::Reset, Some(before.record));
            assert_eq!((before.choice, before.stop(true)), (choice, stop));
        }
        let gone = Before::new(Cause::Reset, Some(run(7, None)));
        assert_eq!(gone.stop(false), Some(Stop::Gone));
        for mut kept in [run(7, None), Retained::damaged()] {
            kept.activate();
            let before = Before::new(Cause::Reset, Some(kept));
            assert_eq!((before.choice, before.stop(true)), (Choice::Newest, None));
        }
    }

    #[test]
    fn two_faults_in_the_first_second_stop_the_program_until_it_is_acknowledged() {
        let start = |record: &mut Retained, kind| {
            record.note(kind, 0, 0);
            let before = Before::new(Cause::Reset, Some(*record));
            *record = before.record;
            before.stop
        };
        let mut record = run(7, None);
        assert_eq!(start(&mut record, FaultKind::Panic), None);
        record.prove();
        assert_eq!(start(&mut record, FaultKind::Panic), None);
        assert_eq!(start(&mut record, FaultKind::Watchdog), None);
        let stopped = Some(Stop::FaultedTwice);
        assert_eq!(start(&mut record, FaultKind::HardFault), stopped);
        // However long it then stands.
        record.prove();
        let before = Before::new(Cause::Reset, Some(record));
        assert_eq!((before.stop, before.choice), (stopped, Choice::Nothing));
        record.activate();
        let before = Before::new(Cause::Reset, Some(record));
        assert_eq!((before.stop, before.choice), (None, Choice::Newest));
        // A crystal that fails has its own remedy.
        let mut record = run(7, None);
        for _ in 0..3 {
            record.step = Step::Clocks;
            assert_eq!(start(&mut record, FaultKind::Watchdog), None);
        }
    }

    #[test]
    fn a_damaged_record_may_have_lost_a_zero() {
        let before = Before::new(Cause::Reset, None);
        assert!(before.record.zero.x_m.is_nan());
        assert!(!before.by_fault);
    }
}

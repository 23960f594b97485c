//! How a program watches its long work: it is told how far the work is, and can end it.

use std::sync::atomic::{AtomicBool, Ordering};

/// What nobody sets.
static NEVER: AtomicBool = AtomicBool::new(false);

/// A flag that ends long work, and a function that shows how far it is.
#[derive(Clone, Copy, Debug)]
pub struct Watch<'a> {
    /// Set where the work should end: by Ctrl-C, or by another thread.
    pub stop: &'a AtomicBool,
    /// Takes the name of the work, how many of its steps are done, and their number. All steps are done
    /// where the work ends, for whatever reason.
    pub report: fn(&'static str, u64, u64),
}

impl Watch<'static> {
    /// Nobody watches: the work goes to its end.
    pub const NONE: Self = Self {
        stop: &NEVER,
        report: |_, _, _| (),
    };
}

impl Default for Watch<'_> {
    fn default() -> Self {
        Watch::NONE
    }
}

impl Watch<'_> {
    /// Whether the work should end.
    pub fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Begins a piece of work. Nothing is reported where the number of steps is not known: 0.
    pub const fn begin(&self, work: &'static str, steps: u64) -> Progress {
        Progress {
            work,
            steps,
            report: self.report,
        }
    }
}

/// One piece of work, which ends when this is dropped.
#[derive(Debug)]
pub struct Progress {
    work: &'static str,
    steps: u64,
    report: fn(&'static str, u64, u64),
}

impl Progress {
    /// Reports how many steps are done.
    pub fn reach(&self, done: u64) {
        if self.steps > 0 {
            (self.report)(self.work, done.min(self.steps), self.steps);
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.reach(self.steps);
    }
}

//! Long work reports its progress to the program around it, which can end it.

use std::sync::atomic::{AtomicBool, Ordering};

/// A flag that nobody sets.
static NEVER: AtomicBool = AtomicBool::new(false);

/// A flag that ends long work, and a function that shows how far it is.
#[derive(Clone, Copy, Debug)]
pub struct Watch<'a> {
    /// Set where the work should end: by Ctrl-C, or by another thread.
    pub stop: &'a AtomicBool,
    /// Takes the name of the work, the number of steps done, and their total. All steps count as done when the work
    /// ends, for any reason.
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

    /// Begins a piece of work. Without a known number of steps (0) it reports nothing.
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

//! How far long work is: a bar with rate and time left on standard error, on a terminal only, of what
//! takes over a second; and for a program that shows it in its own way [`current`].

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// Whether bars are wanted at all.
static WANTED: AtomicBool = AtomicBool::new(false);
/// What is being done, and its steps; work within other work is not shown.
static CURRENT: Mutex<Option<(&str, u64)>> = Mutex::new(None);
/// Steps that are done of it.
static DONE: AtomicU64 = AtomicU64::new(0);

/// What takes less has no bar.
const SHOWN_AFTER: Duration = Duration::from_secs(1);
const TEMPLATE: &str = "{msg:<9} {wide_bar} {percent:>3} %  {per_sec}  {eta} left";

/// From now on long work is shown.
pub fn show() {
    WANTED.store(true, Ordering::Relaxed);
}

/// What is being done, how many steps are done, and of how many.
pub fn current() -> Option<(&'static str, u64, u64)> {
    let current = *CURRENT.lock().unwrap_or_else(PoisonError::into_inner);
    current.map(|(what, total)| (what, DONE.load(Ordering::Relaxed), total))
}

/// One piece of work, no longer shown when dropped.
#[derive(Debug)]
pub struct Progress {
    is_outer: bool,
    bar: Option<ProgressBar>,
}

impl Progress {
    /// Of `total` steps, whatever these are; `what` is being done. Not shown where the total is
    /// not known, which is 0.
    pub fn new(what: &'static str, total: u64) -> Self {
        let mut current = CURRENT.lock().unwrap_or_else(PoisonError::into_inner);
        let is_outer = total > 0 && current.is_none();
        if is_outer {
            *current = Some((what, total));
            DONE.store(0, Ordering::Relaxed);
        }
        let wants_bar = is_outer && WANTED.load(Ordering::Relaxed);
        Self {
            is_outer,
            bar: wants_bar.then(|| bar(what, total)),
        }
    }

    /// So many steps are done.
    pub fn reach(&self, done: u64) {
        if self.is_outer {
            DONE.store(done, Ordering::Relaxed);
        }
        let Some(bar) = &self.bar else { return };
        if bar.is_hidden() && bar.elapsed() > SHOWN_AFTER {
            // Still hidden where standard error is no terminal.
            bar.set_draw_target(ProgressDrawTarget::stderr());
        }
        bar.set_position(done);
    }
}

fn bar(what: &'static str, total: u64) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::hidden());
    // A template of our own, which is sound.
    if let Ok(style) = ProgressStyle::with_template(TEMPLATE) {
        bar.set_style(style);
    }
    bar.set_message(what);
    bar
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
        if self.is_outer {
            *CURRENT.lock().unwrap_or_else(PoisonError::into_inner) = None;
        }
    }
}

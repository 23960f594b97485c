//! How far long work is: a bar with rate and time left on standard error, on a terminal only, of what
//! takes over a second.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Whether bars are wanted at all.
static WANTED: AtomicBool = AtomicBool::new(false);
/// Whether one is in use: work within other work has none of its own.
static IN_USE: AtomicBool = AtomicBool::new(false);

/// What takes less has no bar.
const SHOWN_AFTER: Duration = Duration::from_secs(1);
const TEMPLATE: &str = "{msg:<9} {wide_bar} {percent:>3} %  {per_sec}  {eta} left";

/// From now on long work is shown.
pub fn show() {
    WANTED.store(true, Ordering::Relaxed);
}

/// The bar of one piece of work, gone when dropped.
#[derive(Debug)]
pub struct Progress(Option<ProgressBar>);

impl Progress {
    /// Of `total` steps, whatever these are; `what` is being done. Without a bar where the total is
    /// not known, which is 0.
    pub fn new(what: &'static str, total: u64) -> Self {
        if total == 0 || !WANTED.load(Ordering::Relaxed) || IN_USE.swap(true, Ordering::Relaxed) {
            return Self(None);
        }
        let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::hidden());
        // A template of our own, which is sound.
        if let Ok(style) = ProgressStyle::with_template(TEMPLATE) {
            bar.set_style(style);
        }
        bar.set_message(what);
        Self(Some(bar))
    }

    /// So many steps are done.
    pub fn reach(&self, done: u64) {
        let Some(bar) = &self.0 else { return };
        if bar.is_hidden() && bar.elapsed() > SHOWN_AFTER {
            // Still hidden where standard error is no terminal.
            bar.set_draw_target(ProgressDrawTarget::stderr());
        }
        bar.set_position(done);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = &self.0 {
            bar.finish_and_clear();
            IN_USE.store(false, Ordering::Relaxed);
        }
    }
}

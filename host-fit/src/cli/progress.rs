//! How far long work is: a bar with the time left on standard error. Only a terminal shows it, and
//! only work that takes over a second has one.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// Whether bars are wanted at all.
static WANTED: AtomicBool = AtomicBool::new(false);
/// The bar of the work in hand.
static BAR: Mutex<Option<ProgressBar>> = Mutex::new(None);

/// Shorter work has no bar.
const SHOWN_AFTER: Duration = Duration::from_secs(1);
const TEMPLATE: &str = "{msg:<9} {wide_bar} {percent:>3} %  {eta} left";

/// From now on long work has a bar.
pub(super) fn want() {
    WANTED.store(true, Ordering::Relaxed);
}

/// Shows how many steps of the work are done, and takes the bar away after the last one.
pub(super) fn show(work: &'static str, done: u64, steps: u64) {
    if !WANTED.load(Ordering::Relaxed) {
        return;
    }
    let mut shown = BAR.lock().unwrap_or_else(PoisonError::into_inner);
    let bar = shown.get_or_insert_with(|| bar(work, steps));
    if bar.is_hidden() && bar.elapsed() > SHOWN_AFTER {
        // Still hidden where standard error is no terminal.
        bar.set_draw_target(ProgressDrawTarget::stderr());
    }
    bar.set_position(done);
    if done >= steps {
        bar.finish_and_clear();
        *shown = None;
    }
}

fn bar(work: &'static str, steps: u64) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(steps), ProgressDrawTarget::hidden());
    // A template of our own, which is sound.
    if let Ok(style) = ProgressStyle::with_template(TEMPLATE) {
        bar.set_style(style);
    }
    bar.set_message(work);
    bar
}

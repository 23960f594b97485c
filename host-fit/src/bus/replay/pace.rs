//! An absolute schedule: each row is due at its own time from the start, so a row that is
//! sent late makes no later one late.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Longest sleep in one piece: how soon Ctrl-C is noticed in a slow replay.
const SLEEP_MAX: Duration = Duration::from_millis(100);

/// Waits for the times of a log, at a multiple of its speed.
#[derive(Debug)]
pub(super) struct Pacer {
    started: Instant,
    rate: f64,
}

impl Pacer {
    pub(super) const fn new(started: Instant, rate: f64) -> Self {
        Self { started, rate }
    }

    /// Time since the start, s.
    pub(super) fn elapsed_s(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }

    /// Waits until `at_us` of the log is due, or until `stop`. Gives the time of the log that
    /// is due by then, us, and how late `at_us` is, s.
    pub(super) fn wait_until(&self, at_us: u64, stop: &AtomicBool) -> (u64, f64) {
        let due = Duration::from_secs_f64(at_us as f64 * 1e-6 / self.rate);
        loop {
            let now = self.started.elapsed();
            if now >= due || stop.load(Ordering::Relaxed) {
                let logged_us = now.as_secs_f64() * self.rate * 1e6;
                return (logged_us as u64, now.saturating_sub(due).as_secs_f64());
            }
            std::thread::sleep((due - now).min(SLEEP_MAX));
        }
    }
}

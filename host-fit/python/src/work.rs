//! Long work without the GIL: Ctrl-C ends it, and a notebook shows how far it is.

use crate::error::internal;
use host_fit::input::watch::Watch;
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// So often Python is asked for signals.
const PERIOD: Duration = Duration::from_millis(50);
/// What takes less is not shown.
const SHOWN_AFTER: Duration = Duration::from_secs(1);

/// Flags that end work, free for the next work.
static FLAGS: Mutex<Vec<&'static AtomicBool>> = Mutex::new(Vec::new());
/// The work in hand, how many of its steps are done, and their number.
static CURRENT: Mutex<Option<(&str, u64, u64)>> = Mutex::new(None);

fn locked<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Does `work` in a thread of its own. The calling thread looks for signals and shows the progress. After a signal it goes
/// on at once: the flag of the watch is set, and the work ends when it looks at the flag.
///
/// # Errors
/// The exception of a signal, such as `KeyboardInterrupt`.
pub fn run<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(Watch<'static>) -> T + Send + 'static,
) -> PyResult<T> {
    let free = locked(&FLAGS).pop();
    let stop = free.unwrap_or_else(|| Box::leak(Box::new(AtomicBool::new(false))));
    let watch = Watch {
        stop,
        report: |work, done, steps| *locked(&CURRENT) = Some((work, done, steps)),
    };
    let (done, wait) = channel();
    let started = Instant::now();
    thread::Builder::new().spawn(move || done.send(work(watch)))?;
    let made = py.detach(move || {
        loop {
            match wait.recv_timeout(PERIOD) {
                Ok(made) => return Ok(made),
                // The work has panicked.
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(internal("the work ended without a result"));
                }
                Err(RecvTimeoutError::Timeout) => Python::attach(|py| {
                    py.check_signals()?;
                    if started.elapsed() > SHOWN_AFTER {
                        show(py)?;
                    }
                    Ok::<(), PyErr>(())
                })?,
            }
        }
    });
    if started.elapsed() > SHOWN_AFTER {
        py.import("hallstage._progress")?.call_method0("end")?;
    }
    match made {
        Ok(_) => locked(&FLAGS).push(stop),
        Err(_) => stop.store(true, Ordering::Relaxed),
    }
    made
}

/// Shows how far the work is, where somebody sees it.
fn show(py: Python<'_>) -> PyResult<()> {
    let current = *locked(&CURRENT);
    let Some((what, done, total)) = current else {
        return Ok(());
    };
    let module = py.import("hallstage._progress")?;
    module.call_method1("show", (what, done, total))?;
    Ok(())
}

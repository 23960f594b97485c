//! Long work without the GIL: Ctrl-C ends it, and a notebook shows how far it is.

use host_fit::input::watch::Watch;
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// So often Python is asked for signals.
const PERIOD: Duration = Duration::from_millis(50);
/// What takes less is not shown.
const SHOWN_AFTER: Duration = Duration::from_secs(1);

/// Set by a signal, until the work has ended.
static STOP: AtomicBool = AtomicBool::new(false);
/// The work in hand, how many of its steps are done, and their number.
static CURRENT: Mutex<Option<(&str, u64, u64)>> = Mutex::new(None);

/// How all work is watched.
pub const WATCH: Watch<'static> = Watch {
    stop: &STOP,
    report: |work, done, steps| {
        *CURRENT.lock().unwrap_or_else(PoisonError::into_inner) = Some((work, done, steps));
    },
};

/// Does `work` in a thread of its own. The calling thread looks for signals and shows the progress.
///
/// # Errors
/// What a signal raises, such as `KeyboardInterrupt`. The work has ended then, without a result.
pub fn run<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let (done, wait) = channel();
    let started = Instant::now();
    let watched = py.detach(move || {
        thread::scope(|scope| {
            scope.spawn(move || {
                let _ = done.send(work());
            });
            let mut raised = None;
            let made = loop {
                match wait.recv_timeout(PERIOD) {
                    Ok(made) => break Some(made),
                    Err(RecvTimeoutError::Disconnected) => break None,
                    Err(RecvTimeoutError::Timeout) if raised.is_some() => {}
                    Err(RecvTimeoutError::Timeout) => {
                        let is_long = started.elapsed() > SHOWN_AFTER;
                        let looked = Python::attach(|py| {
                            py.check_signals()?;
                            if is_long { show(py) } else { Ok(()) }
                        });
                        raised = looked.err();
                        if raised.is_some() {
                            STOP.store(true, Ordering::Relaxed);
                        }
                    }
                }
            };
            (made, raised)
        })
    });
    let (made, raised) = watched;
    if started.elapsed() > SHOWN_AFTER {
        py.import("hallstage._progress")?.call_method0("end")?;
    }
    if let Some(raised) = raised {
        STOP.store(false, Ordering::Relaxed);
        return Err(raised);
    }
    // Without a result the work has panicked, and `scope` with it.
    made.ok_or_else(|| crate::error::internal("the work ended without a result"))
}

/// Shows how far the work is, where somebody sees it.
fn show(py: Python<'_>) -> PyResult<()> {
    let current = *CURRENT.lock().unwrap_or_else(PoisonError::into_inner);
    let Some((what, done, total)) = current else {
        return Ok(());
    };
    let module = py.import("hallstage._progress")?;
    module.call_method1("show", (what, done, total))?;
    Ok(())
}

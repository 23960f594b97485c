//! Ctrl-C: long work ends and keeps the best so far; a second Ctrl-C ends the program.

use super::progress;
use hallstage_input::watch::Watch;
use std::sync::atomic::{AtomicBool, Ordering};

static STOP: AtomicBool = AtomicBool::new(false);

/// How commands watch their work. Ctrl-C sets the flag after [`watch`].
pub(super) const WATCH: Watch<'static> = Watch {
    stop: &STOP,
    report: progress::show,
};

/// Exit status of an interrupted program.
pub(super) const EXIT_STATUS: u8 = 130;

/// Makes Ctrl-C set the flag.
pub(super) fn watch() -> Watch<'static> {
    // The handler needs a thread. Where none can be started it would take Ctrl-C and do nothing.
    if std::thread::Builder::new().spawn(|| ()).is_ok() {
        // Fails only where a handler is set already, and that handler stays.
        let _ = ctrlc::set_handler(|| {
            if STOP.swap(true, Ordering::Relaxed) {
                std::process::exit(EXIT_STATUS.into());
            }
        });
    }
    WATCH
}

/// Whether Ctrl-C was pressed since [`watch`].
pub(super) fn is_requested() -> bool {
    WATCH.is_stopped()
}

//! Ctrl-C: a search ends and keeps the best so far; a second Ctrl-C ends the program.

use std::sync::atomic::{AtomicBool, Ordering};

static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Exit status of an interrupted program.
pub const EXIT_STATUS: u8 = 130;

/// From now on Ctrl-C sets the flag that this returns.
pub fn watch() -> &'static AtomicBool {
    // The handler needs a thread. Where none can be started it would take Ctrl-C and do nothing.
    if std::thread::Builder::new().spawn(|| ()).is_err() {
        return &INTERRUPTED;
    }
    // Fails only where a handler is set already: then that one stays in charge.
    let _ = ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::Relaxed) {
            std::process::exit(EXIT_STATUS.into());
        }
    });
    &INTERRUPTED
}

/// As Ctrl-C does, where another program watches for it: what can be ended, ends.
pub fn request() {
    INTERRUPTED.store(true, Ordering::Relaxed);
}

/// Forgets a [`request`], after what it ended.
pub fn clear() {
    INTERRUPTED.store(false, Ordering::Relaxed);
}

/// The flag that a search looks at.
pub const fn flag() -> &'static AtomicBool {
    &INTERRUPTED
}

/// Whether Ctrl-C was pressed since [`watch`].
pub fn requested() -> bool {
    INTERRUPTED.load(Ordering::Relaxed)
}

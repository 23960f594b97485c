//! The threads of a command. The results do not depend on their number.

use crate::cli::error::HostError;
use rayon::ThreadPoolBuilder;
use std::error::Error;

/// Starts the given number of threads, or one for each core, for everything that follows.
pub(super) fn start(threads: Option<u16>) -> Result<(), HostError> {
    let pool = ThreadPoolBuilder::new().num_threads(threads.map_or(0, usize::from));
    let started = match threads {
        Some(1) => pool.use_current_thread().build_global(),
        _ => pool.build_global(),
    };
    match started {
        // Without a source there is a pool already: in a process that runs several commands.
        Err(error) if error.source().is_some() => Err(HostError::input(format!(
            "the threads do not start: {error}; name a smaller number with --threads"
        ))),
        _ => Ok(()),
    }
}

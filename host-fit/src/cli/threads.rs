//! The threads that a command works with. The results do not depend on their number.

use rayon::{ThreadBuilder, ThreadPoolBuilder};
use std::io::Error;
use std::sync::mpsc::{Sender, channel};
use std::thread;

/// Starts so many threads, or one for each core, for everything that follows. Where the system
/// allows fewer, those do the work; where it allows none, the only thread there is does.
pub(super) fn start(threads: Option<u16>) {
    let cores = || thread::available_parallelism().map_or(1, usize::from);
    let wanted = threads.map_or_else(cores, usize::from);
    let mut waiting: Vec<_> = (0..wanted).map_while(|_| waiting_thread()).collect();
    let pool = ThreadPoolBuilder::new().num_threads(waiting.len().max(1));
    // A pool fails as a whole if a thread of it does not start, so they are started before it. It
    // fails too if there is a pool already, which there is not.
    let _ = match waiting.is_empty() {
        true => pool.use_current_thread().build_global(),
        false => pool
            .spawn_handler(|work| {
                let thread = waiting.pop().ok_or_else(|| Error::other("no thread"))?;
                thread.send(work).map_err(|_| Error::other("no thread"))
            })
            .build_global(),
    };
}

/// A thread that waits for its work; `None` if the system allows no more.
fn waiting_thread() -> Option<Sender<ThreadBuilder>> {
    let (send, receive) = channel::<ThreadBuilder>();
    let work = move || receive.recv().map_or((), ThreadBuilder::run);
    thread::Builder::new().spawn(work).ok().map(|_| send)
}

//! `host-fit replay`.

use super::interrupt;
use crate::bus::replay::{self, ReplaySettings};
use crate::cli::error::HostError;
use crate::cli::terminal;

/// Plays a log onto a bus and says how it went.
pub(super) fn run(args: &ReplaySettings) -> Result<(), HostError> {
    let done = replay::run(args, interrupt::watch())?;
    terminal::print(&format!(
        "{} rows in {} frames, {:.3} s of the log in {:.3} s ({:.1} times real time), at most {:.1} ms late\n",
        done.rows,
        done.frames,
        done.logged_s,
        done.elapsed_s,
        done.logged_s / done.elapsed_s,
        done.late_max_s * 1e3
    ))?;
    if interrupt::is_requested() {
        let kept = "the rows above were sent, the rest of the log was not";
        return Err(HostError::interrupted(kept));
    }
    Ok(())
}

//! A dialog on an interface.

use super::dialog::{Dialog, Job};
use super::{
    BlobReader, Identifier, Identity, Plan, UpdateError, UpdateRunError, Updated, Updater,
};
use crate::bus::live::Bus;
use crate::interrupt;
use crate::progress::Progress;
use hal_adapters::can::{BusFrame, Message};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant, SystemTime};

/// How soon Ctrl-C is noticed.
const WAIT_MAX: Duration = Duration::from_millis(50);
/// How long a frame may wait for a place in the transmit queue.
const SEND_DEADLINE: Duration = Duration::from_millis(20);

/// Asks who the node is.
///
/// # Errors
/// See [`UpdateRunError`].
pub fn identify(interface: &str) -> Result<Identity, UpdateRunError> {
    let job = hold(interface, Identifier::default(), |_| {})?;
    job.result().map_err(|cause| told(interface, cause))
}

/// Reads the blob that the node runs.
///
/// # Errors
/// See [`UpdateRunError`].
pub fn read_back(interface: &str) -> Result<(Identity, Vec<u8>), UpdateRunError> {
    let mut bar = None;
    let job = hold(interface, BlobReader::default(), |job| {
        show(&mut bar, "reading", job.progress());
    })?;
    job.result().map_err(|cause| told(interface, cause))
}

/// Updates the node. On Ctrl-C nothing is stored, unless the node is storing already.
///
/// # Errors
/// See [`UpdateRunError`].
pub fn update(interface: &str, plan: Plan) -> Result<Updated, UpdateRunError> {
    let token = now_token();
    let plan = Plan { token, ..plan };
    let mut bar = None;
    let job = hold(interface, Updater::new(plan), |job| {
        show(&mut bar, "updating", job.progress());
    })?;
    job.result().map_err(|cause| told(interface, cause))
}

fn told(interface: &str, cause: UpdateError) -> UpdateRunError {
    let interface = interface.to_owned();
    UpdateRunError::Dialog { interface, cause }
}

fn show(bar: &mut Option<Progress>, what: &'static str, (done, total): (u64, u64)) {
    if total > 0 {
        bar.get_or_insert_with(|| Progress::new(what, total))
            .reach(done);
    }
}

/// A token that another program, or the last run of this one, hardly has.
fn now_token() -> u8 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    since.map_or(0, |d| (d.as_millis() ^ d.as_millis() >> 8) as u8)
}

/// Runs a dialog to its end; `watch` sees the job in every turn.
fn hold<J: Job>(interface: &str, job: J, mut watch: impl FnMut(&J)) -> Result<J, UpdateRunError> {
    let mut bus = Bus::open(interface, &[Message::Answer, Message::Command])?;
    let mut dialog = Dialog::new(job, now_token());
    let stop = interrupt::watch();
    let started = Instant::now();
    let now_us = || u64::try_from(started.elapsed().as_micros()).unwrap_or(u64::MAX);
    while !dialog.is_over() {
        watch(dialog.job());
        if stop.load(Ordering::Relaxed) {
            dialog.interrupt();
        }
        if let Some(coded) = dialog.poll(now_us()) {
            match bus.send(&[BusFrame::from(coded)], SEND_DEADLINE) {
                // Lost, like any frame that nobody answers.
                Err(error) if error.is_queue_full() => {}
                sent => sent?,
            }
        }
        let wait = Duration::from_micros(dialog.due_us().saturating_sub(now_us()));
        if dialog.is_over() {
            break;
        }
        if let Some(stamped) = bus.receive(wait.min(WAIT_MAX))? {
            dialog.take(&stamped.frame, now_us());
        }
    }
    Ok(dialog.into_job())
}

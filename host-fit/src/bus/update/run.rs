//! The scripts on a CAN interface.

use super::{
    Identity, Link, RezeroSettings, Talk, UpdateError, UpdateRunError, UpdateSettings, Updated,
    identity, script,
};
use crate::bus::BusAddress;
use crate::bus::live::{Bus, BusError};
use hal_adapters::can::{BusFrame, Message};
use hallstage_input::watch::Watch;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant, SystemTime};

/// How long a frame may wait for a place in the transmit queue.
const SEND_DEADLINE: Duration = Duration::from_millis(20);

/// Asks for the identity of the node.
///
/// # Errors
/// See [`UpdateRunError`].
pub fn identify(address: &BusAddress, watch: Watch<'_>) -> Result<Identity, UpdateRunError> {
    hold(address, watch, "asking", |talk, _| identity::identify(talk))
}

/// Reads the blob that the node runs.
///
/// # Errors
/// See [`UpdateRunError`].
pub fn read_back(
    address: &BusAddress,
    watch: Watch<'_>,
) -> Result<(Identity, Vec<u8>), UpdateRunError> {
    hold(address, watch, "reading", |talk, progress| {
        identity::read_back(talk, progress)
    })
}

/// Updates the node. Ctrl-C ends it until the node stores the blob.
///
/// # Errors
/// See [`UpdateRunError`].
pub fn update(
    address: &BusAddress,
    plan: &UpdateSettings,
    watch: Watch<'_>,
) -> Result<Updated, UpdateRunError> {
    hold(address, watch, "updating", |talk, progress| {
        script::update(talk, plan, progress)
    })
}

/// Sets or clears the zero of a stage at rest.
///
/// # Errors
/// See [`UpdateRunError`].
pub fn rezero(
    address: &BusAddress,
    zero: &RezeroSettings,
    watch: Watch<'_>,
) -> Result<(), UpdateRunError> {
    hold(address, watch, "re-zeroing", |talk, _| {
        super::on::rezero(talk, zero)
    })
}

/// A token from the clock: the last run of this program hardly had the same.
fn now_token() -> u8 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    since.map_or(0, |d| (d.as_millis() ^ d.as_millis() >> 8) as u8)
}

/// A CAN interface as a link.
struct Interface<'s> {
    bus: Bus,
    started: Instant,
    stop: &'s AtomicBool,
}

fn broken(error: BusError) -> UpdateError {
    UpdateError::Link(error.to_string())
}

impl Link for Interface<'_> {
    fn send(&mut self, frame: BusFrame) -> Result<(), UpdateError> {
        match self.bus.send_all(&[frame], SEND_DEADLINE) {
            // Lost, like a frame without an answer.
            Err(BusError::QueueFull { .. }) => Ok(()),
            sent => sent.map_err(broken),
        }
    }

    fn receive(&mut self, until_us: u64) -> Result<Option<BusFrame>, UpdateError> {
        let wait = Duration::from_micros(until_us.saturating_sub(self.now_us()));
        let received = self.bus.receive(wait).map_err(broken)?;
        Ok(received.map(|stamped| stamped.frame))
    }

    fn now_us(&self) -> u64 {
        u64::try_from(self.started.elapsed().as_micros()).unwrap_or(u64::MAX)
    }

    fn is_interrupted(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

/// Runs a script on an interface with a progress bar.
fn hold<T>(
    address: &BusAddress,
    watch: Watch<'_>,
    what: &'static str,
    talks: impl FnOnce(&mut Talk<Interface<'_>>, &mut dyn FnMut(u64, u64)) -> Result<T, UpdateError>,
) -> Result<T, UpdateRunError> {
    let link = Interface {
        bus: Bus::open(&address.interface, address.node, &[Message::Answer])?,
        started: Instant::now(),
        stop: watch.stop,
    };
    let (mut talk, mut bar) = (Talk::new(link, now_token()), None);
    let result = talks(&mut talk, &mut |done, total| {
        bar.get_or_insert_with(|| watch.begin(what, total))
            .reach(done);
    });
    result.map_err(|cause| UpdateRunError::Dialog {
        address: address.clone(),
        cause,
    })
}

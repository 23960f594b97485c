//! A script on a CAN interface.

use super::{Link, Talk, UpdateError, UpdateRunError};
use crate::bus::BusAddress;
use crate::bus::live::{Bus, BusError};
use hal_adapters::can::{BusFrame, Message, NodeNumber};
use hallstage_input::watch::Watch;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant, SystemTime};

/// How long a frame may wait for a place in the transmit queue.
const SEND_DEADLINE: Duration = Duration::from_millis(20);

/// A token from the clock: the last run of this program hardly had the same.
fn now_token() -> u8 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    since.map_or(0, |d| (d.as_millis() ^ d.as_millis() >> 8) as u8)
}

/// A CAN interface as a link.
pub struct Interface<'s> {
    bus: Bus,
    node: NodeNumber,
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

    fn node(&self) -> NodeNumber {
        self.node
    }

    fn now_us(&self) -> u64 {
        u64::try_from(self.started.elapsed().as_micros()).unwrap_or(u64::MAX)
    }

    fn is_interrupted(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

/// Runs a script of [`on`](super::on) on an interface; `what` is shown with its progress. Ctrl-C ends an update until the
/// node stores the blob.
///
/// # Errors
/// See [`UpdateRunError`].
pub fn talk_to<T>(
    address: &BusAddress,
    watch: Watch<'_>,
    what: &'static str,
    script: impl FnOnce(&mut Talk<Interface<'_>>, &mut dyn FnMut(u64, u64)) -> Result<T, UpdateError>,
) -> Result<T, UpdateRunError> {
    let link = Interface {
        bus: Bus::open(&address.interface, address.node, &[Message::Answer])?,
        node: address.node,
        started: Instant::now(),
        stop: watch.stop,
    };
    let (mut talk, mut bar) = (Talk::new(link, now_token()), None);
    let result = script(&mut talk, &mut |done, total| {
        bar.get_or_insert_with(|| watch.begin(what, total))
            .reach(done);
    });
    result.map_err(|cause| UpdateRunError::Dialog {
        address: address.clone(),
        cause,
    })
}

//! The CAN bus: emptied by the tick, filled by the tick and by interrupt, never waited for.
//!
//! With each tick all frames are taken back from the mailboxes, too: most are out of date, and an answer must not hold back
//! a pose. A frame on the wire is then completed or fails, but is not repeated; the outbox gives no further frame before
//! its mailbox is empty.

use crate::board::Board;
use crate::node::Node;
use crate::outbox::Outbox;
use crate::schedule::Period;
use hal_adapters::can::update::Store;
use hal_adapters::can::{BusFrame, Coded};

/// Commands taken in one tick at most.
const COMMANDS_PER_TICK: u8 = 3;
/// Time after which a controller that does not take part in the bus counts as apart, ms.
const APART_MS: u32 = 500;

/// A CAN controller with mailboxes. It receives the frames of [`hal_adapters::can::Message::Command`] and
/// [`hal_adapters::can::Message::UpdateData`] of its node, and need not receive any others. No function waits.
pub trait Can {
    /// Takes the frames back that have not left.
    fn take_back(&mut self);

    /// The mailboxes.
    fn mailboxes(&mut self) -> Mailboxes;

    /// Puts a frame into an empty mailbox that [`Can::mailboxes`] has reported. Returns whether there was one, on a
    /// bus that the controller takes part in.
    fn put(&mut self, frame: &Coded) -> bool;

    /// The next frame that came, with the standard identifier of the table.
    fn receive(&mut self) -> Option<BusFrame>;

    /// The state, called once a tick.
    fn state(&mut self) -> CanState;
}

/// The mailboxes of a CAN controller at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mailboxes {
    /// Frames sent since the last call.
    pub sent: u32,
    /// Frames given up since the last call.
    pub given_up: u32,
    /// Whether all mailboxes are empty.
    pub are_empty: bool,
}

/// The state of a CAN controller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CanState {
    /// It is bus-off.
    pub is_off: bool,
    /// It was bus-off since the last call.
    pub was_off: bool,
    /// It is set up and takes part in the bus.
    pub takes_part: bool,
    /// A frame was lost since the last call because too many were waiting.
    pub has_lost: bool,
}

/// The controller and the frames that wait for it.
#[derive(Debug)]
pub struct Bus<C> {
    /// The CAN controller.
    pub can: C,
    apart_ticks_max: u32,
    /// Ticks in a row while the controller took no part in the bus.
    apart_ticks: u32,
    was_off: bool,
    /// Times the bus was off. Saturates.
    pub bus_off: u32,
    /// Frames handed to a mailbox.
    pub sent: u32,
    /// Times that a received frame was lost. Saturates.
    pub overruns: u32,
    /// Frames for the mailboxes.
    pub outbox: Outbox,
}

impl<C: Can> Bus<C> {
    /// A bus with nothing to send.
    pub fn new(can: C, period: Period) -> Self {
        Self {
            can,
            apart_ticks_max: period.ticks_in_ms(APART_MS),
            apart_ticks: 0,
            was_off: false,
            bus_off: 0,
            sent: 0,
            overruns: 0,
            outbox: Outbox::default(),
        }
    }

    /// Whether the controller has not been apart from the bus for long.
    pub const fn takes_part(&self) -> bool {
        self.apart_ticks < self.apart_ticks_max
    }

    /// At the start of a tick: discards what is out of date, also in the mailboxes, and notes the state.
    pub fn start_tick(&mut self) {
        self.outbox.start_tick();
        self.can.take_back();
        let state = self.can.state();
        let is_new = (state.was_off || state.is_off) && !self.was_off;
        self.bus_off = self.bus_off.saturating_add(is_new.into());
        self.was_off = state.is_off;
        self.overruns = self.overruns.saturating_add(state.has_lost.into());
        self.apart_ticks = match state.takes_part {
            true => 0,
            false => self.apart_ticks.saturating_add(1),
        };
    }

    /// Whether everything has left, or was taken back.
    pub fn is_idle(&mut self) -> bool {
        self.are_empty() && self.outbox.is_empty()
    }

    /// Passes received commands and words of new parameters to the node.
    pub fn receive(&mut self, node: &mut Node<'_>, store: &mut dyn Store, board: &mut impl Board) {
        for _ in 0..COMMANDS_PER_TICK {
            let Some(frame) = self.can.receive() else {
                return;
            };
            node.take(&frame, &mut self.outbox, store, board.nonce());
        }
    }

    /// Fills the mailboxes. From a tick, and whenever one has become empty.
    pub fn send(&mut self) {
        loop {
            let are_empty = self.are_empty();
            match self.outbox.front(are_empty) {
                Some(frame) if self.can.put(frame) => self.outbox.filled(),
                _ => return,
            }
            self.sent = self.sent.wrapping_add(1);
        }
    }

    fn are_empty(&mut self) -> bool {
        let mailboxes = self.can.mailboxes();
        (0..mailboxes.sent).for_each(|_| self.outbox.completed(true));
        (0..mailboxes.given_up).for_each(|_| self.outbox.completed(false));
        mailboxes.are_empty
    }
}

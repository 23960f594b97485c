//! The CAN controller: emptied by the tick, filled by the tick and by interrupt, never waited for.
//!
//! With each tick all frames are taken back from the mailboxes, too: most are out of date, and an answer must not hold back
//! a pose. A frame on the wire is then completed or fails, but is not repeated; the outbox gives no further frame before
//! its mailbox is empty.

use crate::board;
use crate::random::Random;
use crate::wait::Stopwatch;
use embedded_can::{Frame, StandardId};
use hal_adapters::can::update::Store;
use hal_adapters::can::{BusFrame, Coded, Message, NodeNumber};
use stage_node::node::Node;
use stage_node::outbox::Outbox;
use stage_node::schedule::TICKS_PER_S;
use stm32f4xx_hal::pac::CAN1;
use stm32f4xx_hal::pac::can1::TX;

/// Commands taken in one tick at most; the controller's own store holds three.
const COMMANDS_PER_TICK: u8 = 3;
/// Longest wait for the controller to stand still, us. It takes a few bits.
const INIT_US: u32 = 1000;
/// Ticks after which a controller that does not take part in the bus counts as apart: half a second. It
/// waits for eleven recessive bits, which never come while RX is held low.
const APART_TICKS: u16 = (TICKS_PER_S / 2) as u16;
/// IDE in a mailbox's identifier register and in a filter: the identifier has 29 bits. The eleven bits of the table come
/// first, in the place of a standard identifier (RM0090 rev. 18, 32.9.3 and 32.9.4).
const EXTENDED: u32 = 1 << 2;
/// Bits of TSR for mailbox 0; the bits of the next mailboxes follow after eight bits each.
const REQUEST_COMPLETED: u32 = 1;
const SENT: u32 = 1 << 1;
const ABORT: u32 = 1 << 7;
/// Bit of TSR: mailbox 0 is empty; the bits of the next mailboxes follow.
const EMPTY: u32 = 1 << 26;
const ALL_EMPTY: u32 = 0b111;

/// The controller and what waits for it.
pub struct Bus {
    can: CAN1,
    /// The bits of an identifier register that the node's number sets.
    node_bits: u32,
    started: bool,
    /// Ticks in a row while the controller took no part in the bus.
    apart_ticks: u16,
    was_off: bool,
    /// Times the bus was off. Saturates.
    pub bus_off: u32,
    /// Frames handed to a mailbox.
    pub sent: u32,
    /// Times that a frame was lost because three were waiting. Saturates.
    pub overruns: u32,
    /// Frames for the mailboxes.
    pub outbox: Outbox,
}

impl Bus {
    /// Sets the controller up to join the bus by itself and to receive commands only. The
    /// controller must have been switched on and reset.
    ///
    /// By a crystal it recovers from bus-off by itself. The internal oscillator may be too inexact
    /// for a bus: then the controller's errors end in bus-off, and it stays silent.
    pub fn new(can: CAN1, node: NodeNumber, crystal: bool, stopwatch: &mut Stopwatch) -> Self {
        let node_bits = match node.number() {
            0 => 0,
            number => number << 3 | EXTENDED,
        };
        can.mcr()
            .modify(|_, w| w.sleep().clear_bit().inrq().set_bit());
        let started = stopwatch.until(board::CORE_HZ / 1_000_000, INIT_US, || {
            let state = can.msr().read();
            state.inak().bit_is_set() && state.slak().bit_is_clear()
        });
        if started {
            let (segment_1, segment_2, jump) = board::can_bit_timing(crystal);
            // SAFETY: `board` keeps within the fields' bits.
            can.btr().write(|w| unsafe {
                w.brp().bits(board::CAN_PRESCALER - 1);
                w.ts1().bits(segment_1 - 1);
                w.ts2().bits(segment_2 - 1);
                w.sjw().bits(jump - 1)
            });
            receive_commands_only(&can, node_bits);
            // BOFIE lets ERRI latch a bus-off; ERRIE, which would make it an interrupt, is off.
            can.ier().write(|w| w.tmeie().set_bit().bofie().set_bit());
            can.mcr()
                .modify(|_, w| w.abom().bit(crystal).inrq().clear_bit());
        }
        Self {
            can,
            node_bits,
            started,
            apart_ticks: 0,
            was_off: false,
            bus_off: 0,
            sent: 0,
            overruns: 0,
            outbox: Outbox::new(),
        }
    }

    /// Whether the controller was set up, and has not been apart from the bus for long.
    pub const fn takes_part(&self) -> bool {
        self.started && self.apart_ticks < APART_TICKS
    }

    /// At the start of a tick: discards what is out of date, also in the mailboxes, and
    /// notes whether the bus was off.
    pub fn start_tick(&mut self) {
        self.outbox.start_tick();
        if !self.started {
            return;
        }
        // An answer goes again after the poses.
        let aborts = self.pending().fold(0, |bits, k| bits | ABORT << (8 * k));
        // SAFETY: bits that the controller defines; zeros change nothing.
        self.can.tsr().write(|w| unsafe { w.bits(aborts) });

        // A bus that is off again after less than a tick is seen by the latch alone.
        let state = self.can.msr().read();
        let latched = state.erri().bit_is_set();
        if latched {
            self.can.msr().write(|w| w.erri().set_bit());
        }
        let is_off = self.can.esr().read().boff().bit_is_set();
        if (latched || is_off) && !self.was_off {
            self.bus_off = self.bus_off.saturating_add(1);
        }
        self.was_off = is_off;
        self.apart_ticks = match is_off || state.inak().bit_is_set() {
            true => self.apart_ticks.saturating_add(1),
            false => 0,
        };
    }

    /// Whether everything has left, or was taken back.
    pub fn is_idle(&self) -> bool {
        self.outbox.is_empty() && self.pending().next().is_none()
    }

    /// Passes received commands and words of new parameters to the node.
    pub fn receive(&mut self, node: &mut Node<'_>, store: &mut dyn Store, random: &mut Random) {
        if self.can.rf0r().read().fovr().bit_is_set() {
            self.overruns = self.overruns.saturating_add(1);
            self.can.rf0r().write(|w| w.fovr().clear());
        }
        for _ in 0..COMMANDS_PER_TICK {
            let waiting = self.can.rf0r().read();
            let Some(received) = self.can.rx_iter().next() else {
                return;
            };
            // The controller is still about to put the next frame where it can be read.
            if !self.started || waiting.fmp().bits() == 0 || waiting.rfom().bit_is_set() {
                return;
            }
            let id = StandardId::new(received.rir().read().stid().bits());
            let length = usize::from(received.rdtr().read().dlc().bits());
            let (low, high) = (received.rdlr().read().bits(), received.rdhr().read().bits());
            self.can.rf0r().write(|w| w.rfom().release());
            let bytes = (u64::from(high) << 32 | u64::from(low)).to_le_bytes();
            // A length code of 9 to 15 also means eight bytes, by the standard; no command is so.
            let frame = match (id, bytes.get(..length)) {
                (Some(id), Some(data)) => BusFrame::new(id, data),
                _ => None,
            };
            if let Some(frame) = frame {
                node.take(&frame, &mut self.outbox, store, random.nonce());
            }
        }
    }

    /// Fills the mailboxes. From a tick, and whenever one has become empty.
    pub fn send(&mut self) {
        loop {
            let empty = self.take_completed();
            let state = self.can.msr().read();
            if !self.started || state.inak().bit_is_set() || state.slak().bit_is_set() {
                return;
            }
            let Some(frame) = self.outbox.front(empty == ALL_EMPTY) else {
                return;
            };
            let Some(mailbox) = self.can.tx_iter().nth(empty.trailing_zeros() as usize) else {
                return;
            };
            fill(mailbox, frame, self.node_bits);
            self.outbox.filled();
            self.sent = self.sent.wrapping_add(1);
        }
    }

    /// The mailboxes that are not empty.
    fn pending(&self) -> impl Iterator<Item = u32> {
        let status = self.can.tsr().read().bits();
        (0..3).filter(move |k| status & EMPTY << k == 0)
    }

    /// Notes which requests are completed, which ends their interrupt. Gives the empty mailboxes as
    /// bits 0 to 2.
    fn take_completed(&mut self) -> u32 {
        let status = self.can.tsr().read().bits();
        let mut completed = 0;
        for shift in [0, 8, 16] {
            if status & REQUEST_COMPLETED << shift != 0 {
                completed |= REQUEST_COMPLETED << shift;
                // Only a request that was aborted ends without a frame.
                self.outbox.completed(status & SENT << shift != 0);
            }
        }
        if completed != 0 {
            // SAFETY: bits that the controller defines; zeros change nothing.
            self.can.tsr().write(|w| unsafe { w.bits(completed) });
        }
        (status / EMPTY) & ALL_EMPTY
    }
}

/// Lets data frames of two identifiers into the first store, and no others: the command's and that
/// of new parameters.
fn receive_commands_only(can: &CAN1, node_bits: u32) {
    // Remote frames have a bit that is 0 in these words.
    let [command, data] = [Message::Command, Message::UpdateData]
        .map(|message| u32::from(message.id().as_raw()) << 21 | node_bits);
    can.fmr().modify(|_, w| w.finit().set_bit());
    can.fa1r().write(|w| w.fact0().clear_bit());
    // A list of two identifiers of 32 bits.
    can.fm1r().write(|w| w.fbm0().set_bit());
    can.fs1r().write(|w| w.fsc0().set_bit());
    can.ffa1r().write(|w| w.ffa0().clear_bit());
    if let Some(bank) = can.fb_iter().next() {
        // SAFETY: two identifiers of one filter of 32 bits.
        bank.fr1().write(|w| unsafe { w.bits(command) });
        // SAFETY: as above.
        bank.fr2().write(|w| unsafe { w.bits(data) });
    }
    can.fa1r().write(|w| w.fact0().set_bit());
    can.fmr().modify(|_, w| w.finit().clear_bit());
}

fn fill(mailbox: &TX, frame: &Coded, node_bits: u32) {
    let [a, b, c, d, e, f, g, h] = frame.bytes;
    let (low, high) = (
        u32::from_le_bytes([a, b, c, d]),
        u32::from_le_bytes([e, f, g, h]),
    );
    // SAFETY: eight bytes, and any bits as data.
    unsafe {
        mailbox.tdtr().write(|w| w.dlc().bits(8));
        mailbox.tdlr().write(|w| w.bits(low));
        mailbox.tdhr().write(|w| w.bits(high));
    }
    let id = u32::from(frame.message.id().as_raw()) << 21 | node_bits;
    // SAFETY: identifier and IDE; TXRQ is set besides.
    mailbox
        .tir()
        .write(|w| unsafe { w.bits(id).txrq().set_bit() });
}

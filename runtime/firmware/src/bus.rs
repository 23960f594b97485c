//! The CAN controller: emptied by the tick, filled by the tick and by interrupt, never waited for.

use crate::board;
use bxcan::filter::Mask32;
use bxcan::{Fifo, Frame, Interrupt, Mailbox, StandardId};
use firmware::node::Node;
use firmware::outbox::Outbox;
use hal_adapters::can::Message;
use stm32f4xx_hal::pac::CAN1;

/// Commands taken in one tick at most; the controller's own store holds three.
const COMMANDS_PER_TICK: u8 = 3;

/// The controller and what waits for it.
pub struct Bus {
    can: board::Can,
    /// Whether the controller has seen eleven recessive bits and takes part in the bus.
    joined: bool,
    was_off: bool,
    bus_off: u32,
    sent: u32,
    /// Frames for the mailboxes.
    pub outbox: Outbox,
}

impl Bus {
    /// Sets the controller up to join the bus by itself, to recover from bus-off by itself and
    /// to receive commands only.
    pub fn new(instance: board::CanPins) -> Self {
        let mut can = bxcan::Can::builder(instance)
            .set_bit_timing(board::CAN_BIT_TIMING)
            .set_automatic_retransmit(true)
            .leave_disabled();
        if let Some(id) = StandardId::new(Message::Command.spec().id) {
            let mut commands = Mask32::frames_with_std_id(id, StandardId::MAX);
            commands.data_frames_only();
            can.modify_filters()
                .clear()
                .enable_bank(0, Fifo::Fifo0, commands);
        }
        can.enable_interrupt(Interrupt::TransmitMailboxEmpty);
        Self {
            can,
            joined: false,
            was_off: false,
            bus_off: 0,
            sent: 0,
            outbox: Outbox::new(),
        }
    }

    /// At the start of a tick: joins the bus if there is one, discards the frames of the
    /// previous tick, notes whether the bus is off.
    pub fn start_tick(&mut self) {
        self.joined = self.joined || self.can.enable_non_blocking().is_ok();
        self.outbox.start_tick();
        if !self.can.is_transmitter_idle() {
            for mailbox in [Mailbox::Mailbox0, Mailbox::Mailbox1, Mailbox::Mailbox2] {
                if self.can.abort(mailbox) {
                    self.outbox.count_dropped(1);
                }
            }
        }
        // SAFETY: reading a status register changes nothing, and `bxcan` has no way to.
        let is_off = unsafe { (*CAN1::PTR).esr().read().boff().bit_is_set() };
        if is_off && !self.was_off {
            self.bus_off = self.bus_off.saturating_add(1);
        }
        self.was_off = is_off;
    }

    /// Passes received commands to the node.
    pub fn receive(&mut self, node: &mut Node<'_>) {
        for _ in 0..COMMANDS_PER_TICK {
            // SAFETY: as in `start_tick`.
            let length = unsafe { (*CAN1::PTR).rx(0).rdtr().read().dlc().bits() };
            match self.can.receive() {
                // A data length code of 9 to 15 also means eight bytes, by the standard.
                // `bxcan` panics on the first look into such a frame; no command is one.
                Ok(_) if length > 8 => {}
                Ok(frame) => node.take(&frame, &mut self.outbox),
                Err(nb::Error::WouldBlock) => return,
                Err(nb::Error::Other(_)) => {} // An overrun: a command was lost, unanswered.
            }
        }
    }

    /// Fills the mailboxes. From a tick, and whenever one has become empty.
    pub fn send(&mut self) {
        self.can.clear_tx_interrupt();
        if !self.joined {
            return;
        }
        while let Some(coded) = self.outbox.front(self.can.is_transmitter_idle()) {
            if let Some(frame) = coded.to_frame::<Frame>() {
                match self.can.transmit(&frame) {
                    Err(_) => return,
                    Ok(status) if status.dequeued_frame().is_some() => self.outbox.count_dropped(1),
                    Ok(_) => {}
                }
            }
            self.outbox.pop();
            self.sent = self.sent.wrapping_add(1);
        }
    }

    /// Frames handed to a mailbox.
    pub const fn sent(&self) -> u32 {
        self.sent
    }

    /// Times the bus was off.
    pub const fn bus_off(&self) -> u32 {
        self.bus_off
    }
}

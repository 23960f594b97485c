//! The parts of bxCAN that the controller uses, from RM0090 section 32: three mailboxes, one receive
//! store, bus states.

mod registers;

use crate::can_identifier::{EXTENDED, from_register, to_register};
use embedded_can::Frame;
use hal_adapters::can::{BusFrame, NodeNumber};
use registers::{LATCH_OFF, RECOVER, TXRQ};
use std::collections::VecDeque;

/// State of the bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BusState {
    /// Others listen and acknowledge.
    #[default]
    Good,
    /// No other node: frames are repeated without end.
    Alone,
    /// A short circuit: the controller is bus-off.
    Off,
}

/// Time of one frame at 1 Mbit/s: 111 bits and a few stuffed ones.
const FRAME_NS: u64 = 125_000;
/// Of one with an extended identifier: 20 bits more, and a few stuffed ones.
const EXTENDED_FRAME_NS: u64 = 149_000;
/// Time of eleven recessive bits: then the controller takes part in the bus.
const JOIN_NS: u64 = 11_000;
/// A controller that recovers is bus-off for 128 times eleven recessive bits.
const RECOVERY_NS: u64 = 128 * JOIN_NS;

/// A frame that went over the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sent {
    /// When it was asked for, ns.
    pub asked_ns: u64,
    /// When it was sent completely, ns.
    pub done_ns: u64,
    /// The frame, of the controller's node with the identifier of the table.
    pub frame: BusFrame,
}

#[derive(Clone, Copy, Default)]
struct Mailbox {
    registers: [u32; 4],
    pending: bool,
    /// It is on the wire and will not be repeated.
    aborted: bool,
    asked_ns: u64,
}

/// The controller.
#[derive(Default)]
pub struct CanModel {
    mcr: u32,
    /// When it takes part in the bus, once it was asked to.
    joins_ns: Option<u64>,
    /// Whether it never acknowledges that it stands still.
    pub is_dead: bool,
    /// Whether the receive line is held low: the eleven recessive bits that the controller joins
    /// the bus after never come (RM0090 32.4.1).
    pub held_low: bool,
    interrupts: u32,
    /// ERRI.
    latched: bool,
    /// Time of the last advance.
    advanced_ns: u64,
    /// Until when other nodes hold the bus with frames of higher priority.
    busy_until_ns: u64,
    /// Other nodes always send frames with this identifier.
    pub others_send: Option<u16>,
    /// When it ceases to be bus-off; `None`: never.
    off_until: Option<Option<u64>>,
    mailboxes: [Mailbox; 3],
    done: u32,
    on_the_wire: Option<(usize, u64)>,
    received: VecDeque<[u32; 4]>,
    /// FOVR: a frame came while the store was full (RM0090 32.9.2, CAN_RF0R).
    overrun: bool,
    /// The bus; change it by [`Self::set_bus`].
    pub bus: BusState,
    /// The controller's node. Frames are given and kept here with the identifiers of the table. Foreign frames are kept
    /// unchanged.
    pub node: NodeNumber,
    /// Frames since the last look.
    pub sent: Vec<Sent>,
    /// Mailboxes filled since start.
    pub filled: u64,
    plain: Vec<u32>,
}

impl CanModel {
    /// Resets the controller, as every power-on does. The bus stays.
    pub fn reset(&mut self, now_ns: u64) {
        let bus = self.bus;
        *self = Self {
            mcr: 0x0001_0002,
            plain: vec![0; 256],
            is_dead: self.is_dead,
            node: self.node,
            sent: std::mem::take(&mut self.sent),
            filled: self.filled,
            ..Self::default()
        };
        self.plain[0x200 / 4] = 0x2a1c_0e01;
        self.set_bus(bus, now_ns);
    }

    /// Changes what the bus does from `now_ns` on. What is on the wire is destroyed.
    pub fn set_bus(&mut self, bus: BusState, now_ns: u64) {
        self.fail();
        match bus {
            BusState::Off => self.go_off(None),
            _ if self.bus == BusState::Off && self.mcr & RECOVER != 0 => {
                self.off_until = Some(Some(now_ns + RECOVERY_NS));
            }
            _ => {}
        }
        self.bus = bus;
        self.arbitrate(now_ns);
    }

    /// The controller is bus-off from `now_ns` for so long, shorter than the standard has it.
    pub fn blip(&mut self, now_ns: u64, ns: u64) {
        self.fail();
        self.go_off(Some(now_ns + ns));
    }

    /// Other nodes hold the bus until then.
    pub fn occupy(&mut self, until_ns: u64) {
        self.busy_until_ns = until_ns;
    }

    /// The frame on the wire is destroyed by an error, and says whether there was one.
    pub fn destroy(&mut self, now_ns: u64) -> bool {
        let was_there = self.on_the_wire.is_some();
        self.fail();
        self.arbitrate(now_ns);
        was_there
    }

    fn go_off(&mut self, until: Option<u64>) {
        self.off_until = Some(until);
        self.latched |= self.interrupts & LATCH_OFF != 0;
    }

    /// The frame on the wire fails.
    fn fail(&mut self) {
        if let Some((k, _)) = self.on_the_wire.take()
            && self.mailboxes[k].aborted
        {
            self.complete(k, false);
        }
    }

    fn complete(&mut self, k: usize, sent: bool) {
        let mailbox = &mut self.mailboxes[k];
        mailbox.pending = false;
        mailbox.aborted = false;
        mailbox.registers[0] &= !TXRQ;
        self.done |= (1 | u32::from(sent) << 1) << (8 * k);
    }

    /// A frame from another node to the controller's node.
    pub fn receive(&mut self, frame: &BusFrame) {
        self.receive_coded(frame, 8);
    }

    /// The same with any data length code: 9 to 15 mean eight bytes too.
    pub fn receive_coded(&mut self, frame: &BusFrame, length_code: u8) {
        let frame = self.node.to_bus(frame);
        let id = to_register(frame.id);
        if !self.passes(id) {
            return;
        }
        self.overrun |= self.received.len() == 3;
        if self.received.len() < 3 {
            let data = u64::from_le_bytes(frame.data().try_into().expect("eight bytes"));
            let (low, high) = (data as u32, (data >> 32) as u32);
            self.received.push_back([id, length_code.into(), low, high]);
        }
    }

    fn takes_part(&self, now_ns: u64) -> bool {
        let joined = self.joins_ns.is_some_and(|at| at <= now_ns);
        joined && self.busy_until_ns <= now_ns && self.off_until.is_none()
    }

    /// Starts the pending frame of the highest priority if the wire is free.
    fn arbitrate(&mut self, now_ns: u64) {
        if self.on_the_wire.is_some() || !self.takes_part(now_ns) {
            return;
        }
        self.on_the_wire = self.first().map(|k| {
            let is_long = self.mailboxes[k].registers[0] & EXTENDED != 0;
            let takes_ns = if is_long { EXTENDED_FRAME_NS } else { FRAME_NS };
            (k, now_ns + takes_ns)
        });
    }

    /// The pending frame of the highest priority, if other nodes let it pass.
    fn first(&self) -> Option<usize> {
        let pending = (0..3).filter(|&k| self.mailboxes[k].pending);
        let first = pending.min_by_key(|&k| self.mailboxes[k].registers[0] >> 3)?;
        let id = self.mailboxes[first].registers[0] >> 21;
        (self.others_send)
            .is_none_or(|other| id < other.into())
            .then_some(first)
    }

    /// When the next thing happens by itself.
    pub fn next_event_ns(&self) -> Option<u64> {
        let ends = self.on_the_wire.map(|(_, at)| at);
        let waits = self.first().is_some() && ends.is_none();
        let joins = self.joins_ns.map(|at| at.max(self.busy_until_ns));
        let joins = joins.filter(|_| waits && self.off_until.is_none());
        let recovers = self.off_until.flatten();
        [ends, joins, recovers].into_iter().flatten().min()
    }

    /// Lets time pass.
    pub fn advance(&mut self, now_ns: u64) {
        if let Some(at) = self.off_until.flatten().filter(|at| *at <= now_ns) {
            self.off_until = None;
            self.arbitrate(at);
        }
        let joins = self.joins_ns.map(|at| at.max(self.busy_until_ns));
        if let Some(at) = joins.filter(|at| *at <= now_ns) {
            self.arbitrate(at.max(self.advanced_ns));
        }
        self.advanced_ns = now_ns;
        while let Some((k, at)) = self.on_the_wire.filter(|(_, at)| *at <= now_ns) {
            self.on_the_wire = None;
            if self.bus == BusState::Alone {
                // Nobody acknowledged it: it is repeated, unless it was aborted.
                if self.mailboxes[k].aborted {
                    self.complete(k, false);
                }
            } else {
                let Mailbox {
                    registers: [id, _, low, high],
                    asked_ns,
                    ..
                } = self.mailboxes[k];
                let bytes = (u64::from(high) << 32 | u64::from(low)).to_le_bytes();
                let frame = from_register(id).and_then(|id| BusFrame::new(id, &bytes));
                let frame = frame.expect("an identifier and eight bytes");
                self.sent.push(Sent {
                    asked_ns,
                    done_ns: at,
                    frame: self.node.from_bus(&frame).unwrap_or(frame),
                });
                self.complete(k, true);
            }
            self.arbitrate(at);
        }
    }
}

//! bxCAN, as far as the controller uses it: three mailboxes, one receive store, bus states.

use std::collections::VecDeque;

/// State of the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusState {
    /// Others listen and acknowledge.
    Good,
    /// No other node: frames are repeated without end.
    Alone,
    /// The controller is bus-off.
    Off,
}

/// Time of one frame at 1 Mbit/s: 111 bits and a few stuffed ones.
const FRAME_NS: u64 = 125_000;

/// A frame that went over the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sent {
    /// When it was asked for, ns.
    pub asked_ns: u64,
    /// When it was sent completely, ns.
    pub done_ns: u64,
    /// Standard identifier.
    pub id: u16,
    /// Its bytes.
    pub bytes: [u8; 8],
}

#[derive(Clone, Copy, Default)]
struct Mailbox {
    registers: [u32; 4],
    pending: bool,
    asked_ns: u64,
}

/// The controller.
pub struct CanModel {
    mcr: u32,
    interrupts: u32,
    mailboxes: [Mailbox; 3],
    done: u32,
    on_the_wire: Option<(usize, u64)>,
    received: VecDeque<[u32; 4]>,
    /// The bus; change it by [`Self::set_bus`].
    bus: BusState,
    /// Frames since the last look.
    pub sent: Vec<Sent>,
    /// Mailboxes filled since start.
    pub filled: u64,
    plain: [u32; 256],
}

const TXRQ: u32 = 1;

impl CanModel {
    /// A controller after reset.
    pub fn new() -> Self {
        let mut plain = [0; 256];
        plain[0x200 / 4] = 0x2a1c_0e01;
        Self {
            mcr: 0x0001_0002,
            interrupts: 0,
            mailboxes: [Mailbox::default(); 3],
            done: 0,
            on_the_wire: None,
            received: VecDeque::new(),
            bus: BusState::Good,
            sent: Vec::new(),
            filled: 0,
            plain,
        }
    }

    /// Changes what the bus does from `now_ns` on.
    pub fn set_bus(&mut self, bus: BusState, now_ns: u64) {
        self.bus = bus;
        self.on_the_wire = None;
        self.arbitrate(now_ns);
    }

    /// A frame from another node.
    pub fn receive(&mut self, id: u16, bytes: [u8; 8]) {
        self.receive_coded(id, 8, bytes);
    }

    /// A frame from another node, with any data length code: 9 to 15 mean eight bytes too.
    pub fn receive_coded(&mut self, id: u16, length_code: u8, bytes: [u8; 8]) {
        let [a, b, c, d, e, f, g, h] = bytes;
        if self.received.len() < 3 {
            let (low, high) = (
                u32::from_le_bytes([a, b, c, d]),
                u32::from_le_bytes([e, f, g, h]),
            );
            self.received
                .push_back([u32::from(id) << 21, length_code.into(), low, high]);
        }
    }

    fn takes_part(&self) -> bool {
        self.mcr & 3 == 0 && self.bus != BusState::Off
    }

    /// Starts the pending frame of the highest priority if the wire is free.
    fn arbitrate(&mut self, now_ns: u64) {
        if self.on_the_wire.is_some() || !self.takes_part() || self.bus == BusState::Alone {
            return;
        }
        let pending = (0..3).filter(|&k| self.mailboxes[k].pending);
        let first = pending.min_by_key(|&k| self.mailboxes[k].registers[0] >> 21);
        self.on_the_wire = first.map(|k| (k, now_ns + FRAME_NS));
    }

    /// When the frame on the wire ends.
    pub fn next_event_ns(&self) -> Option<u64> {
        self.on_the_wire.map(|(_, at)| at)
    }

    /// Lets time pass.
    pub fn advance(&mut self, now_ns: u64) {
        while let Some((k, at)) = self.on_the_wire.filter(|(_, at)| *at <= now_ns) {
            let mailbox = &mut self.mailboxes[k];
            mailbox.pending = false;
            mailbox.registers[0] &= !TXRQ;
            let ([a, b, c, d], [e, f, g, h]) = (
                mailbox.registers[2].to_le_bytes(),
                mailbox.registers[3].to_le_bytes(),
            );
            self.sent.push(Sent {
                asked_ns: mailbox.asked_ns,
                done_ns: at,
                id: (mailbox.registers[0] >> 21) as u16,
                bytes: [a, b, c, d, e, f, g, h],
            });
            self.done |= 0b11 << (8 * k);
            self.on_the_wire = None;
            self.arbitrate(at);
        }
    }

    /// Whether the transmit interrupt is pending.
    pub fn transmit_interrupt(&self) -> bool {
        self.interrupts & 1 != 0 && self.done & 0x01_01_01 != 0
    }

    /// A register.
    pub fn read(&mut self, offset: usize) -> u32 {
        match offset {
            0x00 => self.mcr,
            0x04 => 0xc00 | (self.mcr & 1) | if self.mcr & 3 == 2 { 2 } else { 0 },
            0x08 => self.transmit_status(),
            0x0c => self.received.len() as u32,
            0x14 => self.interrupts,
            0x18 => match self.bus {
                BusState::Good => 0,
                BusState::Alone => 128 << 16 | 0b11,
                BusState::Off => 0b111,
            },
            0x180..0x1b0 => self.mailboxes[(offset - 0x180) / 16].registers[offset % 16 / 4],
            0x1b0..0x1c0 => self
                .received
                .front()
                .map_or(0, |frame| frame[offset % 16 / 4]),
            _ => self.plain[offset / 4 % 256],
        }
    }

    fn transmit_status(&self) -> u32 {
        let empty = (0..3).filter(|&k| !self.mailboxes[k].pending);
        let bits = empty.clone().fold(0, |bits, k| bits | 1 << (26 + k));
        let lowest = (0..3).max_by_key(|&k: &usize| self.mailboxes[k].registers[0] >> 21);
        let code = empty.min().or(lowest).unwrap_or(0) as u32;
        bits | code << 24 | self.done
    }

    /// Writes a register.
    pub fn write(&mut self, offset: usize, value: u32, now_ns: u64) {
        match offset {
            0x00 => {
                self.mcr = value;
                self.arbitrate(now_ns);
            }
            0x08 => {
                for k in 0..3 {
                    let shift = 8 * k;
                    // Writing 1 to "request completed" clears its other flags, too.
                    if value >> shift & 1 == 1 {
                        self.done &= !(0xf << shift);
                    }
                    if value >> (shift + 7) & 1 == 1 && self.mailboxes[k].pending {
                        self.mailboxes[k].pending = false;
                        self.mailboxes[k].registers[0] &= !TXRQ;
                        self.done |= 1 << shift;
                        if self.on_the_wire.is_some_and(|(at, _)| at == k) {
                            self.on_the_wire = None;
                        }
                    }
                }
                self.arbitrate(now_ns);
            }
            0x0c if value & 1 << 5 != 0 => {
                self.received.pop_front();
            }
            0x14 => self.interrupts = value,
            0x180..0x1b0 => {
                let mailbox = &mut self.mailboxes[(offset - 0x180) / 16];
                mailbox.registers[offset % 16 / 4] = value;
                if offset.is_multiple_of(16) && value & TXRQ != 0 {
                    mailbox.pending = true;
                    mailbox.asked_ns = now_ns;
                    self.filled += 1;
                    self.arbitrate(now_ns);
                }
            }
            _ => self.plain[offset / 4 % 256] = value,
        }
    }
}

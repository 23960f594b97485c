//! The registers of bxCAN, and the filter.

use super::{BusState, CanModel, JOIN_NS};

/// Bits of MCR.
const INIT: u32 = 1;
const SLEEP: u32 = 1 << 1;
pub(super) const RECOVER: u32 = 1 << 6;
/// Bits of MSR.
const INIT_ACK: u32 = 1;
const SLEEP_ACK: u32 = 1 << 1;
const ERROR_LATCH: u32 = 1 << 2;
/// Bits of IER.
const TX_INTERRUPT: u32 = 1;
pub(super) const LATCH_OFF: u32 = 1 << 10;
/// Bit of a mailbox: it is to be sent.
pub(super) const TXRQ: u32 = 1;

impl CanModel {
    /// Whether the first filter lets a data frame into the first store: its identifier in a filter
    /// of 32 bits, as one of a list of two or by a mask.
    pub(super) fn passes(&self, identifier: u32) -> bool {
        let [control, list, wide, store, active] =
            [0x200, 0x204, 0x20c, 0x214, 0x21c].map(|at| self.plain[at / 4] & 1 == 1);
        let [first, second] = [0x240, 0x244].map(|at| self.plain[at / 4]);
        let matches = if list {
            identifier == first || identifier == second
        } else {
            (identifier ^ first) & second == 0
        };
        !control && wide && !store && active && matches
    }

    /// Whether the transmit interrupt is pending.
    pub fn transmit_interrupt(&self) -> bool {
        self.interrupts & TX_INTERRUPT != 0 && self.done & 0x01_01_01 != 0
    }

    /// A register.
    pub fn read(&mut self, offset: usize, now_ns: u64) -> u32 {
        match offset {
            0x00 => self.mcr,
            0x04 => self.status(now_ns),
            0x08 => self.transmit_status(),
            0x0c => self.received.len() as u32 | u32::from(self.overrun) << 4,
            0x14 => self.interrupts,
            0x18 => match (self.bus, self.off_until) {
                (_, Some(_)) => 0b111,
                (BusState::Alone, _) => 128 << 16 | 0b11,
                _ => 0,
            },
            0x180..0x1b0 => self.mailboxes[(offset - 0x180) / 16].registers[offset % 16 / 4],
            0x1b0..0x1c0 => self
                .received
                .front()
                .map_or(0, |frame| frame[offset % 16 / 4]),
            _ => self.plain[offset / 4 % 256],
        }
    }

    fn status(&self, now_ns: u64) -> u32 {
        let on = |bit, is| if is { bit } else { 0 };
        let stands = !self.is_dead && self.mcr & SLEEP == 0;
        let stands = stands && self.joins_ns.is_none_or(|at| at > now_ns);
        0xc00
            | on(INIT_ACK, stands)
            | on(SLEEP_ACK, self.mcr & SLEEP != 0)
            | on(ERROR_LATCH, self.latched)
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
                let joins = !self.is_dead && !self.held_low && value & (INIT | SLEEP) == 0;
                self.joins_ns = joins.then(|| self.joins_ns.unwrap_or(now_ns + JOIN_NS));
                self.arbitrate(now_ns);
            }
            0x04 => self.latched &= value & ERROR_LATCH == 0,
            0x08 => {
                for k in 0..3 {
                    let shift = 8 * k;
                    // Writing 1 to "request completed" clears its other flags, too.
                    if value >> shift & 1 == 1 {
                        self.done &= !(0xf << shift);
                    }
                    if value >> (shift + 7) & 1 == 1 && self.mailboxes[k].pending {
                        // What is on the wire is completed or fails first.
                        if self.on_the_wire.is_some_and(|(at, _)| at == k) {
                            self.mailboxes[k].aborted = true;
                        } else {
                            self.complete(k, false);
                        }
                    }
                }
                self.arbitrate(now_ns);
            }
            0x0c => {
                self.overrun &= value & 1 << 4 == 0;
                if value & 1 << 5 != 0 {
                    self.received.pop_front();
                }
            }
            0x14 => self.interrupts = value,
            0x180..0x1b0 => {
                let k = (offset - 0x180) / 16;
                let mailbox = &mut self.mailboxes[k];
                // A pending mailbox cannot be written.
                if mailbox.pending {
                    return;
                }
                mailbox.registers[offset % 16 / 4] = value;
                if offset.is_multiple_of(16) && value & TXRQ != 0 {
                    mailbox.pending = true;
                    mailbox.asked_ns = now_ns;
                    self.done &= !(0xf << (8 * k));
                    self.filled += 1;
                    self.arbitrate(now_ns);
                }
            }
            _ => self.plain[offset / 4 % 256] = value,
        }
    }
}

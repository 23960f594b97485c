//! The CAN controller, bxCAN (RM0090 rev. 18, section 32).

use crate::board;
use crate::wait::Stopwatch;
use embedded_can::{Frame, StandardId};
use hal_adapters::can::{BusFrame, Coded, Message};
use stage_node::bus::{Can, CanState, Mailboxes};
use stm32f4xx_hal::pac::CAN1;
use stm32f4xx_hal::pac::can1::TX;
use stm32f4xx_hal::rcc::{Enable, Rcc, Reset};

/// Longest wait for the controller to stand still, us. It takes a few bits.
const INIT_US: u32 = 1000;
/// IDE in a mailbox's identifier register and in a filter: the identifier has 29 bits. The eleven bits of the table come
/// first, in the place of a standard identifier (RM0090 rev. 18, 32.9.3 and 32.9.4).
const EXTENDED: u32 = 1 << 2;
/// The bits of an identifier register that the node's number sets.
const NODE_BITS: u32 = match board::STAGE_NODE.number() {
    0 => 0,
    number => number << 3 | EXTENDED,
};
/// Bits of TSR for all three mailboxes (32.9.2): request completed; request to abort; empty. TXOK is the bit above the first.
const COMPLETED: u32 = 0x01_01_01;
const ABORT: u32 = 0x80_80_80;
const EMPTY: u32 = 0b111 << 26;

/// The controller.
pub struct BxCan {
    can: CAN1,
    is_started: bool,
}

impl BxCan {
    /// Sets the controller up to join the bus by itself and to receive commands only.
    ///
    /// By a crystal it recovers from bus-off by itself. The internal oscillator may be too inexact
    /// for a bus: then the controller's errors end in bus-off, and it stays silent.
    pub fn new(can: CAN1, rcc: &mut Rcc, crystal: bool, stopwatch: &mut Stopwatch) -> Self {
        CAN1::enable(rcc);
        CAN1::reset(rcc);
        can.mcr()
            .modify(|_, w| w.sleep().clear_bit().inrq().set_bit());
        let is_started = stopwatch.until(board::CORE_HZ / 1_000_000, INIT_US, || {
            let state = can.msr().read();
            state.inak().bit_is_set() && state.slak().bit_is_clear()
        });
        if is_started {
            let (segment_1, segment_2, jump) = board::can_bit_timing(crystal);
            // SAFETY: `board` keeps within the fields' bits.
            can.btr().write(|w| unsafe {
                w.brp().bits(board::CAN_PRESCALER - 1);
                w.ts1().bits(segment_1 - 1);
                w.ts2().bits(segment_2 - 1);
                w.sjw().bits(jump - 1)
            });
            receive_commands_only(&can);
            // BOFIE lets ERRI latch a bus-off; ERRIE, which would make it an interrupt, is off.
            can.ier().write(|w| w.tmeie().set_bit().bofie().set_bit());
            can.mcr()
                .modify(|_, w| w.abom().bit(crystal).inrq().clear_bit());
        }
        Self { can, is_started }
    }
}

impl Can for BxCan {
    fn take_back(&mut self) {
        // SAFETY: bits that the controller defines. They change nothing in an empty mailbox.
        self.can.tsr().write(|w| unsafe { w.bits(ABORT) });
    }

    fn mailboxes(&mut self) -> Mailboxes {
        let status = self.can.tsr().read().bits();
        let completed = status & COMPLETED;
        if completed != 0 {
            // Ends their interrupt. SAFETY: bits that the controller defines; zeros change nothing.
            self.can.tsr().write(|w| unsafe { w.bits(completed) });
        }
        // Only a request that was aborted ends without a frame.
        let sent = status >> 1 & completed;
        Mailboxes {
            sent: sent.count_ones(),
            given_up: (completed & !sent).count_ones(),
            are_empty: status & EMPTY == EMPTY,
        }
    }

    fn put(&mut self, frame: &Coded) -> bool {
        let (state, status) = (self.can.msr().read(), self.can.tsr().read().bits());
        let is_apart = state.inak().bit_is_set() || state.slak().bit_is_set();
        // Empty, and reported as such.
        let is_free = |k: &usize| status >> (26 + k) & 1 == 1 && status >> (8 * k) & 1 == 0;
        let mailbox = (0..3).find(is_free).and_then(|k| self.can.tx_iter().nth(k));
        let mailbox = mailbox.filter(|_| self.is_started && !is_apart);
        mailbox.map(|mailbox| fill(mailbox, frame)).is_some()
    }

    fn receive(&mut self) -> Option<BusFrame> {
        let waiting = self.can.rf0r().read();
        let received = self.can.rx_iter().next()?;
        // RFOM: the controller is still about to put the next frame where it can be read.
        if !self.is_started || waiting.fmp().bits() == 0 || waiting.rfom().bit_is_set() {
            return None;
        }
        let id = StandardId::new(received.rir().read().stid().bits());
        let length = usize::from(received.rdtr().read().dlc().bits());
        let (low, high) = (received.rdlr().read().bits(), received.rdhr().read().bits());
        self.can.rf0r().write(|w| w.rfom().release());
        let bytes = (u64::from(high) << 32 | u64::from(low)).to_le_bytes();
        // A length code of 9 to 15 also means eight bytes, by the standard; no command is so.
        BusFrame::new(id?, bytes.get(..length)?)
    }

    fn state(&mut self) -> CanState {
        let state = self.can.msr().read();
        // A bus that is off again after less than a tick is seen by the latch alone.
        let was_off = state.erri().bit_is_set();
        if was_off {
            self.can.msr().write(|w| w.erri().set_bit());
        }
        let has_lost = self.can.rf0r().read().fovr().bit_is_set();
        if has_lost {
            self.can.rf0r().write(|w| w.fovr().clear());
        }
        let is_off = self.can.esr().read().boff().bit_is_set();
        CanState {
            is_off,
            was_off,
            takes_part: self.is_started && !is_off && state.inak().bit_is_clear(),
            has_lost,
        }
    }
}

/// Lets data frames of two identifiers into the first store, and no others: the command's and that
/// of new parameters.
fn receive_commands_only(can: &CAN1) {
    // Remote frames have a bit that is 0 in these words.
    let [command, data] = [Message::Command, Message::UpdateData]
        .map(|message| u32::from(message.id().as_raw()) << 21 | NODE_BITS);
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

fn fill(mailbox: &TX, frame: &Coded) {
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
    let id = u32::from(frame.message.id().as_raw()) << 21 | NODE_BITS;
    // SAFETY: identifier and IDE; TXRQ is set besides.
    mailbox
        .tir()
        .write(|w| unsafe { w.bits(id).txrq().set_bit() });
}

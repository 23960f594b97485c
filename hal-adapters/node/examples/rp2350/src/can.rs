//! An MCP2515 as the controller's CAN bus.

use embassy_rp::gpio::Output;
use embassy_rp::peripherals::SPI1;
use embassy_rp::spi::{Blocking, Spi};
use embedded_can::StandardId;
use embedded_can::nb::Can as _;
use embedded_hal_bus::spi::{ExclusiveDevice, NoDelay};
use hal_adapters::can::{BusFrame, Coded, Message};
use mcp25xx::bitrates::clock_16mhz::CNF_1000K_BPS;
use mcp25xx::registers::{CANCTRL, CANINTF, EFLG, OperationMode, RXB0CTRL, RXM};
use mcp25xx::{AcceptanceFilter::*, Config, IdHeader, MCP25xx, TxBuffer};
use stage_node::bus::{Can, CanState, Mailboxes};

/// Bits of registers: ABAT in CANCTRL, TX0IF to TX2IF in CANINTF, RX0OVR and RX1OVR in EFLG.
const ABORT: u8 = 1 << 4;
const SENT: u8 = 0b111 << 2;
const LOST: u8 = 0b11 << 6;

type Device = ExclusiveDevice<Spi<'static, SPI1, Blocking>, Output<'static>, NoDelay>;

/// The part, and its transmit buffers that hold a frame, as bits.
pub struct Mcp2515 {
    part: MCP25xx<Device>,
    pending: u8,
}

impl Mcp2515 {
    /// Lets it join the bus at 1 Mbit/s and receive commands only.
    pub fn new(spi: Device) -> Self {
        let mut part = MCP25xx { spi };
        let [command, data] =
            [Message::Command, Message::UpdateData].map(|m| IdHeader::from(m.id()));
        let whole = IdHeader::from(StandardId::MAX);
        let filters = [
            (Mask0, whole),
            (Mask1, whole),
            (Filter0, command),
            (Filter1, data),
        ];
        let buffer = RXB0CTRL::new().with_rxm(RXM::Filter).with_bukt(true);
        let config = Config::default()
            .mode(OperationMode::NormalOperation)
            .bitrate(CNF_1000K_BPS)
            .receive_buffer_0(buffer)
            .filters(&filters);
        // If it fails, the part takes no part in the bus.
        let _ = part.apply_config(&config);
        Self { part, pending: 0 }
    }
}

impl Can for Mcp2515 {
    fn take_back(&mut self) {
        for bits in [CANCTRL::new().with_abat(true), CANCTRL::new()] {
            let _ = self.part.modify_register(bits, ABORT);
        }
    }

    fn mailboxes(&mut self) -> Mailboxes {
        let (mut requested, mut sent) = (self.pending, 0);
        if self.pending != 0
            && let Ok(status) = self.part.read_status()
        {
            let bits = |[a, b, c]: [bool; 3]| u8::from(a) | u8::from(b) << 1 | u8::from(c) << 2;
            requested = bits([status.txreq0(), status.txreq1(), status.txreq2()]);
            sent = bits([status.tx0if(), status.tx1if(), status.tx2if()]);
        }
        let ended = self.pending & !requested;
        self.pending = requested;
        Mailboxes {
            sent: (ended & sent).count_ones(),
            given_up: (ended & !sent).count_ones(),
            are_empty: requested == 0,
        }
    }

    fn put(&mut self, frame: &Coded) -> bool {
        if self.pending == 0 {
            let _ = self.part.modify_register(CANINTF::from(0), SENT);
        }
        // The part sends the highest of its buffers first.
        let buffer = match self.pending.trailing_zeros() {
            0 => return false,
            1 => TxBuffer::TXB0,
            2 => TxBuffer::TXB1,
            _ => TxBuffer::TXB2,
        };
        let is_put = frame.to_frame().is_some_and(|frame| {
            self.part.load_tx_buffer(buffer, &frame).is_ok()
                && self.part.request_to_send(buffer).is_ok()
        });
        self.pending |= u8::from(is_put) << buffer as u8;
        is_put
    }

    fn receive(&mut self) -> Option<BusFrame> {
        let frame = self.part.receive().ok()?;
        Some(BusFrame::from_frame(&frame))
    }

    fn state(&mut self) -> CanState {
        let Ok(flags) = self.part.read_register::<EFLG>() else {
            return CanState::default();
        };
        let _ = self.part.modify_register(EFLG::from(0), LOST);
        CanState {
            is_off: flags.txbo(),
            was_off: flags.txbo(),
            takes_part: !flags.txbo(),
            has_lost: flags.rx0ovr() || flags.rx1ovr(),
        }
    }
}

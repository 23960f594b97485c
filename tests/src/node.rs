//! The stage controller on this machine: the code of every chip over two sectors of flash in RAM. The clock is advanced by
//! the caller, the codes are made up, and the random numbers follow from a seed.

use crate::flash_model::{FlashModel, slots};
use crate::random::Random;
use embedded_hal::spi::{MODE_0, Mode};
use hal_adapters::adc::{AdcError, FrameSampler};
use hal_adapters::can::status::BoardFacts;
use hal_adapters::can::update::{Identity, Key, Nonce, Store as _};
use hal_adapters::can::{BusFrame, Coded};
use runtime::zero_offset::ZeroOffsetSettings;
use runtime::{PlanarPose, RawFrame};
use stage_node::board::Board;
use stage_node::bus::{Can, CanState, Mailboxes};
use stage_node::controller::{Controller, Parts};
use stage_node::node::Settings;
use stage_node::records::{Choice, Records};
use stage_node::retained::RetainedRam;
use stage_node::schedule::Period;
use stage_node::start_up::{Before, Cause};
use std::collections::VecDeque;
use std::convert::Infallible;

/// Frames that a tick takes from the bus at most.
pub const TAKEN_PER_TICK: usize = 3;
/// The servo period, us.
const PERIOD_US: u32 = 2000;

/// A controller.
pub struct Node {
    settings: Settings<'static>,
    controller: Controller<'static, Converter, Wire, FlashModel, Host>,
    resets: u32,
}

impl Node {
    /// A controller of the stage `serial`, if its program knows that, with this flash, after
    /// power-on.
    ///
    /// # Panics
    /// Never.
    pub fn new(
        serial: Option<&'static str>,
        key: Option<&'static Key>,
        flash: FlashModel,
        seed: u64,
    ) -> Self {
        let settings = Settings {
            identity: Identity {
                serial,
                key,
                program_version: 0x00_01_02_03,
                ..Identity::default()
            },
            period: Period::from_us(PERIOD_US).expect("a period"),
            rezero_limits: ZeroOffsetSettings::default(),
        };
        let host = Host {
            now_us: 0,
            erases: false,
            is_to_be_reset: false,
            random: Random::new(seed),
            record: RetainedRam::new(),
        };
        Self {
            settings,
            controller: start(&settings, flash, host, Cause::PowerOn),
            resets: 0,
        }
    }

    /// When the next tick is due, us.
    pub const fn due_us(&self) -> u32 {
        self.controller.due_us()
    }

    /// One tick, so much late: decodes codes, takes frames of the bus, and stores an update.
    /// Returns whether it stored one, which takes half a second.
    pub fn tick(&mut self, late_us: u32, received: impl IntoIterator<Item = BusFrame>) -> bool {
        self.controller.bus.can.received.extend(received);
        let now_us = self.controller.due_us().wrapping_add(late_us);
        self.controller.board.now_us = now_us;
        self.controller.turn();
        self.controller.turn();
        core::mem::take(&mut self.controller.board.erases)
    }

    /// Whether a zero deviation is subtracted.
    pub fn is_zeroed(&self) -> bool {
        self.controller.node.zero() != PlanarPose::ZERO
    }

    /// The next frame for the bus.
    pub fn send(&mut self) -> Option<Coded> {
        let wire = &mut self.controller.bus.can;
        let frame = wire.mailbox.take()?;
        wire.sent += 1;
        self.controller.mailbox_empty();
        Some(frame)
    }

    /// Whether it waits for the reset that it asked for.
    pub const fn is_to_be_reset(&self) -> bool {
        self.controller.board.is_to_be_reset
    }

    /// A reset that takes so long: flash and retained RAM are kept.
    pub fn reset(&mut self, us: u32) {
        let board = &mut self.controller.board;
        let host = Host {
            now_us: board.now_us.wrapping_add(us),
            erases: false,
            is_to_be_reset: false,
            random: board.random.clone(),
            record: core::mem::take(&mut board.record),
        };
        let mut flash = self.flash();
        flash.power_on();
        self.controller = start(&self.settings, flash, host, Cause::Reset);
        self.resets += 1;
    }

    /// Starts so far, without the first.
    pub const fn resets(&self) -> u32 {
        self.resets
    }

    /// A copy of its flash.
    fn flash(&mut self) -> FlashModel {
        self.controller.records.slots.flash.clone()
    }

    /// The blob that the next power-on would run.
    pub fn newest(&mut self) -> Option<Vec<u8>> {
        let serial = self.settings.identity.serial;
        let (mut records, _) = Records::start(slots(self.flash()), Choice::Newest, serial);
        let newest = records.newest()?;
        [0, 1].into_iter().find_map(|slot| {
            let image = records.slots.image(slot);
            let stored = image.stored(slot)?;
            let is_newest = (stored.sequence, stored.crc) == (newest.sequence, newest.crc);
            is_newest.then(|| image.blob()[..stored.bytes as usize].to_vec())
        })
    }

    /// The highest sequence number; 0 for a plain blob.
    pub fn records(&mut self) -> u32 {
        self.controller.records.newest_sequence()
    }
}

fn start(
    settings: &Settings<'static>,
    flash: FlashModel,
    board: Host,
    cause: Cause,
) -> Controller<'static, Converter, Wire, FlashModel, Host> {
    let before = Before::of_ram(cause, &board.record);
    let parts = Parts {
        converter: Converter,
        can: Wire::default(),
        slots: slots(flash),
        board,
    };
    Controller::start(parts, *settings, &before, BoardFacts::default())
}

/// The board: a clock of the caller, and random numbers by a seed. The servo is off.
struct Host {
    now_us: u32,
    /// A sector was erased.
    erases: bool,
    is_to_be_reset: bool,
    random: Random,
    /// RAM that survives a reset.
    record: RetainedRam,
}

impl Board for Host {
    fn now_us(&mut self) -> u32 {
        self.now_us
    }

    fn feed_watchdog(&mut self) {}

    fn expect_erase(&mut self, is_next: bool) {
        self.erases |= is_next;
    }

    fn light(&mut self, _: bool) {}

    fn servo_is_off(&mut self) -> Option<bool> {
        Some(true)
    }

    fn nonce(&mut self) -> Option<Nonce> {
        Some([(); 4].map(|()| self.random.bits() as u32))
    }

    fn record(&self) -> &RetainedRam {
        &self.record
    }

    fn reset(&mut self) {
        self.is_to_be_reset = true;
    }
}

/// A CAN controller with one mailbox.
#[derive(Default)]
struct Wire {
    mailbox: Option<Coded>,
    /// Frames sent and given up since they were last asked for.
    sent: u32,
    given_up: u32,
    received: VecDeque<BusFrame>,
}

impl Can for Wire {
    fn take_back(&mut self) {
        self.given_up += u32::from(self.mailbox.take().is_some());
    }

    fn mailboxes(&mut self) -> Mailboxes {
        Mailboxes {
            sent: core::mem::take(&mut self.sent),
            given_up: core::mem::take(&mut self.given_up),
            are_empty: self.mailbox.is_none(),
        }
    }

    fn put(&mut self, frame: &Coded) -> bool {
        let is_empty = self.mailbox.is_none();
        self.mailbox.get_or_insert(*frame);
        is_empty
    }

    fn receive(&mut self) -> Option<BusFrame> {
        self.received.pop_front()
    }

    fn state(&mut self) -> CanState {
        CanState {
            takes_part: true,
            ..CanState::default()
        }
    }
}

/// Codes of a stage at rest; no two ticks in a row have the same.
struct Converter;

impl FrameSampler for Converter {
    type Bus = Infallible;
    const SPI_MODE: Mode = MODE_0;
    const SPI_HZ_MAX: u32 = 1;
    const SETTLE_US: u32 = 0;
    const CODE_BITS: u32 = 24;

    fn start(&mut self) -> Result<(), AdcError<Infallible>> {
        Ok(())
    }

    fn trigger(&mut self) -> Result<(), AdcError<Infallible>> {
        Ok(())
    }

    fn sample(&mut self, sequence: u32) -> Result<RawFrame, AdcError<Infallible>> {
        let change = (sequence % 10) as i32;
        let hall = [100 + change, 200 - change, change];
        let time_us = sequence.wrapping_mul(PERIOD_US);
        Ok(RawFrame::new(
            hall,
            [change, -change, 10 + change],
            sequence,
            time_us,
        ))
    }
}

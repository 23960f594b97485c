//! The stage controller on this machine: the firmware's own start, node, records and outbox, over
//! two sectors of flash in RAM. The clock is advanced by the caller, the codes are made up, and the random numbers
//! follow from a seed.

use crate::flash_model::FlashModel;
use crate::random::Random;
use hal_adapters::can::update::{Identity, Key, Store as _};
use hal_adapters::can::{BusFrame, Coded, Layout};
use runtime::RawFrame;
use stage_node::node::{Facts, Node as Ticking, Parameters};
use stage_node::outbox::Outbox;
use stage_node::records::{Choice, Loaded, Records};
use stage_node::retained::{Retained, WORDS};
use stage_node::schedule::PERIOD_US;
use stage_node::start_up::{Before, Cause, PROVEN_TICKS};
use stage_node::store::Image;
use std::ptr::NonNull;

/// Frames that a tick takes from the bus at most.
pub const TAKEN_PER_TICK: usize = 3;

/// A controller.
pub struct Node {
    serial: Option<&'static str>,
    key: Option<Key>,
    ticking: Ticking<'static>,
    records: Records<FlashModel>,
    // Below what borrows from it: fields are dropped in this order.
    statics: Statics,
    /// RAM that survives a reset.
    retained: [u32; WORDS],
    outbox: Outbox,
    random: Random,
    resets: u32,
}

impl Node {
    /// A controller of the stage `serial`, if its program knows that, with this flash, after
    /// power-on.
    pub fn new(
        serial: Option<&'static str>,
        key: Option<Key>,
        flash: FlashModel,
        seed: u64,
    ) -> Self {
        let before = Before::new(Cause::PowerOn, None);
        let (ticking, records, statics) = start(flash, (serial, key), &before);
        let retained = retained(&before, &records, &ticking);
        Self {
            serial,
            key,
            ticking,
            records,
            statics,
            retained,
            outbox: Outbox::new(),
            random: Random::new(seed),
            resets: 0,
        }
    }

    /// One tick after `missed_ticks` missed ticks: decodes codes, takes frames of the bus, and stores an update.
    /// Returns whether it stored one, which takes half a second.
    pub fn tick(
        &mut self,
        missed_ticks: u32,
        received: impl IntoIterator<Item = BusFrame>,
    ) -> bool {
        self.outbox.start_tick();
        let stores = self.ticking.is_storing() && self.outbox.is_empty();
        let sample = Ok(codes(self.ticking.ticks()));
        let facts = Facts {
            missed_ticks,
            servo_off_pin: Some(true),
            ..Facts::default()
        };
        (self.ticking).tick(sample, &facts, &mut self.outbox);
        for frame in received.into_iter().take(TAKEN_PER_TICK) {
            let nonce = [(); 4].map(|()| self.random.bits() as u32);
            (self.ticking).take(&frame, &mut self.outbox, &mut self.records, Some(nonce));
        }
        if self.ticking.ticks() == PROVEN_TICKS {
            let mut record = Retained::from_words(&self.retained).unwrap_or_default();
            record.prove();
            self.retained = record.to_words();
        }
        if stores {
            (self.ticking).store(&mut self.outbox, &mut self.records);
        }
        stores
    }

    /// Whether a zero deviation is subtracted.
    pub fn is_zeroed(&self) -> bool {
        self.ticking.zero() != runtime::PlanarPose::ZERO
    }

    /// The next frame for the bus.
    pub fn send(&mut self) -> Option<Coded> {
        self.outbox.pop()
    }

    /// Whether it waits for a reset, and its answers have left.
    pub fn is_to_be_reset(&self) -> bool {
        self.ticking.wants_reset() && self.outbox.is_empty()
    }

    /// A reset: flash and retained RAM are kept.
    pub fn reset(&mut self) {
        if self.ticking.wants_reset() {
            let mut record = Retained::from_words(&self.retained).unwrap_or_default();
            record.activate();
            self.retained = record.to_words();
        }
        self.start(Cause::Reset);
    }

    fn start(&mut self, cause: Cause) {
        let before = Before::new(cause, Retained::from_words(&self.retained));
        let mut flash = self.flash().clone();
        flash.power_on();
        let statics;
        (self.ticking, self.records, statics) = start(flash, (self.serial, self.key), &before);
        self.statics = statics;
        self.retained = retained(&before, &self.records, &self.ticking);
        self.outbox = Outbox::new();
        self.resets += 1;
    }

    /// Starts so far, without the first.
    pub const fn resets(&self) -> u32 {
        self.resets
    }

    /// Its flash.
    pub const fn flash(&self) -> &FlashModel {
        self.records.flash()
    }

    /// The blob that the next power-on would run.
    pub fn newest(&self) -> Option<Vec<u8>> {
        let mut flash = self.flash().clone();
        let (records, _) = Records::start(&mut flash, Choice::Newest, self.serial);
        let newest = records.newest()?;
        [0, 1].into_iter().find_map(|slot| {
            let image = Image::read(records.flash(), slot);
            let stored = image.stored(slot)?;
            let is_newest = (stored.sequence, stored.crc) == (newest.sequence, newest.crc);
            is_newest.then(|| image.blob()[..stored.bytes as usize].to_vec())
        })
    }

    /// The highest sequence number; 0 for a plain blob.
    pub fn records(&self) -> u32 {
        self.records.newest_sequence()
    }
}

/// The statics of the controller, for one start.
struct Statics {
    place: NonNull<Option<Loaded>>,
}

impl Drop for Statics {
    fn drop(&mut self) {
        // SAFETY: it is a box of `start`, which gave its only reference to the node and the records. `Node` drops or
        // replaces both first, and hands out neither.
        drop(unsafe { Box::from_raw(self.place.as_ptr()) });
    }
}

/// The firmware's `init` without the chip.
fn start(
    flash: FlashModel,
    (serial, key): (Option<&'static str>, Option<Key>),
    before: &Before,
) -> (Ticking<'static>, Records<FlashModel>, Statics) {
    let place = Box::leak(Box::new(None));
    let statics = Statics {
        place: NonNull::from(&mut *place),
    };
    let (mut records, refusal) = Records::start(flash, before.choice, serial);
    let is_sound = runtime::arithmetic::check().is_ok();
    let loaded = match is_sound {
        true => records.load(before.choice, place),
        false => None,
    };
    let stop = before.stop(loaded.is_some());
    let parameters = Parameters::at_start(loaded, refusal, stop, is_sound);
    let identity = Identity {
        serial,
        key,
        program_version: 0x00_01_02_03,
    };
    let mut node = Ticking::new(parameters, before.by_fault, Layout::Bits24, identity);
    before.restore_zero(&mut node, loaded.map_or(0, |loaded| loaded.crc));
    (node, records, statics)
}

/// RAM that survives a reset, once the node runs.
fn retained(before: &Before, records: &Records<FlashModel>, ticking: &Ticking<'_>) -> [u32; WORDS] {
    let mut record = before.record;
    if let Some(running) = records.running() {
        record.runs(running.id.crc, ticking.zero());
    }
    record.to_words()
}

/// Codes of a stage at rest; no two ticks in a row have the same.
fn codes(tick: u32) -> RawFrame {
    let change = (tick % 10) as i32;
    RawFrame::new(
        [100 + change, 200 - change, change],
        [change, -change, 10 + change],
        tick,
        tick.wrapping_mul(PERIOD_US),
    )
}

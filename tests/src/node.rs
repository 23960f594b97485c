//! The stage controller on this machine: the firmware's own start, node, records and outbox, over
//! two sectors of flash in RAM. In place of the chip there are a clock that others advance, codes
//! that are made up, and random numbers by a seed.

use firmware::fpu::FpuSettings;
use firmware::node::{Facts, Node as Ticking, Parameters};
use firmware::outbox::Outbox;
use firmware::records::Records;
use firmware::retained::{FaultKind, Retained, Step, WORDS};
use firmware::schedule::PERIOD_US;
use firmware::slots::Loaded;
use firmware::start_up::{Before, Cause, PROVEN_TICKS};
use firmware::store::flash_model::FlashModel;
use firmware::store::{Record, Store};
use hal_adapters::can::status::NodeState;
use hal_adapters::can::update::{Identity, Key, Store as _};
use hal_adapters::can::{BusFrame, Coded, Layout};
use hal_adapters::fault::Random;
use runtime::RawFrame;
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
    /// What a reset leaves in RAM.
    retained: [u32; WORDS],
    outbox: Outbox,
    random: Random,
    resets: u32,
}

/// This machine's FPU, which nothing changes.
struct Unchanged;

impl FpuSettings for Unchanged {
    fn restore(&mut self) -> bool {
        false
    }
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
        let before = Before::of(Cause::PowerOn, None);
        let (ticking, records, statics) = start(flash, (serial, key), &before);
        Self {
            serial,
            key,
            ticking,
            records,
            statics,
            retained: before.record.to_words(),
            outbox: Outbox::new(),
            random: Random::new(seed),
            resets: 0,
        }
    }

    /// One tick, of which so many before it were missed: decodes codes, takes frames of the bus,
    /// and does a step of an update.
    pub fn tick(&mut self, missed_ticks: u32, received: impl IntoIterator<Item = BusFrame>) {
        self.outbox.start_tick();
        let sample = Ok(codes(self.ticking.ticks()));
        let facts = Facts {
            missed_ticks,
            ..Facts::default()
        };
        (self.ticking).tick(sample, &facts, &mut Unchanged, &mut self.outbox);
        for frame in received.into_iter().take(TAKEN_PER_TICK) {
            let nonce = [(); 4].map(|()| self.random.bits() as u32);
            (self.ticking).take(&frame, &mut self.outbox, &mut self.records, Some(nonce));
        }
        if self.ticking.ticks() == PROVEN_TICKS {
            let mut record = Retained::from_words(&self.retained).unwrap_or_default();
            record.prove();
            self.retained = record.to_words();
            self.records.prove();
        }
        (self.ticking).update(&mut self.outbox, &mut self.records);
    }

    /// The next frame for the bus.
    pub fn send(&mut self) -> Option<Coded> {
        self.outbox.pop()
    }

    /// Whether it waits for a reset, and its answers have left.
    pub fn is_to_be_reset(&self) -> bool {
        self.ticking.wants_reset() && self.outbox.is_empty()
    }

    /// A reset that the program asked for: flash and retained RAM are kept, and all else is as the
    /// start-up makes it.
    pub fn reset(&mut self) {
        self.start(Cause::Reset);
    }

    /// The program panics in a tick: its parameters are blamed for it, unless they are proven.
    pub fn fault(&mut self) {
        let mut record = Retained::from_words(&self.retained).unwrap_or_default();
        record.step = Step::Ticking;
        record.note(FaultKind::Panic, 0, 0);
        self.retained = record.to_words();
        self.start(Cause::Reset);
    }

    /// The power goes and comes back: only the flash is kept.
    pub fn power_cycle(&mut self) {
        self.start(Cause::PowerOn);
    }

    fn start(&mut self, cause: Cause) {
        let before = Before::of(cause, Retained::from_words(&self.retained));
        let mut flash = self.flash().clone();
        flash.power_on();
        let statics;
        (self.ticking, self.records, statics) = start(flash, (self.serial, self.key), &before);
        self.statics = statics;
        self.retained = before.record.to_words();
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

    /// The blob that the next start would run.
    pub fn newest(&self) -> Option<&[u8]> {
        let newest = Store::read(self.flash(), self.serial).newest()?;
        Some(newest.blob(self.flash()))
    }

    /// Records that were written: the sequence number of the newest one; 0 for a plain blob.
    pub fn records(&self) -> u32 {
        self.records.newest_sequence()
    }

    /// Whether a transfer is open.
    pub fn is_updating(&self) -> bool {
        self.ticking.state().0 == NodeState::Updating
    }
}

/// What the controller has as statics, for one start.
struct Statics {
    record: NonNull<Record>,
    place: NonNull<Option<Loaded>>,
}

impl Drop for Statics {
    fn drop(&mut self) {
        // SAFETY: both are boxes of `start`, which gave their only references to the node and the
        // records that it made. `Node` drops or replaces those first, and hands out neither.
        unsafe {
            drop(Box::from_raw(self.record.as_ptr()));
            drop(Box::from_raw(self.place.as_ptr()));
        }
    }
}

/// What the firmware's `init` does, as far as it is not about the chip.
fn start(
    flash: FlashModel,
    (serial, key): (Option<&'static str>, Option<Key>),
    before: &Before,
) -> (Ticking<'static>, Records<FlashModel>, Statics) {
    let record = Box::leak(Box::new(Record::EMPTY));
    let place = Box::leak(Box::new(None));
    let statics = Statics {
        record: NonNull::from(&mut *record),
        place: NonNull::from(&mut *place),
    };
    // No check of a blob faults here, whose CRC the next start had to know.
    let check = before.check(serial, |_| ());
    let (mut records, found) = Records::start(flash, record, check, before.blames_newest());
    let is_sound = runtime::arithmetic::check().is_ok();
    let runs = found.blob.filter(|_| is_sound);
    let loaded = runs.and_then(|blob| records.load(blob, place));
    let parameters = Parameters::at_start(loaded, found.refusal, is_sound);
    let identity = Identity {
        serial,
        key,
        program_version: 0x00_01_02_03,
        program_hash: 0xfeed_beef,
    };
    let mut node = Ticking::new(parameters, before.by_fault, Layout::Bits24, identity);
    before.restore_zero(&mut node, loaded.map_or(0, |loaded| loaded.crc));
    (node, records, statics)
}

/// Codes that 16-bit converters may give, and no two ticks in a row with the same.
fn codes(tick: u32) -> RawFrame {
    let change = (tick % 100) as i32;
    RawFrame {
        hall: [1_000 + change, 2_000 - change, change],
        capacitive: [change, -change, 10 + change],
        sequence: tick,
        time_us: tick.wrapping_mul(PERIOD_US),
    }
}

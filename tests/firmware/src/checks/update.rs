//! New parameters over the bus: the host's own dialog with the program and its flash.

use super::asking::{SERVO_OFF, answers, ask};
use super::parameters::{for_stage_7, host_poses};
use super::same_words;
use crate::bench::{Bench, Seen};
use crate::flash_model::PowerCut;
use crate::machine::Machine;
use hal_adapters::can::BusFrame;
use hal_adapters::can::command::{Outcome, Request};
use hal_adapters::can::status::{NodeState, NodeStatus, board_check};
use hal_adapters::can::update::{Key, UpdateRequest};
use host_fit::bus::update::{Identity, Link, Talk, UpdateError, UpdateSettings, Updated, on};
use std::collections::VecDeque;
use tests::flash_model::Cut;

/// The key of the stage's program.
pub(crate) const KEY: Key = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];
/// The golden example of the field model.
const FIELD: &[u8] = include_bytes!("../../../../runtime/examples/field.bin");
/// Between two looks at the bus.
const STEP_NS: u64 = 250_000;
const S: u64 = 1_000_000_000;
/// Limits of the time of an update, and of its erase without frames, s.
const UPDATE_S_MAX: f64 = 1.5;
const STALL_S: std::ops::Range<f64> = 0.5..0.55;

pub(super) fn plan(blob: &[u8]) -> UpdateSettings {
    UpdateSettings {
        blob: Some(blob.to_vec()),
        serial: Some("stage-7".to_owned()),
        key: Some(KEY),
        declares_servo_off: true,
        activates: false,
    }
}

/// The bus between one host and the controller. It ends when the power is lost.
pub(crate) struct Wire<'m> {
    machine: &'m mut Machine,
    cuts: u32,
    until_ns: u64,
    seen: Seen,
    heard: VecDeque<BusFrame>,
}

impl Link for Wire<'_> {
    fn send(&mut self, frame: BusFrame) -> Result<(), UpdateError> {
        self.machine.chip.can.receive(&frame);
        Ok(())
    }

    fn receive(&mut self, until_us: u64) -> Result<Option<BusFrame>, UpdateError> {
        while self.heard.is_empty() && self.now_us() < until_us {
            if self.machine.power_cuts != self.cuts {
                return Err(UpdateError::Link(String::new()));
            }
            assert!(self.machine.chip.now_ns <= self.until_ns, "it does not end");
            self.machine.run_ns(STEP_NS);
            let first_ns = self.machine.chip.first_tick_ns.unwrap_or(0);
            for sent in std::mem::take(&mut self.machine.chip.can.sent) {
                self.seen.take(&sent, first_ns);
                self.heard.push_back(sent.frame);
            }
        }
        Ok(self.heard.pop_front())
    }

    fn now_us(&self) -> u64 {
        self.machine.chip.now_ns / 1000
    }
}

/// Runs a script until it ends or the power is lost. Also returns the frames meanwhile.
pub(crate) fn talk<T>(
    machine: &mut Machine,
    script: impl FnOnce(&mut Talk<Wire<'_>>) -> Result<T, UpdateError>,
) -> (Result<T, UpdateError>, Seen) {
    let token = (machine.chip.now_ns / 1_000_000) as u8;
    let (cuts, until_ns) = (machine.power_cuts, machine.chip.now_ns + 30 * S);
    let wire = Wire {
        machine,
        cuts,
        until_ns,
        seen: Seen::default(),
        heard: VecDeque::new(),
    };
    let mut talk = Talk::new(wire, token);
    let result = script(&mut talk);
    (result, talk.link.seen)
}

fn update(machine: &mut Machine, plan: &UpdateSettings) -> (Result<Updated, UpdateError>, Seen) {
    talk(machine, |talk| on::update(talk, plan, &mut |_, _| {}))
}

pub(super) fn updated(machine: &mut Machine, plan: &UpdateSettings) -> Updated {
    update(machine, plan).0.expect("an update")
}

pub(super) fn identity(machine: &mut Machine) -> Identity {
    let (identity, _) = talk(machine, |talk| {
        let identity = on::identify(talk)?;
        Ok(identity)
    });
    identity.expect("an identity")
}

/// The blob that runs, read over the bus.
pub(super) fn running(machine: &mut Machine) -> Vec<u8> {
    let (read, _) = talk(machine, |talk| on::read_back(talk, &mut |_, _| {}));
    read.expect("a blob").1
}

/// An update: in time, poses invalid meanwhile, and the state "updating" sent before the erase. The ticks stand during
/// the erase and the watchdog does not reset. The next power-on runs the new blob; activation runs it at
/// once. The words are the host's words with the field model.
pub fn new_parameters(bench: &Bench) {
    let mut machine = bench.running(100);
    let (large, set) = for_stage_7(FIELD);
    let from_ns = machine.chip.now_ns;
    let (ended, seen) = update(&mut machine, &plan(&large));
    let ended = ended.expect("an update");
    let s = (machine.chip.now_ns - from_ns) as f64 / 1e9;
    println!("RESULT firmware_update_bytes={}", large.len());
    println!("RESULT firmware_update_s={s:.3}");
    assert_eq!((ended.sequence, ended.is_stored), (1, true));
    assert_eq!((ended.repeated_words, ended.repeated_transfers), (0, 0));
    assert!(ended.before.needs_key);
    assert!(s <= UPDATE_S_MAX, "{s} s");
    let later = Seen::after(&mut machine, 20);
    let missed = later.last_status().map_or(0, |status| status.missed_ticks);
    println!("RESULT firmware_update_missed_ticks={missed}");
    assert_eq!(machine.chip.flash.erases, 1);
    let stall_s = f64::from(missed) * 0.002;
    assert!(STALL_S.contains(&stall_s), "{missed} ticks missed");
    assert!(seen.x().filter(|axis| !axis.is_valid()).count() > 70);
    // The last state before the ticks that are missed.
    let gap = |pair: &&[(u64, NodeStatus)]| pair[1].0 - pair[0].0 > 200;
    let before = seen.statuses.windows(2).find(gap);
    let before = before.map(|pair| pair[0].1.state);
    assert_eq!(before, Some(Some(NodeState::Updating)));
    assert_eq!(running(&mut machine), bench.blob);

    let mut next = bench.machine([&[], &[]]);
    next.chip.flash.sectors = machine.chip.flash.sectors.clone();
    let seen = Seen::after(&mut next, 200);
    same_words(&seen.axes, &host_poses(bench, &set), 0, 198);

    // Back again by the blob that ran before.
    for (sequence, blob) in [(2, &bench.later), (3, &bench.blob)] {
        let activates = UpdateSettings {
            activates: true,
            ..plan(blob)
        };
        let ended = updated(&mut machine, &activates);
        assert_eq!((ended.sequence, ended.is_active), (sequence, true));
        assert_eq!(running(&mut machine), *blob);
    }
    assert_eq!((machine.panics, machine.watchdog_resets), (2, 0));
    let ram = bench.image.static_bytes + machine.stack_bytes();
    println!("RESULT firmware_update_ram_bytes={ram}");
    assert!(ram <= super::figures::RAM_BYTES_MAX, "{ram} bytes of RAM");
}

/// A wrong key, the service pin, a broken generator of random numbers: nothing is written.
pub fn refused(bench: &Bench) {
    let mut machine = bench.running(100);
    let other = UpdateSettings {
        key: Some([0; 16]),
        ..plan(&bench.later)
    };
    let (refused, _) = update(&mut machine, &other);
    assert_eq!(refused, Err(UpdateError::NotAuthorised));
    machine.chip.servo_on = true;
    let (refused, _) = update(&mut machine, &plan(&bench.later));
    assert!(matches!(refused, Err(UpdateError::ServoOn { .. })));
    machine.chip.servo_on = false;
    machine.run_ticks(2);
    machine.chip.random.broken = true;
    let (refused, _) = update(&mut machine, &plan(&bench.later));
    assert_eq!(refused, Err(UpdateError::NoRandomNumber));
    machine.chip.random.broken = false;
    assert_eq!(machine.chip.flash.sectors.operations, 0);
    assert_eq!(updated(&mut machine, &plan(&bench.later)).sequence, 1);
}

/// Every challenge has a new random number: a recorded tag proves nothing later.
pub fn no_nonce_twice(bench: &Bench) {
    let mut machine = bench.running(20);
    answers(&mut machine, &[(SERVO_OFF, 99, Outcome::Done)]);
    let mut words: Vec<u32> = Vec::new();
    for token in 100..104 {
        for part in 0..4 {
            let challenge = Request::Update(UpdateRequest::Challenge { part });
            let seen = ask(&mut machine, challenge, token, 10);
            let answer = seen.answers.iter().find(|answer| answer.token == token);
            let word = answer.expect("an answer").detail;
            assert!(!words.contains(&word), "{word:x} again");
            words.push(word);
        }
    }
}

/// Operations of the flash in an update.
fn operations(bench: &Bench) -> usize {
    let mut machine = bench.running(20);
    updated(&mut machine, &plan(&bench.later));
    machine.chip.flash.sectors.operations
}

/// Flash that reports an error or a supply that drops ends the update with the reason. The blob that ran runs on,
/// and sound hardware takes another update. With a low supply no further operation is done.
pub fn hardware_that_fails(bench: &Bench) {
    // Without its seal the blob counts, and a start seals it.
    for at in (0..operations(bench) - 1).step_by(7) {
        let mut machine = bench.running(20);
        machine.chip.supply_drops_at = Some(at);
        let (ended, _) = update(&mut machine, &plan(&bench.later));
        assert_eq!(ended, Err(UpdateError::SupplyLow));
        assert_eq!(machine.chip.flash.sectors.operations, at);
        Seen::since_last(&mut machine);
        let checks = Seen::after(&mut machine, 200).page(11);
        assert_eq!(checks, Some(board_check::SUPPLY_LOW));
        assert_eq!(running(&mut machine), bench.blob);
        machine.chip.supply_drops_at = None;
        machine.power_cycle();
        machine.run_ticks(20);
        assert_eq!(running(&mut machine), bench.blob, "{at}");
        updated(&mut machine, &plan(&bench.later));
    }
    let mut machine = bench.running(20);
    machine.chip.flash.sectors.reports = Some(50);
    let (ended, _) = update(&mut machine, &plan(&bench.later));
    assert_eq!(ended, Err(UpdateError::StoreFailed));
    assert_eq!(running(&mut machine), bench.blob);
}

/// Cuts of the power before, inside and after operations of the flash, and again in the start that follows:
/// the old or the new blob runs, and for certain the new blob once the update was answered. After a brown-out the
/// old blob runs. Another update is possible.
pub fn power_cuts(bench: &Bench) {
    let operations = operations(bench);
    for is_short in [false, true] {
        let (old, new) = cut(bench, operations, is_short);
        println!(
            "RESULT firmware_{}={} old={old} new={new}",
            ["power_cuts", "brown_outs"][usize::from(is_short)],
            old + new
        );
        assert!(old > 0 && (new > 0) != is_short, "old {old}, new {new}");
    }
}

/// How often the old and the new blob ran after cuts in these operations.
fn cut(bench: &Bench, operations: usize, is_short: bool) -> (u32, u32) {
    let (mut old, mut new) = (0, 0);
    // The drop of the old slot, its erase, the first words, a word of the blob; check, commit word, seal.
    let first = [0, 1, 2, operations / 2];
    let places = first.into_iter().chain(operations - 3..operations);
    let all = places.flat_map(|at| Cut::ALL.map(|place| (at, place)));
    for (seed, (at, place)) in (1..).zip(all) {
        let cut = PowerCut { at, place, seed };
        let again = PowerCut { at: 0, ..cut };
        let cuts = if place == Cut::Inside { 2 } else { 1 };
        let mut machine = bench.running(20);
        machine.cuts_are_short = is_short;
        machine.chip.flash.cut_at(&[cut, again][..cuts]);
        let (_ended, _) = update(&mut machine, &plan(&bench.later));
        machine.run_ticks(20);
        assert!(machine.power_cuts > 0, "{cut:?}");
        let found = running(&mut machine);
        let is_stored = (at, place) == (operations - 1, Cut::After);
        assert!(
            found == bench.later && !is_short || found == bench.blob && (is_short || !is_stored),
            "after {cut:?}"
        );
        (old, new) = match found == bench.blob {
            true => (old + 1, new),
            false => (old, new + 1),
        };
        machine.chip.flash.cut_at(&[]);
        let (large, _) = for_stage_7(FIELD);
        assert!(
            updated(&mut machine, &plan(&large)).is_stored,
            "after {cut:?}"
        );
    }
    (old, new)
}

//! New parameters over the bus: the host's own dialog against the program and its flash.

use super::asking::{answers, ask};
use super::commands::SERVO_OFF;
use super::parameters::{FIELD, bytes_of, of_stage_7, poses_of};
use super::same_words;
use crate::bench::{Bench, Seen};
use crate::flash_model::BYTES;
use crate::machine::Machine;
use embedded_can::{Frame, Id, StandardId};
use hal_adapters::can::BusFrame;
use hal_adapters::can::command::{Outcome as Ended, Request};
use hal_adapters::can::status::{NodeState, NodeStatus, board_check};
use hal_adapters::can::update::{Key, UpdateRequest};
use host_fit::bus::update::{Identity, Link, Plan, Talk, UpdateError, Updated, on};
use runtime::ParameterSet;
use runtime::parameters::Text;
use std::collections::VecDeque;

/// The key of the stage's program.
pub(crate) const KEY: Key = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];
/// Between two looks at the bus.
const STEP_NS: u64 = 250_000;
const S: u64 = 1_000_000_000;
/// An update may take so long, s, and its erase, in which no frame is sent.
const UPDATE_S_MAX: f64 = 1.5;
const STALL_S: std::ops::Range<f64> = 0.5..0.55;

pub(super) fn plan(blob: &[u8]) -> Plan {
    Plan {
        blob: Some(blob.to_vec()),
        serial: Some("stage-7".to_owned()),
        key: Some(KEY),
        declares_servo_off: true,
        activates: false,
    }
}

/// The controller on a bus that only the host is on. It ends when the power is lost.
pub(crate) struct Wire<'m> {
    machine: &'m mut Machine,
    cuts: u32,
    until_ns: u64,
    seen: Seen,
    heard: VecDeque<BusFrame>,
}

impl Link for Wire<'_> {
    fn send(&mut self, frame: BusFrame) -> Result<(), UpdateError> {
        let data = frame.data().try_into().map_err(|_| UpdateError::Link)?;
        let Id::Standard(id) = frame.id else {
            return Err(UpdateError::Link);
        };
        self.machine.chip.can.receive(id.as_raw(), data);
        Ok(())
    }

    fn receive(&mut self, until_us: u64) -> Result<Option<BusFrame>, UpdateError> {
        while self.heard.is_empty() && self.now_us() < until_us {
            if self.machine.power_cuts != self.cuts {
                return Err(UpdateError::Link);
            }
            assert!(self.machine.chip.now_ns <= self.until_ns, "it does not end");
            self.machine.run_ns(STEP_NS);
            let first_ns = self.machine.chip.first_tick_ns.unwrap_or(0);
            for sent in std::mem::take(&mut self.machine.chip.can.sent) {
                self.seen.take(&sent, first_ns);
                let id = StandardId::new(sent.id);
                let frame = id.and_then(|id| BusFrame::new(id, &sent.bytes));
                self.heard.extend(frame);
            }
        }
        Ok(self.heard.pop_front())
    }

    fn now_us(&self) -> u64 {
        self.machine.chip.now_ns / 1000
    }
}

/// Runs a script until it is over or the power is lost; what was on the bus meanwhile.
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

pub(super) fn update(machine: &mut Machine, plan: &Plan) -> (Result<Updated, UpdateError>, Seen) {
    talk(machine, |talk| on::update(talk, plan, &mut |_, _| {}))
}

pub(super) fn updated(machine: &mut Machine, plan: &Plan) -> Updated {
    update(machine, plan).0.expect("an update")
}

/// What the controller says about itself.
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

/// The next start with what is in flash now: its words are those of the host with this blob.
fn starts_with(bench: &Bench, machine: &Machine, blob: &[u8]) {
    let poses = poses_of(bench, &ParameterSet::from_bytes(blob).expect("sound"));
    let mut next = bench.machine([&[], &[]]);
    next.chip.flash.sectors = machine.chip.flash.sectors.clone();
    let seen = Seen::after(&mut next, 200);
    same_words(&seen.axes, &poses, 0, 198);
}

/// The field model's example as one of this stage, with the longest text of its time.
pub(super) fn large() -> Vec<u8> {
    let (_, mut set) = of_stage_7(FIELD);
    set.created = Text::try_from("2026-11-22T10:00:00.000000+00:00").expect("short");
    bytes_of(&set)
}

/// An update: in time, poses invalid meanwhile and the state "updating" sent before the erase, in which the ticks
/// stand and the watchdog does not bite; the next power-on runs it. Another one takes its place and is
/// activated at once, and so does the one that ran before.
pub fn new_parameters(bench: &Bench) {
    let mut machine = bench.running(100);
    let large = large();
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
    starts_with(bench, &machine, &large);

    // Back again by the blob that ran before.
    for (sequence, blob) in [(2, &bench.later), (3, &bench.blob)] {
        let activates = Plan {
            activates: true,
            ..plan(blob)
        };
        let ended = updated(&mut machine, &activates);
        assert_eq!((ended.sequence, ended.is_active), (sequence, true));
        assert_eq!(running(&mut machine), *blob);
    }
    assert_eq!((machine.panics, machine.watchdog_resets), (2, 0));
    let (statics, stack) = (bench.image.static_bytes, machine.stack_bytes());
    println!("RESULT firmware_update_ram_bytes={}", statics + stack);
    assert!(
        statics + stack <= super::figures::RAM_BYTES_MAX,
        "{statics} + {stack} bytes of RAM"
    );
}

/// A key that is not the program's, the service pin, a generator of random numbers that is broken.
pub fn refused(bench: &Bench) {
    let mut machine = bench.running(100);
    let other = Plan {
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
    let ended = updated(&mut machine, &plan(&bench.later));
    assert_eq!(ended.sequence, 1);
}

/// Every transfer has a random number of its own: what was proven for one proves nothing for another.
pub fn no_nonce_twice(bench: &Bench) {
    let mut machine = bench.running(20);
    answers(&mut machine, &[(SERVO_OFF, 99, Ended::Done)]);
    let mut nonces: Vec<[u32; 4]> = Vec::new();
    for token in 100..104 {
        let begin = Request::Update(UpdateRequest::Begin { bytes: 1 });
        answers(&mut machine, &[(begin, token, Ended::Done)]);
        let mut nonce = [0; 4];
        for (part, word) in (0..).zip(&mut nonce) {
            let challenge = Request::Update(UpdateRequest::Challenge { part });
            let seen = ask(&mut machine, challenge, token, 10);
            let mut answers = seen.answers.iter().filter(|answer| answer.token == token);
            let answer = answers.next().expect("an answer");
            assert_eq!(answer.outcome, Some(Ended::Done));
            *word = answer.detail;
        }
        assert!(
            nonces.iter().flatten().all(|word| !nonce.contains(word)),
            "{nonce:x?} after {nonces:x?}"
        );
        nonces.push(nonce);
        let abort = Request::Update(UpdateRequest::Abort);
        answers(&mut machine, &[(abort, token, Ended::Done)]);
    }
}

/// Flash that reports an error at once or later, or of which a word does not change: the update
/// ends with that, before and after the next start the old parameters run, and a start with sound
/// flash takes new ones.
pub fn flash_that_fails(bench: &Bench) {
    // A slot in words.
    const OTHER_SLOT: usize = BYTES / 8;
    for (reports, stuck) in [
        (Some(0), None),
        (Some(50), None),
        (None, Some(OTHER_SLOT)),
        (None, Some(OTHER_SLOT + 50)),
    ] {
        let mut machine = bench.running(20);
        let sectors = &mut machine.chip.flash.sectors;
        (sectors.reports, sectors.stuck) = (reports, stuck);
        let (ended, _) = update(&mut machine, &plan(&bench.later));
        assert_eq!(ended, Err(UpdateError::StoreFailed));
        assert_eq!(running(&mut machine), bench.blob);
        machine.reset_by_pin();
        machine.run_ticks(40);
        assert_eq!(running(&mut machine), bench.blob);
        let sectors = &mut machine.chip.flash.sectors;
        (sectors.reports, sectors.stuck) = (None, None);
        machine.power_cycle();
        machine.run_ticks(20);
        updated(&mut machine, &plan(&bench.later));
        starts_with(bench, &machine, &bench.later);
    }
}

/// The supply drops at any operation of an update: no further one is done, the answer says why, the blob that
/// was there runs, and with a sound supply another update is taken.
pub fn supply_that_drops(bench: &Bench) {
    let mut whole = bench.running(20);
    updated(&mut whole, &plan(&bench.later));
    let operations = whole.chip.flash.sectors.operations;
    // Without its seal the blob counts, and a start seals it.
    for at in 0..operations - 1 {
        let mut machine = bench.running(20);
        machine.chip.supply_drops_at = Some(at);
        let (ended, _) = update(&mut machine, &plan(&bench.later));
        assert_eq!(ended, Err(UpdateError::SupplyLow));
        assert_eq!(machine.chip.flash.sectors.operations, at);
        if at % 16 == 0 {
            Seen::since_last(&mut machine);
            let checks = Seen::after(&mut machine, 200).page(11);
            assert_eq!(checks, Some(board_check::SUPPLY_LOW));
            machine.chip.supply_drops_at = None;
            machine.power_cycle();
            machine.run_ticks(20);
            assert_eq!(running(&mut machine), bench.blob);
            updated(&mut machine, &plan(&bench.later));
        }
    }
    println!(
        "RESULT firmware_supply_drops={} written_below=0",
        operations - 1
    );
}

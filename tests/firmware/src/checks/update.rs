//! New parameters over the bus: the host's own dialog against the program and its flash.

use super::asking::{answers, ask};
use super::commands::SERVO_OFF;
use super::parameters::{FIELD, poses_of};
use super::start::page;
use super::{Failure, Outcome, equal, expect, same_words};
use crate::adc_model::Part;
use crate::bench::{Bench, Seen, Words};
use crate::flash_model::Failing;
use crate::machine::Machine;
use embedded_can::{Frame, Id, StandardId};
use hal_adapters::can::BusFrame;
use hal_adapters::can::command::{Outcome as Ended, Request};
use hal_adapters::can::status::{NodeState, NodeStatus, board_check};
use hal_adapters::can::update::{Key, UpdateRequest};
use host_fit::bus::update::{Identity, Link, Plan, Talk, UpdateError, Updated, Wanted, on};
use runtime::blob::MAX_BYTES;
use runtime::parameters::Text;
use runtime::{ParameterSet, Status};
use std::collections::VecDeque;

/// The program for the ADS131M08 is built with this key, the other one without any.
pub(super) const PART: Part = Part::Ads131m08;
pub(crate) const KEY: Key = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];
/// Between two looks at the bus.
const STEP_NS: u64 = 250_000;
const S: u64 = 1_000_000_000;
/// An update may take so long, s, and its erase, in which no frame is sent.
const UPDATE_S_MAX: f64 = 1.5;
const STALL_S: std::ops::Range<f64> = 0.5..0.55;

pub(super) fn plan(blob: &[u8]) -> Plan {
    Plan {
        wanted: match blob {
            [] => Wanted::Previous,
            blob => Wanted::Blob(blob.to_vec()),
        },
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
    failure: Option<Failure>,
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
            if self.machine.chip.now_ns > self.until_ns {
                self.failure = Some("it does not end".into());
                return Err(UpdateError::Link);
            }
            if let Err(failure) = self.machine.run_ns(STEP_NS) {
                self.failure = Some(failure.into());
                return Err(UpdateError::Link);
            }
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
) -> Result<(Result<T, UpdateError>, Seen), Failure> {
    let token = (machine.chip.now_ns / 1_000_000) as u8;
    let (cuts, until_ns) = (machine.power_cuts, machine.chip.now_ns + 30 * S);
    let wire = Wire {
        machine,
        cuts,
        until_ns,
        seen: Seen::default(),
        heard: VecDeque::new(),
        failure: None,
    };
    let mut talk = Talk::new(wire, token);
    let result = script(&mut talk);
    match talk.link.failure {
        Some(failure) => Err(failure),
        None => Ok((result, talk.link.seen)),
    }
}

pub(super) fn update(
    machine: &mut Machine,
    plan: &Plan,
) -> Result<(Result<Updated, UpdateError>, Seen), Failure> {
    talk(machine, |talk| on::update(talk, plan, &mut |_, _| {}))
}

/// What the controller says about itself.
pub(super) fn identity(machine: &mut Machine) -> Result<Identity, Failure> {
    let (identity, _) = talk(machine, |talk| {
        let identity = on::identify(talk)?;
        Ok(identity)
    })?;
    Ok(identity?)
}

/// The blob that runs, read over the bus.
pub(super) fn running(machine: &mut Machine) -> Result<Vec<u8>, Failure> {
    let (read, _) = talk(machine, |talk| on::read_back(talk, &mut |_, _| {}))?;
    Ok(read?.1)
}

/// The next start with what is in flash now: its words are those of the host.
fn starts_with(bench: &Bench, machine: &Machine, poses: &[Words]) -> Outcome {
    let mut next = bench.machine(PART, [&[], &[]])?;
    next.chip.flash.bytes.clone_from(&machine.chip.flash.bytes);
    next.run_ticks(200)?;
    same_words(&Seen::since_last(&mut next).axes, poses, 0, 198)
}

/// The field model's example as one of this stage, with the longest text of its time.
pub(super) fn large() -> Result<Vec<u8>, Failure> {
    let mut set = ParameterSet::from_bytes(FIELD)?;
    set.serial = Text::try_from("stage-7").map_err(|_| "the serial")?;
    set.created = Text::try_from("2026-11-22T10:00:00.000000+00:00").map_err(|_| "the time")?;
    let mut buffer = [0; MAX_BYTES];
    Ok(set.to_bytes(&mut buffer)?.to_vec())
}

/// An update: in time, poses invalid meanwhile and the state "updating" sent before the erase, in which the ticks
/// stand and the watchdog does not bite; the next power-on runs it. Another one takes its place and is
/// activated at once; back is to the one that ran before.
pub fn new_parameters(bench: &Bench) -> Outcome {
    let mut machine = bench.running(PART, 100)?;
    let large = large()?;
    let from_ns = machine.chip.now_ns;
    let (updated, seen) = update(&mut machine, &plan(&large))?;
    let updated = updated?;
    let s = (machine.chip.now_ns - from_ns) as f64 / 1e9;
    println!("RESULT firmware_update_bytes={}", large.len());
    println!("RESULT firmware_update_s={s:.3}");
    equal("sequence number", updated.sequence, Some(1))?;
    equal("sent again", updated.repeated, (0, 0))?;
    equal("key needed", updated.before.needs_key, true)?;
    expect(s <= UPDATE_S_MAX, || format!("{s} s"))?;
    machine.run_ticks(20)?;
    let later = Seen::since_last(&mut machine);
    let missed = later.last_status().map_or(0, |status| status.missed_ticks);
    println!("RESULT firmware_update_missed_ticks={missed}");
    equal("erases", machine.chip.flash.erases, 1)?;
    let stall_s = f64::from(missed) * 0.002;
    expect(STALL_S.contains(&stall_s), || {
        format!("{missed} ticks missed")
    })?;
    let invalid = seen
        .axes
        .iter()
        .filter(|axis| axis.axis == 0 && axis.status & Status::PLANAR_INVALID.bits() != 0);
    expect(invalid.count() > 70, || "poses were valid".to_owned())?;
    // The last state before the ticks that are missed.
    let gap = |pair: &&[(u64, NodeStatus)]| pair[1].0 - pair[0].0 > 200;
    let before = seen.statuses.windows(2).find(gap);
    let before = before.map(|pair| pair[0].1.state);
    equal("state", before, Some(Some(NodeState::Updating)))?;
    equal("running", running(&mut machine)?, bench.blob.clone())?;
    starts_with(
        bench,
        &machine,
        &poses_of(bench, &ParameterSet::from_bytes(&large)?),
    )?;

    let activates = |plan: Plan| Plan {
        activates: true,
        ..plan
    };
    let (updated, _) = update(&mut machine, &activates(plan(&bench.later)))?;
    let updated = updated?;
    equal(
        "second",
        (updated.sequence, updated.is_active),
        (Some(2), true),
    )?;
    equal("running", running(&mut machine)?, bench.later.clone())?;
    let (updated, _) = update(&mut machine, &activates(plan(&[])))?;
    let updated = updated?;
    equal(
        "back",
        (updated.sequence, updated.is_active),
        (Some(3), true),
    )?;
    equal("running", running(&mut machine)?, bench.blob.clone())?;
    let resets = (machine.panics, machine.watchdog_resets);
    equal("resets asked for, and by the watchdog", resets, (2, 0))?;
    let (statics, stack) = (bench.image(PART).static_bytes, machine.stack_bytes());
    println!("RESULT firmware_update_ram_bytes={}", statics + stack);
    expect(statics + stack <= super::figures::RAM_BYTES_MAX, || {
        format!("{statics} + {stack} bytes of RAM")
    })
}

/// A key that is not the program's, the service pin, a generator of random numbers that is broken.
pub fn refused(bench: &Bench) -> Outcome {
    let mut machine = bench.running(PART, 100)?;
    let other = Plan {
        key: Some([0; 16]),
        ..plan(&bench.later)
    };
    let (refused, _) = update(&mut machine, &other)?;
    equal("the end", refused, Err(UpdateError::NotAuthorised))?;
    machine.chip.servo_on = true;
    let (refused, _) = update(&mut machine, &plan(&bench.later))?;
    expect(matches!(refused, Err(UpdateError::ServoOn { .. })), || {
        format!("with the servo on: {refused:?}")
    })?;
    machine.chip.servo_on = false;
    machine.run_ticks(2)?;
    machine.chip.random.broken = true;
    let (refused, _) = update(&mut machine, &plan(&bench.later))?;
    expect(matches!(refused, Err(UpdateError::NoRandomNumber)), || {
        format!("without random numbers: {refused:?}")
    })?;
    machine.chip.random.broken = false;
    equal("operations", machine.chip.flash.operations, 0)?;
    let (updated, _) = update(&mut machine, &plan(&bench.later))?;
    equal("once all is well", updated?.sequence, Some(1))
}

/// Every transfer has a random number of its own: what was proven for one proves nothing for another.
pub fn no_nonce_twice(bench: &Bench) -> Outcome {
    let mut machine = bench.running(PART, 20)?;
    answers(&mut machine, &[(SERVO_OFF, 99, Ended::Done)])?;
    let mut nonces: Vec<[u32; 4]> = Vec::new();
    for token in 100..104 {
        let begin = Request::Update(UpdateRequest::begin(1, 0));
        answers(&mut machine, &[(begin, token, Ended::Done)])?;
        let mut nonce = [0; 4];
        for (part, word) in (0..).zip(&mut nonce) {
            let challenge = Request::Update(UpdateRequest::Challenge { part });
            let seen = ask(&mut machine, challenge, token, 10)?;
            let answer = seen.answers.iter().find(|(_, a)| a.token == token);
            let (_, answer) = answer.ok_or("no answer")?;
            equal("answer", answer.outcome, Some(Ended::Done))?;
            *word = answer.detail;
        }
        expect(
            nonces.iter().flatten().all(|word| !nonce.contains(word)),
            || format!("{nonce:x?} after {nonces:x?}"),
        )?;
        nonces.push(nonce);
        let abort = Request::Update(UpdateRequest::Abort);
        answers(&mut machine, &[(abort, token, Ended::Done)])?;
    }
    Ok(())
}

/// Flash of which the first or a later word does not change, and tells so or does not: the update
/// ends with that, before and after the next start the old parameters run, and a start with sound
/// flash takes new ones.
pub fn flash_that_fails(bench: &Bench) -> Outcome {
    for (word, failing) in [
        (0, Failing::Reported),
        (0, Failing::Silent),
        (50, Failing::Reported),
        (50, Failing::Silent),
    ] {
        let mut machine = bench.running(PART, 20)?;
        let from = machine.chip.flash.operations + word;
        machine.chip.flash.fails = Some((from, failing));
        let (ended, _) = update(&mut machine, &plan(&bench.later))?;
        equal("the end", ended, Err(UpdateError::StoreFailed))?;
        equal("running", running(&mut machine)?, bench.blob.clone())?;
        machine.reset_by_pin();
        machine.run_ticks(40)?;
        equal("running", running(&mut machine)?, bench.blob.clone())?;
        machine.chip.flash.fails = None;
        machine.power_cycle();
        machine.run_ticks(20)?;
        update(&mut machine, &plan(&bench.later))?.0?;
        let later = ParameterSet::from_bytes(&bench.later)?;
        starts_with(bench, &machine, &poses_of(bench, &later))?;
    }
    Ok(())
}

/// The supply drops at any operation of an update: no further one is done, the answer says why, the blob that
/// was there runs, and with a sound supply another update is taken.
pub fn supply_that_drops(bench: &Bench) -> Outcome {
    let mut whole = bench.machine(PART, [&bench.blob, &[]])?;
    whole.run_ticks(20)?;
    update(&mut whole, &plan(&bench.later))?.0?;
    let operations = whole.chip.flash.operations;
    // Without its seal the blob counts, and a start seals it.
    for at in 0..operations - 1 {
        let mut machine = bench.running(PART, 20)?;
        machine.chip.supply_drops_at = Some(at);
        let (ended, _) = update(&mut machine, &plan(&bench.later))?;
        equal("the end", ended, Err(UpdateError::SupplyLow))?;
        equal("operations", machine.chip.flash.operations, at)?;
        if at % 16 == 0 {
            Seen::since_last(&mut machine);
            machine.run_ticks(200)?;
            let checks = page(&Seen::since_last(&mut machine), 11);
            equal("checks", checks, Some(board_check::SUPPLY_LOW))?;
            machine.chip.supply_drops_at = None;
            machine.power_cycle();
            machine.run_ticks(20)?;
            equal("running", running(&mut machine)?, bench.blob.clone())?;
            update(&mut machine, &plan(&bench.later))?.0?;
        }
    }
    println!(
        "RESULT firmware_supply_drops={} written_below=0",
        operations - 1
    );
    Ok(())
}

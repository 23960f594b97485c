//! New parameters over the bus: the host's own dialog against the program and its flash.

use super::commands::{SERVO_OFF, answers, ask};
use super::figures::CYCLES_PER_INSTRUCTION;
use super::log::Stage;
use super::parameters::{FIELD, poses_of};
use super::{Failure, Outcome, equal, expect};
use crate::adc_model::Part;
use crate::bench::{Bench, Comparison, Seen, Words};
use crate::flash_model::Failing;
use crate::machine::Machine;
use embedded_can::{Frame, StandardId};
use hal_adapters::can::command::{Mailbox, Outcome as Ended, Request, Told};
use hal_adapters::can::status::NodeState;
use hal_adapters::can::update::{Key, TAG_INDEX, UpdateData, UpdateRequest};
use hal_adapters::can::{BusFrame, Coded};
use host_fit::bus::update::{BlobReader, Dialog, Job, Plan, UpdateError, Updated, Updater, Wanted};
use runtime::blob::MAX_BYTES;
use runtime::parameters::Text;
use runtime::{ParameterSet, Status};

/// The program for the ADS131M08 is built with this key, the other one without any.
pub(super) const PART: Part = Part::Ads131m08;
const KEY: Key = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];
/// Between two looks at the bus.
const STEP_NS: u64 = 250_000;
const S: u64 = 1_000_000_000;
/// An update may take so long, s.
const UPDATE_S_MAX: f64 = 1.0;
/// Two words of flash in a tick, at the longest.
const FLASH_US: f64 = 200.0;
/// What a tick has after its codes were read.
const TICK_US_MAX: f64 = 1700.0;

pub(super) fn plan(blob: &[u8], token: u8) -> Plan {
    Plan {
        wanted: match blob {
            [] => Wanted::Previous,
            blob => Wanted::Blob(blob.to_vec()),
        },
        serial: Some("stage-7".to_owned()),
        key: Some(KEY),
        declares_servo_off: true,
        activates: false,
        token,
    }
}

/// Runs until a dialog is over or the power is lost; what was on the bus meanwhile.
pub(super) fn talk<J: Job>(machine: &mut Machine, job: J, token: u8) -> Result<(J, Seen), Failure> {
    let (mut dialog, mut seen) = (Dialog::new(job, token), Seen::default());
    let until_ns = machine.chip.now_ns + 30 * S;
    let cuts = machine.power_cuts;
    while !dialog.is_over() && machine.power_cuts == cuts {
        expect(machine.chip.now_ns < until_ns, || {
            "it does not end".to_owned()
        })?;
        let now_us = machine.chip.now_ns / 1000;
        if let Some(Coded { message, bytes }) = dialog.poll(now_us) {
            machine.chip.can.receive(message.spec().id, bytes);
        }
        machine.run_ns(STEP_NS)?;
        let first_ns = machine.chip.first_tick_ns.unwrap_or(0);
        for sent in std::mem::take(&mut machine.chip.can.sent) {
            seen.take(&sent, first_ns);
            let id = StandardId::new(sent.id).ok_or("an identifier")?;
            if let Some(frame) = BusFrame::new(id, &sent.bytes) {
                dialog.take(&frame, sent.done_ns / 1000);
            }
        }
    }
    Ok((dialog.into_job(), seen))
}

pub(super) fn update(
    machine: &mut Machine,
    plan: Plan,
) -> Result<(Result<Updated, UpdateError>, Seen), Failure> {
    let token = plan.token;
    let (job, seen) = talk(machine, Updater::new(plan), token)?;
    Ok((job.result(), seen))
}

/// The blob that runs, read over the bus.
pub(super) fn running(machine: &mut Machine) -> Result<Vec<u8>, Failure> {
    let (job, _) = talk(machine, BlobReader::default(), 90)?;
    Ok(job.result()?.1)
}

/// The next start with what is in flash now: its words are those of the host.
fn starts_with(bench: &Bench, machine: &Machine, poses: &[Words]) -> Outcome {
    let mut next = bench.machine(PART, [&[], &[]])?;
    next.chip.flash.bytes.clone_from(&machine.chip.flash.bytes);
    next.run_ticks(200)?;
    let mut comparison = Comparison::default();
    comparison.add(&Seen::since_last(&mut next).axes, poses, 0);
    equal("words that differ", comparison.differing, 0)?;
    expect(comparison.planar >= 198, || {
        format!("only {} poses", comparison.planar)
    })
}

/// The field model's example as one of this stage, with the longest text of its time.
pub(super) fn large() -> Result<Vec<u8>, Failure> {
    let mut set = ParameterSet::from_bytes(FIELD)?;
    set.serial = Text::try_from("stage-7").map_err(|_| "the serial")?;
    set.created = Text::try_from("2026-11-22T10:00:00.000000+00:00").map_err(|_| "the time")?;
    let mut buffer = [0; MAX_BYTES];
    Ok(set.to_bytes(&mut buffer)?.to_vec())
}

/// An update: in time, no tick missed, poses invalid meanwhile and "updating" told; the next start
/// runs it. Another one is activated at once; and back to the one before.
pub fn new_parameters(bench: &Bench) -> Outcome {
    let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
    machine.count_instructions()?;
    machine.run_ticks(100)?;
    Seen::since_last(&mut machine);
    let large = large()?;
    let from_ns = machine.chip.now_ns;
    let (updated, seen) = update(&mut machine, plan(&large, 1))?;
    let updated = updated?;
    let s = (machine.chip.now_ns - from_ns) as f64 / 1e9;
    println!("RESULT firmware_update_bytes={}", large.len());
    println!("RESULT firmware_update_s={s:.3}");
    equal("sequence number", updated.sequence, Some(1))?;
    equal("sent again", updated.repeated, (0, 0))?;
    equal("key needed", updated.before.needs_key, true)?;
    expect(s <= UPDATE_S_MAX, || format!("{s} s"))?;
    let stage = Stage::read(&machine, bench, PART)?;
    println!("RESULT firmware_update_missed_ticks={}", stage.missed_ticks);
    let ticks = (stage.missed_ticks, stage.overrun_ticks);
    equal("ticks missed and overrun", ticks, (0, 0))?;
    equal("erases", machine.chip.flash.erases, 0)?;
    // Instructions take no time in the emulator: the longest tick, with its words of flash.
    let instructions = machine.costs.iter().map(|cost| cost.all_instructions);
    let us = instructions.max().unwrap_or(0) as f64 * CYCLES_PER_INSTRUCTION / 168.0 + FLASH_US;
    println!("RESULT firmware_update_longest_tick_us_estimate={us:.0}");
    expect(us < TICK_US_MAX, || format!("a tick of {us:.0} us"))?;
    let invalid = seen
        .axes
        .iter()
        .filter(|axis| axis.axis == 0 && axis.status & Status::PLANAR_INVALID.bits() != 0);
    expect(invalid.count() > 150, || "poses were valid".to_owned())?;
    let mut states = seen.statuses.iter().map(|(_, status)| status.state);
    expect(
        states.any(|state| state == Some(NodeState::Updating)),
        || "updating was not told".to_owned(),
    )?;
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
    let (updated, _) = update(&mut machine, activates(plan(&bench.later, 2)))?;
    let updated = updated?;
    equal(
        "second",
        (updated.sequence, updated.is_active),
        (Some(2), true),
    )?;
    equal("running", running(&mut machine)?, bench.later.clone())?;
    let (updated, _) = update(&mut machine, activates(plan(&[], 3)))?;
    let updated = updated?;
    equal(
        "back",
        (updated.sequence, updated.is_active),
        (Some(3), true),
    )?;
    equal("running", running(&mut machine)?, large)?;
    let resets = (machine.panics, machine.watchdog_resets);
    equal("resets asked for, and by the watchdog", resets, (2, 0))?;
    let (statics, stack) = (bench.image(PART).static_bytes, machine.stack_bytes());
    println!("RESULT firmware_update_ram_bytes={}", statics + stack);
    expect(statics + stack <= super::figures::RAM_BYTES_MAX, || {
        format!("{statics} + {stack} bytes of RAM")
    })
}

/// A wrong key, no key, another stage's blob, the service pin, a stale sequence number, a generator
/// of random numbers that is broken.
pub fn refused(bench: &Bench) -> Outcome {
    let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
    machine.run_ticks(100)?;
    let (updated, _) = update(&mut machine, plan(&bench.later, 1))?;
    updated?;
    let operations = machine.chip.flash.operations;
    let with_key = |key| Plan {
        key,
        ..plan(&bench.blob, 2)
    };
    let other_stage = Plan {
        serial: None,
        ..plan(&bench.other, 2)
    };
    let [expected, found] = ["stage-8", "stage-7"].map(str::to_owned);
    for (plan, want) in [
        (with_key(Some([0; 16])), UpdateError::NotAuthorised),
        (with_key(None), UpdateError::KeyNeeded),
        (other_stage, UpdateError::OtherStage { expected, found }),
    ] {
        let (refused, _) = update(&mut machine, plan)?;
        equal("the end", refused, Err(want))?;
    }
    machine.chip.servo_on = true;
    let (refused, _) = update(&mut machine, plan(&bench.blob, 3))?;
    expect(matches!(refused, Err(UpdateError::ServoOn { .. })), || {
        format!("with the servo on: {refused:?}")
    })?;
    machine.chip.servo_on = false;
    machine.run_ticks(2)?;
    let request = Request::Update;
    answers(
        &mut machine,
        &[
            (Request::ServoOff { seconds: 0 }, 99, Ended::Done),
            (request(UpdateRequest::begin(0, 0)), 100, Ended::ServoOn),
            (SERVO_OFF, 101, Ended::Done),
            (request(UpdateRequest::begin(1, 0)), 102, Ended::Done),
            (request(UpdateRequest::begin(1, 0)), 103, Ended::Busy),
            (
                request(UpdateRequest::Commit { sequence: 2 }),
                102,
                Ended::NotAuthorised,
            ),
            (request(UpdateRequest::Abort), 102, Ended::Done),
            (request(UpdateRequest::begin(1, 0)), 104, Ended::Done),
        ],
    )?;
    let mut host = Mailbox::default();
    for index in (TAG_INDEX..TAG_INDEX + 4).chain([0]) {
        let (token, word) = (104, 0);
        let data = host.send(&Told::UpdateData(UpdateData { token, index, word }));
        let Coded { message, bytes } = data.ok_or("a word")?;
        machine.chip.can.receive(message.spec().id, bytes);
        machine.run_ticks(1)?;
    }
    let stale = request(UpdateRequest::Verify { sequence: 1 });
    answers(&mut machine, &[(stale, 104, Ended::WrongSequence)])?;
    answers(
        &mut machine,
        &[(request(UpdateRequest::Abort), 104, Ended::Done)],
    )?;
    machine.chip.random.broken = true;
    let (refused, _) = update(&mut machine, plan(&bench.blob, 4))?;
    expect(matches!(refused, Err(UpdateError::NoRandomNumber)), || {
        format!("without random numbers: {refused:?}")
    })?;
    machine.chip.random.broken = false;
    equal("operations", machine.chip.flash.operations, operations)?;
    let (updated, _) = update(&mut machine, plan(&bench.blob, 5))?;
    equal("once all is well", updated?.sequence, Some(2))
}

/// Every transfer has a random number of its own: what was proven for one proves nothing for another.
pub fn no_nonce_twice(bench: &Bench) -> Outcome {
    let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
    machine.run_ticks(20)?;
    answers(&mut machine, &[(SERVO_OFF, 99, Ended::Done)])?;
    let mut nonces: Vec<[u32; 4]> = Vec::new();
    for token in 100..104 {
        let begin = Request::Update(UpdateRequest::begin(1, 0));
        answers(&mut machine, &[(begin, token, Ended::Done)])?;
        let mut nonce = [0; 4];
        for (part, word) in (0..).zip(&mut nonce) {
            let challenge = Request::Update(UpdateRequest::Challenge { part });
            let seen = ask(&mut machine, challenge, token, 10)?;
            let told = seen.answers.iter().find(|(_, told)| told.token == token);
            let (_, told) = told.ok_or("no answer")?;
            equal("answer", told.outcome, Some(Ended::Done))?;
            *word = told.detail;
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

/// Of two plain blobs the older one is erased at a start, but not before the newer one has run for a
/// second.
pub fn two_plain_blobs(bench: &Bench) -> Outcome {
    let mut machine = bench.machine(PART, [&bench.blob, &bench.later])?;
    machine.run_ticks(400)?;
    machine.power_cycle();
    machine.run_ticks(600)?;
    equal("erases", machine.chip.flash.erases, 0)?;
    equal("running", running(&mut machine)?, bench.later.clone())?;
    let (refused, _) = update(&mut machine, plan(&bench.blob, 1))?;
    equal("the end", refused, Err(UpdateError::NoRoom))?;
    machine.power_cycle();
    machine.run_ticks(50)?;
    equal("erases", machine.chip.flash.erases, 1)?;
    equal("running", running(&mut machine)?, bench.later.clone())?;
    update(&mut machine, plan(&bench.blob, 2))?.0?;
    starts_with(bench, &machine, &bench.poses)
}

/// Flash of which the first or a later word does not change, and tells so or does not: the update
/// ends with that, before and after the next start the old parameters run, and a start with sound
/// flash takes new ones.
pub fn flash_that_fails(bench: &Bench) -> Outcome {
    for (word, failing) in [
        (0, Failing::Told),
        (0, Failing::Silent),
        (50, Failing::Told),
        (50, Failing::Silent),
    ] {
        let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
        machine.run_ticks(20)?;
        let from = machine.chip.flash.operations + word;
        machine.chip.flash.fails = Some((from, failing));
        let (ended, _) = update(&mut machine, plan(&bench.later, 1))?;
        equal("the end", ended, Err(UpdateError::StoreFailed))?;
        equal("running", running(&mut machine)?, bench.blob.clone())?;
        machine.reset_by_pin();
        machine.run_ticks(40)?;
        equal("running", running(&mut machine)?, bench.blob.clone())?;
        machine.chip.flash.fails = None;
        machine.power_cycle();
        machine.run_ticks(20)?;
        update(&mut machine, plan(&bench.later, 2))?.0?;
        let later = ParameterSet::from_bytes(&bench.later)?;
        starts_with(bench, &machine, &poses_of(bench, &later))?;
    }
    Ok(())
}

/// A sector with anything in it is erased at the first start beside a plain blob; the watchdog runs
/// and does not bite, and the next start erases nothing.
pub fn erase_at_the_start(bench: &Bench) -> Outcome {
    let mut machine = bench.machine(PART, [&bench.blob, &[0x5a; 4096]])?;
    machine.run_ticks(50)?;
    equal("erases", machine.chip.flash.erases, 1)?;
    expect(machine.chip.first_tick_ns > Some(S / 2), || {
        "an erase that takes no time".to_owned()
    })?;
    machine.power_cycle();
    machine.run_ticks(50)?;
    equal("erases", machine.chip.flash.erases, 1)?;
    equal("bites", (machine.panics, machine.watchdog_resets), (0, 0))?;
    starts_with(bench, &machine, &bench.poses)?;
    update(&mut machine, plan(&bench.later, 1))?.0?;
    let later = ParameterSet::from_bytes(&bench.later)?;
    starts_with(bench, &machine, &poses_of(bench, &later))
}

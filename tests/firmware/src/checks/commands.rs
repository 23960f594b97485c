//! Commands over the bus.

use super::{Outcome, equal, expect};
use crate::adc_model::Part;
use crate::bench::{Bench, Seen, command};
use crate::machine::Machine;
use hal_adapters::can::command::{Outcome as Ended, Request};
use hal_adapters::can::status::flag;

const PART: Part = Part::Ads131m08;

fn ask(
    machine: &mut Machine,
    request: Request,
    token: u8,
    ticks: u64,
) -> Result<Seen, super::Failure> {
    let (id, bytes) = command(request, token, token);
    machine.chip.can.receive(id, bytes);
    machine.run_ticks(ticks)?;
    Ok(Seen::since_last(machine))
}

fn ended(seen: &Seen, token: u8) -> Vec<Option<Ended>> {
    seen.answers
        .iter()
        .filter(|(_, a)| a.token == token)
        .map(|(_, a)| a.outcome)
        .collect()
}

fn flags(seen: &Seen) -> u8 {
    seen.last_status().map_or(0, |status| status.flags)
}

/// Identify: the serial number in six pages, the flag for as long as was asked, a fast LED.
pub fn identify(bench: &Bench) -> Outcome {
    let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
    machine.run_ticks(50)?;
    Seen::since_last(&mut machine);
    let seen = ask(&mut machine, Request::Identify { seconds: 1 }, 1, 100)?;
    equal("answer", ended(&seen, 1), vec![Some(Ended::Done)])?;
    let text: Vec<u8> = seen
        .identity
        .iter()
        .copied()
        .take_while(|&b| b != 0)
        .collect();
    equal(
        "serial number",
        String::from_utf8_lossy(&text).into_owned(),
        "stage-7".to_owned(),
    )?;
    equal("bytes of text", seen.identity.len(), 36)?;
    equal("flag", flags(&seen) & flag::IDENTIFYING, flag::IDENTIFYING)?;
    let mut blinks = 0;
    let mut lit = machine.chip.led;
    for _ in 0..300 {
        machine.run_ticks(1)?;
        blinks += u32::from(machine.chip.led != lit);
        lit = machine.chip.led;
    }
    expect((8..=11).contains(&blinks), || {
        format!("the LED changed {blinks} times")
    })?;
    machine.run_ticks(300)?;
    equal(
        "flag afterwards",
        flags(&Seen::since_last(&mut machine)) & flag::IDENTIFYING,
        0,
    )
}

/// Re-zero on a moving stage is refused with its axis; at rest it is done, and the pose is
/// zero from then on until the zero is cleared.
pub fn rezero(bench: &Bench) -> Outcome {
    let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
    machine.run_ticks(50)?;
    Seen::since_last(&mut machine);
    let seen = ask(&mut machine, Request::Rezero { ticks: 200 }, 1, 260)?;
    equal(
        "answers while moving",
        ended(&seen, 1),
        vec![Some(Ended::Started), Some(Ended::Moved)],
    )?;
    equal(
        "flag",
        flags(&seen) & flag::REZERO_REFUSED,
        flag::REZERO_REFUSED,
    )?;

    // A stage at rest, a few um off: the noise of a few codes around one row.
    let rest = [100, -50, 70, 10, 20, -30];
    let noise = |k: usize, c: usize| (k as i32 * 7 + c as i32 * 3) % 5 - 2;
    let rows = (0..1000)
        .map(|k| core::array::from_fn(|c| rest[c] + noise(k, c)))
        .collect();
    let mut machine = bench.machine_playing(PART, [&bench.blob, &[]], rows)?;
    machine.run_ticks(50)?;
    let x = |seen: &Seen| {
        let last = seen.axes.iter().rev().find(|axis| axis.axis == 0);
        last.map_or(f32::NAN, |axis| f32::from_bits(axis.word))
    };
    let before = x(&Seen::since_last(&mut machine));
    expect(before.abs() > 2e-6, || format!("X is {before:e} before"))?;
    let seen = ask(&mut machine, Request::Rezero { ticks: 400 }, 2, 200)?;
    equal(
        "answers while it runs",
        ended(&seen, 2),
        vec![Some(Ended::Started)],
    )?;
    equal("flag", flags(&seen) & flag::REZERO_RUNS, flag::REZERO_RUNS)?;
    let seen = ask(&mut machine, Request::ClearZero, 3, 20)?;
    equal(
        "answer while busy",
        ended(&seen, 3),
        vec![Some(Ended::Busy)],
    )?;
    machine.run_ticks(250)?;
    let seen = Seen::since_last(&mut machine);
    equal(
        "answer at the end",
        ended(&seen, 2),
        vec![Some(Ended::Done)],
    )?;
    equal(
        "flag",
        flags(&seen) & (flag::ZERO_SET | flag::REZERO_RUNS),
        flag::ZERO_SET,
    )?;
    expect(x(&seen).abs() < 0.5e-6, || {
        format!("X is {:e} after", x(&seen))
    })?;
    let seen = ask(&mut machine, Request::ClearZero, 4, 40)?;
    equal("answer", ended(&seen, 4), vec![Some(Ended::Done)])?;
    expect((x(&seen) - before).abs() < 1e-6, || {
        format!("X is {:e} once cleared", x(&seen))
    })
}

/// Commands without parameters, unknown ones, damaged ones and repeated ones.
pub fn odd_commands(bench: &Bench) -> Outcome {
    let mut machine = bench.machine(PART, [&[], &[]])?;
    machine.run_ticks(50)?;
    let seen = ask(&mut machine, Request::Rezero { ticks: 0 }, 1, 20)?;
    equal(
        "answer without parameters",
        ended(&seen, 1),
        vec![Some(Ended::NoParameters)],
    )?;
    let seen = ask(&mut machine, Request::Identify { seconds: 1 }, 2, 20)?;
    equal(
        "answer to identify",
        ended(&seen, 2),
        vec![Some(Ended::Done)],
    )?;

    let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
    machine.run_ticks(50)?;
    Seen::since_last(&mut machine);
    let (id, mut bytes) = command(Request::ClearZero, 9, 1);
    machine.chip.can.receive(id, bytes);
    machine.chip.can.receive(id, bytes);
    bytes[3] ^= 1;
    machine.chip.can.receive(id, bytes);
    machine.run_ticks(20)?;
    equal(
        "answers to one good frame of three",
        ended(&Seen::since_last(&mut machine), 9).len(),
        1,
    )
}

/// Frames under the command's identifier with every data length code: none stops the program.
pub fn any_length_code(bench: &Bench) -> Outcome {
    let mut machine = bench.machine(PART, [&bench.blob, &[]])?;
    machine.run_ticks(50)?;
    for code in 0..16 {
        let (id, bytes) = command(Request::ClearZero, code, code);
        machine.chip.can.receive_coded(id, code, bytes);
        machine.run_ticks(20)?;
    }
    equal(
        "panics and watchdog resets",
        (machine.panics, machine.watchdog_resets),
        (0, 0),
    )?;
    let seen = Seen::since_last(&mut machine);
    equal(
        "tokens answered",
        seen.answers.iter().map(|(_, a)| a.token).collect(),
        vec![8],
    )
}

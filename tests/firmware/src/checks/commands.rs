//! Commands over the bus.

use super::asking::{answers, ask, ended};
use super::{Outcome, equal, expect, no_resets};
use crate::adc_model::{Part, Row};
use crate::bench::{Bench, Seen, command};
use embedded_can::{Id, StandardId};
use hal_adapters::can::command::{Outcome as Ended, Request};
use hal_adapters::can::status::flag;
use hal_adapters::can::{Layout, Message as M, SensorReceiver, Timing};
use runtime::RawFrame;
use runtime::frame::MISSING_CODE;

const PART: Part = Part::Ads131m08;
/// From the trigger to the middle of what is sampled, by the drivers' documentation, us.
const ADS131M08_SAMPLE_US: u32 = 166;
const ADS8688_SAMPLE_US: u32 = 12;

/// Identify: the serial number in six pages, the flag for as long as was asked, a fast LED.
pub fn identify(bench: &Bench) -> Outcome {
    let mut machine = bench.running(PART, 50)?;
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
    equal("flag", seen.flags() & flag::IDENTIFYING, flag::IDENTIFYING)?;
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
        Seen::since_last(&mut machine).flags() & flag::IDENTIFYING,
        0,
    )
}

/// Rows of a stage at rest, with the noise of a few codes around one row.
pub(super) fn at_rest(rest: [i32; 6]) -> Vec<Row> {
    let noise = |k: usize, c: usize| (k as i32 * 7 + c as i32 * 3) % 5 - 2;
    (0..1000)
        .map(|k| core::array::from_fn(|c| rest[c] + noise(k, c)))
        .collect()
}

pub(super) const REZERO: Request = Request::Rezero { ticks: 400 };
pub(super) const SERVO_OFF: Request = Request::ServoOff { seconds: 3 };

/// With the servo off and the stage at rest a re-zero is done, and the pose is zero from then on
/// until the zero is cleared; with the servo on neither is.
pub fn rezero(bench: &Bench) -> Outcome {
    let rows = at_rest([100, -50, 70, 10, 20, -30]);
    let mut machine = bench.machine_playing(PART, [&bench.blob, &[]], rows)?;
    machine.run_ticks(50)?;
    let x = |seen: &Seen| {
        let last = seen.axes.iter().rev().find(|axis| axis.axis == 0);
        last.map_or(f32::NAN, |axis| f32::from_bits(axis.word))
    };
    let before = x(&Seen::since_last(&mut machine));
    expect(before.abs() > 2e-6, || format!("X is {before:e} before"))?;
    answers(
        &mut machine,
        &[
            (REZERO, 1, Ended::ServoOn),
            (Request::ClearZero, 2, Ended::ServoOn),
            (SERVO_OFF, 3, Ended::Done),
            (REZERO, 4, Ended::Started),
            (Request::ClearZero, 5, Ended::Busy),
        ],
    )?;
    machine.run_ticks(100)?;
    let seen = Seen::since_last(&mut machine);
    equal("flag", seen.flags() & flag::REZERO_RUNS, flag::REZERO_RUNS)?;
    machine.run_ticks(350)?;
    let seen = Seen::since_last(&mut machine);
    equal(
        "answer at the end",
        ended(&seen, 4),
        vec![Some(Ended::Done)],
    )?;
    equal(
        "flag",
        seen.flags() & (flag::ZERO_SET | flag::REZERO_RUNS),
        flag::ZERO_SET,
    )?;
    let is_zero = |seen: &Seen| {
        let x = x(seen);
        expect(x.abs() < 0.5e-6, || format!("X is {x:e} after"))
    };
    is_zero(&seen)?;

    answers(
        &mut machine,
        &[
            (SERVO_OFF, 7, Ended::Done),
            (Request::ClearZero, 8, Ended::Done),
        ],
    )?;
    machine.run_ticks(20)?;
    let seen = Seen::since_last(&mut machine);
    expect((x(&seen) - before).abs() < 1e-6, || {
        format!("X is {:e} once cleared", x(&seen))
    })?;

    // The service pin overrules the declaration.
    machine.chip.servo_on = true;
    machine.run_ticks(1)?;
    answers(&mut machine, &[(REZERO, 11, Ended::ServoOn)])
}

/// Record mode: every tick's codes, after the pose, with parameters and without, until a command
/// ends it.
pub fn record(bench: &Bench, part: Part) -> Outcome {
    let layout = match part {
        Part::Ads131m08 => Layout::Bits24,
        Part::Ads8688 => Layout::Bits16,
    };
    for blob in [bench.blob.as_slice(), &[]] {
        let mut machine = bench.machine(part, [blob, &[]])?;
        machine.run_ticks(50)?;
        let seen = Seen::since_last(&mut machine);
        equal("codes that nobody asked for", seen.recorded(), 0)?;
        let seen = ask(&mut machine, Request::Record { on: true }, 1, 800)?;
        equal("answer", ended(&seen, 1), vec![Some(Ended::Done)])?;
        equal("flag", seen.flags() & flag::RECORDING, flag::RECORDING)?;
        let mut receiver = SensorReceiver::new(layout, Timing::default());
        let mut ticks: Vec<RawFrame> = Vec::new();
        for (done_ns, frame) in &seen.codes {
            ticks.extend(receiver.take(frame, (done_ns / 1000) as u32).tick);
        }
        equal(
            "faults",
            receiver.health().lost + receiver.health().incomplete,
            0,
        )?;
        expect(ticks.len() >= 797, || format!("{} ticks", ticks.len()))?;
        let warm = |tick: &&RawFrame| !tick.temperature_mc.contains(&MISSING_CODE);
        let warm = ticks.iter().filter(warm).count();
        // Record mode begins up to 100 ms before the next frame of temperatures.
        expect(warm >= 797 - 52, || {
            format!("{warm} ticks with temperatures")
        })?;
        let codes = |tick: &RawFrame| -> Row {
            let ([a, b, c], [d, e, f]) = (tick.hall, tick.capacitive);
            [a, b, c, d, e, f]
        };
        // Its codes show which tick is the first of the record.
        let first = ticks.first().map(codes).ok_or("no ticks")?;
        let at = (50..90).find(|k| bench.rows[*k] == first);
        let rows = &bench.rows[at.ok_or("other codes than the converter's")?..];
        let differ = ticks
            .iter()
            .zip(rows)
            .filter(|(tick, row)| codes(tick) != **row);
        equal("ticks whose codes differ", differ.count(), 0)?;
        let words = seen.axes.iter().filter(|axis| axis.axis < 3).count();
        let planar = if blob.is_empty() { 0 } else { 3 * 799 };
        expect(words >= planar, || format!("{words} words of poses"))?;
        let seen = ask(&mut machine, Request::Record { on: false }, 2, 20)?;
        equal("answer", ended(&seen, 2), vec![Some(Ended::Done)])?;
        machine.run_ticks(20)?;
        let seen = Seen::since_last(&mut machine);
        equal("codes afterwards", seen.recorded(), 0)?;
    }
    Ok(())
}

/// What one tick sends, in the order of sending: X, Y, Rz, what else belongs to the pose, the
/// codes; and how old each is then.
pub fn order_and_age(bench: &Bench, part: Part, name: &str) -> Outcome {
    let mut machine = bench.machine(part, [&bench.blob, &[]])?;
    machine.run_ticks(50)?;
    ask(&mut machine, Request::Record { on: true }, 1, 20)?;
    ask(&mut machine, Request::Identify { seconds: 1 }, 2, 0)?;
    machine.chip.can.sent.clear();
    machine.run_ticks(320)?;
    let first_ns = machine.chip.first_tick_ns.ok_or("no tick")?;
    let sampled_us = match part {
        Part::Ads131m08 => ADS131M08_SAMPLE_US,
        Part::Ads8688 => ADS8688_SAMPLE_US,
    };
    let groups = [
        &[M::PoseX, M::PoseY, M::PoseRz][..],
        &[M::PoseTime],
        &[M::PoseZ, M::PoseRx, M::PoseRy],
        &[M::Temperature],
        &[M::SensorTime],
        Layout::Bits16.messages(),
        Layout::Bits24.messages(),
        &[M::NodeStatus, M::Health],
        &[M::Answer, M::Identity],
    ];
    let places: Vec<M> = groups.concat();
    let mut ages: Vec<Option<(u64, u64)>> = vec![None; places.len()];
    let mut last = (0, 0);
    for sent in &machine.chip.can.sent {
        let id = StandardId::new(sent.id).map(Id::Standard);
        let message = id.and_then(M::from_id).ok_or("a foreign frame")?;
        let place = places.iter().position(|m| *m == message);
        let place = place.ok_or("a message that nobody asked for")?;
        let tick = (sent.asked_ns - first_ns) / 2_000_000;
        // An answer and the pages of a serial number wait behind all others.
        expect((tick, place) > last, || {
            format!(
                "{message:?} comes after {:?} in tick {tick}",
                places[last.1]
            )
        })?;
        last = (tick, place);
        let since_us = (sent.done_ns - first_ns) / 1000 - 2_000 * tick;
        let age_us = since_us - u64::from(sampled_us);
        let (least, most) = ages[place].get_or_insert((age_us, age_us));
        (*least, *most) = (age_us.min(*least), age_us.max(*most));
    }
    for (message, age) in places.iter().zip(&ages) {
        if let Some((least, most)) = age {
            let key = format!("RESULT firmware_{name}_age_at_end_of_{message:?}_us");
            println!("{key}={least}..{most}");
        }
    }
    let oldest = ages.iter().flatten().map(|(_, most)| *most).max();
    let oldest_us = oldest.ok_or("no frames")?;
    expect(oldest_us < 2_000, || format!("a frame of {oldest_us} us"))
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
    no_resets(&machine)?;
    let seen = Seen::since_last(&mut machine);
    equal(
        "tokens answered",
        seen.answers.iter().map(|(_, a)| a.token).collect(),
        vec![8],
    )
}

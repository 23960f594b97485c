//! Commands over the bus.

use super::asking::{answers, ask};
use super::no_resets;
use crate::adc_model::{AdcFault, Row};
use crate::bench::{Bench, Seen, command};
use embedded_can::{Id, StandardId};
use hal_adapters::can::command::{Outcome as Ended, Request};
use hal_adapters::can::status::flag;
use hal_adapters::can::{Layout, Message as M, SensorReceiver, Timing};
use runtime::RawFrame;
use runtime::frame::MISSING_CODE;

/// From the trigger to the middle of the sample, by the driver's documentation, us.
const SAMPLE_US: u64 = 166;
const LAYOUT: Layout = Layout::Bits24;

/// Identify: the flag and a fast LED for the time asked for.
pub fn identify(bench: &Bench) {
    let mut machine = bench.running(50);
    let seen = ask(&mut machine, Request::Identify { seconds: 1 }, 1, 100);
    assert_eq!(seen.ended(1), [Some(Ended::Done)]);
    assert_eq!(seen.flags() & flag::IDENTIFYING, flag::IDENTIFYING);
    let mut blinks = 0;
    let mut lit = machine.chip.led;
    for _ in 0..300 {
        machine.run_ticks(1);
        blinks += u32::from(machine.chip.led != lit);
        lit = machine.chip.led;
    }
    assert!((8..=11).contains(&blinks), "the LED changed {blinks} times");
    let flags = Seen::after(&mut machine, 300).flags();
    assert_eq!(flags & flag::IDENTIFYING, 0);
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
pub fn rezero(bench: &Bench) {
    let rows = at_rest([100, -50, 70, 10, 20, -30]);
    let mut machine = bench.machine_playing([&bench.blob, &[]], rows);
    let x = |seen: &Seen| {
        seen.x()
            .last()
            .map_or(f32::NAN, |axis| f32::from_bits(axis.word))
    };
    let before = x(&Seen::after(&mut machine, 50));
    assert!(before.abs() > 2e-6, "X is {before:e} before");
    answers(
        &mut machine,
        &[
            (REZERO, 1, Ended::ServoOn),
            (Request::ClearZero, 2, Ended::ServoOn),
            (SERVO_OFF, 3, Ended::Done),
            (REZERO, 4, Ended::Started),
            (Request::ClearZero, 5, Ended::Busy),
        ],
    );
    let seen = Seen::after(&mut machine, 100);
    assert_eq!(seen.flags() & flag::REZERO_RUNS, flag::REZERO_RUNS);
    let seen = Seen::after(&mut machine, 350);
    assert_eq!(seen.ended(4), [Some(Ended::Done)]);
    assert_eq!(
        seen.flags() & (flag::ZERO_SET | flag::REZERO_RUNS),
        flag::ZERO_SET
    );
    assert!(x(&seen).abs() < 0.5e-6, "X is {:e} after", x(&seen));
    answers(
        &mut machine,
        &[
            (SERVO_OFF, 7, Ended::Done),
            (Request::ClearZero, 8, Ended::Done),
        ],
    );
    let seen = Seen::after(&mut machine, 20);
    assert!(
        (x(&seen) - before).abs() < 1e-6,
        "X is {:e} once cleared",
        x(&seen)
    );

    // The service pin overrules the declaration.
    machine.chip.servo_on = true;
    machine.run_ticks(1);
    answers(&mut machine, &[(REZERO, 11, Ended::ServoOn)])
}

/// Record mode: every tick's codes, after the pose, with parameters and without, until a command
/// ends it; a tick without codes is a gap.
pub fn record(bench: &Bench) {
    for blob in [bench.blob.as_slice(), &[]] {
        let mut machine = bench.machine([blob, &[]]);
        let seen = Seen::after(&mut machine, 50);
        assert_eq!(seen.recorded, 0);
        let mut seen = ask(&mut machine, Request::Record { on: true }, 1, 400);
        assert_eq!(seen.ended(1), [Some(Ended::Done)]);
        assert_eq!(seen.flags() & flag::RECORDING, flag::RECORDING);
        // A tick without codes, and one that never comes.
        machine.chip.adc.fault = AdcFault::Line(0);
        for ticks in [1, 399] {
            let more = Seen::after(&mut machine, ticks);
            seen.frames.extend(more.frames);
            seen.axes.extend(more.axes);
            machine.chip.adc.fault = AdcFault::None;
            machine.hold_ns = 3_000_000;
        }
        machine.hold_ns = 0;
        let mut receiver = SensorReceiver::new(LAYOUT, Timing::default());
        let mut ticks: Vec<RawFrame> = Vec::new();
        for (done_ns, frame) in &seen.frames {
            ticks.extend(receiver.take(frame, (done_ns / 1000) as u32).tick);
        }
        let health = receiver.health();
        let lost = 2 * LAYOUT.messages().len() as u32;
        assert_eq!((health.lost, health.incomplete), (lost, 0));
        assert!(ticks.len() >= 795, "{} ticks", ticks.len());
        let warm = |tick: &&RawFrame| !tick.temperature_mc.contains(&MISSING_CODE);
        let warm = ticks.iter().filter(warm).count();
        // Record mode begins up to 100 ms before the next frame of temperatures.
        assert!(warm >= 795 - 52, "{warm} ticks with temperatures");
        let codes = |tick: &RawFrame| -> Row {
            let ([a, b, c], [d, e, f]) = (tick.hall, tick.capacitive);
            [a, b, c, d, e, f]
        };
        // Its codes show which tick is the first of the record.
        let first = ticks.first().expect("ticks");
        let at = (50..90).find(|k| bench.rows[*k] == codes(first));
        let at = at.expect("the converter's codes");
        for tick in &ticks {
            let since = (tick.sequence - first.sequence) as usize;
            assert_eq!(codes(tick), bench.rows[at + since], "tick {since}");
        }
        let words = seen.axes.iter().filter(|axis| axis.axis < 3).count();
        let planar = if blob.is_empty() { 0 } else { 3 * 797 };
        assert!(words >= planar, "{words} words of poses");
        let seen = ask(&mut machine, Request::Record { on: false }, 2, 20);
        assert_eq!(seen.ended(2), [Some(Ended::Done)]);
        let seen = Seen::after(&mut machine, 20);
        assert_eq!(seen.recorded, 0);
    }
}

/// What one tick sends, in the order of sending: X, Y, Rz, what else belongs to the pose, the
/// codes; and how old each is then.
pub fn order_and_age(bench: &Bench) {
    let mut machine = bench.running(50);
    ask(&mut machine, Request::Record { on: true }, 1, 20);
    ask(&mut machine, Request::Identify { seconds: 1 }, 2, 0);
    machine.chip.can.sent.clear();
    machine.run_ticks(320);
    let first_ns = machine.chip.first_tick_ns.expect("no tick");
    let groups = [
        &[M::PoseX, M::PoseY, M::PoseRz][..],
        &[M::PoseTime],
        &[M::PoseZ, M::PoseRx, M::PoseRy],
        &[M::Temperature],
        &[M::SensorTime],
        LAYOUT.messages(),
        &[M::NodeStatus, M::Health],
        &[M::Answer],
    ];
    let places: Vec<M> = groups.concat();
    let mut ages: Vec<Option<(u64, u64)>> = vec![None; places.len()];
    let mut last = (0, 0);
    for sent in &machine.chip.can.sent {
        let id = StandardId::new(sent.id).map(Id::Standard);
        let message = id.and_then(M::from_id).expect("a foreign frame");
        let place = places.iter().position(|m| *m == message);
        let place = place.expect("a message that nobody asked for");
        let tick = (sent.asked_ns - first_ns) / 2_000_000;
        // An answer waits behind all others.
        assert!(
            (tick, place) > last,
            "{message:?} comes after {:?} in tick {tick}",
            places[last.1]
        );
        last = (tick, place);
        let since_us = (sent.done_ns - first_ns) / 1000 - 2_000 * tick;
        let age_us = since_us - SAMPLE_US;
        let (least, most) = ages[place].get_or_insert((age_us, age_us));
        (*least, *most) = (age_us.min(*least), age_us.max(*most));
    }
    for (message, age) in places.iter().zip(&ages) {
        if let Some((least, most)) = age {
            let key = format!("RESULT firmware_age_at_end_of_{message:?}_us");
            println!("{key}={least}..{most}");
        }
    }
    let oldest = ages.iter().flatten().map(|(_, most)| *most).max();
    let oldest_us = oldest.expect("no frames");
    assert!(oldest_us < 2_000, "a frame of {oldest_us} us");
}

/// Frames under the command's identifier with every data length code: none stops the program.
pub fn any_length_code(bench: &Bench) {
    let mut machine = bench.running(50);
    for code in 0..16 {
        let (id, bytes) = command(Request::ClearZero, code, code);
        machine.chip.can.receive_coded(id, code, bytes);
        machine.run_ticks(20);
    }
    no_resets(&machine);
    let seen = Seen::since_last(&mut machine);
    let tokens: Vec<_> = seen.answers.iter().map(|answer| answer.token).collect();
    assert_eq!(tokens, [8]);
}

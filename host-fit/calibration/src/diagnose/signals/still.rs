//! Movements in which nothing moves, and those that end in a rest.

use super::channels::{LogSignals, median, spread};
use crate::diagnose::left_out;
use crate::finding::{Code, Finding, Severity};
use std::ops::Range;

/// A movement stands still within this, m; its beams within this time, s.
const IDLE_M: f64 = 2e-6;
const ONCE_S: f64 = 1.0;
/// Length of a rest after a crash, s, of the stretches it is looked for in, and the share of
/// the usual speed that the stage has just before it.
const REST_S: f64 = 0.2;
const REST_STRETCH_S: f64 = 0.05;
const SPEED_SHARE: f64 = 0.3;

/// A channel that stood still, at the longest in these rows, and in such a share of the log's rows.
pub(super) fn stuck(log: &LogSignals, who: &str, longest: &Range<usize>, share: f64) -> Finding {
    let severity = left_out::severity(share);
    let stood_s = longest.len() as f64 * log.period_s;
    let in_all = match severity {
        Severity::Refuse => format!(", in {:.0} % of the log in all", 100.0 * share),
        _ => String::new(),
    };
    let message = format!(
        "{who} stood still for {stood_s:.2} s ({}){in_all} while it should have moved or shown its noise: look for a stage that \
         stopped, a cable or a frozen register, and leave these rows out",
        log.place(longest.start),
    );
    let found = log.warning_at(Code::Stuck, longest.start, message);
    found.severe(severity).of(stood_s, "s")
}

/// Names movements in which nothing moves, and rests at the end of movements; their rows are left out.
pub(super) fn rests(log: &mut LogSignals) -> Vec<Finding> {
    let (mut idle, mut crashed) = (Vec::new(), Vec::new());
    let (movements, once) = (log.segments.len(), log.rows_in(ONCE_S));
    for rows in &log.segments {
        if rows.len() < 2 || !log.usable[rows.clone()].iter().all(|used| *used) {
            continue;
        }
        // Over longer the interferometers of a stage at rest drift.
        let is_still = |moved: &f64| *moved < IDLE_M;
        if hall_motion_m(log, rows) < IDLE_M && moved_m(log, rows, once).iter().all(is_still) {
            idle.push(rows.clone());
        } else if let Some(rest) = sudden_rest(log, rows) {
            crashed.push(rest);
        }
    }
    // Where most movements end in a rest, it is how the stage is driven.
    if 2 * crashed.len() > movements.max(2) {
        crashed.clear();
    }
    let mut findings = Vec::new();
    if let Some(first) = idle.first() {
        let starts: Vec<usize> = idle.iter().map(|rows| rows.start).collect();
        let message = format!(
            "nothing moves in {} of {movements} movements ({}): they add nothing to the fit; leave them out or record \
             them again",
            idle.len(),
            log.places(&starts),
        );
        findings.push(log.warning_at(Code::IdleMovement, first.start, message));
    }
    if let Some(longest) = crashed.iter().max_by_key(|rest| rest.len()) {
        let who = match crashed.len() {
            1 => "the stage".to_owned(),
            count => format!("the stage, at the end of {count} of {movements} movements,"),
        };
        findings.push(stuck(log, &who, longest, 0.0));
    }
    log.leave_out(idle.into_iter().chain(crashed));
    findings
}

/// How far the stage moves by any beam, m.
fn motion_m(log: &LogSignals, rows: &Range<usize>) -> f64 {
    let beams = log.channels[3..6].iter();
    let spreads = beams.map(|beam| spread(&beam.values[rows.clone()]));
    spreads.fold(0.0, f64::max)
}

/// How far it moves by any probe, by means of 25 rows, so that noise does not count, m.
pub(super) fn hall_motion_m(log: &LogSignals, rows: &Range<usize>) -> f64 {
    let moved = |k: usize| {
        let some = log.channels[k].values[rows.clone()].chunks(25);
        let some = some.filter(|some| some.len() > 12);
        let means = some.map(|some| some.iter().sum::<f64>() / some.len() as f64);
        spread(&means.collect::<Vec<_>>())
    };
    moved(0).max(moved(1)).max(moved(2))
}

/// How far the stage moves in stretches of some rows, counted from the last, m.
fn moved_m(log: &LogSignals, rows: &Range<usize>, length: usize) -> Vec<f64> {
    let length = length.min(rows.len());
    let ends = (0..rows.len() / length).map(|k| rows.end - k * length);
    ends.map(|end| motion_m(log, &(end - length..end)))
        .collect()
}

/// The rest at the end of a movement that was at speed just before.
fn sudden_rest(log: &LogSignals, rows: &Range<usize>) -> Option<Range<usize>> {
    let length = log.rows_in(REST_STRETCH_S);
    // Cheap first: most movements do not end in a rest.
    let last = rows.end.saturating_sub(length).max(rows.start)..rows.end;
    if motion_m(log, &last) >= IDLE_M {
        return None;
    }
    let mut moved = moved_m(log, rows, length);
    let still_m = IDLE_M.min(0.01 * motion_m(log, rows)).max(0.3e-6);
    let still = moved.iter().take_while(|moved| **moved < still_m).count();
    if still * length < log.rows_in(REST_S) || still + 4 > moved.len() {
        return None;
    }
    // The stretch in which it stopped holds part of the motion only.
    let last = moved[still].max(moved[still + 1]);
    (last > SPEED_SHARE * median(&mut moved[still..]))
        .then_some(rows.end - still * length..rows.end)
}

#[cfg(test)]
mod tests {
    use super::super::sample_for_tests::{ROWS, only, recording};
    use super::*;
    use crate::simulate::random::{Purpose, Stream};
    use crate::simulate::recording::{Recording, Sample};

    /// Rows that repeat the first of them, with the noise of sensors.
    fn rest(recording: &mut Recording, movement: usize, rows: Range<usize>) {
        let mut random = Stream::new(7, Purpose::Sensors, 0);
        let first = recording.movements[movement][rows.start];
        for sample in &mut recording.movements[movement][rows] {
            let mut noise = |deviation: f64| random.normal(deviation).round();
            *sample = Sample {
                t_us: sample.t_us,
                beams_nm: first.beams_nm.map(|nm| nm + noise(5.0) as i64),
                capacitive: first.capacitive.map(|code| code + noise(0.8) as i32),
                hall: first.hall.map(|code| code + noise(8.0) as i32),
                ..*sample
            };
        }
    }

    #[test]
    fn a_stage_that_stops_in_a_movement_is_stuck_and_one_that_does_not_start_idle() {
        let mut crashed = recording();
        rest(&mut crashed, 1, 1200..ROWS);
        let found = only(&crashed, Code::Stuck, None);
        let off_us = found.t_us.expect("a time") - 2_400_000;
        assert!(off_us.abs() <= 100_000, "{off_us} us");
        let mut idle = recording();
        rest(&mut idle, 2, 0..ROWS);
        let found = only(&idle, Code::IdleMovement, None);
        assert_eq!(found.movement.as_deref(), Some("2"));
    }
}

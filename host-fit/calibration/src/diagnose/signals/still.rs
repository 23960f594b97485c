//! Movements in which nothing moves, and those that end in a rest.

use super::channels::{LogSignals, median, spread};
use super::places::{Place, Told};
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

/// A channel that stood still, for so long at a time, and in such a share of the log's rows.
pub(super) fn stuck(
    told: &Told,
    who: &str,
    channel: Option<&str>,
    first: &Place,
    stood_s: f64,
    share: f64,
) -> Finding {
    let severity = left_out::severity(share);
    let in_all = match severity {
        Severity::Refuse => format!(", in {:.0} % of the log in all", 100.0 * share),
        _ => String::new(),
    };
    let message = format!(
        "{who} stood still for {stood_s:.2} s ({}){in_all} while it should have moved or shown its noise: look for a stage that \
         stopped, a cable or a frozen register, and leave these rows out",
        told.place(first),
    );
    Finding {
        severity,
        channel: channel.map(str::to_owned),
        value: Some(stood_s),
        unit: Some("s"),
        ..told.warning_at(Code::Stuck, first, message)
    }
}

/// Movements in which nothing moves, and rests at the end of movements.
#[derive(Clone, Debug, Default)]
pub(super) struct Rests {
    idle: Vec<Place>,
    /// First row and length of each.
    crashed: Vec<(Place, usize)>,
}

impl Rests {
    /// Looks for them and leaves their rows out.
    pub(super) fn of(log: &mut LogSignals) -> Self {
        let mut idle_rows = Vec::new();
        let mut crashed = Vec::new();
        for movement in &log.movements {
            let rows = log.rows_of(movement);
            if rows.len() < 2 || !rows.clone().all(|row| log.usable[row]) {
                continue;
            }
            if !moves_at_once(log, &rows) && hall_motion_m(log, &rows) < IDLE_M {
                idle_rows.push(rows);
            } else if let Some(rest) = sudden_rest(log, &rows) {
                crashed.push(rest);
            }
        }
        let rests = Self {
            idle: idle_rows.iter().map(|rows| log.at(rows.start)).collect(),
            crashed: (crashed.iter())
                .map(|rest| (log.at(rest.start), rest.len()))
                .collect(),
        };
        if is_usual(crashed.len(), log.movements.len()) {
            crashed.clear();
        }
        leave_out(log, idle_rows.into_iter().chain(crashed));
        rests
    }

    /// What is told of them.
    pub(super) fn findings(&self, told: &Told, period_s: f64) -> Vec<Finding> {
        let movements = told.movements();
        let mut findings = Vec::new();
        if let Some(first) = self.idle.first() {
            let message = format!(
                "nothing moves in {} of {movements} movements ({}): they tell the fit nothing; leave them out or record \
                 them again",
                self.idle.len(),
                told.places(&self.idle),
            );
            findings.push(told.warning_at(Code::IdleMovement, first, message));
        }
        if !is_usual(self.crashed.len(), movements) {
            let longest = self.crashed.iter().max_by_key(|(_, rows)| *rows);
            findings.extend(longest.map(|(first, rows)| {
                let who = match self.crashed.len() {
                    1 => "the stage".to_owned(),
                    count => format!("the stage, at the end of {count} of {movements} movements,"),
                };
                stuck(told, &who, None, first, *rows as f64 * period_s, 0.0)
            }));
        }
        findings
    }
}

/// Where most movements end in a rest, it is how the stage is driven.
fn is_usual(crashed: usize, movements: usize) -> bool {
    2 * crashed > movements.max(2)
}

/// Whether any beam moves within a second or so: over longer the interferometers of a stage at rest
/// drift.
fn moves_at_once(log: &LogSignals, rows: &Range<usize>) -> bool {
    let length = log.rows_in(ONCE_S);
    let stretch = |start: usize| start..(start + length).min(rows.end);
    let mut starts = rows.clone().step_by(length.div_ceil(2));
    starts.any(|start| motion_m(log, &stretch(start)) >= IDLE_M)
}

/// How far the stage moves by any beam, m.
fn motion_m(log: &LogSignals, rows: &Range<usize>) -> f64 {
    let beams = &log.channels[3..6];
    (beams.iter()).fold(0.0, |most, beam| {
        spread(&beam.values[rows.clone()]).max(most)
    })
}

/// How far it moves by any probe, m.
pub(super) fn hall_motion_m(log: &LogSignals, rows: &Range<usize>) -> f64 {
    let halls = hall_means_m(log, rows);
    (halls.iter()).fold(0.0, |most, [low, high]| (high - low).max(most))
}

/// Lowest and highest mean of 25 rows of each probe, so that noise does not count, m.
fn hall_means_m(log: &LogSignals, rows: &Range<usize>) -> [[f64; 2]; 3] {
    [0, 1, 2].map(|k| {
        let means = log.channels[k].values[rows.clone()]
            .chunks(25)
            .filter(|c| c.len() > 12)
            .map(|c| c.iter().sum::<f64>() / c.len() as f64);
        means.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
            [low.min(x), high.max(x)]
        })
    })
}

/// The rest at the end of a movement that begins at speed.
fn sudden_rest(log: &LogSignals, rows: &Range<usize>) -> Option<Range<usize>> {
    let (length, rest_rows) = (log.rows_in(REST_STRETCH_S), log.rows_in(REST_S));
    // Cheap first: most movements do not end in a rest.
    let last = rows.end.saturating_sub(length).max(rows.start)..rows.end;
    if motion_m(log, &last) >= IDLE_M {
        return None;
    }
    let rest = rest_of(motion_m(log, rows), &moved_m(log, rows), length, rest_rows)?;
    Some(rows.end - rest..rows.end)
}

/// How far the stage moves in the stretches of a movement, counted from its end, m.
fn moved_m(log: &LogSignals, rows: &Range<usize>) -> Vec<f64> {
    let length = log.rows_in(REST_STRETCH_S);
    let moved = |k: usize| {
        let end = rows.end - k * length;
        motion_m(log, &(end - length..end))
    };
    (0..rows.len() / length).map(moved).collect()
}

/// Rows of the rest at the end of a movement that moves so far, and in stretches of `length` rows,
/// counted from its end, as `moved_m` says.
fn rest_of(motion_m: f64, moved_m: &[f64], length: usize, rest_rows: usize) -> Option<usize> {
    let still_m = IDLE_M.min(0.01 * motion_m).max(0.3e-6);
    let still = moved_m.iter().take_while(|moved| **moved < still_m).count();
    if still * length < rest_rows || still + 4 > moved_m.len() {
        return None;
    }
    let mut before = moved_m[still..].to_vec();
    // The stretch in which it stopped holds part of the motion only.
    let last = before[0].max(before[1]);
    let usual = median(&mut before);
    (last > SPEED_SHARE * usual).then_some(still * length)
}

/// Leaves rows out, with those beside them, whose velocity is not that of the motion.
pub(super) fn leave_out(log: &mut LogSignals, runs: impl IntoIterator<Item = Range<usize>>) {
    let rows = log.usable.len();
    for run in runs {
        log.usable[run.start.saturating_sub(2)..(run.end + 2).min(rows)].fill(false);
    }
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

//! Channels and movements that stand still.

use super::channels::{Channel, LogSignals, median, spread};
use crate::diagnose::finding::{Code, Finding};
use std::ops::Range;

/// Chance that noise repeats a code so often.
const CHANCE: f64 = 1e-9;
/// Fewest equal values in a row that are worth a word.
const RUN_MIN: usize = 50;
/// Codes that another gap moves by where one stands still.
const GAP_CODES: f64 = 20.0;
/// Rows of a stretch in which the liveliness of a channel is counted.
const STRETCH: usize = 250;
/// A movement stands still within this, m; its beams within this time, s.
const IDLE_M: f64 = 2e-6;
const ONCE_S: f64 = 1.0;
/// Residual that shows that it should have moved, m.
pub(super) const MISSED_M: f64 = 6e-6;
/// Length of a rest after a crash, s, of the stretches it is looked for in, and the share of
/// the usual speed that the stage has just before it.
const REST_S: f64 = 0.2;
const REST_STRETCH_S: f64 = 0.05;
const SPEED_SHARE: f64 = 0.3;

/// Channels that repeat one value longer than their own noise lets them; their rows are left out.
pub(super) fn frozen(log: &mut LogSignals, has_reference: bool) -> Vec<Finding> {
    let mut runs: Vec<(usize, Range<usize>)> = Vec::new();
    let lively = |values: &[f64]| {
        let changes = values.windows(2).filter(|pair| pair[0] != pair[1]).count();
        changes as f64 / (values.len() - 1) as f64
    };
    for (index, channel) in log.channels.iter().enumerate() {
        let mut shares: Vec<f64> = (log.segments.iter())
            .flat_map(|segment| channel.values[segment.clone()].chunks_exact(STRETCH))
            .map(lively)
            .collect();
        if shares.is_empty() || ((3..6).contains(&index) && !has_reference) {
            continue;
        }
        let high = shares.len() * 3 / 4;
        let share = *shares.select_nth_unstable_by(high, f64::total_cmp).1;
        // At a share of one, a single repetition would be beyond chance.
        let chance = (CHANCE.ln() / (-share.min(0.9)).ln_1p()).max(RUN_MIN as f64);
        let least = match spread(&channel.values) {
            0.0 => RUN_MIN as f64,
            _ if share > 0.0 => chance,
            _ => f64::INFINITY,
        };
        for segment in &log.segments {
            let mut row = segment.start;
            while row < segment.end {
                let start = row;
                while row < segment.end && channel.values[row] == channel.values[start] {
                    row += 1;
                }
                let long = (row - start) as f64 > least;
                if long && log.usable[start] && others_move(log, index, &(start..row)) {
                    runs.push((index, start..row));
                }
            }
        }
    }
    let findings = of_runs(log, &runs);
    leave_out(log, runs.into_iter().map(|(_, run)| run));
    findings
}

/// Whether others move while a channel does not: a beam or gap of coarse steps may well rest. A
/// probe may not, its noise is many codes.
fn others_move(log: &LogSignals, channel: usize, run: &Range<usize>) -> bool {
    let gap_moves = |other: usize| {
        let gap = &log.channels[other];
        other != channel && spread(&gap.values[run.clone()]) > GAP_CODES * gap.m_per_code
    };
    match channel {
        0..3 => true,
        3..6 => hall_motion_m(log, run) > MISSED_M,
        _ => (6..log.channels.len()).any(gap_moves),
    }
}

/// One finding for a channel, at its longest run; one for channels that stand still together.
fn of_runs(log: &LogSignals, runs: &[(usize, Range<usize>)]) -> Vec<Finding> {
    let mut longest: Vec<(Vec<&'static str>, Range<usize>)> = Vec::new();
    for (index, channel) in log.channels.iter().enumerate() {
        let own = runs.iter().filter(|(of, _)| *of == index);
        let Some((_, run)) = own.max_by_key(|(_, run)| run.len()) else {
            continue;
        };
        let together = |other: &Range<usize>| {
            let shared = (run.end.min(other.end)).saturating_sub(run.start.max(other.start));
            2 * shared > run.len().max(other.len())
        };
        match longest.iter_mut().find(|(_, other)| together(other)) {
            Some((names, _)) => names.push(channel.name),
            None => longest.push((vec![channel.name], run.clone())),
        }
    }
    (longest.into_iter())
        .map(|(names, run)| {
            let still = |c: &Channel| spread(&c.values[run.clone()]) == 0.0;
            if log.channels.iter().all(still) {
                stuck(log, &["every channel"], &run)
            } else {
                stuck(log, &names, &run)
            }
        })
        .collect()
}

pub(super) fn stuck(log: &LogSignals, names: &[&str], run: &Range<usize>) -> Finding {
    let time_s = run.len() as f64 * log.period_s;
    let who = names.join(", ");
    let message = format!(
        "{who} stood still for {time_s:.2} s ({}) while it should have moved or shown its noise: look for a stage that \
         stopped, a cable or a frozen register, and leave these rows out",
        log.place(run.start),
    );
    Finding {
        channel: (log.channels.iter())
            .find(|channel| names == [channel.name])
            .map(|channel| channel.name.to_owned()),
        value: Some(time_s),
        unit: Some("s"),
        ..log.warning_at(Code::Stuck, run.start, message)
    }
}

/// Movements in which nothing moves, and those that end in a sudden rest; such rows are left out.
pub(super) fn idle_and_crashed(log: &mut LogSignals) -> Vec<Finding> {
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
    let idle: Vec<usize> = idle_rows.iter().map(|rows| rows.start).collect();
    let mut findings = Vec::new();
    if let Some(&first) = idle.first() {
        let message = format!(
            "nothing moves in {} of {} movements ({}): they tell the fit nothing; leave them out or record them again",
            idle.len(),
            log.movements.len(),
            log.places(&idle),
        );
        findings.push(log.warning_at(Code::IdleMovement, first, message));
    }
    // Where most movements end so, it is how this stage is driven.
    if 2 * crashed.len() > log.movements.len().max(2) {
        crashed.clear();
    } else {
        findings.extend(crashed.iter().map(|rest| stuck(log, &["the stage"], rest)));
    }
    leave_out(log, idle_rows.into_iter().chain(crashed));
    findings
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

/// How far it moves by any probe: means of 25 rows, so that noise does not count, m.
fn hall_motion_m(log: &LogSignals, rows: &Range<usize>) -> f64 {
    let halls = &log.channels[..3];
    halls.iter().fold(0.0, |most, hall| {
        let means = hall.values[rows.clone()]
            .chunks(25)
            .filter(|c| c.len() > 12);
        let means: Vec<f64> = means
            .map(|c| c.iter().sum::<f64>() / c.len() as f64)
            .collect();
        spread(&means).max(most)
    })
}

/// The rest at the end of a movement that begins at speed.
fn sudden_rest(log: &LogSignals, rows: &Range<usize>) -> Option<Range<usize>> {
    let length = log.rows_in(REST_STRETCH_S);
    let rest_rows = log.rows_in(REST_S);
    let still_m = IDLE_M.min(0.01 * motion_m(log, rows)).max(0.3e-6);
    let stretches = rows.len() / length;
    // Counted from the end.
    let moved = |k: usize| {
        let end = rows.end - k * length;
        motion_m(log, &(end - length..end))
    };
    let still = (0..stretches).take_while(|&k| moved(k) < still_m).count();
    if still * length < rest_rows || still + 4 > stretches {
        return None;
    }
    let mut before: Vec<f64> = (still..stretches).map(moved).collect();
    // The stretch in which it stopped holds part of the motion only.
    let last = before[0].max(before[1]);
    let usual = median(&mut before);
    (last > SPEED_SHARE * usual).then(|| rows.end - still * length..rows.end)
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
    use super::super::sample::{ROWS, dataset, only, recording, warnings};
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
    fn a_channel_that_stands_still_is_stuck_with_its_noise_or_without() {
        let sound = recording();
        let mut random = Stream::new(7, Purpose::Sensors, 0);
        for (noise, rows) in [(0.0, 700..1400), (1.0, 0..1000)] {
            let mut probe = sound.clone();
            let held = probe.movements[1][rows.start].hall[2];
            for sample in &mut probe.movements[1][rows.clone()] {
                sample.hall[2] = held + random.normal(8.0 * noise).round() as i32;
            }
            let mut beam = sound.clone();
            let held = beam.movements[1][rows.start].beams_nm[0];
            for sample in &mut beam.movements[1][rows.clone()] {
                sample.beams_nm[0] = held + random.normal(5.0 * noise).round() as i64;
            }
            for (recording, name) in [(probe, "hall_c"), (beam, "ifm_x")] {
                let found = only(&recording, Code::Stuck, Some(name));
                assert_eq!(found.movement.as_deref(), Some("1"));
                assert_eq!(found.t_us, Some(2000 * rows.start as i64));
            }
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

    #[test]
    fn a_gap_that_repeats_its_code_while_the_heights_change_is_stuck() {
        let mut recording = recording();
        let held = recording.movements[0][500].capacitive[1];
        for sample in &mut recording.movements[0][500..1500] {
            sample.capacitive[1] = held;
        }
        let found = warnings(&dataset(&recording));
        let stuck = found.iter().find(|finding| finding.code == Code::Stuck);
        assert_eq!(
            stuck.and_then(|finding| finding.channel.as_deref()),
            Some("cap_2")
        );
    }
}

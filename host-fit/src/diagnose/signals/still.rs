//! Channels and movements that stand still.

use super::channels::{BEAMS, HALL, LogSignals, median, spread};
use super::residual::Residuals;
use crate::diagnose::finding::{Code, Finding};
use std::ops::Range;

/// Chance that noise repeats a code so often.
const CHANCE: f64 = 1e-9;
/// Fewest equal values in a row that are worth a word.
const RUN_MIN: usize = 50;
/// Rows of a stretch in which the liveliness of a channel is counted.
const STRETCH: usize = 250;
/// A movement stands still within this, m.
const IDLE_M: f64 = 2e-6;
/// A channel stands still if it moves by less than this share of what it moves elsewhere.
const STILL_SHARE: f64 = 0.01;
/// Residual that shows that it should have moved, m.
const MISSED_M: f64 = 3e-6;
/// Length of the stretches in which a channel stands still, s.
const STANDING_S: f64 = 0.5;
/// Length of a rest after a crash, s, of the stretches it is looked for in, and the share of
/// the usual speed that the stage has just before it.
const REST_S: f64 = 0.2;
const REST_STRETCH_S: f64 = 0.05;
const SPEED_SHARE: f64 = 0.3;

/// Channels that repeat one value longer than their own noise lets them; their rows are left out.
pub(super) fn frozen(log: &mut LogSignals) -> Vec<Finding> {
    let mut runs: Vec<(&'static str, Range<usize>)> = Vec::new();
    let lively = |values: &[f64]| {
        let changes = values.windows(2).filter(|pair| pair[0] != pair[1]).count();
        changes as f64 / (values.len() - 1) as f64
    };
    for channel in &log.channels {
        let mut shares: Vec<f64> = (log.segments.iter())
            .flat_map(|segment| channel.values[segment.clone()].chunks_exact(STRETCH))
            .map(lively)
            .collect();
        let others_move = || log.channels.iter().any(|other| spread(&other.values) > 0.0);
        if spread(&channel.values) == 0.0 && log.len() > RUN_MIN && others_move() {
            runs.push((channel.name, 0..log.len()));
            continue;
        }
        if shares.is_empty() {
            continue;
        }
        let quarter = shares.len() / 4;
        let share = *shares.select_nth_unstable_by(quarter, f64::total_cmp).1;
        // At a share of one, a single repetition would be beyond chance.
        let least = (CHANCE.ln() / (-share.min(0.9)).ln_1p()).max(RUN_MIN as f64);
        let usable = |row: usize| log.usable[row];
        for segment in &log.segments {
            let mut row = segment.start;
            while row < segment.end {
                let start = row;
                while row < segment.end && channel.values[row] == channel.values[start] {
                    row += 1;
                }
                if (row - start) as f64 > least && usable(start) {
                    runs.push((channel.name, start..row));
                }
            }
        }
    }
    let findings = of_runs(log, &runs);
    leave_out(log, runs.into_iter().map(|(_, run)| run));
    findings
}

/// One finding for a channel, at its longest run; one for all channels that stand still together.
fn of_runs(log: &LogSignals, runs: &[(&'static str, Range<usize>)]) -> Vec<Finding> {
    let mut longest: Vec<(Vec<&'static str>, Range<usize>)> = Vec::new();
    for channel in &log.channels {
        let own = runs.iter().filter(|(name, _)| *name == channel.name);
        let Some((_, run)) = own.max_by_key(|(_, run)| run.len()) else {
            continue;
        };
        let together = |other: &Range<usize>| {
            let shared = run
                .end
                .min(other.end)
                .saturating_sub(run.start.max(other.start));
            2 * shared > run.len().max(other.len())
        };
        match longest.iter_mut().find(|(_, other)| together(other)) {
            Some((names, _)) => names.push(channel.name),
            None => longest.push((vec![channel.name], run.clone())),
        }
    }
    (longest.into_iter())
        .map(|(names, run)| stuck(log, &names, &run))
        .collect()
}

fn stuck(log: &LogSignals, names: &[&str], run: &Range<usize>) -> Finding {
    let time_s = run.len() as f64 * log.period_s;
    let who = if names.len() == log.channels.len() {
        "every channel".to_owned()
    } else {
        names.join(", ")
    };
    let message = format!(
        "{who} stood still for {time_s:.2} s ({}) while it should have moved or shown its noise: look for a stage that \
         stopped, a cable or a frozen register, and leave these rows out",
        log.place(run.start),
    );
    Finding {
        channel: (names.len() == 1).then(|| names[0].to_owned()),
        value: Some(time_s),
        unit: Some("s"),
        ..log.warning_at(Code::Stuck, run.start, message)
    }
}

/// Movements in which nothing moves, and those that end in a sudden rest.
pub(super) fn idle_and_crashed(log: &LogSignals) -> Vec<Finding> {
    let mut idle = Vec::new();
    let mut crashed = Vec::new();
    for movement in &log.movements {
        let rows = log.rows_of(movement);
        if rows.len() < 2 || !rows.clone().all(|row| log.usable[row]) {
            continue;
        }
        if motion_m(log, &rows) < IDLE_M && hall_motion_m(log, &rows) < IDLE_M {
            idle.push(rows.start);
        } else if let Some(rest) = sudden_rest(log, &rows) {
            crashed.push(rest);
        }
    }
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
    if 2 * crashed.len() <= log.movements.len() {
        findings.extend(crashed.iter().map(|rest| stuck(log, &["the stage"], rest)));
    }
    for finding in &mut findings {
        finding.channel = None;
    }
    findings
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

/// Probes and beams that stand still, noise aside, where the others say that they move; the rows
/// of such stretches are left out.
pub(super) fn standing(log: &mut LogSignals, residuals: &Residuals) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut left_out: Vec<Range<usize>> = Vec::new();
    let length = log.rows_in(STANDING_S);
    let stretches: Vec<Range<usize>> = (log.segments.iter())
        .flat_map(|s| {
            let end = s.end;
            (s.clone().step_by(length)).map(move |start| start..(start + length).min(end))
        })
        .filter(|stretch| stretch.len() > length / 2)
        .collect();
    let noise_m = residuals.noise_m.iter().copied().fold(0.0, f64::max);
    let missed_m = MISSED_M + 8.0 * noise_m;
    for (channel, name) in HALL.into_iter().chain(BEAMS).enumerate() {
        let values = &log.channels[channel].values;
        let range = |stretch: &Range<usize>| usual_spread(&values[stretch.clone()]);
        let most = stretches.iter().map(range).fold(0.0, f64::max);
        let noise_m = 4.0 * residuals.noise_m.get(channel).copied().unwrap_or(0.0);
        let stands = |stretch: &&Range<usize>| {
            log.usable[stretch.start]
                && range(stretch) < (STILL_SHARE * most).max(noise_m)
                && is_missed(log, residuals, channel, stretch, missed_m)
        };
        let still: Vec<&Range<usize>> = stretches.iter().filter(stands).collect();
        let Some(first) = still.first() else {
            continue;
        };
        let mut run = (*first).clone();
        for next in &still {
            if next.start == run.end {
                run.end = next.end;
            }
        }
        findings.push(stuck(log, &[name], &run));
        left_out.extend(still.into_iter().cloned());
    }
    leave_out(log, left_out);
    findings
}

/// Whether the others say that a channel moves. A probe is missed in its own residual alone; a
/// beam in those of all probes that it concerns, which move themselves.
fn is_missed(
    log: &LogSignals,
    residuals: &Residuals,
    channel: usize,
    stretch: &Range<usize>,
    missed_m: f64,
) -> bool {
    let off_m = |probe: usize| usual_spread(&residuals.values[probe][stretch.clone()]);
    if channel < 3 {
        let own_m = off_m(channel);
        let others_m = (0..3)
            .filter(|&i| i != channel)
            .map(off_m)
            .fold(0.0, f64::max);
        return own_m > missed_m && others_m < 0.3 * own_m;
    }
    let mut concerned = (0..3).filter(|&probe| residuals.slope(probe, channel).abs() > 0.3);
    concerned.all(|probe| {
        let moves_m = usual_spread(&log.channels[probe].values[stretch.clone()]);
        off_m(probe) > missed_m && moves_m > missed_m
    })
}

/// Between the ninth part from below and from above: outliers do not count.
fn usual_spread(values: &[f64]) -> f64 {
    let mut values = values.to_vec();
    values.sort_unstable_by(f64::total_cmp);
    let ninth = values.len() / 9;
    match (values.get(ninth), values.get(values.len() - 1 - ninth)) {
        (Some(low), Some(high)) => high - low,
        _ => 0.0,
    }
}

/// Leaves rows out, with those beside them, whose velocity is not that of the motion.
fn leave_out(log: &mut LogSignals, runs: impl IntoIterator<Item = Range<usize>>) {
    let rows = log.usable.len();
    for run in runs {
        log.usable[run.start.saturating_sub(2)..(run.end + 2).min(rows)].fill(false);
    }
}

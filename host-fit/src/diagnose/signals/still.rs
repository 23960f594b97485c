//! Channels and movements that stand still.

use super::channels::{Channel, LogSignals, median, spread};
use super::residual::Residuals;
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
/// A movement stands still within this, m.
const IDLE_M: f64 = 2e-6;
/// A channel stands still if it moves by less than this share of what it moves elsewhere.
const STILL_SHARE: f64 = 0.01;
/// Residual that shows that it should have moved, m.
const MISSED_M: f64 = 6e-6;
/// Length of the stretches in which a channel stands still, and of the blocks whose means show
/// what it misses, s.
const STANDING_S: f64 = 0.25;
const BLOCK_S: f64 = 0.02;
/// Power of the residuals that the error of one channel may leave, and by how much more than that
/// of another; the largest part of its own that two levels may explain: that is a step.
const LEFT_MAX: f64 = 0.45;
const WORSE_MAX: f64 = 0.1;
const STEP_SHARE: f64 = 0.93;
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

fn stuck(log: &LogSignals, names: &[&str], run: &Range<usize>) -> Finding {
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
        if motion_m(log, &rows) < IDLE_M && hall_motion_m(log, &rows) < IDLE_M {
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

/// Channels that stand still, noise aside, where the others say that they move; the rows of such
/// runs are left out.
pub(super) fn standing(log: &mut LogSignals, residuals: &Residuals) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut left_out: Vec<Range<usize>> = Vec::new();
    let noise_m = residuals.noise_m.iter().copied().fold(0.0, f64::max);
    for (channel, signal) in log.channels.iter().enumerate() {
        let own_noise_m = residuals.noise_m.get(channel).copied().unwrap_or(0.0);
        let mut stuck_runs = still_runs(log, &signal.values, 4.0 * own_noise_m);
        stuck_runs.retain(|run| is_missed(log, residuals, channel, run, MISSED_M + 4.0 * noise_m));
        if let Some(longest) = stuck_runs.iter().max_by_key(|run| run.len()) {
            findings.push(stuck(log, &[signal.name], longest));
        }
        left_out.extend(stuck_runs);
    }
    leave_out(log, left_out);
    findings
}

/// Runs within segments in which a channel hardly moves, of what it moves elsewhere.
fn still_runs(log: &LogSignals, values: &[f64], noise_m: f64) -> Vec<Range<usize>> {
    let length = log.rows_in(STANDING_S);
    let stretches = |segment: &Range<usize>| {
        let (start, end) = (segment.start, segment.end);
        let starts = (start..end).step_by(length);
        let stretches = starts.map(move |start| start..(start + length).min(end));
        stretches
            .filter(|stretch| stretch.len() > length / 2)
            .collect::<Vec<_>>()
    };
    let range = |stretch: &Range<usize>| usual_spread(&values[stretch.clone()]);
    let all = || log.segments.iter().flat_map(stretches);
    let most = all().map(|stretch| range(&stretch)).fold(0.0, f64::max);
    let mut runs: Vec<Range<usize>> = Vec::new();
    for stretch in all() {
        let still = range(&stretch) < (STILL_SHARE * most).max(noise_m);
        if !still || !log.usable[stretch.start] {
            continue;
        }
        let starts_segment = log.segments.iter().any(|s| s.start == stretch.start);
        match runs.last_mut() {
            Some(run) if run.end == stretch.start && !starts_segment => run.end = stretch.end,
            _ => runs.push(stretch),
        }
    }
    runs
}

/// Whether an error of the channel explains the residuals in a run, and these move like a stage:
/// noise, hum and outliers vanish in medians of blocks of rows, and a step is no motion.
fn is_missed(
    log: &LogSignals,
    residuals: &Residuals,
    channel: usize,
    run: &Range<usize>,
    missed_m: f64,
) -> bool {
    let length = log.rows_in(BLOCK_S);
    let blocks: Vec<Range<usize>> = (run.clone().step_by(length))
        .map(|start| start..start + length)
        .filter(|block| block.end <= run.end)
        .collect();
    let level = |values: &[f64], block: &Range<usize>| median(&mut values[block.clone()].to_vec());
    let mut shown: Vec<[f64; 3]> = (blocks.iter())
        .map(|block| [0, 1, 2].map(|k| level(&residuals.values[k], block)))
        .collect();
    for k in 0..3 {
        let middle = shown.iter().map(|m| m[k]).sum::<f64>() / shown.len().max(1) as f64;
        shown.iter_mut().for_each(|m| m[k] -= middle);
    }
    let dot = |a: &[f64; 3], b: &[f64; 3]| (0..3).map(|k| a[k] * b[k]).sum::<f64>();
    let mut all = 0.0;
    let mut left = vec![0.0; log.channels.len()];
    let mut errors_m = Vec::with_capacity(blocks.len());
    for (block, shown) in blocks.iter().zip(&shown) {
        all += dot(shown, shown);
        let of_errors = residuals.of_errors(log, block.start);
        for (other, slopes) in of_errors.iter().enumerate() {
            let error_m = dot(slopes, shown) / dot(slopes, slopes).max(1e-6);
            let rest = [0, 1, 2].map(|k| shown[k] - slopes[k] * error_m);
            left[other] += dot(&rest, &rest);
            if other == channel {
                errors_m.push(error_m);
            }
        }
    }
    let least = left.iter().copied().fold(f64::INFINITY, f64::min);
    left[channel] < (LEFT_MAX * all).min(least + WORSE_MAX * all)
        && (0..3).any(|k| usual_spread(&shown.iter().map(|m| m[k]).collect::<Vec<_>>()) > missed_m)
        && two_levels(&errors_m) < STEP_SHARE
}

/// The part of the variance that the best two levels, one after the other, explain.
fn two_levels(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let all: f64 = values.iter().map(|x| (x - mean) * (x - mean)).sum();
    let (mut sum, mut most) = (0.0, 0.0_f64);
    for (k, x) in values
        .iter()
        .enumerate()
        .take(values.len().saturating_sub(1))
    {
        sum += x - mean;
        let before = (k + 1) as f64;
        most = most.max(sum * sum * n / (before * (n - before)));
    }
    most / all.max(f64::MIN_POSITIVE)
}

/// Between the ninth part from below and from above: outliers do not count.
fn usual_spread(values: &[f64]) -> f64 {
    let mut values = values.to_vec();
    values.sort_unstable_by(f64::total_cmp);
    let ninth = values.len() / 9;
    match (
        values.get(ninth),
        values.get(values.len().saturating_sub(1 + ninth)),
    ) {
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

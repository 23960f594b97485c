//! Whether the field model describes a log: what it leaves of the Hall signals is noise in a sound one,
//! and the walk of the interferometers, which is slow.
//!
//! Where another stage, a gain or a height that changes is in the log, the model that fits all of it fits
//! none of it. What is left follows the motion: in means over a tenth of a second, in which noise and
//! hum vanish, about a line over each second, which takes drift and walk off.

use super::channels::{HALL, LogSignals};
use crate::diagnose::finding::{Code, Finding, Severity};
use crate::diagnose::left_out;
use std::fmt::Write;
use std::ops::Range;

/// Times of the means, s.
const FAST_S: f64 = 0.1;
const SLOW_S: f64 = 1.0;
/// Rows in a mean over [`FAST_S`] that leave little of the noise.
const ROWS_MIN: usize = 5;
/// Means over [`FAST_S`] that are needed in one over [`SLOW_S`].
const MEANS_MIN: usize = 4;
/// Seconds that are needed.
const SECONDS_MIN: usize = 5;
/// Told from here on, in terms of the noise: sound logs leave 0.2, those of quick steps or of imperfect
/// magnets up to 0.6, ...
const TOLD_MIN: f64 = 1.2;
/// ... and refused from here on: the gain of a probe that changes at once by 1 % leaves from 0.9 to 2.5,
/// by 2 % from 2.3 to 5, by how far the log moves the probe.
const REFUSED_MIN: f64 = 2.2;
/// Noise below this is not that of a Hall probe, and less than the field model may lack, m.
const NOISE_MIN_M: f64 = 0.3e-6;

/// Adds the probe of which the field model leaves most to the findings, if that is more than noise:
/// `left_m` by probe and row without drift, which is told by itself and bends the model.
pub(super) fn add(
    findings: &mut Vec<Finding>,
    log: &LogSignals,
    left_m: &[Vec<f64>; 3],
    noise_m: [f64; 3],
) {
    let of_probe = |k: usize| Some((k, left_to_noise(log, &left_m[k], noise_m[k])?));
    let all = (0..3).filter_map(of_probe);
    let Some((probe, left)) = all.max_by(|(_, a), (_, b)| a.total_cmp(b)) else {
        return;
    };
    if left < TOLD_MIN {
        return;
    }
    let severity = match left > REFUSED_MIN {
        true => Severity::Refuse,
        false => Severity::Warn,
    };
    let name = HALL[probe];
    let explains = |found: &&mut Finding| {
        found.code == Code::GainDrift && found.channel.as_deref() == Some(name)
    };
    if let Some(drift) = findings.iter_mut().find(explains) {
        drift.severity = severity;
        let _ = write!(
            drift.message,
            ". The field model leaves {left:.1} times the noise of {name} or more in a twelfth of the log: the change may be \
             another, or the log of two stages"
        );
        return;
    }
    // What a drift or hum leaves is told already.
    if severity == Severity::Warn && !findings.is_empty() {
        return;
    }
    let message = format!(
        "the field model, which describes a sound log to its noise, leaves {left:.1} times the noise of {name} or more in a \
         twelfth of the log: the log is of two stages, or the gain of a probe or the reading of a height changed in it. See the \
         errors over the log in the report, and fit the parts that agree"
    );
    findings.push(Finding {
        severity,
        channel: Some(name.to_owned()),
        value: Some(left),
        unit: Some("times"),
        ..log.warning(Code::ModelLacks, message)
    });
}

/// What is left of a probe that follows the motion, in terms of its noise: rms within a second that
/// only as many of the seconds exceed as a fit may leave out of account. `None` for a log of too few seconds, or
/// rows in them.
fn left_to_noise(log: &LogSignals, values: &[f64], noise_m: f64) -> Option<f64> {
    let (slow, fast) = (log.rows_in(SLOW_S), log.rows_in(FAST_S));
    if fast < ROWS_MIN {
        return None;
    }
    let mut seconds = Vec::new();
    for segment in &log.segments {
        for second in pieces(segment, slow) {
            let is_whole =
                |rows: &Range<usize>| rows.len() == fast && rows.clone().all(|row| log.usable[row]);
            let mean = |rows: Range<usize>| {
                let sum: f64 = values[rows.clone()].iter().sum();
                (rows.start as f64, sum / fast as f64)
            };
            let means: Vec<(f64, f64)> = pieces(&second, fast).filter(is_whole).map(mean).collect();
            if means.len() >= MEANS_MIN {
                seconds.push(variance_about_a_line(&means));
            }
        }
    }
    if seconds.len() < SECONDS_MIN {
        return None;
    }
    seconds.sort_by(f64::total_cmp);
    let most = seconds[((1.0 - left_out::REFUSED_MIN) * seconds.len() as f64) as usize];
    let of_noise = noise_m * noise_m / fast as f64;
    Some((most - of_noise).max(0.0).sqrt() / noise_m.max(NOISE_MIN_M))
}

/// Variance of values about the line through them, by their places.
fn variance_about_a_line(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let sum = |of: &dyn Fn(f64, f64) -> f64| points.iter().map(|&(x, y)| of(x, y)).sum::<f64>();
    let (x0, y0) = (sum(&|x, _| x) / n, sum(&|_, y| y) / n);
    let slope = sum(&|x, y| (x - x0) * (y - y0)) / sum(&|x, _| (x - x0) * (x - x0));
    sum(&|x, y| (y - y0 - slope * (x - x0)).powi(2)) / (n - 2.0)
}

/// Pieces of so many rows; the last may be shorter.
fn pieces(rows: &Range<usize>, length: usize) -> impl Iterator<Item = Range<usize>> {
    let end = rows.end;
    rows.clone()
        .step_by(length)
        .map(move |start| start..end.min(start + length))
}

#[cfg(test)]
mod tests {
    use super::super::sample::{dataset, only, recording, warnings};
    use super::*;

    /// Which no straight line over the log shows.
    #[test]
    fn a_gain_that_rises_and_comes_back_is_told_by_what_is_left() {
        let mut recording = recording();
        let rows = recording.rows() as f64;
        for (k, sample) in recording.movements.iter_mut().flatten().enumerate() {
            let gain = 1.0 + 0.008 * (std::f64::consts::PI * k as f64 / rows).sin();
            sample.hall[0] = (f64::from(sample.hall[0]) * gain).round() as i32;
        }
        let found = only(&recording, Code::ModelLacks, Some("hall_a"));
        assert_eq!(found.severity, Severity::Warn);
    }

    #[test]
    fn a_gain_that_jumps_far_and_comes_back_is_refused() {
        let mut recording = recording();
        for sample in &mut recording.movements[1] {
            sample.hall[2] = (f64::from(sample.hall[2]) * 1.05).round() as i32;
        }
        let found = warnings(&dataset(&recording));
        let [found] = &found[..] else {
            panic!("{found:#?}");
        };
        assert_eq!(
            (found.code, found.severity),
            (Code::ModelLacks, Severity::Refuse)
        );
        assert_eq!(found.channel.as_deref(), Some("hall_c"));
    }
}

//! Stretches of a long log whose errors are far above those of the rest: faults that an excerpt of
//! the log may have missed.

use crate::input::whole::Whole;
use crate::judge::of_rows::Spread;

/// Errors that are far above those of the rest, in terms of their median.
const FAR: f64 = 3.0;
/// If more than this part of the log is far above the rest, it is no fault of some stretches.
const PART_MAX: f64 = 0.1;

/// A second of a log whose errors are far above those of the rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// Its number among [`Whole::runs`].
    pub run: usize,
    /// The axis: X, Y, Rz.
    pub axis: usize,
    /// rms of the errors less their mean, or the shift of that mean from the second before in the
    /// same movement, whichever is larger: m or rad.
    pub error: f64,
    /// The same in terms of the median rms of the axis.
    pub ratio: f64,
}

/// The stretches of a log whose errors are far above those of the rest, the worst first; `spreads` of
/// each of [`Whole::runs`].
pub fn far_worse(spreads: &[Option<Spread>], whole: &Whole) -> Vec<Stretch> {
    let runs = whole.runs();
    let usual = [0, 1, 2].map(|axis| {
        let mut rms: Vec<f64> = spreads.iter().flatten().map(|s| s.rms[axis]).collect();
        let middle = rms.len() / 2;
        match rms.is_empty() {
            true => f64::INFINITY,
            false => *rms.select_nth_unstable_by(middle, f64::total_cmp).1,
        }
    });
    let of = |run: usize| {
        let here = spreads[run]?;
        let before = run.checked_sub(1).and_then(|before| {
            (runs[before].movement == runs[run].movement).then_some(spreads[before])?
        });
        let error = |axis: usize| {
            let shift = before.map_or(0.0, |before| (here.mean[axis] - before.mean[axis]).abs());
            here.rms[axis].max(shift)
        };
        let stretch = |axis: usize| Stretch {
            run,
            axis,
            error: error(axis),
            ratio: error(axis) / usual[axis].max(f64::MIN_POSITIVE),
        };
        let worst = (0..3)
            .map(stretch)
            .max_by(|a, b| a.ratio.total_cmp(&b.ratio))?;
        (worst.ratio > FAR).then_some(worst)
    };
    let mut far: Vec<Stretch> = (0..runs.len()).filter_map(of).collect();
    if far.len() as f64 > PART_MAX * runs.len() as f64 {
        return Vec::new();
    }
    far.sort_by(|a, b| b.ratio.total_cmp(&a.ratio));
    far
}

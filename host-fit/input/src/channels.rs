//! Each column of a log by itself: its properties without a model and before a fit.
//!
//! | module | what it does |
//! |---|---|
//! | `signal` | the values of one channel, in runs of consecutive rows |
//! | `noise` | white noise from fifth differences |
//! | `codes` | step, stuck bits, overflows |
//! | `rate` | values that are held or interpolated |
//! | `spectrum` | density of the noise in bands |

mod codes;
mod noise;
mod rate;
mod signal;
mod spectrum;

pub use rate::SlowRate;

use crate::channel::Channel;
use crate::dataset::Dataset;
use crate::stage::Stage;
use crate::statistics::median;
use signal::Signal;
use std::ops::Range;

/// A channel shows its rounding alone if its step is this many times its noise or more.
const ROUNDED: f64 = 1.5;
/// The noise of a probe is white. If it falls by more than a random walk does, the stage moves so fast.
const MOTION: f64 = 1.0;

/// The channels of the probes A, B, C.
pub const PROBES: [Channel; 3] = [Channel::HallA, Channel::HallB, Channel::HallC];
/// A probe or a gap is noisy from this many times the noise of its siblings: in sound logs a probe has at most 1.14 times
/// the noise of the middle probe.
pub const NOISY: f64 = 1.3;

/// One channel of one log.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// The log: an index into [`Dataset::logs`].
    pub log: usize,
    /// The channel.
    pub channel: Channel,
    /// The unit of its values: a code, and a picometre for beams, m.
    pub unit_m: f64,
    /// The smallest and the largest value, m.
    pub range_m: [f64; 2],
    /// The step of the values, m: their differences are multiples of it; 0 if all values are the same.
    pub step_m: f64,
    /// White noise from fifth differences, m; `None` without six consecutive rows.
    pub white_noise_m: Option<f64>,
    /// Noise over the median of its kind.
    pub to_siblings: Option<f64>,
    /// Falls of its noise from 20 to 75 Hz and from 75 to 200 Hz, over the falls of a random walk; `None` for rates
    /// below 480 rows a second. White noise has 0.08 and 0.21, drift of an interferometer up to one.
    pub falls: Option<[f64; 2]>,
    /// The rate of new values where there is not one in each row.
    pub slow: Option<SlowRate>,
    /// The longest run of rows on a straight line, where chance does not make it; rows of the log.
    pub straight: Option<Range<usize>>,
    /// Bits that never change.
    pub stuck_bits: Vec<u32>,
    /// The bits of a counter that overflows, and how often.
    pub overflows: Option<(u32, usize)>,
}

/// The channels of all logs, log after log, in the order of [`Channel::SINGLE`]: beams only if the log has a
/// reference, gaps only if it has codes.
pub fn columns(dataset: &Dataset, stage: &Stage) -> Vec<Column> {
    let mut columns = Vec::new();
    for (log, source) in dataset.logs.iter().enumerate() {
        let runs = signal::runs(dataset, source);
        let period_s = dataset.period_s(source.rows.clone());
        let period_s = period_s.unwrap_or(stage.servo_period_s);
        let signals = signal::signals(dataset, stage, source, &runs);
        let first = columns.len();
        columns.extend(
            signals
                .iter()
                .map(|signal| Column::new(log, signal, period_s)),
        );
        compare(&mut columns[first..]);
        set_motion_apart(&mut columns[first..]);
    }
    columns
}

/// The noise of the probes A, B, C that makes the noise floor in service, m: the median of the logs, from the readings
/// alone, so no reference raises the floor. Steps that are coarser than a code are taken off, and a noisy probe counts
/// as the middle probe. `None` without six consecutive rows.
pub fn probe_noise_m(columns: &[Column]) -> Option<[f64; 3]> {
    let own_m = |probe: usize| {
        let own = columns
            .iter()
            .filter(|column| column.channel == PROBES[probe]);
        median(&mut own.filter_map(Column::fine_noise_m).collect::<Vec<f64>>())
    };
    let own_m = [own_m(0)?, own_m(1)?, own_m(2)?];
    let usual_m = median(&mut own_m.clone())?;
    Some(own_m.map(|m| if m > NOISY * usual_m { usual_m } else { m }))
}

/// Leaves out falls of the noise where all probes show motion.
fn set_motion_apart(columns: &mut [Column]) {
    let moves = |column: &Column| column.falls.is_some_and(|[low, _]| low > MOTION);
    if columns.iter().take(3).all(moves) {
        columns.iter_mut().for_each(|column| column.falls = None);
    }
}

/// Compares the noise of the channels of each kind.
fn compare(columns: &mut [Column]) {
    for kind in columns.chunks_mut(3) {
        let mut noise_m: Vec<f64> = kind
            .iter()
            .filter_map(|column| column.white_noise_m)
            .collect();
        let Some(usual_m) = median(&mut noise_m).filter(|noise_m| *noise_m > 0.0) else {
            continue;
        };
        for column in kind {
            column.to_siblings = column.white_noise_m.map(|noise_m| noise_m / usual_m);
        }
    }
}

impl Column {
    fn new(log: usize, signal: &Signal, period_s: f64) -> Self {
        let step = codes::step(signal);
        let noise = noise::white(signal);
        let is_beam = signal.channel.is_beam();
        let values = || signal.values.iter().copied();
        let range = [
            values().fold(f64::INFINITY, f64::min),
            values().fold(f64::NEG_INFINITY, f64::max),
        ];
        let mut column = Self {
            log,
            channel: signal.channel,
            unit_m: signal.unit_m,
            range_m: range.map(|value| value * signal.unit_m),
            step_m: step * signal.unit_m,
            white_noise_m: noise.map(|noise| noise * signal.unit_m),
            to_siblings: None,
            falls: spectrum::falls(signal, step, period_s),
            slow: rate::slow(signal, step),
            straight: None,
            stuck_bits: match is_beam {
                true => Vec::new(),
                false => codes::stuck_bits(signal, step),
            },
            overflows: codes::overflows(signal).filter(|_| !is_beam),
        };
        if !column.is_rounded() {
            column.straight = rate::straight(signal, step);
        }
        column
    }

    /// Its noise with steps of one unit, m.
    fn fine_noise_m(&self) -> Option<f64> {
        let [own_m2, fine_m2] = [self.step_m, self.unit_m].map(|step_m| step_m * step_m / 12.0);
        let noise_m = self.white_noise_m?;
        let noise_m2 = noise_m * noise_m - own_m2 + fine_m2;
        // A step of more than six times the noise hides it.
        Some(noise_m2.max(own_m2 / 3.0).max(fine_m2).sqrt())
    }

    /// Whether its noise is below its step, so that it shows the rounding alone.
    pub fn is_rounded(&self) -> bool {
        self.white_noise_m
            .is_none_or(|noise_m| self.step_m > ROUNDED * noise_m)
    }
}

#[cfg(test)]
mod tests;

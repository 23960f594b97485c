//! Each column of a log by itself: its properties without a model and before a fit.
//!
//! | module | what it does |
//! |---|---|
//! | `signal` | the values of one channel, in runs of consecutive rows |
//! | `noise` | white noise from fifth differences |
//! | `codes` | step, stuck bits, overflows |
//! | `rate` | values that are held or interpolated |
//! | `outliers` | rows far from the rows before and behind |
//! | `spectrum` | low passes, lines, and noise that channels of a kind share |

mod codes;
mod noise;
mod outliers;
mod rate;
mod signal;
mod spectrum;

pub use noise::white_noise;
pub use outliers::outliers;
pub use rate::SlowRate;
pub use signal::{Signal, runs, signals};

use crate::channel::Channel;
use crate::dataset::Dataset;
use crate::stage::Stage;
use crate::statistics::median;
use spectrum::{FastNoise, Spectra};
use std::ops::Range;

/// A channel shows its rounding alone if its step is this many times its noise or more.
const ROUNDED: f64 = 1.5;
/// The noise of a probe is white. If it falls by more than a random walk does, the stage moves so fast.
const MOTION: f64 = 1.0;

/// The noise of a probe is white, with 0.21 of the fall of a random walk. A filter is there from this fall.
const FALL_OF_PROBE: f64 = 0.45;
/// The noise of a beam is drift and white noise. A filter is there if it falls by more than a random walk from 75 to
/// 200 Hz, and this many times as much from 20 to 75 Hz. A low pass of 30 Hz has 2.7 and is harmless.
const FALLS_OF_BEAM: [f64; 2] = [3.0, 1.0];
/// The noise of a beam is the noise of its reading, and no motion, below this part of the noise of a probe.
const QUIET: f64 = 1.0 / 200.0;
/// The noise of a probe where its readings do not show it, m.
pub const USUAL_NOISE_M: f64 = 5e-7;
/// The channels of the probes A, B, C.
pub const PROBES: [Channel; 3] = [Channel::HallA, Channel::HallB, Channel::HallC];
/// A probe or a gap is noisy from this many times the noise of its siblings: in sound logs a probe has at most 1.14 times
/// the noise of the middle probe.
pub const NOISY: f64 = 1.3;

/// A line in the spectrum of a channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Its frequency, Hz.
    pub frequency_hz: f64,
    /// Its amplitude, m.
    pub amplitude_m: f64,
}

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
    /// White noise from fifth differences, or from the spectrum if that is less, m; `None` without six consecutive rows.
    pub white_noise_m: Option<f64>,
    /// Noise over the median of its kind.
    pub to_siblings: Option<f64>,
    /// Falls of its noise from 20 to 75 Hz and from 75 to 200 Hz, over the falls of a random walk; `None` for rates
    /// below 480 rows a second. White noise has 0.08 and 0.21, drift of an interferometer up to one.
    pub falls: Option<[f64; 2]>,
    /// Whether it was averaged, or went through a low-pass filter.
    pub is_low_passed: bool,
    /// The rate of new values where there is not one in each row.
    pub slow: Option<SlowRate>,
    /// The longest run of rows on a straight line, where chance does not make it; rows of the log.
    pub straight: Option<Range<usize>>,
    /// Bits that never change.
    pub stuck_bits: Vec<u32>,
    /// The bits of a counter that overflows, and how often.
    pub overflows: Option<(u32, usize)>,
    /// Rows of the log that are far from the rows before and behind, with their errors, m.
    pub outliers: Vec<(usize, f64)>,
    /// The strongest line above 30 Hz that is no motion of the stage.
    pub line: Option<Line>,
    /// The share of the variance of its noise that all channels of the kind have at the same time.
    pub shared: f64,
    /// Its covariance with the channels of its kind above 30 Hz, less the variance of noise of its own, m2.
    pub beyond_m2: [f64; 3],
}

/// The channels of all logs, log after log, in the order of [`Channel::SINGLE`]: beams only if the log has a
/// reference, gaps only if it has codes.
pub fn columns(dataset: &Dataset, stage: &Stage) -> Vec<Column> {
    let mut columns = Vec::new();
    for (log, source) in dataset.logs.iter().enumerate() {
        let runs = runs(dataset, source);
        let period_s = dataset.period_s(source.rows.clone());
        let signals = signals(dataset, stage, source, &runs);
        let spectra = Spectra::new(&signals, period_s.unwrap_or(stage.servo_period_s));
        let first = columns.len();
        for (k, signal) in signals.iter().enumerate() {
            columns.push(Column::new(log, signal, &spectra, k));
        }
        let own = &mut columns[first..];
        for (start, kind) in own.chunks_mut(3).enumerate().map(|(k, kind)| (3 * k, kind)) {
            // Probes and beams show the motion of each other.
            let others = match (kind[0].channel, source.has_reference) {
                (Channel::HallA, true) => 3..6,
                (Channel::BeamX, _) => 0..3,
                _ => 0..0,
            };
            let to_own = signals[others.start].unit_m / kind[0].unit_m;
            let white = [0, 1, 2].map(|k| {
                let column: &Column = &kind[k];
                let noise_m = column.white_noise_m.unwrap_or(0.0);
                (noise_m.max(column.step_m / 12f64.sqrt()) / column.unit_m).powi(2)
            });
            if let Some(fast) = spectra.fast_noise((start, white), others, to_own * to_own) {
                kind.iter_mut()
                    .enumerate()
                    .for_each(|(k, column)| column.add_fast(&fast, k));
            }
            add_outliers(kind, source.rows.len());
        }
        compare(own);
        set_motion_apart(own);
    }
    let probes_m = probe_noise_m(&columns).and_then(|mut noise_m| median(&mut noise_m));
    for column in &mut columns {
        column.is_low_passed = column.is_filtered(probes_m.unwrap_or(0.0));
    }
    columns
}

/// The noise of the probes A, B, C that makes the noise floor in service, m: the median of the logs, from the readings
/// alone, so no reference raises the floor. Steps that are coarser than a code and noise that the probes share are taken off.
/// A probe that is noisy, or whose noise a filter hides, counts as the middle of the others. `None` without six consecutive
/// rows.
pub fn probe_noise_m(columns: &[Column]) -> Option<[f64; 3]> {
    let own_m = PROBES.map(|probe| {
        let shows = |of: &&Column| of.channel == probe && !of.is_low_passed && of.slow.is_none();
        let own = columns.iter().filter(shows);
        median(&mut own.filter_map(Column::fine_noise_m).collect::<Vec<f64>>())
    });
    let usual_m = median(&mut own_m.into_iter().flatten().collect::<Vec<f64>>())?;
    Some(own_m.map(|m| m.filter(|m| *m <= NOISY * usual_m).unwrap_or(usual_m)))
}

/// Takes the covariance of the outliers where it is larger: spectra have no row that few windows have.
fn add_outliers(kind: &mut [Column], rows: usize) {
    let sum = |a: &Column, b: &Column| {
        let at = |row: usize| b.outliers.binary_search_by_key(&row, |outlier| outlier.0);
        let products = a
            .outliers
            .iter()
            .map(|(row, error_m)| at(*row).map_or(0.0, |at| error_m * b.outliers[at].1));
        products.sum::<f64>() / rows as f64
    };
    let sums: Vec<[f64; 3]> = kind
        .iter()
        .map(|a| [0, 1, 2].map(|k| sum(a, &kind[k])))
        .collect();
    let trace = |of: &dyn Fn(usize) -> f64| (0..3).map(of).sum::<f64>();
    if trace(&|k| sums[k][k]) > trace(&|k| kind[k].beyond_m2[k]) {
        kind.iter_mut()
            .zip(sums)
            .for_each(|(column, sums)| column.beyond_m2 = sums);
    }
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
    /// The channel number `k` of a log.
    fn new(log: usize, signal: &Signal, spectra: &Spectra, k: usize) -> Self {
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
            falls: spectra.falls(k, step),
            is_low_passed: false,
            slow: rate::slow(signal, step),
            straight: None,
            stuck_bits: match is_beam {
                true => Vec::new(),
                false => codes::stuck_bits(signal, step),
            },
            overflows: codes::overflows(signal).filter(|_| !is_beam),
            outliers: Vec::new(),
            line: None,
            shared: 0.0,
            beyond_m2: [0.0; 3],
        };
        if column.slow.is_none() {
            column.outliers = outliers(signal);
        }
        if !column.is_rounded() {
            column.straight = rate::straight(signal, step);
        }
        column
    }

    /// Whether its noise falls like that of a filter beside probes with this noise.
    fn is_filtered(&self, probes_m: f64) -> bool {
        let [low, high] = self.falls.unwrap_or_default();
        match self.channel {
            channel if channel.is_beam() => {
                let is_quiet = self.white_noise_m.unwrap_or(0.0) < QUIET * probes_m;
                is_quiet && low > FALLS_OF_BEAM[0] && high > FALLS_OF_BEAM[1]
            }
            channel => PROBES.contains(&channel) && high > FALL_OF_PROBE,
        }
    }

    /// Adds the noise of its kind, in which it has the number `k`.
    fn add_fast(&mut self, fast: &FastNoise, k: usize) {
        let noise_m = fast.white[k].sqrt() * self.unit_m;
        self.white_noise_m = self.white_noise_m.map(|own_m| own_m.min(noise_m));
        // New values at a lower rate make lines.
        let line = fast.lines[k].filter(|_| self.slow.is_none());
        self.line = line.map(|line| Line {
            amplitude_m: line.amplitude_m * self.unit_m,
            ..line
        });
        self.shared = 1.0 - fast.own[k] / fast.white[k];
        self.beyond_m2 = fast.beyond[k].map(|variance| variance * self.unit_m * self.unit_m);
    }

    /// Its own noise with steps of one unit, m.
    fn fine_noise_m(&self) -> Option<f64> {
        let [own_m2, fine_m2] = [self.step_m, self.unit_m].map(|step_m| step_m * step_m / 12.0);
        let noise_m = self.white_noise_m?;
        let noise_m2 = noise_m * noise_m * (1.0 - self.shared) - own_m2 + fine_m2;
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

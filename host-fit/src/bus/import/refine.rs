//! Offset and rate of two clocks to a few microseconds: least squares in which each Hall signal is a
//! polynomial of the poses that the reference and the capacitive sensors show.
//!
//! What a probe reads follows all six axes, and a prediction by the designed geometry alone lets
//! what it lacks pass for a delay: of a run of all axes by up to a millisecond at its ends. So the
//! signal of each probe is fitted by all products of up to two of the six coordinates, by these times
//! its own, and by its speed and its speed times the time from the middle of the record: the
//! last two are what a wrong offset and a wrong rate add. Both are shared by the probes. The
//! coefficients are solved for and forgotten.

use super::join::{At, Cursor};
use super::offset::Offset;
use super::reference::Sample;
use super::survey::Point;
use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

/// Coordinates: what each designed probe would read of the reference, and three gaps.
const COORDINATES: usize = 6;
/// Products of two coordinates.
const PAIRS: usize = COORDINATES * (COORDINATES + 1) / 2;
/// Coordinates, their products, and these times the probe's own coordinate.
const TERMS: usize = COORDINATES + 2 * PAIRS;
/// With the two columns of time.
const COLUMNS: usize = TERMS + 2;
/// Weight of "no difference in speed": two crystals differ by 50 parts in a million where nothing
/// else is known.
pub(super) const RATE_PRIOR: f64 = 1.0 / (50.0 * 50.0);
/// Crystals differ by less; more means that the two records do not belong together.
pub(super) const RATE_MAX: f64 = 500e-6;
/// Added to each term's square, as a share: what a record does not move stays near 0.
const RIDGE: f64 = 1e-9;
/// Steps for one stretch of the record.
const STEPS: usize = 4;
/// The first stretch, about the middle of the points: a wrong rate has moved little in it, us.
pub(super) const FIRST_STRETCH_US: f64 = 60e6;

/// The offset and rate that leave the least of the signals, from an offset within a few servo
/// periods in a first stretch about its middle. `None` where the record does not say: nothing moves, or a step leads away.
pub(super) fn refine(
    points: &[Point],
    predicted: &[Sample],
    start: Offset,
    step_us: f64,
    first_stretch_us: f64,
) -> Option<Offset> {
    let ends = points.first().zip(points.last())?;
    let half_us = (ends.1.t_us - start.middle_us).max(start.middle_us - ends.0.t_us);
    let scales = Scales::of(points, predicted);
    let mut offset = start;
    let mut stretch_us = first_stretch_us / 2.0;
    loop {
        for _ in 0..STEPS {
            let sums = Sums::over(points, predicted, &scales, &offset, (stretch_us, step_us));
            let step = sums.step(offset.rate * 1e6)?;
            offset.us += step.x;
            offset.rate += step.y * 1e-6;
        }
        if stretch_us >= half_us {
            break;
        }
        stretch_us *= 4.0;
    }
    let moved_us = (offset.us - start.us).abs();
    (moved_us <= 2.0 * step_us && offset.rate.abs() <= RATE_MAX).then_some(offset)
}

/// Middle and half of the range of each coordinate, which bring it into -1 to 1.
pub(super) struct Scales {
    middle: [f64; COORDINATES],
    half: [f64; COORDINATES],
}

impl Scales {
    pub(super) fn of(points: &[Point], predicted: &[Sample]) -> Self {
        let mut low = [f64::INFINITY; COORDINATES];
        let mut high = [f64::NEG_INFINITY; COORDINATES];
        let mut take = |first: usize, values: [f64; 3]| {
            for (k, value) in (first..).zip(values) {
                low[k] = low[k].min(value);
                high[k] = high[k].max(value);
            }
        };
        predicted.iter().for_each(|sample| take(0, sample.values));
        points.iter().for_each(|point| take(3, point.gaps));
        Self {
            middle: std::array::from_fn(|k| (low[k] + high[k]) / 2.0),
            half: std::array::from_fn(|k| (high[k] - low[k]) / 2.0),
        }
    }

    /// The coordinates of a row; 0 where one never changes.
    fn apply(&self, [a, b, c]: [f64; 3], [d, e, f]: [f64; 3]) -> [f64; COORDINATES] {
        let values = [a, b, c, d, e, f];
        std::array::from_fn(|k| match self.half[k] > 0.0 {
            true => (values[k] - self.middle[k]) / self.half[k],
            false => 0.0,
        })
    }
}

/// A tick with a reference.
pub(super) struct Row {
    pub(super) movement: i64,
    pub(super) signal: [f64; 3],
    x: [f64; COORDINATES],
    /// Of each probe's own coordinate, in units of it per us.
    speed: [f64; 3],
    /// From the middle of the record, s.
    since: f64,
}

impl Row {
    /// The columns of a probe: terms, then the speed and the speed times the time.
    pub(super) fn columns(&self, own: usize) -> DVector<f64> {
        let mut columns = DVector::zeros(COLUMNS);
        let mut place = COORDINATES;
        for (i, a) in self.x.iter().enumerate() {
            columns[i] = *a;
            for b in &self.x[i..] {
                columns[place] = a * b;
                columns[place + PAIRS] = a * b * self.x[own];
                place += 1;
            }
        }
        columns[TERMS] = self.speed[own];
        columns[TERMS + 1] = self.speed[own] * self.since;
        columns
    }
}

/// Calls `take` with each of the points that has a reference and a speed.
pub(super) fn each_row<'p>(
    points: impl Iterator<Item = &'p Point>,
    predicted: &[Sample],
    scales: &Scales,
    offset: &Offset,
    step_us: f64,
    mut take: impl FnMut(Row),
) {
    let mut cursors = [(); 3].map(|()| Cursor::new(predicted));
    for point in points {
        let t_us = offset.on_reference_us(point.t_us);
        let [before, here, after] = &mut cursors;
        let apart_us = step_us / 2.0;
        let found = [
            before.at(t_us - apart_us, 2.0 * step_us),
            here.at(t_us, 2.0 * step_us),
            after.at(t_us + apart_us, 2.0 * step_us),
        ];
        let [Some(before), Some(here), Some(after)] = found.map(values) else {
            continue;
        };
        if before.0 != after.0 {
            continue;
        }
        let per_us = |k: usize| (after.1[k] - before.1[k]) / (step_us * scales.half[k]);
        take(Row {
            movement: here.0,
            signal: point.signal,
            x: scales.apply(here.1, point.gaps),
            speed: [0, 1, 2].map(per_us),
            since: (point.t_us - offset.middle_us) * 1e-6,
        });
    }
}

/// Normal equations of one probe, zero deviations of the movements taken out.
#[derive(Clone)]
pub(super) struct Probe {
    square: DMatrix<f64>,
    product: DVector<f64>,
    signal_square: f64,
    rows: f64,
}

pub(super) struct Sums {
    pub(super) probes: [Probe; 3],
}

/// Sums over one movement, of columns and signal.
struct Means {
    rows: f64,
    columns: DVector<f64>,
    signal: f64,
}

impl Sums {
    pub(super) fn over(
        points: &[Point],
        predicted: &[Sample],
        scales: &Scales,
        offset: &Offset,
        (stretch_us, step_us): (f64, f64),
    ) -> Self {
        let empty = Probe {
            square: DMatrix::zeros(COLUMNS, COLUMNS),
            product: DVector::zeros(COLUMNS),
            signal_square: 0.0,
            rows: 0.0,
        };
        let mut probes = [empty.clone(), empty.clone(), empty];
        let none = || Means {
            rows: 0.0,
            columns: DVector::zeros(COLUMNS),
            signal: 0.0,
        };
        let mut means = [none(), none(), none()];
        let mut current = None;
        let near = |point: &&Point| (point.t_us - offset.middle_us).abs() <= stretch_us;
        let points = points.iter().filter(near);
        each_row(points, predicted, scales, offset, step_us, |row| {
            if current.replace(row.movement) != Some(row.movement) {
                for (probe, means) in probes.iter_mut().zip(&mut means) {
                    probe.take_out(&std::mem::replace(means, none()));
                }
            }
            for (k, (probe, means)) in probes.iter_mut().zip(&mut means).enumerate() {
                let (columns, signal) = (row.columns(k), row.signal[k]);
                probe.square.ger(1.0, &columns, &columns, 1.0);
                probe.product.axpy(signal, &columns, 1.0);
                probe.signal_square += signal * signal;
                probe.rows += 1.0;
                means.rows += 1.0;
                means.columns += columns;
                means.signal += signal;
            }
        });
        for (probe, means) in probes.iter_mut().zip(&means) {
            probe.take_out(means);
        }
        Self { probes }
    }

    /// What the offset must change by, us, and the rate, in parts in a million, which is
    /// `rate_ppm` now; `None` if nothing moves.
    fn step(&self, rate_ppm: f64) -> Option<Vector2<f64>> {
        let prior = RATE_PRIOR;
        let mut square = Matrix2::new(0.0, 0.0, 0.0, prior);
        let mut product = Vector2::new(0.0, -prior * rate_ppm);
        for (own, probe) in self.probes.iter().enumerate() {
            let (of_time, by_signal) = probe.of_time(own)?;
            square += of_time;
            product -= by_signal;
        }
        Some(square.cholesky()?.solve(&product))
    }
}

impl Probe {
    fn take_out(&mut self, means: &Means) {
        if means.rows > 0.0 {
            let weight = -1.0 / means.rows;
            self.square.ger(weight, &means.columns, &means.columns, 1.0);
            self.product
                .axpy(weight * means.signal, &means.columns, 1.0);
            self.signal_square += weight * means.signal * means.signal;
        }
    }

    /// Squares of the two columns of time, and their products with the signal, once the terms are
    /// solved for; over the noise that is left, and times the sensitivity to the probe's `own`
    /// coordinate: a signal that is read too early by t lacks that times its speed times t.
    fn of_time(&self, own: usize) -> Option<(Matrix2<f64>, Vector2<f64>)> {
        let solved = self.solved(own)?;
        let across = self.square.view((0, TERMS), (TERMS, 2));
        let mut square = Matrix2::zeros();
        let mut product = Vector2::zeros();
        for i in 0..2 {
            product[i] = self.product[TERMS + i] - across.column(i).dot(&solved.of_signal);
            for j in 0..2 {
                square[(i, j)] = self.square[(TERMS + i, TERMS + j)]
                    - across.column(i).dot(&solved.of_time.column(j));
            }
        }
        let (eta, variance) = (solved.sensitivity, solved.variance);
        Some((square * (eta * eta / variance), product * (eta / variance)))
    }

    /// The terms by which the signal and the columns of time are told.
    pub(super) fn solved(&self, own: usize) -> Option<Solved> {
        let mut terms = self.square.view((0, 0), (TERMS, TERMS)).into_owned();
        let largest = terms.diagonal().max();
        for k in 0..TERMS {
            terms[(k, k)] += RIDGE * largest + f64::MIN_POSITIVE;
        }
        let terms = terms.cholesky()?;
        let of_time = terms.solve(&self.square.view((0, TERMS), (TERMS, 2)));
        let of_signal = terms.solve(&self.product.rows(0, TERMS));
        let left = self.signal_square - self.product.rows(0, TERMS).dot(&of_signal);
        Some(Solved {
            variance: left.max(f64::MIN_POSITIVE) / self.rows.max(1.0),
            sensitivity: self.product[own] / self.square[(own, own)],
            of_signal,
            of_time,
        })
    }
}

/// Coefficients of the terms of one probe.
pub(super) struct Solved {
    of_signal: DVector<f64>,
    of_time: DMatrix<f64>,
    sensitivity: f64,
    /// Of what the terms leave of the signal, codes squared.
    pub(super) variance: f64,
}

impl Solved {
    /// What the terms leave of a row's signal, in codes, and of what a wrong offset, us, and a
    /// wrong rate, parts in a million, would add to it.
    pub(super) fn left(&self, row: &Row, own: usize) -> (f64, Vector2<f64>) {
        let columns = row.columns(own);
        let terms = columns.rows(0, TERMS);
        let of_time = [0, 1].map(|k| columns[TERMS + k] - terms.dot(&self.of_time.column(k)));
        let signal = row.signal[own] - terms.dot(&self.of_signal);
        (signal, Vector2::from(of_time) * self.sensitivity)
    }
}

/// Movement and values of a reference that was found.
fn values(at: At) -> Option<(i64, [f64; 3])> {
    match at {
        At::Found {
            movement, values, ..
        } => Some((movement, values)),
        At::Outside | At::BetweenMovements | At::TooFar => None,
    }
}

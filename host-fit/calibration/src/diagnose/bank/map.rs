//! The most likely parameters of the field model, with faults as further unknowns.

use super::blocks::Log;
use super::noise::Filter;
use crate::solve::field::parameters::FieldParameters;
use crate::solve::field::probe::{Reading, probes};
use crate::solve::field::terms::{COUNT, PER_PROBE, TERMS};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix3, Vector3};
use rayon::prelude::*;

/// The parameters and the lag of the reference.
pub(super) const UNKNOWNS: usize = COUNT + 1;
/// A step that gains less than this in chi-square is none.
const GAIN_MIN: f64 = 0.1;
/// Steps at most, from a start that is a fit.
const STEPS_MAX: usize = 8;

/// The priors are so much wider than what magnets and a workshop give: see
/// [`TERMS`](crate::solve::field::terms::TERMS).
const USUAL_PART: f64 = 0.5;

/// What is estimated.
#[derive(Clone, Debug)]
pub(super) struct State {
    pub(super) parameters: FieldParameters,
    /// The mean of the prior.
    expected: [f64; COUNT],
    pub(super) lag_s: f64,
    /// By movement: mm, mm, mrad.
    offsets_mm: Vec<[f64; 3]>,
    /// How large the faults are.
    pub(super) faults: Vec<f64>,
}

/// The estimate of a log.
#[derive(Debug)]
pub(super) struct Estimate {
    pub(super) state: State,
    pub(super) filter: Filter,
    /// By mean and channel, side by side: the parameters, the lag, the residual; whitened.
    pub(super) columns: Vec<f64>,
    /// The curvature, the faults' part included.
    pub(super) curvature: Curvature,
    /// The same without faults, not factored.
    own: DMatrix<f64>,
    /// Columns of the faults, whitened.
    pub(super) faults: Vec<Vec<[f64; 3]>>,
    /// Sum of squares of the whitened residuals.
    pub(super) chi_squared: f64,
    /// From signals to channels, by mean.
    pub(super) channels: Vec<Matrix3<f64>>,
}

/// The columns of [`Estimate::columns`] for each mean and channel.
pub(super) const WIDTH: usize = UNKNOWNS + 1;

/// A factored curvature in the scale in which its diagonal is one.
#[derive(Debug)]
pub(super) struct Curvature {
    scale: DVector<f64>,
    factor: Cholesky<f64, Dyn>,
}

impl Curvature {
    pub(super) fn new(products: &DMatrix<f64>, damping: f64) -> Option<Self> {
        let scale = products
            .diagonal()
            .map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
        let scaled = DMatrix::from_fn(scale.len(), scale.len(), |i, j| match i == j {
            true => 1.0 + damping,
            false => products[(i, j)] * scale[i] * scale[j],
        });
        let factor = Cholesky::new(scaled)?;
        Some(Self { scale, factor })
    }

    pub(super) fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        let scaled = right.component_mul(&self.scale);
        self.factor.solve(&scaled).component_mul(&self.scale)
    }

    /// The same for each column.
    pub(super) fn solve_all(&self, right: &DMatrix<f64>) -> DMatrix<f64> {
        let scale = |mut columns: DMatrix<f64>| {
            for mut column in columns.column_iter_mut() {
                column.component_mul_assign(&self.scale);
            }
            columns
        };
        scale(self.factor.solve(&scale(right.clone())))
    }

    pub(super) fn covariance(&self) -> DMatrix<f64> {
        let mut inverse = self.factor.inverse();
        for (i, mut column) in inverse.column_iter_mut().enumerate() {
            for (j, x) in column.iter_mut().enumerate() {
                *x *= self.scale[i] * self.scale[j];
            }
        }
        inverse
    }
}

/// A log at a state: columns in the channels, not yet whitened.
struct Linear {
    columns: Vec<f64>,
    channels: Vec<Matrix3<f64>>,
}

/// How far lever arm, theta, eta and a, b, c, whose priors are flat, are from any start: so far that no log
/// that shows them feels it.
const OPEN: [f64; 6] = [1.0, 1.0, 3.0, 400.0, 200.0, 200.0];

/// The precision of the prior of an unknown.
pub(super) fn prior(unknown: usize) -> f64 {
    if unknown >= COUNT {
        return 0.0;
    }
    let place = unknown % PER_PROBE;
    let deviation = OPEN.get(place).copied().or(TERMS[place].prior);
    deviation.map_or(0.0, |deviation| 1.0 / (deviation * deviation))
}

impl State {
    fn readings(&self, log: &Log) -> Vec<[Reading; 3]> {
        let probes = probes(&self.parameters);
        let of_movement = |(movement, offset): (&std::ops::Range<usize>, &[f64; 3])| {
            let read = |at: usize| {
                let row = &log.means[at].row;
                let planar_mm = row.planar_mm(self.lag_s, *offset);
                [0, 1, 2].map(|k| probes[k].read(planar_mm, row.vertical))
            };
            movement.clone().map(read).collect::<Vec<_>>()
        };
        let movements: Vec<_> = log.movements.iter().zip(&self.offsets_mm).collect();
        movements
            .into_par_iter()
            .flat_map_iter(of_movement)
            .collect()
    }

    /// Moves the offsets to where the residuals have no mean; the readings there.
    fn centred(&mut self, log: &Log) -> Option<Vec<[Reading; 3]>> {
        let readings = self.readings(log);
        for (movement, offset) in log.movements.iter().zip(&mut self.offsets_mm) {
            let mut sum = Vector3::zeros();
            for at in movement.clone() {
                sum += by_pose(&readings[at]).try_inverse()? * residual(log, &readings, at);
            }
            for axis in 0..3 {
                offset[axis] += sum[axis] / movement.len() as f64;
            }
        }
        Some(self.readings(log))
    }

    fn step(&mut self, change: &DVector<f64>) {
        for (k, x) in change.iter().enumerate() {
            match k {
                0..COUNT => self.parameters.probes[k / PER_PROBE][k % PER_PROBE] += x,
                COUNT => self.lag_s += x,
                _ => self.faults[k - UNKNOWNS] += x,
            }
        }
    }

    /// How far a parameter is from the mean of its prior.
    pub(super) fn off(&self, unknown: usize) -> f64 {
        self.parameters.probes.as_flattened()[unknown] - self.expected[unknown]
    }

    fn prior_squares(&self) -> f64 {
        (0..COUNT).map(|k| prior(k) * self.off(k).powi(2)).sum()
    }
}

fn by_pose(reading: &[Reading; 3]) -> Matrix3<f64> {
    Matrix3::from_fn(|probe, axis| reading[probe].by_pose[axis])
}

fn residual(log: &Log, readings: &[[Reading; 3]], at: usize) -> Vector3<f64> {
    Vector3::from_fn(|k, _| log.means[at].row.signal_mm[k] - readings[at][k].signal_mm)
}

fn middle(readings: &[[Reading; 3]]) -> Matrix3<f64> {
    readings.iter().map(by_pose).sum::<Matrix3<f64>>() / readings.len().max(1) as f64
}

/// The columns of the readings in the channels of a filter.
fn linear(log: &Log, readings: &[[Reading; 3]], filter: &Filter) -> Option<Linear> {
    let channels: Option<Vec<Matrix3<f64>>> = readings
        .iter()
        .map(|r| Some(filter.to_channels * by_pose(r).try_inverse()?))
        .collect();
    let channels = channels?;
    let mut columns = vec![0.0; 3 * WIDTH * readings.len()];
    for (at, rows) in columns.chunks_exact_mut(3 * WIDTH).enumerate() {
        let row = &log.means[at].row;
        let rest = channels[at] * residual(log, readings, at);
        for (channel, out) in rows.chunks_exact_mut(WIDTH).enumerate() {
            for (probe, reading) in readings[at].iter().enumerate() {
                let by = channels[at][(channel, probe)];
                let own = &mut out[probe * PER_PROBE..][..PER_PROBE];
                for (out, x) in own.iter_mut().zip(&reading.by_parameter) {
                    *out = by * x;
                }
                let rates = reading.by_pose.iter().zip(&row.rate_mm_per_s);
                out[COUNT] += by * rates.map(|(a, b)| a * b).sum::<f64>();
            }
            out[UNKNOWNS] = rest[channel];
        }
    }
    Some(Linear { columns, channels })
}

/// Products of all columns; the faults' columns come after the others.
pub(super) fn products(columns: &[f64], faults: &[Vec<[f64; 3]>]) -> DMatrix<f64> {
    const TOGETHER: usize = 3 * 256;
    let width = WIDTH + faults.len();
    let parts: Vec<Vec<f64>> = columns
        .par_chunks(TOGETHER * WIDTH)
        .enumerate()
        .map(|(chunk, rows)| {
            let mut sums = vec![0.0; width * width];
            let mut all = vec![0.0; width];
            for (k, row) in rows.chunks_exact(WIDTH).enumerate() {
                let place = chunk * TOGETHER + k;
                all[..WIDTH].copy_from_slice(row);
                for (out, fault) in all[WIDTH..].iter_mut().zip(faults) {
                    *out = fault[place / 3][place % 3];
                }
                for (i, x) in all.iter().enumerate() {
                    for (sum, y) in sums[i * width..][i..width].iter_mut().zip(&all[i..]) {
                        *sum += x * y;
                    }
                }
            }
            sums
        })
        .collect();
    let mut sums = vec![0.0; width * width];
    for part in parts {
        sums.iter_mut().zip(part).for_each(|(sum, x)| *sum += x);
    }
    DMatrix::from_fn(width, width, |i, j| sums[i.min(j) * width + i.max(j)])
}

impl Estimate {
    /// From a start near the truth.
    pub(super) fn new(log: &Log, start: &FieldParameters) -> Option<Self> {
        let mut state = State {
            parameters: *start,
            expected: std::array::from_fn(|k| match k % PER_PROBE {
                flat if flat < OPEN.len() => start.probes.as_flattened()[k],
                _ => 0.0,
            }),
            lag_s: 0.0,
            offsets_mm: vec![[0.0; 3]; log.movements.len()],
            faults: Vec::new(),
        };
        let filter = Self::filter(log, &mut state)?;
        let first = Self::descend(log, state, filter, &[])?;
        let mut state = first.state;
        let filter = Self::filter(log, &mut state)?;
        Self::descend(log, state, filter, &[])
    }

    /// What a unit of a fault adds to the gradient of the parameters.
    pub(super) fn pull(&self, fault: usize) -> DVector<f64> {
        let mut pull = DVector::zeros(UNKNOWNS);
        for (row, x) in self
            .columns
            .chunks_exact(WIDTH)
            .zip(self.faults[fault].as_flattened())
        {
            pull.iter_mut().zip(row).for_each(|(sum, y)| *sum += x * y);
        }
        pull
    }

    fn filter(log: &Log, state: &mut State) -> Option<Filter> {
        let readings = state.centred(log)?;
        let poses: Option<Vec<Vector3<f64>>> = (0..readings.len())
            .map(|at| Some(by_pose(&readings[at]).try_inverse()? * residual(log, &readings, at)))
            .collect();
        Filter::best(log, &middle(&readings), &poses?)
    }

    /// The curvature of a fit that knows of no faults and has only the first `free` parameters of each
    /// probe.
    pub(super) fn without_faults(&self, free: usize) -> Option<Curvature> {
        let is_free = |k: usize| k >= COUNT || k % PER_PROBE < free;
        let own = DMatrix::from_fn(UNKNOWNS, UNKNOWNS, |i, j| match is_free(i) && is_free(j) {
            true => self.own[(i, j)],
            false => 0.0,
        });
        Curvature::new(&own, 0.0)
    }

    /// The covariance of the errors of such a fit, faults left out, where the omitted parameters are what
    /// magnets and a workshop make them: by the noise, and by what the fit takes them for.
    pub(super) fn omitting(&self, free: usize) -> Option<DMatrix<f64>> {
        let is_free = |k: usize| k >= COUNT || k % PER_PROBE < free;
        let own = self.without_faults(free)?;
        let pulls = DMatrix::from_fn(UNKNOWNS, UNKNOWNS, |i, j| match (is_free(i), is_free(j)) {
            (true, false) => self.own[(i, j)],
            _ => 0.0,
        });
        let mut errors = own.solve_all(&pulls);
        for k in (0..UNKNOWNS).filter(|&k| !is_free(k)) {
            errors[(k, k)] = -1.0;
            let deviation = USUAL_PART / prior(k).sqrt();
            errors.column_mut(k).scale_mut(deviation);
        }
        Some(own.covariance() + &errors * errors.transpose())
    }

    /// With columns of faults (in the channels, not whitened) as further unknowns.
    pub(super) fn with_faults(&self, log: &Log, faults: &[Vec<[f64; 3]>]) -> Option<Self> {
        let mut state = self.state.clone();
        state.faults.resize(faults.len(), 0.0);
        Self::descend(log, state, self.filter.clone(), faults)
    }

    fn descend(
        log: &Log,
        mut state: State,
        filter: Filter,
        faults: &[Vec<[f64; 3]>],
    ) -> Option<Self> {
        let whitened: Vec<Vec<[f64; 3]>> = (faults.iter())
            .map(|fault| {
                let mut column = fault.clone();
                filter.whiten(&mut column);
                column
            })
            .collect();
        let size = UNKNOWNS + faults.len();
        let mut damping = 0.0;
        let mut best: Option<(f64, Estimate, DVector<f64>, DMatrix<f64>)> = None;
        let mut filter = Some(filter);
        for step in 0..STEPS_MAX {
            let own = match &best {
                Some((_, estimate, ..)) => &estimate.filter,
                None => filter.as_ref()?,
            };
            let readings = state.centred(log)?;
            let Linear {
                mut columns,
                channels,
            } = linear(log, &readings, own)?;
            own.whiten_rows(&mut columns, WIDTH);
            for (fault, by) in whitened.iter().zip(&state.faults) {
                for (place, x) in fault.as_flattened().iter().enumerate() {
                    columns[place * WIDTH + UNKNOWNS] -= by * x;
                }
            }
            let all = products(&columns, &whitened);
            let chi_squared = all[(UNKNOWNS, UNKNOWNS)];
            let cost = chi_squared + state.prior_squares();
            let is_better = best
                .as_ref()
                .is_none_or(|(least, ..)| cost <= *least + GAIN_MIN);
            if is_better {
                let place = |k: usize| if k < UNKNOWNS { k } else { k + 1 };
                let descent = DVector::from_fn(size, |k, _| {
                    let pull = if k < COUNT {
                        prior(k) * state.off(k)
                    } else {
                        0.0
                    };
                    all[(place(k), UNKNOWNS)] - pull
                });
                let squares = DMatrix::from_fn(size, size, |i, j| {
                    let own = if i == j { prior(i) } else { 0.0 };
                    all[(place(i), place(j))] + own
                });
                damping *= 0.1;
                if damping < 1e-6 {
                    damping = 0.0;
                }
                let filter = match best.take() {
                    Some((_, estimate, ..)) => estimate.filter,
                    None => filter.take()?,
                };
                let curvature = Curvature::new(&squares, 0.0)?;
                let estimate = Estimate {
                    state: state.clone(),
                    filter,
                    columns,
                    curvature,
                    own: squares.view((0, 0), (UNKNOWNS, UNKNOWNS)).into_owned(),
                    faults: whitened.clone(),
                    chi_squared,
                    channels,
                };
                best = Some((cost, estimate, descent, squares));
            } else {
                damping = f64::max(1e-3, damping * 10.0);
            }
            let (_, estimate, descent, squares) = best.as_ref()?;
            let change = match damping {
                0.0 => estimate.curvature.solve(descent),
                damping => Curvature::new(squares, damping)?.solve(descent),
            };
            if descent.dot(&change) < GAIN_MIN || step + 1 == STEPS_MAX {
                break;
            }
            state = estimate.state.clone();
            state.step(&change);
        }
        let (_, mut estimate, descent, _) = best?;
        let change = estimate.curvature.solve(&descent);
        estimate.finish(&change);
        Some(estimate)
    }

    /// The last step, residuals and all, in the linear form that everything after it works with.
    fn finish(&mut self, change: &DVector<f64>) {
        self.chi_squared = 0.0;
        for (place, row) in self.columns.chunks_exact_mut(WIDTH).enumerate() {
            let of_parameters: f64 = row
                .iter()
                .zip(change.iter())
                .take(UNKNOWNS)
                .map(|(a, b)| a * b)
                .sum();
            let of_faults = self.faults.iter().zip(change.iter().skip(UNKNOWNS));
            let of_faults: f64 = of_faults
                .map(|(fault, b)| fault[place / 3][place % 3] * b)
                .sum();
            row[UNKNOWNS] -= of_parameters + of_faults;
            self.chi_squared += row[UNKNOWNS] * row[UNKNOWNS];
        }
        self.state.step(change);
    }
}

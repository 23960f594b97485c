//! The most likely parameters of the field model, with faults as further unknowns.

use super::FAULTS_MAX;
use super::blocks::{Log, Mean};
use super::noise::Filter;
use crate::solve::field::parameters::FieldParameters;
use crate::solve::field::probe::{Reading, probes};
use crate::solve::field::terms::{BEYOND_MODEL_31, COUNT, PER_PROBE, TERMS};
use crate::solve::gauss_newton::{self, Factor, Limits, Normal, Point, Unknowns};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// The parameters and the lags of the beams X, Y1, Y2.
pub(super) const UNKNOWNS: usize = COUNT + 3;
/// Columns: these, the sizes of the faults, and the residual in the last one; a multiple of four is quick.
pub(super) const WIDTH: usize = (UNKNOWNS + FAULTS_MAX + 1).next_multiple_of(4);
pub(super) const RESIDUAL: usize = WIDTH - 1;
/// From a start that is a fit.
const LIMITS: Limits = Limits {
    steps: 20,
    gain: 0.1,
};

/// The priors are so much wider than what magnets and a workshop give: see
/// [`TERMS`](crate::solve::field::terms::TERMS).
const USUAL_PART: f64 = 0.5;
/// E in parts of its prior: with magnets as designed, whose probes stand 2.5 mm off the tilt plane, ...
const CARRY_LEAST: f64 = 0.03;
/// ... and over the part that the other terms even in u have of theirs: by 60 simulated stages.
const CARRY_PART: f64 = 0.3;
/// Rounds in which that part settles.
const ROUNDS: usize = 8;
/// How far lever arm, theta, eta and a, b, c, whose priors are flat, are from any start: so far that no log
/// that shows them feels it.
const OPEN: [f64; 6] = [1.0, 1.0, 3.0, 400.0, 200.0, 200.0];

/// Lags of beams, standard deviation, s: a beam that hardly moves shows none.
const LAG_S: f64 = 0.02;

/// Columns of a mean in the three channels.
pub(super) type Row = [[f64; WIDTH]; 3];

/// The estimate of a log.
#[derive(Debug)]
pub(super) struct Estimate {
    pub(super) parameters: FieldParameters,
    pub(super) filter: Filter,
    /// By mean, whitened.
    pub(super) rows: Vec<Row>,
    /// From signals to channels, by mean.
    pub(super) channels: Vec<Matrix3<f64>>,
    /// The curvature, with the prior: the unknowns, then the faults.
    squares: DMatrix<f64>,
    pub(super) curvature: Factor,
    /// The step to the very end, which is too small for a fit but not where parts of a log are compared.
    pub(super) step: DVector<f64>,
    /// Sum of squares of the whitened residuals.
    pub(super) chi_squared: f64,
    at: Point,
    /// The mean of the prior.
    expected: DVector<f64>,
}

/// A log at a point, seen through a filter.
struct Equations<'a> {
    log: &'a Log,
    filter: &'a Filter,
    places: [[f64; 2]; 3],
    /// Columns of the faults in the channels, not whitened.
    faults: &'a [Vec<[f64; 3]>],
}

impl gauss_newton::Equations<WIDTH> for Equations<'_> {
    fn normal(&self, at: &Point) -> Option<Normal<WIDTH>> {
        let to_pose = self.filter.to_channels.try_inverse()?;
        Normal::of_movements(self.log.movements.len(), |movement| {
            let mut rows = self.rows(movement, at)?;
            let share = 1.0 / rows.len() as f64;
            // An offset is where the residuals have no mean.
            let mut end = [[0.0; WIDTH]; 3];
            for (axis, end) in end.iter_mut().enumerate() {
                for (channel, row) in rows.iter().flat_map(|row| row.iter().enumerate()) {
                    let by = share * to_pose[(axis, channel)];
                    end.iter_mut().zip(row).for_each(|(sum, x)| *sum += by * x);
                }
                end[RESIDUAL] -= at.offsets[movement][axis];
            }
            self.filter
                .whiten(self.log.movements[movement].start, &mut rows);
            let mut sums = Normal::none();
            rows.iter().for_each(|row| sums.add_row(row, 1.0));
            sums.ends.push(end);
            Some(sums)
        })
    }
}

/// Readings of a mean, and what turns signals into a pose.
fn readings(
    log: &Log,
    places: [[f64; 2]; 3],
    at: &Point,
    movement: usize,
) -> Option<Vec<([Reading; 3], Matrix3<f64>)>> {
    let probes = probes(&FieldParameters::of_values(at.values.as_slice(), places));
    let reading = |mean: usize| {
        let row = &log.means[mean].row;
        let planar_mm = log.planar_mm(row, lags_s(&at.values), at.offsets[movement]);
        let readings = [0, 1, 2].map(|k| probes[k].read(planar_mm, row.vertical));
        let by_pose = Matrix3::from_fn(|probe, axis| readings[probe].by_pose[axis]);
        Some((readings, by_pose.try_inverse()?))
    };
    log.movements[movement].clone().map(reading).collect()
}

impl Equations<'_> {
    /// The columns of a movement, not whitened.
    fn rows(&self, movement: usize, at: &Point) -> Option<Vec<Row>> {
        let readings = readings(self.log, self.places, at, movement)?;
        // Beside the offset, which is expected to be zero.
        let offset = self.filter.to_channels * Vector3::from(at.offsets[movement]);
        let row = |(mean, (readings, to_pose)): (usize, ([Reading; 3], Matrix3<f64>))| {
            let row = &self.log.means[mean].row;
            let channels = self.filter.to_channels * to_pose;
            let mut out = [[0.0; WIDTH]; 3];
            for (channel, out) in out.iter_mut().enumerate() {
                out[RESIDUAL] = offset[channel];
                for (probe, reading) in readings.iter().enumerate() {
                    let by = channels[(channel, probe)];
                    let own = &mut out[probe * PER_PROBE..][..PER_PROBE];
                    for (out, x) in own.iter_mut().zip(&reading.by_parameter) {
                        *out = by * x;
                    }
                    for (out, rates) in out[COUNT..].iter_mut().zip(self.log.by_lag(row)) {
                        let rates = reading.by_pose.iter().zip(rates);
                        *out += by * rates.map(|(a, b)| a * b).sum::<f64>();
                    }
                    out[RESIDUAL] += by * (row.signal_mm[probe] - reading.signal_mm);
                }
                for (k, fault) in self.faults.iter().enumerate() {
                    out[UNKNOWNS + k] = fault[mean][channel];
                    out[RESIDUAL] -= at.values[UNKNOWNS + k] * fault[mean][channel];
                }
            }
            out
        };
        let means = self.log.movements[movement].clone();
        Some(means.zip(readings).map(row).collect())
    }
}

/// The precision of the prior of an unknown.
fn prior(unknown: usize) -> f64 {
    let place = unknown % PER_PROBE;
    let deviation = match unknown {
        0..COUNT => OPEN.get(place).copied().or(TERMS[place].prior),
        COUNT..UNKNOWNS => Some(LAG_S),
        _ => None,
    };
    deviation.map_or(0.0, |deviation| 1.0 / (deviation * deviation))
}

/// The lags of X, Y1, Y2 among values, s.
fn lags_s(values: &DVector<f64>) -> [f64; 3] {
    [0, 1, 2].map(|beam| values[COUNT + beam])
}

/// The solution for each column.
pub(super) fn solve_all(factor: &Factor, right: &DMatrix<f64>) -> DMatrix<f64> {
    let columns = right.column_iter();
    let solved: Vec<_> = columns.map(|c| factor.solve(&c.into_owned())).collect();
    DMatrix::from_columns(&solved)
}

impl Estimate {
    /// From a start near the truth.
    pub(super) fn new(log: &Log, start: &FieldParameters) -> Option<Self> {
        let values = start.probes.as_flattened();
        let at = Point {
            values: DVector::from_fn(UNKNOWNS, |k, _| values.get(k).copied().unwrap_or(0.0)),
            offsets: vec![[0.0; 3]; log.movements.len()],
        };
        let is_flat = |k: usize| k < COUNT && k % PER_PROBE < OPEN.len();
        let expected = |k: usize, _| if is_flat(k) { at.values[k] } else { 0.0 };
        let expected = DVector::from_fn(UNKNOWNS, expected);
        let filter = Self::filter(log, start, &at)?;
        let first = Self::descend(log, start, at, expected, filter, &[])?;
        let filter = Self::filter(log, start, &first.at)?;
        Self::descend(log, start, first.at, first.expected, filter, &[])
    }

    fn filter(log: &Log, start: &FieldParameters, at: &Point) -> Option<Filter> {
        let movements = 0..log.movements.len();
        let readings = movements.map(|movement| readings(log, start.places, at, movement));
        let readings = readings.collect::<Option<Vec<_>>>()?.concat();
        let pose = |(mean, (readings, to_pose)): (&Mean, &([Reading; 3], Matrix3<f64>))| {
            to_pose * Vector3::from_fn(|k, _| mean.row.signal_mm[k] - readings[k].signal_mm)
        };
        let mut poses: Vec<_> = log.means.iter().zip(&readings).map(pose).collect();
        for (movement, offset) in log.movements.iter().zip(&at.offsets) {
            (poses[movement.clone()].iter_mut()).for_each(|pose| *pose += Vector3::from(*offset));
        }
        let share = 1.0 / readings.len() as f64;
        let middle = readings
            .iter()
            .map(|(_, to_pose)| to_pose)
            .sum::<Matrix3<f64>>()
            * share;
        Filter::best(log, &middle, &poses)
    }

    fn descend(
        log: &Log,
        start: &FieldParameters,
        at: Point,
        expected: DVector<f64>,
        filter: Filter,
        faults: &[Vec<[f64; 3]>],
    ) -> Option<Self> {
        let size = UNKNOWNS + faults.len();
        let unknowns = Unknowns {
            origin: expected.clone().resize_vertically(size, 0.0),
            basis: DMatrix::identity(size, size),
            prior: DMatrix::from_fn(size, size, |i, j| if i == j { prior(i) } else { 0.0 }),
            ranges: Vec::new(),
        };
        let equations = Equations {
            log,
            filter: &filter,
            places: start.places,
            faults,
        };
        let x = at.values.resize_vertically(size, 0.0) - &unknowns.origin;
        let solved = gauss_newton::solve(&equations, &unknowns, x, at.offsets, LIMITS)?;
        let at = solved.point;
        let (mut rows, mut channels) = (Vec::new(), Vec::new());
        for (movement, means) in log.movements.iter().enumerate() {
            let mut some = equations.rows(movement, &at)?;
            filter.whiten(means.start, &mut some);
            rows.extend(some);
            let readings = readings(log, start.places, &at, movement)?.into_iter();
            channels.extend(readings.map(|(_, to_pose)| filter.to_channels * to_pose));
        }
        let curvature = unknowns.factor(&solved.normal)?;
        Some(Self {
            parameters: FieldParameters::of_values(at.values.as_slice(), start.places),
            step: curvature.solve(&unknowns.descent(&solved.normal, &solved.x)),
            curvature,
            squares: unknowns.curvature(&solved.normal),
            chi_squared: solved.normal.chi_squared(),
            rows,
            channels,
            filter,
            at,
            expected,
        })
    }

    /// With columns of faults (in the channels, not whitened) as further unknowns.
    pub(super) fn with_faults(&self, log: &Log, faults: &[Vec<[f64; 3]>]) -> Option<Self> {
        let (at, expected) = (self.at.clone(), self.expected.clone());
        Self::descend(
            log,
            &self.parameters,
            at,
            expected,
            self.filter.clone(),
            faults,
        )
    }

    /// The lags of the beams X, Y1, Y2, s.
    pub(super) fn lags_s(&self) -> [f64; 3] {
        lags_s(&self.at.values)
    }

    /// The values of the unknowns.
    pub(super) fn values(&self) -> DVector<f64> {
        self.at.values.clone()
    }

    /// How large the faults are.
    pub(super) fn sizes(&self) -> &[f64] {
        &self.at.values.as_slice()[UNKNOWNS..]
    }

    /// What the prior adds to the curvature, and takes from the gradient, of each unknown.
    pub(super) fn of_prior(&self) -> impl Iterator<Item = (f64, f64)> {
        (0..UNKNOWNS).map(|k| (prior(k), prior(k) * (self.at.values[k] - self.expected[k])))
    }

    /// What a unit of a fault adds to the gradient of the parameters.
    pub(super) fn pull(&self, fault: usize) -> DVector<f64> {
        DVector::from_fn(UNKNOWNS, |k, _| self.squares[(k, UNKNOWNS + fault)])
    }

    /// The curvature of a fit that knows of no faults and has only the first `free` parameters of each
    /// probe.
    pub(super) fn without_faults(&self, free: usize) -> Option<Factor> {
        let own = DMatrix::from_fn(UNKNOWNS, UNKNOWNS, |i, j| {
            match is_free(i, free) && is_free(j, free) {
                true => self.squares[(i, j)],
                false => 0.0,
            }
        });
        Factor::new(&own, 0.0)
    }

    /// The parameters and their covariance where terms beyond Model (31) are as large as on a stage of this
    /// kind, for what a log leaves open of them is what it does to a model without them. A magnet as designed
    /// has none that are even in u: how large those are that the log shows says how large the others are.
    pub(super) fn of_this_stage(&self) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let mut imperfect = USUAL_PART;
        let mut found = None;
        for _ in 0..ROUNDS {
            let part = |k: usize| match (k % PER_PROBE, TERMS[k % PER_PROBE].powers) {
                _ if k >= COUNT => 1.0,
                (0..BEYOND_MODEL_31, _) => 1.0,
                (_, [0, 0, 0]) => CARRY_LEAST.hypot(CARRY_PART * imperfect),
                (_, [0 | 2, ..]) => imperfect,
                _ => USUAL_PART,
            };
            let mut squares = self.squares.clone();
            let mut change = DVector::zeros(squares.nrows());
            for (k, (usual, pull)) in self.of_prior().enumerate() {
                let more = 1.0 / (part(k) * part(k)) - 1.0;
                squares[(k, k)] += more * usual;
                change[k] = -more * pull;
            }
            let factor = Factor::new(&squares, 0.0)?;
            let values = &self.at.values + factor.solve(&change);
            let covariance = factor.inverse();
            let even = (0..COUNT).filter(|k| {
                let powers = TERMS[k % PER_PROBE].powers;
                powers != [0; 3] && powers[0].is_multiple_of(2)
            });
            // Squares over the number of terms that the log, not the prior, tells (MacKay 1992).
            let (mut sum, mut count) = (0.0, 0.0);
            for k in even {
                sum += prior(k) * values[k] * values[k];
                count += 1.0 - prior(k) * covariance[(k, k)] / (imperfect * imperfect);
            }
            imperfect = (sum / f64::max(count, 1e-9)).sqrt().clamp(0.01, 1.0);
            found = Some((values, covariance));
        }
        found
    }
}

/// Whether a fit of the first `free` parameters of each probe changes an unknown.
fn is_free(unknown: usize, free: usize) -> bool {
    unknown >= COUNT || unknown % PER_PROBE < free
}

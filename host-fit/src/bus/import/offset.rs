//! The offset between the clocks and how much faster one runs, by the motion that both saw.
//!
//! A grid of one servo period finds the offset by correlation: at the right one each Hall signal is
//! about what the designed probe would read at the reference pose, times a sensitivity. (A
//! fit by all three axes of the reference would also explain a run shifted by a whole movement:
//! each movement moves one axis only, and some matrix turns any axis into any other.) From the
//! minute with most motion, offset and rate are then followed to the ends of the record: they are the
//! lag of the reference and its rate in the fit of the field model.

mod rows;

use super::ImportError;
use super::node_clock::{Run, Tick};
use super::reference::{Reference, Sample};
use hallstage_input::log::layout::Quantity;
use hallstage_input::stage::Stage;
use hallstage_solver::solve::field::clocks::{Alignment, Lag};
use nalgebra::Matrix3;
use rayon::iter::{IntoParallelIterator, ParallelIterator};
use rows::Row;
use serde::Serialize;

/// The offset between the clocks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Offset {
    /// Time of the recorder less time of the reference in the middle of the record, us.
    #[serde(rename = "in_the_middle_us")]
    pub us: f64,
    /// How much faster the clock of the sensor node runs than that of the reference, as a part of one.
    #[serde(rename = "node_clock_faster_by")]
    pub rate: f64,
    /// What the motion that both saw shows.
    #[serde(flatten)]
    pub seen: Seen,
}

/// What the motion that both records saw shows of an offset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Seen {
    /// Share of the Hall signals' motion that the reference explains.
    #[serde(rename = "share_of_motion_explained")]
    pub explained: f64,
    /// Over how many ticks.
    pub ticks: usize,
    /// Standard error of the offset that the motion shows, at the end of the record where it is
    /// larger, us.
    pub standard_error_us: f64,
    /// For an offset that was given: the one that the motion shows less the one given, us.
    #[serde(rename = "motion_asks_for_more_us")]
    pub apart_us: Option<f64>,
}

/// The clocks of node and reference.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clocks {
    /// Time of the node less time of the reference in the middle, us.
    pub(super) us: f64,
    /// How much faster the node's runs, as a part of one.
    pub(super) rate: f64,
    /// The middle, us on the clock of the node.
    pub(super) middle_us: f64,
}

impl Clocks {
    /// A time of the node on the clock of the reference, us.
    pub(super) fn on_reference_us(&self, node_us: f64) -> f64 {
        node_us - self.us - self.rate * (node_us - self.middle_us)
    }

    /// The same with another middle.
    pub(super) fn about(self, middle_us: f64) -> Self {
        Self {
            us: self.us + self.rate * (middle_us - self.middle_us),
            middle_us,
            ..self
        }
    }
}

/// Both records.
pub(super) struct Records<'r> {
    ticks: &'r [Tick],
    /// When the record starts, us on the clock of the node.
    start_us: f64,
    samples: &'r [Sample],
    stage: &'r Stage,
    period_us: f64,
    /// m or rad per unit of the reference's columns.
    scale: [f64; 3],
    /// Whether the reference has beams.
    is_beams: bool,
    /// What the designed probes read of X, Y, Rz.
    plane: Matrix3<f64>,
}

/// Ticks of the correlation, and of a fit, at most.
const COARSE_TICKS: usize = 2_000;
const FIT_TICKS: usize = 10_000;

/// The first part of a record that is fitted: a wrong rate has moved little in it, us.
const STRETCH_US: f64 = 60e6;

/// Steps for one stretch of the record, at most, and the last one in standard errors.
const STEPS: usize = 4;
const SETTLED: f64 = 0.1;

/// Share that must be explained: signals of another run reach a third by chance.
const EXPLAINED_MIN: f64 = 0.6;

/// Crystals differ by less; more means that the two records do not belong together.
const RATE_MAX: f64 = 500e-6;

/// A clock that was set shows in some ten seconds of a movement, us.
const PIECE_US: f64 = 1e7;

/// The motion of such a piece, as a share of the mean motion of the record, from which on as much of it
/// must be explained.
const MOTION_MIN: f64 = 0.02;

/// How far its own offset may be off, in standard errors.
const STANDARD_ERRORS: f64 = 5.0;

/// How far the correlation may be wrong, in servo periods.
const COARSE_PERIODS_MAX: f64 = 2.0;

/// Largest standard error of an offset, in servo periods.
const STANDARD_ERROR_PERIODS_MAX: f64 = 0.1;

/// How far a given offset, or that of a piece of the record, may be from the one that the motion
/// shows, in servo periods: the time that frames take is part of the latter.
const APART_PERIODS_MAX: f64 = 0.5;

impl<'r> Records<'r> {
    pub(super) fn new(run: &'r Run, reference: &'r Reference, stage: &'r Stage) -> Self {
        Self {
            ticks: &run.ticks,
            start_us: -run.since_start_us,
            samples: &reference.samples,
            period_us: stage.servo_period_s * 1e6,
            scale: reference.quantities.map(|q| stage.log.column(q).scale),
            stage,
            is_beams: reference.quantities == Quantity::BEAMS,
            plane: stage.geometry().plane(),
        }
    }

    /// The middle of the record, us on the clock of the node.
    pub(super) fn middle_us(&self) -> f64 {
        middle_us(self.ticks)
    }

    /// Finds the offset within `search_us` of where both records start together.
    ///
    /// # Errors
    /// `NoOffset`, `UnsteadyClocks`, `UncertainOffset`, `Astray`.
    pub(super) fn estimate(&self, search_us: f64) -> Result<(Clocks, Seen), ImportError> {
        let start = self.coarse(search_us);
        let (found, seen) = self.follow(start)?;
        let most_us = STANDARD_ERROR_PERIODS_MAX * self.period_us;
        if seen.standard_error_us > most_us {
            return Err(ImportError::UncertainOffset {
                standard_error_us: seen.standard_error_us,
                most_us,
            });
        }
        let moved_us = found.about(start.middle_us).us - start.us;
        if moved_us.abs() > COARSE_PERIODS_MAX * self.period_us {
            return Err(UNSTEADY);
        }
        Ok((found, seen))
    }

    /// Checks an offset that was given for the middle of the record against the motion, which
    /// adds the rate.
    ///
    /// # Errors
    /// `NoOffset`, `UnsteadyClocks`, `WrongOffset`, `Astray`.
    pub(super) fn checked(&self, given: Clocks) -> Result<(Clocks, Seen), ImportError> {
        let (found, seen) = self.follow(given.about(middle_us(self.liveliest())))?;
        let apart_us = found.us - given.us;
        let most_us = APART_PERIODS_MAX * self.period_us + 3.0 * seen.standard_error_us;
        if apart_us.abs() > most_us {
            return Err(ImportError::WrongOffset { apart_us });
        }
        let clocks = Clocks {
            us: given.us,
            ..found
        };
        let apart_us = Some(apart_us);
        Ok((clocks, Seen { apart_us, ..seen }))
    }

    /// The minute with most motion.
    fn liveliest(&self) -> &'r [Tick] {
        let ticks = (STRETCH_US / self.period_us).max(1.0);
        let parts = (self.ticks.len() as f64 / ticks).ceil().max(1.0) as usize;
        let minutes = self.ticks.chunks(self.ticks.len().div_ceil(parts).max(1));
        let motion = |ticks: &&[Tick]| {
            let mean = |k: usize| {
                let sum: f64 = ticks.iter().map(|tick| f64::from(tick.codes.hall[k])).sum();
                sum / ticks.len() as f64
            };
            let means = [0, 1, 2].map(mean);
            let of_tick = |tick: &Tick| -> f64 {
                let of_probe = |k: usize| (f64::from(tick.codes.hall[k]) - means[k]).powi(2);
                [0, 1, 2].map(of_probe).iter().sum()
            };
            ticks.iter().map(of_tick).sum::<f64>()
        };
        let most = minutes.max_by(|a, b| motion(a).total_cmp(&motion(b)));
        most.unwrap_or_default()
    }

    /// The best offset on a grid of one servo period.
    fn coarse(&self, search_us: f64) -> Clocks {
        let minute = self.liveliest();
        let points: Vec<Tick> = thinned(minute, COARSE_TICKS).collect();
        let first_us = self.samples.first().map_or(0.0, |sample| sample.t_us);
        let steps = (search_us / self.period_us).ceil().clamp(1.0, 1e6) as i32;
        let clocks = |step: i32| Clocks {
            us: self.start_us - first_us + f64::from(step) * self.period_us,
            rate: 0.0,
            middle_us: middle_us(minute),
        };
        let trial = |step: i32| (self.explained(&self.rows(&points, &clocks(step)))[0], step);
        let trials: Vec<(f64, i32)> = (-steps..steps + 1).into_par_iter().map(trial).collect();
        // The first of equals.
        let best = trials.iter().rev().max_by(|a, b| a.0.total_cmp(&b.0));
        clocks(best.map_or(0, |(_, step)| *step))
    }

    /// Follows an offset from the first stretch about its middle over the whole record.
    ///
    /// # Errors
    /// `NoOffset`, `UnsteadyClocks`, `Astray`.
    fn follow(&self, start: Clocks) -> Result<(Clocks, Seen), ImportError> {
        let far_us = |tick: Option<&Tick>| tick.map_or(0.0, |t| (t.t_us - start.middle_us).abs());
        let half_us = far_us(self.ticks.first()).max(far_us(self.ticks.last()));
        let mut clocks = start;
        let mut alignment = Alignment::new(self.stage);
        let mut stretch_us = STRETCH_US / 2.0;
        loop {
            let from = |t_us: f64| self.ticks.partition_point(|tick| tick.t_us < t_us);
            let (first, last) = (
                from(start.middle_us - stretch_us),
                from(start.middle_us + stretch_us),
            );
            let near = self.ticks.get(first..last).unwrap_or_default();
            let points: Vec<Tick> = thinned(near, FIT_TICKS).collect();
            let rows = self.rows(&points, &clocks);
            let share = self.share(&rows)?;
            let mut lag = self.step(&mut alignment, &rows, &mut clocks)?;
            for _ in 1..STEPS {
                lag = self.step(&mut alignment, &self.rows(&points, &clocks), &mut clocks)?;
                if lag.value_s.abs() < SETTLED * lag.standard_errors_s[0] {
                    break;
                }
            }
            if clocks.rate.abs() > RATE_MAX {
                return Err(UNSTEADY);
            }
            if stretch_us > half_us {
                let rows = self.rows(&points, &clocks);
                self.check_pieces(&alignment, &rows, &clocks, lag.excess)?;
                let seen = Seen {
                    explained: share.max(self.share(&rows)?),
                    ticks: rows.len(),
                    standard_error_us: 1e6 * lag.standard_errors_s[0].max(lag.standard_errors_s[1]),
                    apart_us: None,
                };
                return Ok((clocks.about(self.middle_us()), seen));
            }
            stretch_us *= 4.0;
        }
    }

    /// One step of the fit, by which the clocks move.
    fn step(
        &self,
        alignment: &mut Alignment,
        rows: &[Row],
        clocks: &mut Clocks,
    ) -> Result<Lag, ImportError> {
        let lag = alignment
            .step(&self.field_rows(rows, clocks))
            .ok_or(UNSTEADY)?;
        // What lags is read too early.
        clocks.us -= 1e6 * lag.value_s;
        clocks.rate -= lag.rate;
        Ok(lag)
    }

    /// Every piece of the record must agree with the offset of all.
    ///
    /// # Errors
    /// `Astray`.
    fn check_pieces(
        &self,
        alignment: &Alignment,
        rows: &[Row],
        clocks: &Clocks,
        excess: f64,
    ) -> Result<(), ImportError> {
        let key = |row: &Row| (row.movement, (row.tick.t_us / PIECE_US).floor() as i64);
        let least_motion = MOTION_MIN * self.explained(rows)[1] / rows.len() as f64;
        for piece in rows.chunk_by(|a, b| key(a) == key(b)) {
            let [explained, motion] = self.explained(piece);
            let is_explained =
                explained >= EXPLAINED_MIN * motion || motion < least_motion * piece.len() as f64;
            let own = alignment.own_lag_s(&self.field_rows(piece, clocks));
            let is_far = own.is_some_and(|[lag_s, standard_error_s]| {
                let most_s = STANDARD_ERRORS * standard_error_s * excess.sqrt();
                lag_s.abs() > 1e-6 * APART_PERIODS_MAX * self.period_us + most_s
            });
            if is_far || !is_explained {
                let movement = piece.first().map_or(0, |row| row.movement);
                return Err(ImportError::Astray { movement });
            }
        }
        Ok(())
    }
}

const UNSTEADY: ImportError = ImportError::UnsteadyClocks {
    most_ppm: RATE_MAX * 1e6,
};

fn middle_us(ticks: &[Tick]) -> f64 {
    let ends = ticks.first().zip(ticks.last());
    ends.map_or(0.0, |(first, last)| (first.t_us + last.t_us) / 2.0)
}

/// At most `most` of the ticks from all over them, in steps that no motion repeats in.
fn thinned(ticks: &[Tick], most: usize) -> impl Iterator<Item = Tick> {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let step = (ticks.len() as f64 / most as f64).max(1.0);
    let count = (ticks.len() as f64 / step) as usize;
    let place = move |k: usize| {
        let within = if step > 1.0 {
            (k as f64 * GOLDEN).fract()
        } else {
            0.0
        };
        ((k as f64 + within) * step) as usize
    };
    (0..count).filter_map(move |k| ticks.get(place(k)).copied())
}

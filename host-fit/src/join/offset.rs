//! The offset between the clocks and their difference in speed, from the motion that both records saw.
//!
//! A grid of one period finds the offset by correlation (`search.rs`): at the right offset each Hall
//! signal is about a sensitivity times the reading of the designed probe at the reference pose. (A fit by all
//! three axes of the reference would also explain a run shifted by a whole movement: each movement moves one
//! axis only, and some matrix turns any axis into any other.) From the minute with the most motion, offset
//! and rate are followed to the ends of the record: they are the lag of the reference and its rate in the fit
//! of the field model.

mod cause;
mod rows;
mod search;

use super::JoinError;
use super::node_clock::Tick;
use super::reference::{Reference, Sample};
use super::sensors::Sensors;
use hallstage_input::log::layout::Quantity;
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::clocks::{Alignment, Lag};
use nalgebra::Matrix3;
use rows::ReferencedTick;
use runtime::capacitive::vertical_per_gap;

/// The estimated offset between the clocks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offset {
    /// Time of the sensors' record less time of the reference in the middle of the record, us.
    pub us: f64,
    /// Relative speed of the sensors' clock to the clock of the reference, less one.
    pub rate: f64,
    /// Standard error of the rate.
    pub rate_standard_error: f64,
    /// Share of the Hall signals' motion that the reference explains.
    pub explained: f64,
    /// Ticks of the fit.
    pub ticks: usize,
    /// Standard error of the offset, at the end of the record where it is larger, us.
    pub standard_error_us: f64,
}

/// The clocks of node and reference.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clocks {
    /// Time of the node less time of the reference in the middle, us.
    us: f64,
    /// Relative speed of the node's clock to the clock of the reference, less one.
    rate: f64,
    /// The middle, us on the clock of the node.
    middle_us: f64,
}

impl Clocks {
    /// A time of the node on the clock of the reference, us.
    pub(super) fn on_reference_us(&self, node_us: f64) -> f64 {
        node_us - self.us - self.rate * (node_us - self.middle_us)
    }

    /// The same clocks with another middle.
    fn about(self, middle_us: f64) -> Self {
        Self {
            us: self.us + self.rate * (middle_us - self.middle_us),
            middle_us,
            ..self
        }
    }
}

/// Both records.
#[derive(Clone, Copy)]
pub(super) struct Records<'r> {
    ticks: &'r [Tick],
    /// The quantities of the reference.
    quantities: [Quantity; 3],
    /// The offsets to try, us, without the time of the recorder.
    range_us: [f64; 2],
    /// When the record starts, us on the clock of the node.
    start_us: f64,
    /// Time of the recorder less time of the node, us.
    recorder_us: f64,
    samples: &'r [Sample],
    stage: &'r Stage,
    /// The usual time from tick to tick, us.
    period_us: f64,
    /// The longer of the periods of the two records, us.
    longer_us: f64,
    /// The servo period, us.
    servo_us: f64,
    /// m or rad per unit of the reference's columns.
    scale: [f64; 3],
    /// Readings of the designed probes per X, Y, Rz.
    plane: Matrix3<f64>,
    /// Z, Rx, Ry per gap.
    per_gap: Matrix3<f64>,
}

/// Most ticks of a fit.
const FIT_TICKS: usize = 10_000;

/// The first stretch of the record that is fitted, us: a wrong rate moves little in it.
const STRETCH_US: f64 = 60e6;

/// Most minutes of the record that are tried as a start: the reference may have missed the liveliest.
const MINUTES: usize = 5;

/// Most steps for one stretch, and the size of the last one in standard errors.
const STEPS: usize = 4;
const SETTLED: f64 = 0.1;

/// Least share of the motion that must be explained: signals of another run reach a third by chance.
const EXPLAINED_MIN: f64 = 0.6;

/// Crystals differ by less. A larger difference means that the records do not belong together.
const RATE_MAX: f64 = 500e-6;

/// Length of a piece, us: a step of a clock shows within a piece.
const PIECE_US: f64 = 1e7;

/// Least motion of such a piece, relative to the mean motion of the record, to judge its explained share.
const MOTION_MIN: f64 = 0.02;

/// How far the offset of a piece may be off, in standard errors.
const STANDARD_ERRORS: f64 = 5.0;

/// Largest error of the correlation, in servo periods.
const COARSE_PERIODS_MAX: f64 = 2.0;

/// Largest standard error of the offset, in servo periods.
const STANDARD_ERROR_PERIODS_MAX: f64 = 0.1;

/// How far the offset of a piece may be off beyond its standard errors, in servo periods: it includes the
/// time that frames take.
const APART_PERIODS_MAX: f64 = 0.5;

impl<'r> Records<'r> {
    pub(super) fn new(sensors: &'r Sensors, reference: &'r Reference, stage: &'r Stage) -> Self {
        Self {
            ticks: &sensors.ticks,
            quantities: reference.quantities,
            range_us: [0.0; 2],
            start_us: sensors.start_us,
            recorder_us: sensors.recorder_us,
            samples: &reference.samples,
            period_us: sensors.period_us,
            longer_us: sensors.period_us.max(reference.period_us),
            servo_us: stage.servo_period_s * 1e6,
            scale: reference.quantities.map(|q| stage.log.column(q).scale),
            stage,
            // A checked stage has its sensors in a triangle.
            per_gap: vertical_per_gap(&stage.capacitive_probes_m).unwrap_or_default(),
            plane: stage.geometry().plane(),
        }
    }

    /// Finds the offset within `search_s` of a start: of `offset_us` (sensors less reference), or of a common start of
    /// both records. Without both arguments, wherever half of the shorter record has a partner.
    ///
    /// # Errors
    /// `NoOffset`, `UnsteadyClocks`, `UncertainOffset`, `Astray`, `Columns`, `Unit`.
    pub(super) fn estimate(
        mut self,
        offset_us: Option<f64>,
        search_s: Option<f64>,
    ) -> Result<(Clocks, Offset), JoinError> {
        self.range_us = self.range_us(offset_us, search_s.map(|search_s| search_s * 1e6));
        let minutes = self.liveliest();
        let mut outcome = Err(self.no_offset(0.0));
        for minute in minutes.into_iter().take(MINUTES) {
            let start = self.coarse(minute);
            self.check_unit(minute, &start)?;
            outcome = self.follow(start).map(|found| (start, found));
            if !matches!(outcome, Err(JoinError::NoOffset { .. })) {
                break;
            }
        }
        let (start, (found, offset)) = outcome.map_err(|error| self.cause(error))?;
        let most_us = STANDARD_ERROR_PERIODS_MAX * self.servo_us;
        if offset.standard_error_us > most_us {
            return Err(JoinError::UncertainOffset {
                standard_error_us: offset.standard_error_us,
                most_us,
            });
        }
        let moved_us = found.about(start.middle_us).us - start.us;
        if moved_us.abs() > COARSE_PERIODS_MAX * self.servo_us {
            return Err(self.cause(UNSTEADY));
        }
        Ok((found, offset))
    }

    /// Follows an offset from the first stretch about its middle over the whole record.
    ///
    /// # Errors
    /// `NoOffset`, `UnsteadyClocks`, `Astray`.
    fn follow(&self, start: Clocks) -> Result<(Clocks, Offset), JoinError> {
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
                let clocks = clocks.about(middle_us(self.ticks));
                let offset = Offset {
                    us: clocks.us + self.recorder_us,
                    rate: clocks.rate,
                    explained: share.max(self.share(&rows)?),
                    ticks: rows.len(),
                    rate_standard_error: lag.rate_standard_error,
                    standard_error_us: 1e6 * lag.standard_errors_s[0].max(lag.standard_errors_s[1]),
                };
                return Ok((clocks, offset));
            }
            stretch_us *= 4.0;
        }
    }

    /// One step of the fit, which moves the clocks.
    fn step(
        &self,
        alignment: &mut Alignment,
        rows: &[ReferencedTick],
        clocks: &mut Clocks,
    ) -> Result<Lag, JoinError> {
        let lag = alignment
            .step(&self.field_rows(rows, clocks))
            .ok_or(UNSTEADY)?;
        // A reference that lags is read too early.
        clocks.us -= 1e6 * lag.value_s;
        clocks.rate -= lag.rate;
        Ok(lag)
    }

    /// Checks that every piece of the record agrees with the offset of the whole.
    ///
    /// # Errors
    /// `Astray`.
    fn check_pieces(
        &self,
        alignment: &Alignment,
        rows: &[ReferencedTick],
        clocks: &Clocks,
        excess: f64,
    ) -> Result<(), JoinError> {
        let key = |row: &ReferencedTick| (row.movement, (row.tick.t_us / PIECE_US).floor() as i64);
        let least_motion = MOTION_MIN * self.explained(rows)[1] / rows.len() as f64;
        for piece in rows.chunk_by(|a, b| key(a) == key(b)) {
            let [explained, motion] = self.explained(piece);
            let is_explained =
                explained >= EXPLAINED_MIN * motion || motion < least_motion * piece.len() as f64;
            let own = alignment.own_lag_s(&self.field_rows(piece, clocks));
            let is_far = own.is_some_and(|[lag_s, standard_error_s]| {
                let most_s = STANDARD_ERRORS * standard_error_s * excess.sqrt();
                lag_s.abs() > 1e-6 * APART_PERIODS_MAX * self.servo_us + most_s
            });
            if is_far || !is_explained {
                let movement = piece.first().map_or(0, |row| row.movement);
                return Err(JoinError::Astray { movement });
            }
        }
        Ok(())
    }
}

const UNSTEADY: JoinError = JoinError::UnsteadyClocks {
    most_ppm: RATE_MAX * 1e6,
};

fn middle_us(ticks: &[Tick]) -> f64 {
    let ends = ticks.first().zip(ticks.last());
    ends.map_or(0.0, |(first, last)| (first.t_us + last.t_us) / 2.0)
}

/// At most `most` of the ticks, spread evenly at irregular distances, so that no motion repeats with them.
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

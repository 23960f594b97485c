//! The log of the interferometers.

use super::{JoinError, check_length};
use hallstage_input::log::cell::{CellFault, WHOLE_MAX};
use hallstage_input::log::header::{Header, Source};
use hallstage_input::log::layout::{Dimension, Quantity};
use hallstage_input::log::order::{Order, OrderCells};
use hallstage_input::log::rows::{ROTATION_MAX_RAD, displacement_max_m};
use hallstage_input::log::table::Table;
use hallstage_input::log::time::Clock;
use hallstage_input::log::{BadRows, LogError, LogProblem};
use hallstage_input::stage::Stage;
use hallstage_input::statistics::quantile;
use hallstage_input::text::TextReader;
use hallstage_input::watch::Watch;
use std::path::Path;

/// One sample of the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Its time, us.
    pub t_us: f64,
    /// Number of the movement.
    pub movement: i64,
    /// Three beams, or X, Y, Rz, in the units of the log's columns.
    pub values: [f64; 3],
}

/// The counts of a reference log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReferenceCounts {
    /// Rows.
    pub rows: usize,
    /// Skipped rows with a bad cell.
    pub bad: usize,
    /// Skipped rows with the time of the row before.
    pub duplicates: usize,
    /// Places with more than one and a half of the usual time between rows of a movement.
    pub gaps: usize,
    /// Movements that start their time anew; each is put one period after the last.
    pub restarts: usize,
    /// Whether there is a column for the movement; otherwise all rows are movement 0.
    pub has_movements: bool,
}

/// The places of the cells.
struct Cells {
    time: Source,
    movement: Option<Source>,
    values: [Value; 3],
}

/// A cell of a displacement or rotation.
struct Value {
    source: Source,
    /// Units of the log's column per unit of this column.
    log_units: f64,
    /// Largest sensible magnitude, m or rad.
    limit: f64,
    unit: &'static str,
}

/// A reference that holds its values for more rows than this on average is not sampled in each row.
const HELD_ROWS: f64 = 1.5;

/// A reference is too slow if a cubic misses its motion in more samples than this leaves. Fewer are spikes.
const MOST: f64 = 0.95;

/// Error of a cubic in the middle between samples, in fourth differences.
const CUBIC: f64 = 3.0 / 128.0;

/// A log of the reference.
pub(super) struct Reference {
    /// The quantities of the three values.
    pub(super) quantities: [Quantity; 3],
    /// In ascending order of time.
    pub(super) samples: Vec<Sample>,
    /// The median time from sample to sample, us.
    pub(super) period_us: f64,
    pub(super) counts: ReferenceCounts,
}

impl Reference {
    /// Reads a log; columns that the layout does not know are left out. Movements that start their
    /// time anew are put one period after the last, and repeated times are left out.
    ///
    /// # Errors
    /// `Log` for cells, time that runs backwards and movements that return; `NoReference`;
    /// `TooLong`.
    pub(super) fn read(
        path: &Path,
        bad_rows: BadRows,
        stage: &Stage,
        watch: Watch<'static>,
    ) -> Result<Self, JoinError> {
        let text = TextReader::open(path).map_err(LogError::from)?;
        let table = Table::open(text, |name| stage.log.knows(name))?;
        let mut table = table.watched(watch, "reading the reference");
        let (quantities, cells) = Cells::find(&table, stage)?;
        let movement = cells.movement;
        let period_us = table.period_us(cells.time, movement)?.unwrap_or_default();
        let places = OrderCells {
            time: cells.time,
            movement: movement.map(|source| source.cell),
        };
        let mut order = Order::new(places, period_us);
        let mut counts = ReferenceCounts {
            has_movements: movement.is_some(),
            ..ReferenceCounts::default()
        };
        let mut first_bad: Option<LogError> = None;
        let (mut samples, mut clock, mut shift_us) = (Vec::<Sample>::new(), Clock::default(), 0.0);
        while table.next_row()? {
            check_length(&table.head.path, counts.rows)?;
            counts.rows += 1;
            let mut sample = match cells.sample(&table, &mut clock) {
                Err(bad) => {
                    counts.bad += 1;
                    first_bad.get_or_insert(bad);
                    continue;
                }
                Ok(sample) => sample,
            };
            let (line, named) = (table.row_line(), Some(sample.movement));
            match order.take(&table.head, line, named, sample.t_us) {
                Err(LogError {
                    problem: LogProblem::DuplicatedRow { .. },
                    ..
                }) => {
                    counts.duplicates += 1;
                    continue;
                }
                taken => taken?,
            }
            sample.t_us += shift_us;
            if let Some(before) = samples.last() {
                let begins = sample.movement != before.movement;
                if begins && sample.t_us <= before.t_us {
                    let anew_us = before.t_us + period_us - sample.t_us;
                    shift_us += anew_us;
                    sample.t_us += anew_us;
                    counts.restarts += 1;
                }
                if sample.t_us <= before.t_us {
                    counts.duplicates += 1;
                    continue;
                }
                let is_gap = sample.t_us - before.t_us > 1.5 * period_us;
                counts.gaps += usize::from(!begins && is_gap);
            }
            if sample.t_us > WHOLE_MAX {
                let (value, limit, unit) = (sample.t_us, WHOLE_MAX, "us");
                let place = table.head.place(line, cells.time.cell, named);
                let fault = CellFault::Absurd { value, limit, unit };
                return Err(place.refuse(fault.into()).into());
            }
            samples.push(sample);
        }
        if let Some(bad) = first_bad.filter(|_| bad_rows == BadRows::Refuse) {
            return Err(bad.of_rows(counts.bad, counts.rows).into());
        }
        match samples.len() {
            0 | 1 => Err(JoinError::NoReference {
                path: table.head.path,
            }),
            _ => Ok(Self {
                quantities,
                samples,
                period_us,
                counts,
            }),
        }
    }
}

impl Reference {
    /// Checks that a cubic through four samples follows the motion: the fourth differences are small.
    ///
    /// # Errors
    /// `ReferenceTooSlow`, `ReferenceHeld`, `ReferenceSpikes`.
    pub(super) fn check_speed(&self, stage: &Stage) -> Result<(), JoinError> {
        let scale = self
            .quantities
            .map(|quantity| stage.log.column(quantity).scale);
        let mut errors_m = Vec::new();
        for five in self.samples.windows(5) {
            let is_even = five.windows(2).all(|pair| {
                let step_us = pair[1].t_us - pair[0].t_us;
                pair[0].movement == pair[1].movement && step_us < 1.5 * self.period_us
            });
            if is_even {
                // The third value may be a rotation.
                for (k, scale) in scale.iter().enumerate().take(2) {
                    let [a, b, c, d, e] = [0, 1, 2, 3, 4].map(|at| scale * five[at].values[k]);
                    errors_m.push(CUBIC * (a - 4.0 * b + 6.0 * c - 4.0 * d + e).abs());
                }
            }
        }
        let changes = self
            .samples
            .windows(2)
            .filter(|pair| pair[0].values != pair[1].values);
        let held_rows = self.samples.len() as f64 / (1 + changes.count()) as f64;
        let sum: f64 = errors_m.iter().map(|error_m| error_m * error_m).sum();
        let rms_m = (sum / f64::max(errors_m.len() as f64, 1.0)).sqrt();
        let most_m = quantile(&mut errors_m, MOST).unwrap_or_default();
        let limit_m = stage.hall.m_per_count;
        if rms_m <= limit_m {
            Ok(())
        } else if held_rows > HELD_ROWS {
            Err(JoinError::ReferenceHeld { rows: held_rows })
        } else if most_m <= limit_m {
            let largest_m = errors_m.iter().copied().fold(0.0, f64::max) / (6.0 * CUBIC);
            Err(JoinError::ReferenceSpikes {
                largest_um: largest_m * 1e6,
            })
        } else {
            Err(JoinError::ReferenceTooSlow {
                period_ms: self.period_us * 1e-3,
                rms_um: rms_m * 1e6,
            })
        }
    }
}

impl Cells {
    /// The beams, or X, Y, Rz where the log has those.
    fn find(table: &Table<'_>, stage: &Stage) -> Result<([Quantity; 3], Self), LogError> {
        let header = Header::new(&table.head, &stage.log)?;
        let [time] = header.all([Quantity::Time])?;
        let (quantities, [a, b, c]) = header.one_of(&Quantity::REFERENCES)?;
        let value = |quantity: Quantity, source: Source| {
            let (limit, unit) = match quantity.dimension() {
                Dimension::Angle => (ROTATION_MAX_RAD, "rad"),
                _ => (displacement_max_m(stage), "m"),
            };
            Value {
                source,
                log_units: source.scale / stage.log.column(quantity).scale,
                limit,
                unit,
            }
        };
        let [p, q, r] = quantities;
        let cells = Self {
            time,
            movement: header.find(Quantity::Movement),
            values: [value(p, a), value(q, b), value(r, c)],
        };
        Ok((quantities, cells))
    }

    /// The sample in the row in hand.
    fn sample(&self, table: &Table<'_>, clock: &mut Clock) -> Result<Sample, LogError> {
        let bad = |cell, movement, fault: CellFault| {
            let place = table.head.place(table.row_line(), cell, movement);
            place.refuse(fault.into())
        };
        let movement = self.movement.map_or(Ok(0), |Source { cell, .. }| {
            let number = table.cell(cell).whole("movement numbers");
            number.map_err(|fault| bad(cell, None, fault))
        })?;
        let number = |value: &Value| {
            let (at, scale) = (value.source.cell, value.source.scale);
            let cell = table.cell(at);
            cell.scaled(scale, value.limit, value.unit)
                .and_then(|_| Ok(cell.number()? * value.log_units))
                .map_err(|fault| bad(at, Some(movement), fault))
        };
        let [a, b, c] = &self.values;
        Ok(Sample {
            t_us: clock
                .t_us(table.cell(self.time.cell), self.time.scale)
                .map_err(|fault| bad(self.time.cell, Some(movement), fault))?,
            movement,
            values: [number(a)?, number(b)?, number(c)?],
        })
    }
}

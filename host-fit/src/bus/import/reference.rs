//! The log of the interferometers.

use super::ImportError;
use crate::input::log::LogError;
use crate::input::log::cell::{self, CellFault};
use crate::input::log::header::{Header, Source, UnknownColumns};
use crate::input::log::layout::Quantity;
use crate::input::log::table::Table;
use crate::input::log::time::Clock;
use crate::input::source;
use crate::input::stage::Stage;
use crate::input::text::TextReader;
use std::path::Path;

/// One sample of the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Its time, us.
    pub t_us: f64,
    /// Number of the movement.
    pub movement: i64,
    /// Three beams, or X, Y, Rz, in the units of their columns.
    pub values: [f64; 3],
}

/// A log of the reference.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    /// What the three values are.
    pub quantities: [Quantity; 3],
    /// The samples, in the order of time.
    pub samples: Vec<Sample>,
}

/// What a log of the reference held.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReferenceCounts {
    /// Rows.
    pub rows: usize,
    /// Rows that were left out: the time of the row before again.
    pub duplicates: usize,
    /// Places where more than one and a half of the usual time passes between rows of a
    /// movement.
    pub gaps: usize,
    /// Movements that started their time anew; each was put one period after the last.
    pub restarts: usize,
    /// Whether there is a column for the movement; without one everything is movement 0.
    pub has_movements: bool,
}

/// Which cells hold what.
struct Cells {
    time: Source,
    movement: Option<usize>,
    quantities: [Quantity; 3],
    values: [Source; 3],
}

/// Reads a log of the reference; columns that the layout does not know are left out.
///
/// # Errors
/// `Reference`, `NoReference`.
pub fn read(path: &Path, stage: &Stage) -> Result<(Reference, ReferenceCounts), ImportError> {
    let text = TextReader::open(path).map_err(LogError::from)?;
    let path = source::shown_name(path);
    let mut table = Table::open(text, |name| stage.log.knows(name))?;
    let cells = Cells::find(&table, stage)?;
    let mut samples: Vec<Sample> = Vec::new();
    let mut clock = Clock::default();
    let mut row_lines: Vec<usize> = Vec::new();
    while table.next_row()? {
        samples.push(cells.sample(&table, &mut clock)?);
        row_lines.push(table.row_line());
    }
    let mut counts = ReferenceCounts {
        rows: samples.len(),
        has_movements: cells.movement.is_some(),
        ..ReferenceCounts::default()
    };
    let backwards = |row: usize, movement, before_us: f64, t_us: f64| LogError::TimeBackwards {
        place: table.head.place(
            row_lines.get(row).copied().unwrap_or_default(),
            cells.time.cell,
            Some(movement),
        ),
        before_us: before_us.round() as i64,
        t_us: t_us.round() as i64,
    };
    let samples = in_order(samples, backwards, &mut counts)?;
    if samples.len() < 2 {
        return Err(ImportError::NoReference {
            path: path.to_owned(),
        });
    }
    let quantities = cells.quantities;
    Ok((
        Reference {
            quantities,
            samples,
        },
        counts,
    ))
}

impl Cells {
    /// The beams, or X, Y, Rz where a beam is missing.
    fn find(table: &Table<'_>, stage: &Stage) -> Result<Self, LogError> {
        let header = Header::new(&table.head, &stage.log, UnknownColumns::LeaveOut)?;
        let [time] = header.all([Quantity::Time])?;
        let (quantities, values) = match header.all(Quantity::BEAMS) {
            Ok(values) => (Quantity::BEAMS, values),
            Err(missing) => (
                Quantity::PLANAR,
                header.all(Quantity::PLANAR).map_err(|_| missing)?,
            ),
        };
        Ok(Self {
            time,
            movement: header.find(Quantity::Movement).map(|source| source.cell),
            quantities,
            values,
        })
    }

    /// The sample in the row in hand.
    fn sample(&self, table: &Table<'_>, clock: &mut Clock) -> Result<Sample, LogError> {
        let bad = |cell, movement, fault: CellFault| LogError::Cell {
            place: table.head.place(table.row_line(), cell, movement),
            fault,
        };
        let movement = self.movement.map_or(Ok(0), |at| {
            cell::whole(table.cell(at), "movement numbers").map_err(|fault| bad(at, None, fault))
        })?;
        let number = |source: &Source| {
            let at = source.cell;
            cell::number(table.cell(at)).map_err(|fault| bad(at, Some(movement), fault))
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

/// Puts movements that start their time anew one period after the last, leaves repeated times
/// out, counts gaps, and refuses time that runs backwards.
fn in_order(
    samples: Vec<Sample>,
    backwards: impl Fn(usize, i64, f64, f64) -> LogError,
    counts: &mut ReferenceCounts,
) -> Result<Vec<Sample>, LogError> {
    let mut steps: Vec<f64> = samples
        .windows(2)
        .filter_map(|pair| match pair {
            [a, b] if a.movement == b.movement && b.t_us > a.t_us => Some(b.t_us - a.t_us),
            _ => None,
        })
        .collect();
    let middle = steps.len() / 2;
    let period_us = if steps.is_empty() {
        0.0
    } else {
        *steps.select_nth_unstable_by(middle, f64::total_cmp).1
    };
    let mut kept: Vec<Sample> = Vec::with_capacity(samples.len());
    let mut shift_us = 0.0;
    for (row, mut sample) in samples.into_iter().enumerate() {
        sample.t_us += shift_us;
        if let Some(before) = kept.last() {
            let new = sample.movement != before.movement;
            if new && sample.t_us <= before.t_us {
                let anew_us = before.t_us + period_us - sample.t_us;
                shift_us += anew_us;
                sample.t_us += anew_us;
                counts.restarts += 1;
            }
            if sample.t_us == before.t_us {
                counts.duplicates += 1;
                continue;
            }
            if sample.t_us < before.t_us {
                return Err(backwards(row, sample.movement, before.t_us, sample.t_us));
            }
            if !new && sample.t_us - before.t_us > 1.5 * period_us {
                counts.gaps += 1;
            }
        }
        kept.push(sample);
    }
    Ok(kept)
}

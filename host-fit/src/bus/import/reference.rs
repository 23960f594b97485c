//! The log of the interferometers.

use super::{ImportError, text};
use crate::input::log::layout::{Column, Quantity};
use crate::input::stage::Stage;
use csv::StringRecord;
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
    time: (usize, Column),
    movement: Option<usize>,
    quantities: [Quantity; 3],
    values: [usize; 3],
}

/// Reads a log of the reference.
///
/// # Errors
/// `Unreadable`, `MissingColumn`, `BadRow`, `NoReference`.
pub fn read(path: &Path, stage: &Stage) -> Result<(Reference, ReferenceCounts), ImportError> {
    let bytes = text::read(path)?;
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes);
    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .delimiter(delimiter(bytes))
        .from_reader(bytes);
    let header = reader.headers().map_err(|error| bad_csv(path, &error))?;
    let cells = find(header, path, stage)?;
    let mut counts = ReferenceCounts {
        has_movements: cells.movement.is_some(),
        ..ReferenceCounts::default()
    };
    let mut samples: Vec<Sample> = Vec::new();
    let mut lines: Vec<u64> = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|error| bad_csv(path, &error))?;
        let line = record.position().map_or(0, csv::Position::line);
        let bad = |problem| ImportError::BadRow {
            path: path.to_owned(),
            line,
            problem,
        };
        samples.push(sample(&record, &cells).map_err(bad)?);
        lines.push(line);
    }
    counts.rows = samples.len();
    let samples = in_order(samples, &lines, path, &mut counts)?;
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

fn bad_csv(path: &Path, error: &csv::Error) -> ImportError {
    ImportError::BadRow {
        path: path.to_owned(),
        line: error.position().map_or(1, csv::Position::line),
        problem: match error.kind() {
            csv::ErrorKind::Utf8 { .. } => "not text".to_owned(),
            csv::ErrorKind::UnequalLengths {
                expected_len, len, ..
            } => format!("{len} cells where the header has {expected_len}"),
            _ => error.to_string(),
        },
    }
}

/// The separator that the header holds most of: comma, semicolon or tab.
fn delimiter(bytes: &[u8]) -> u8 {
    let mut lines = bytes.split(|b| *b == b'\n');
    let header = lines.find(|line| !line.trim_ascii().is_empty() && !line.starts_with(b"#"));
    let header = header.unwrap_or_default();
    let count = |separator: &u8| header.iter().filter(|b| *b == separator).count();
    // The last of equals wins: a comma, where there is none at all.
    *[b'\t', b';', b',']
        .iter()
        .max_by_key(|s| count(s))
        .unwrap_or(&b',')
}

fn find(header: &StringRecord, path: &Path, stage: &Stage) -> Result<Cells, ImportError> {
    let cell = |q: Quantity| {
        let name = &stage.log.column(q).name;
        header.iter().position(|found| found == name)
    };
    let missing = |q: Quantity| ImportError::MissingColumn {
        path: path.to_owned(),
        column: stage.log.column(q).name.clone(),
    };
    let three = |quantities: [Quantity; 3]| {
        let [a, b, c] = quantities;
        Some([cell(a)?, cell(b)?, cell(c)?])
    };
    let (quantities, values) = match (three(Quantity::BEAMS), three(Quantity::PLANAR)) {
        (Some(values), _) => (Quantity::BEAMS, values),
        (None, Some(values)) => (Quantity::PLANAR, values),
        (None, None) => {
            let absent = Quantity::BEAMS.into_iter().find(|q| cell(*q).is_none());
            return Err(missing(absent.unwrap_or(Quantity::BeamX)));
        }
    };
    let time = Quantity::Time;
    Ok(Cells {
        time: (
            cell(time).ok_or_else(|| missing(time))?,
            stage.log.column(time).clone(),
        ),
        movement: cell(Quantity::Movement),
        quantities,
        values,
    })
}

fn sample(record: &StringRecord, cells: &Cells) -> Result<Sample, String> {
    let number = |cell: usize| {
        let text = record.get(cell).unwrap_or_default();
        match text.parse::<f64>() {
            Ok(x) if x.is_finite() => Ok(x),
            _ => Err(format!("column {}: `{text}` is no number", cell + 1)),
        }
    };
    let (time, column) = &cells.time;
    let movement = match cells.movement {
        None => 0,
        Some(cell) => {
            let text = record.get(cell).unwrap_or_default();
            text.parse()
                .map_err(|_| format!("column {}: `{text}` is no movement number", cell + 1))?
        }
    };
    let [a, b, c] = cells.values;
    Ok(Sample {
        t_us: number(*time)? * column.scale,
        movement,
        values: [number(a)?, number(b)?, number(c)?],
    })
}

/// Puts movements that start their time anew one period after the last, leaves repeated times
/// out, counts gaps, and refuses time that runs backwards.
fn in_order(
    samples: Vec<Sample>,
    lines: &[u64],
    path: &Path,
    counts: &mut ReferenceCounts,
) -> Result<Vec<Sample>, ImportError> {
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
    for (mut sample, line) in samples.into_iter().zip(lines) {
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
                return Err(ImportError::BadRow {
                    path: path.to_owned(),
                    line: *line,
                    problem: "time runs backwards within a movement".to_owned(),
                });
            }
            if !new && sample.t_us - before.t_us > 1.5 * period_us {
                counts.gaps += 1;
            }
        }
        kept.push(sample);
    }
    Ok(kept)
}

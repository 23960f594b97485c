//! The header of a table: the cell of each quantity.

use super::ReferenceUse;
use super::cell::shown;
use super::error::{LogError, LogProblem, Place};
use super::layout::{Dimension, LogLayout, Meaning, Quantity, UnitFault};
use super::table::Head;
use crate::stage::Stage;

/// The cell of a quantity in each row.
#[derive(Clone, Copy, Debug)]
pub struct Source {
    /// Number of the cell, from 0.
    pub cell: usize,
    /// m, rad, us or codes per unit.
    pub scale: f64,
}

/// Three quantities and their cells.
pub type Set = ([Quantity; 3], [Source; 3]);

/// The columns of one log.
#[derive(Clone, Debug)]
pub(super) struct Columns {
    /// The columns that are left out, as messages name them.
    pub(super) unknown: Vec<String>,
    /// `None` if gaps in the time separate the movements.
    pub(super) movement: Option<Source>,
    pub(super) time: Source,
    pub(super) hall: [Source; 3],
    /// The gaps, or Z, Rx, Ry.
    pub(super) vertical: Set,
    /// The beams, or X, Y, Rz, or the commanded X, Y, Rz.
    pub(super) reference: Option<Set>,
    /// Temperatures of mount and body.
    pub(super) temperature: [Option<Source>; 2],
}

/// The cells of a row that hold quantities of the layout.
pub struct Header<'a> {
    table: &'a Head,
    layout: &'a LogLayout,
    /// The cell of each quantity that the table has.
    sources: [Option<Source>; Quantity::ALL.len()],
    /// The columns that hold no quantity of the layout, as messages name them.
    unknown: Vec<String>,
}

/// Finds the columns of a log.
pub(super) fn columns(
    table: &Head,
    stage: &Stage,
    reference: ReferenceUse,
) -> Result<Columns, LogError> {
    let layout = &stage.log;
    let header = Header::new(table, layout)?;
    let movement = match header.find(Quantity::Movement) {
        None if !layout.is_mapped(Quantity::Movement) => None,
        _ => Some(header.all([Quantity::Movement])?[0]),
    };
    let [time] = header.all([Quantity::Time])?;
    let hall = header.all(Quantity::HALL)?;
    let vertical = header.one_of(&Quantity::VERTICALS)?;
    let sets: &[[Quantity; 3]] = match reference {
        ReferenceUse::Commanded => &[Quantity::COMMANDED],
        _ => &Quantity::REFERENCES,
    };
    let is_there = sets.iter().flatten().any(|q| header.find(*q).is_some());
    let is_needed = is_there || reference == ReferenceUse::Required;
    let reference = is_needed.then(|| header.one_of(sets)).transpose()?;
    let is_pose = reference.is_some_and(|(set, _)| set == Quantity::PLANAR);
    if is_pose && stage.interferometer.corrects() {
        return Err(header.refused(LogProblem::PoseWithPlaces));
    }
    Ok(Columns {
        unknown: header.unknown,
        movement,
        time,
        hall,
        vertical,
        reference,
        temperature: stage.temperature.columns.each_ref().map(|column| {
            let cell = table
                .names
                .iter()
                .position(|name| Some(name) == column.as_ref())?;
            let scale = stage.temperature.scale_mc[0];
            Some(Source { cell, scale })
        }),
    })
}

impl<'a> Header<'a> {
    /// Finds the quantities of the layout among the columns. A column that has its exact name comes before one
    /// that is known by other words. Columns without a name, a meaning or a unit of their quantity are unknown.
    ///
    /// # Errors
    /// `RepeatedQuantity`, `NoUnit`, `NoVoltsPerCount`, `UnitsDisagree`.
    pub fn new(table: &'a Head, layout: &'a LogLayout) -> Result<Self, LogError> {
        let mut header = Self {
            table,
            layout,
            sources: [None; Quantity::ALL.len()],
            unknown: Vec::new(),
        };
        let mut exact = header.sources;
        for is_exact in [true, false] {
            for (cell, name) in table.names.iter().enumerate() {
                let refuse = |problem| Err(table.place(table.line, cell, None).refuse(problem));
                let meaning = layout.meaning(name);
                let is_copy = table.copies.iter().any(|(copy, _)| *copy == cell);
                let is_later = matches!(meaning, Meaning::Exact(_)) != is_exact;
                if is_later || is_copy || meaning == Meaning::Ignored {
                    continue;
                }
                let (quantity, scale) = match header.source(cell, name, meaning) {
                    Ok(Some(found)) if exact[found.0 as usize].is_none() => found,
                    Ok(_) => {
                        let end = if cell + 1 == table.names.len() {
                            " (the header ends with a separator)"
                        } else {
                            ""
                        };
                        let name = match name.as_str() {
                            "" => format!("column {} without a name{end}", cell + 1),
                            name => shown(name.as_bytes()),
                        };
                        if !header.unknown.contains(&name) {
                            header.unknown.push(name);
                        }
                        continue;
                    }
                    Err(problem) => return refuse(problem),
                };
                let earlier = header.sources[quantity as usize].replace(Source { cell, scale });
                if let Some(first) = earlier {
                    let first = first.cell + 1;
                    return refuse(LogProblem::RepeatedQuantity { first });
                }
            }
            exact = header.sources;
        }
        Ok(header)
    }

    /// A problem of the whole header, as an error.
    fn refused(&self, problem: LogProblem) -> LogError {
        Place::new(&self.table.path, self.table.line).refuse(problem)
    }

    /// The quantity of a column, and m, rad, us or codes per unit; `None` if it holds none.
    fn source(
        &self,
        cell: usize,
        name: &str,
        meaning: Meaning<'_>,
    ) -> Result<Option<(Quantity, f64)>, LogProblem> {
        let below = self.table.unit(cell);
        let (quantity, unit) = match meaning {
            Meaning::Ignored | Meaning::Unknown => return Ok(None),
            Meaning::Exact(quantity) => (quantity, None),
            Meaning::WithUnit(quantity, unit) => {
                let quantity = quantity.in_unit(unit.or(Some(below)));
                let kind = quantity.dimension();
                let fallback = match kind {
                    Dimension::Index | Dimension::Code => Some(below),
                    Dimension::Time if self.table.is_time(cell) => Some("iso"),
                    _ => (!below.is_empty()).then_some(below),
                };
                let Some(unit) = unit.or(fallback) else {
                    let (units, key) = (kind.units(), quantity.key());
                    let name = shown(name.as_bytes());
                    return Err(LogProblem::NoUnit { name, units, key });
                };
                (quantity, Some(unit))
            }
        };
        let scale = match unit.map(|unit| self.layout.scale(quantity, unit)) {
            None => self.layout.column(quantity).scale,
            Some(Ok(scale)) => scale,
            Some(Err(UnitFault::Unknown)) => return Ok(None),
            Some(Err(UnitFault::NoVoltsPerCount)) => {
                let table = quantity.table();
                return Err(LogProblem::NoVoltsPerCount { table });
            }
        };
        if self.disagrees(quantity, scale, below) {
            let below = shown(below.as_bytes());
            return Err(LogProblem::UnitsDisagree { below });
        }
        Ok(Some((quantity, scale)))
    }

    /// Whether the unit below the header contradicts the column: it is a unit of the same kind, and so is the scale of
    /// the column.
    fn disagrees(&self, quantity: Quantity, scale: f64, below: &str) -> bool {
        let kind = quantity.dimension();
        match (kind, kind.unit(below)) {
            (_, None) => false,
            (Dimension::Code, Some(_)) => self.layout.scale(quantity, below) != Ok(scale),
            (_, Some(unit)) => unit != scale.abs() && kind.has_unit(scale.abs()),
        }
    }

    /// The cell of a quantity, if the table has it.
    pub fn find(&self, quantity: Quantity) -> Option<Source> {
        self.sources[quantity as usize]
    }

    /// The cells of the quantities, or an error that names the first missing column.
    pub fn all<const N: usize>(&self, quantities: [Quantity; N]) -> Result<[Source; N], LogError> {
        let mut sources = [Source {
            cell: 0,
            scale: 1.0,
        }; N];
        for (source, quantity) in sources.iter_mut().zip(quantities) {
            *source = self.find(quantity).ok_or_else(|| {
                self.refused(LogProblem::MissingColumn {
                    column: self.layout.column(quantity).name.clone(),
                    key: quantity.key(),
                    unknown: self.unknown.clone(),
                })
            })?;
        }
        Ok(sources)
    }

    /// The cells of the first of these alternative sets that the table has; of the first set if it has none.
    ///
    /// # Errors
    /// `AmbiguousColumns`, `MissingColumn`.
    pub fn one_of(&self, sets: &[[Quantity; 3]]) -> Result<Set, LogError> {
        let present = |set: &[Quantity; 3]| set.iter().copied().find(|q| self.find(*q).is_some());
        let mut found = sets.iter().filter_map(|set| Some((*set, present(set)?)));
        let (first, second) = (found.next(), found.next());
        if let (Some((_, one)), Some((_, other))) = (first, second) {
            let [one, other] = [one, other].map(|q| self.layout.column(q).name.clone());
            return Err(self.refused(LogProblem::AmbiguousColumns { one, other }));
        }
        let set = first.map_or(sets[0], |(set, _)| set);
        Ok((set, self.all(set)?))
    }
}

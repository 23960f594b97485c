//! The header of a table: which cell of a row holds what.

use super::ReferenceUse;
use super::cell::shown;
use super::error::LogError;
use super::layout::{Kind, LogLayout, Meaning, Quantity, UnitFault};
use super::table::Head;
use super::time;
use std::path::Path;

/// A cell of each row that is read.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Source {
    /// Which cell, from 0.
    pub(crate) cell: usize,
    /// m, rad, us or codes per unit.
    pub(crate) scale: f64,
}

/// Where the vertical pose of a log comes from.
#[derive(Clone, Debug)]
pub(super) enum VerticalSource {
    /// Capacitive codes 1, 2, 3.
    Codes([Source; 3]),
    /// Z, Rx, Ry.
    Pose([Source; 3]),
}

/// Where the reference of a log comes from.
#[derive(Clone, Debug)]
pub(super) enum ReferenceSource {
    /// Beams X, Y1, Y2.
    Beams([Source; 3]),
    /// X, Y, Rz.
    Pose([Source; 3]),
    /// The log has none.
    Absent,
}

/// The columns of one log.
#[derive(Clone, Debug)]
pub(super) struct Columns {
    /// `None` where the movements are to be told by the time.
    pub(super) movement: Option<Source>,
    pub(super) time: Source,
    pub(super) hall: [Source; 3],
    pub(super) vertical: VerticalSource,
    pub(super) reference: ReferenceSource,
}

/// What to do with columns that the layout does not know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum UnknownColumns {
    /// Refuse the table: a misspelt name would be ignored without a word.
    Refuse,
    /// Leave them out: an instrument may record more than is asked for.
    LeaveOut,
}

/// The cells of a row that hold quantities of the layout.
pub(crate) struct Header<'a> {
    path: &'a Path,
    line: usize,
    layout: &'a LogLayout,
    /// Where each quantity is that is there.
    sources: [Option<Source>; 17],
}

/// Finds the columns of a log.
pub(super) fn columns(
    table: &Head,
    layout: &LogLayout,
    reference: ReferenceUse,
) -> Result<Columns, LogError> {
    let header = Header::new(table, layout, UnknownColumns::Refuse)?;
    let movement = match header.find(Quantity::Movement) {
        None if !layout.is_mapped(Quantity::Movement) => None,
        _ => Some(header.all([Quantity::Movement])?[0]),
    };
    let [time] = header.all([Quantity::Time])?;
    let hall = header.all(Quantity::HALL)?;
    let vertical = match header.one_set(Quantity::GAPS, Quantity::VERTICAL)? {
        Some(Quantity::Z) => VerticalSource::Pose(header.all(Quantity::VERTICAL)?),
        _ => VerticalSource::Codes(header.all(Quantity::GAPS)?),
    };
    let reference = match header.one_set(Quantity::BEAMS, Quantity::PLANAR)? {
        Some(Quantity::X) => ReferenceSource::Pose(header.all(Quantity::PLANAR)?),
        None if reference == ReferenceUse::IfPresent => ReferenceSource::Absent,
        _ => ReferenceSource::Beams(header.all(Quantity::BEAMS)?),
    };
    Ok(Columns {
        movement,
        time,
        hall,
        vertical,
        reference,
    })
}

impl<'a> Header<'a> {
    /// Finds the quantities of the layout among the columns.
    ///
    /// # Errors
    /// `UnnamedColumn`, `UnknownColumn`, `RepeatedColumn`, `NoUnit`, `NoVoltsPerCount`,
    /// `UnitsDisagree`.
    pub(crate) fn new(
        table: &'a Head,
        layout: &'a LogLayout,
        unknown: UnknownColumns,
    ) -> Result<Self, LogError> {
        let (path, line) = (table.path.as_path(), table.line);
        let mut header = Self {
            path,
            line,
            layout,
            sources: [None; 17],
        };
        for (cell, name) in table.names.iter().enumerate() {
            let found = header.source(table, cell, name);
            let found = match (found, unknown) {
                (Err(LogError::UnknownColumn { .. }), UnknownColumns::LeaveOut) => None,
                (Err(LogError::UnnamedColumn { .. }), UnknownColumns::LeaveOut) => None,
                (Err(LogError::NoUnit { .. }), UnknownColumns::LeaveOut) => None,
                (found, _) => found?,
            };
            let Some((quantity, scale)) = found else {
                continue;
            };
            let earlier = header.sources[quantity as usize].replace(Source { cell, scale });
            if let Some(first) = earlier {
                return Err(LogError::RepeatedColumn {
                    path: path.to_path_buf(),
                    line,
                    column: cell + 1,
                    first: first.cell + 1,
                    name: name.clone(),
                });
            }
        }
        Ok(header)
    }

    /// What a column holds, and m, rad, us or codes per unit; `None` if it is to be left out.
    fn source(
        &self,
        table: &Head,
        cell: usize,
        name: &str,
    ) -> Result<Option<(Quantity, f64)>, LogError> {
        let (path, line, column) = (self.path.to_path_buf(), self.line, cell + 1);
        let below = table.unit(cell);
        let unknown = || match name.is_empty() {
            true => LogError::UnnamedColumn {
                path: self.path.to_path_buf(),
                line,
                column,
            },
            false => LogError::UnknownColumn {
                path: self.path.to_path_buf(),
                line,
                column,
                name: shown(name.as_bytes()),
                known: Quantity::ALL
                    .map(|q| self.layout.column(q).name.as_str())
                    .join(", "),
            },
        };
        let (quantity, unit) = match self.layout.meaning(name) {
            Meaning::Ignored => return Ok(None),
            Meaning::Unknown => return Err(unknown()),
            Meaning::Exact(quantity) => (quantity, None),
            Meaning::WithUnit(quantity, unit) => {
                let kind = quantity.kind();
                let date = kind == Kind::Time && time::is_date_time(table.first_cell(cell));
                let fallback = match kind {
                    Kind::Index | Kind::Code => Some(below),
                    _ if date => Some("iso"),
                    _ => (!below.is_empty()).then_some(below),
                };
                let unit = unit.or(fallback).ok_or_else(|| LogError::NoUnit {
                    path: path.clone(),
                    line,
                    column,
                    name: shown(name.as_bytes()),
                    units: kind.units(),
                    key: quantity.key(),
                })?;
                (quantity, Some(unit))
            }
        };
        let scale = match unit {
            None => self.layout.column(quantity).scale,
            Some(unit) => match self.layout.scale(quantity, unit) {
                Ok(scale) => scale,
                Err(UnitFault::Unknown) => return Err(unknown()),
                Err(UnitFault::NoVoltsPerCount) => {
                    return Err(LogError::NoVoltsPerCount {
                        path,
                        line,
                        column,
                        name: shown(name.as_bytes()),
                        table: quantity.table(),
                    });
                }
            },
        };
        if self.disagrees(quantity, scale, below) {
            return Err(LogError::UnitsDisagree {
                path,
                line,
                column,
                name: shown(name.as_bytes()),
                below: shown(below.as_bytes()),
            });
        }
        Ok(Some((quantity, scale)))
    }

    /// Whether the unit below the header is another than that of the column: it is of the
    /// quantity's kind, and so is the scale of the column that of a unit.
    fn disagrees(&self, quantity: Quantity, scale: f64, below: &str) -> bool {
        let kind = quantity.kind();
        match (kind, kind.unit(below)) {
            (_, None) => false,
            (Kind::Code, Some(_)) => self.layout.scale(quantity, below) != Ok(scale),
            (_, Some(unit)) => unit != scale.abs() && kind.has_unit_of(scale.abs()),
        }
    }

    /// Where a quantity is, if the table has it.
    pub(crate) fn find(&self, quantity: Quantity) -> Option<Source> {
        self.sources[quantity as usize]
    }

    /// The cells of these quantities, or an error that names the first missing one.
    pub(crate) fn all<const N: usize>(
        &self,
        quantities: [Quantity; N],
    ) -> Result<[Source; N], LogError> {
        let missing = |quantity: &Quantity| self.find(*quantity).is_none();
        if let Some(quantity) = quantities.into_iter().find(missing) {
            return Err(LogError::MissingColumn {
                path: self.path.to_path_buf(),
                line: self.line,
                column: self.layout.column(quantity).name.clone(),
                key: quantity.key(),
            });
        }
        // All are there: checked above.
        let absent = Source {
            cell: usize::MAX,
            scale: f64::NAN,
        };
        Ok(quantities.map(|quantity| self.find(quantity).unwrap_or(absent)))
    }

    /// The first quantity of the set that has columns here, if any has.
    pub(crate) fn one_set(
        &self,
        one: [Quantity; 3],
        other: [Quantity; 3],
    ) -> Result<Option<Quantity>, LogError> {
        let present = |set: [Quantity; 3]| set.into_iter().find(|q| self.find(*q).is_some());
        match (present(one), present(other)) {
            (Some(a), Some(b)) => Err(LogError::AmbiguousColumns {
                path: self.path.to_path_buf(),
                line: self.line,
                one: self.layout.column(a).name.clone(),
                other: self.layout.column(b).name.clone(),
            }),
            (Some(_), None) => Ok(Some(one[0])),
            (None, Some(_)) => Ok(Some(other[0])),
            (None, None) => Ok(None),
        }
    }
}

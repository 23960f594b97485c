//! The header of a table: which cell of a row holds what.

use super::ReferenceUse;
use super::cell::shown;
use super::error::LogError;
use super::layout::{LogLayout, Quantity};
use super::table::Table;
use std::path::Path;

/// A cell of each row that is read.
#[derive(Clone, Debug)]
pub(crate) struct Source {
    /// Which cell, from 0.
    pub(crate) cell: usize,
    /// m, rad or us per unit.
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
    pub(super) movement: Source,
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
    /// Cell of each quantity that is there.
    cells: [Option<usize>; 17],
}

/// Finds the columns of a log.
pub(super) fn columns(
    table: &Table<'_>,
    layout: &LogLayout,
    reference: ReferenceUse,
) -> Result<Columns, LogError> {
    let header = Header::new(table, layout, UnknownColumns::Refuse)?;
    let [movement] = header.all([Quantity::Movement])?;
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
    /// `UnnamedColumn`, `UnknownColumn`, `RepeatedColumn`.
    pub(crate) fn new(
        table: &Table<'a>,
        layout: &'a LogLayout,
        unknown: UnknownColumns,
    ) -> Result<Self, LogError> {
        let (path, line) = (table.path, table.header_line());
        let owned = || path.to_path_buf();
        let mut cells = [None; 17];
        for (cell, name) in table.names().iter().enumerate() {
            if layout.ignores(name) {
                continue;
            }
            let column = cell + 1;
            let Some(quantity) = layout.quantity(name) else {
                if unknown == UnknownColumns::LeaveOut {
                    continue;
                }
                if name.is_empty() {
                    return Err(LogError::UnnamedColumn {
                        path: owned(),
                        line,
                        column,
                    });
                }
                return Err(LogError::UnknownColumn {
                    path: owned(),
                    line,
                    column,
                    name: shown(name.as_bytes()),
                    known: Quantity::ALL
                        .map(|q| layout.column(q).name.as_str())
                        .join(", "),
                });
            };
            if let Some(first) = cells[quantity as usize].replace(cell) {
                return Err(LogError::RepeatedColumn {
                    path: owned(),
                    line,
                    column,
                    first: first + 1,
                    name: name.clone(),
                });
            }
        }
        Ok(Self {
            path,
            line,
            layout,
            cells,
        })
    }

    /// The cell of a quantity, from 0, if the table has it.
    pub(crate) fn find(&self, quantity: Quantity) -> Option<usize> {
        self.cells[quantity as usize]
    }

    /// The cells of these quantities, or an error that names the first missing one.
    pub(crate) fn all<const N: usize>(
        &self,
        quantities: [Quantity; N],
    ) -> Result<[Source; N], LogError> {
        let missing = quantities.into_iter().find(|q| self.find(*q).is_none());
        if let Some(quantity) = missing {
            return Err(LogError::MissingColumn {
                path: self.path.to_path_buf(),
                line: self.line,
                column: self.layout.column(quantity).name.clone(),
                key: quantity.key(),
            });
        }
        Ok(quantities.map(|quantity| Source {
            // Present: checked above.
            cell: self.find(quantity).unwrap_or(usize::MAX),
            scale: self.layout.column(quantity).scale,
        }))
    }

    /// The first quantity of the set that has columns here, if any has.
    fn one_set(
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

//! The header of a log: which cell of a row holds what.

use super::ReferenceUse;
use super::cell::shown;
use super::error::LogError;
use super::layout::{LogLayout, Quantity};
use csv::ByteRecord;
use std::path::Path;

/// A cell of each row that is read.
#[derive(Clone, Debug)]
pub(super) struct Source {
    /// Which cell, from 0.
    pub(super) cell: usize,
    /// m, rad or us per unit.
    pub(super) scale: f64,
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
    /// Name of each column.
    pub(super) names: Vec<String>,
    pub(super) movement: Source,
    pub(super) time: Source,
    pub(super) hall: [Source; 3],
    pub(super) vertical: VerticalSource,
    pub(super) reference: ReferenceSource,
}

struct Header<'a> {
    path: &'a Path,
    line: usize,
    layout: &'a LogLayout,
    /// Cell of each quantity that is there.
    cells: [Option<usize>; 17],
}

/// Finds the columns in the header.
pub(super) fn columns(
    record: &ByteRecord,
    path: &Path,
    line: usize,
    layout: &LogLayout,
    reference: ReferenceUse,
) -> Result<Columns, LogError> {
    let name = |cell: &[u8]| String::from_utf8_lossy(cell.trim_ascii()).into_owned();
    let names: Vec<String> = record.iter().map(name).collect();
    let owned = || path.to_path_buf();
    if names.iter().all(|name| name.parse::<f64>().is_ok()) {
        return Err(LogError::NoHeader {
            path: owned(),
            line,
        });
    }
    if let [one] = names.as_slice() {
        return Err(LogError::NoSeparator {
            path: owned(),
            line,
            text: shown(one.as_bytes()),
        });
    }
    let mut cells = [None; 17];
    for (cell, name) in names.iter().enumerate() {
        if layout.ignores(name) {
            continue;
        }
        let column = cell + 1;
        if name.is_empty() {
            return Err(LogError::UnnamedColumn {
                path: owned(),
                line,
                column,
            });
        }
        let Some(quantity) = layout.quantity(name) else {
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
    let header = Header {
        path,
        line,
        layout,
        cells,
    };
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
        names,
        movement,
        time,
        hall,
        vertical,
        reference,
    })
}

impl Header<'_> {
    fn find(&self, quantity: Quantity) -> Option<usize> {
        self.cells[quantity as usize]
    }

    /// The cells of these quantities, or an error that names the first missing one.
    fn all<const N: usize>(&self, quantities: [Quantity; N]) -> Result<[Source; N], LogError> {
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

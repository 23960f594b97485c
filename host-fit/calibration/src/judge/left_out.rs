//! Rows that a fit left out of account: how many, and from where to where.

/// Where a row stands in the logs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RowPlace {
    /// The number of its log.
    pub log: usize,
    /// Its movement, by the number that the log gives it.
    pub movement: i64,
    /// Its time in the log, us.
    pub t_us: i64,
}

/// The rows that were left out of account.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LeftOut {
    /// Rows that were left out.
    pub rows: usize,
    /// Rows in all.
    pub of: usize,
    /// The first and the last row that was left out.
    pub span: Option<(RowPlace, RowPlace)>,
}

impl LeftOut {
    /// Takes the next row.
    pub fn take(&mut self, place: RowPlace, is_left_out: bool) {
        self.of += 1;
        if is_left_out {
            self.rows += 1;
            self.span = Some((self.span.map_or(place, |(first, _)| first), place));
        }
    }

    /// The part of the rows that was left out.
    pub fn share(&self) -> f64 {
        self.rows as f64 / self.of.max(1) as f64
    }
}

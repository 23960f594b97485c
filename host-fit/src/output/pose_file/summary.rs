//! How many rows of a pose file have which status.

use runtime::Status;

/// Rows by status.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StatusCounts {
    /// All rows.
    pub rows: usize,
    /// Rows with status 0.
    pub good: usize,
    /// Rows by bit of the status, in the order of [`Status::NAMES`]. Outside the calibrated
    /// range counts only where the pose was measured.
    by_bit: [usize; Status::NAMES.len()],
}

impl StatusCounts {
    /// Counts one more row.
    pub fn add(&mut self, status: Status) {
        self.rows += 1;
        if status.is_good() {
            self.good += 1;
            return;
        }
        for (count, (bit, _)) in self.by_bit.iter_mut().zip(&Status::NAMES) {
            *count += usize::from(status.any(*bit) && means_something(*bit, status));
        }
    }

    /// The bits that occur, with their names and how many rows have them.
    pub fn named(&self) -> impl Iterator<Item = (&'static str, usize)> {
        let counts = Status::NAMES.iter().zip(self.by_bit);
        counts
            .map(|((_, name), count)| (*name, count))
            .filter(|(_, count)| *count > 0)
    }
}

/// The bits for "outside the calibrated range" say nothing about a pose that is invalid.
fn means_something(bit: Status, status: Status) -> bool {
    match bit {
        Status::PLANAR_EXTRAPOLATED => !status.any(Status::PLANAR_INVALID),
        Status::VERTICAL_EXTRAPOLATED => !status.any(Status::VERTICAL_INVALID),
        _ => true,
    }
}

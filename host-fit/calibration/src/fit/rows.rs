//! The rows of a fit, and how much each counts.

use hallstage_input::dataset::{Dataset, Row};
use hallstage_solver::estimator::robust::{HALF, Loss};

/// The rows of a dataset that a fit uses.
#[derive(Clone, Debug)]
pub struct FittedRows {
    /// Their numbers, ascending.
    pub numbers: Vec<usize>,
    /// How much each of them counts: 0 to 1.
    pub weights: Vec<f64>,
    /// The loss that gave the weights.
    pub loss: Loss,
}

impl FittedRows {
    /// Rows that all count alike.
    pub fn alike(numbers: Vec<usize>) -> Self {
        Self {
            weights: vec![1.0; numbers.len()],
            numbers,
            loss: Loss::None,
        }
    }

    /// Numbers and weights of the rows that count.
    pub fn counted(&self) -> impl Iterator<Item = (usize, f64)> {
        let rows = self.numbers.iter().copied();
        rows.zip(self.weights.iter().copied())
            .filter(|(_, weight)| *weight > 0.0)
    }

    /// The rows that count less than half, ascending.
    pub fn outliers(&self) -> impl Iterator<Item = usize> {
        let rows = self.numbers.iter().copied().zip(&self.weights);
        rows.filter(|(_, weight)| **weight < HALF)
            .map(|(row, _)| row)
    }

    /// The rows of a log that are no outliers.
    pub fn sound<'r>(&self, dataset: &'r Dataset) -> impl Iterator<Item = &'r Row> {
        let mut outliers = self.outliers().peekable();
        let rows = dataset.rows.iter().enumerate();
        rows.filter(move |(row, _)| outliers.next_if_eq(row).is_none())
            .map(|(_, row)| row)
    }

    /// The weights of all rows of a dataset; 0 for rows that the fit does not use.
    pub fn weights_by_row(&self, dataset: &Dataset) -> Vec<f64> {
        let mut all = vec![0.0; dataset.rows.len()];
        for (row, weight) in self.counted() {
            all[row] = weight;
        }
        all
    }
}

//! Where in the logs named something was found.

use super::channels::LogSignals;
use crate::finding::{Code, Finding};
use crate::input::dataset::{Dataset, Movement};

/// A row of a dataset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    /// Its number.
    pub(super) row: usize,
    /// The number of its movement.
    pub(super) movement: usize,
    /// Its time in the log, us.
    pub(super) t_us: i64,
}

/// Rows of a channel that follow each other in a movement and have one value.
#[derive(Clone, Debug)]
pub(super) struct Run {
    pub(super) channel: usize,
    pub(super) first: Place,
    pub(super) len: usize,
    /// Whether all other channels stand still as well.
    pub(super) all_still: bool,
}

impl Run {
    /// The row after the last.
    pub(super) const fn end(&self) -> usize {
        self.first.row + self.len
    }
}

/// One log, for what is told of it.
#[derive(Clone, Copy)]
pub(super) struct Told<'a> {
    dataset: &'a Dataset,
    log: usize,
    /// How many there are.
    pub(super) rows: usize,
}

impl<'a> Told<'a> {
    /// Of a log of a dataset.
    pub(super) fn new(dataset: &'a Dataset, log: usize) -> Self {
        Self {
            dataset,
            log,
            rows: dataset.logs[log].rows.len(),
        }
    }

    /// The movements of the log.
    pub(super) fn movements(&self) -> usize {
        let of_log = |movement: &&Movement| movement.log == self.log;
        self.dataset.movements.iter().filter(of_log).count()
    }

    pub(super) fn movement_name(&self, place: &Place) -> String {
        let movement = &self.dataset.movements[place.movement];
        self.dataset.movement_name(movement)
    }

    /// "movement 3 at t_us = 4000".
    pub(super) fn place(&self, place: &Place) -> String {
        let t_us = place.t_us;
        format!("movement {} at t_us = {t_us}", self.movement_name(place))
    }

    /// The first of many, in words.
    pub(super) fn places(&self, places: &[Place]) -> String {
        const SHOWN: usize = 3;
        let shown: Vec<String> = places.iter().take(SHOWN).map(|p| self.place(p)).collect();
        let dots = if places.len() > SHOWN { ", ..." } else { "" };
        shown.join(", ") + dots
    }

    /// A warning about the whole log, or several of its movements.
    pub(super) fn warning(&self, code: Code, message: String) -> Finding {
        let message = match self.dataset.logs.len() {
            1 => message,
            _ => format!("{}: {message}", self.dataset.logs[self.log].path.display()),
        };
        Finding {
            message,
            ..crate::diagnose::warning(code)
        }
    }

    /// A warning about a place in the log.
    pub(super) fn warning_at(&self, code: Code, place: &Place, message: String) -> Finding {
        Finding {
            movement: Some(self.movement_name(place)),
            t_us: Some(place.t_us),
            ..self.warning(code, message)
        }
    }
}

impl LogSignals<'_> {
    /// The place of a row of the log.
    pub(super) fn at(&self, row: usize) -> Place {
        Place {
            row,
            movement: self.rows[row].movement,
            t_us: self.rows[row].t_us,
        }
    }

    /// The first places of many, in words.
    pub(super) fn places(&self, rows: &[usize]) -> String {
        let places: Vec<Place> = rows.iter().map(|&row| self.at(row)).collect();
        self.told.places(&places)
    }

    /// A warning about the whole log, or several of its movements.
    pub(super) fn warning(&self, code: Code, message: String) -> Finding {
        self.told.warning(code, message)
    }

    /// A warning about a place in the log.
    pub(super) fn warning_at(&self, code: Code, row: usize, message: String) -> Finding {
        self.told.warning_at(code, &self.at(row), message)
    }
}

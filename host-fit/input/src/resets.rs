//! Resets of the interferometers and slips of a beam that no column shows: beams jump, and the Hall probes do not.
//!
//! A movement ends there, so that each part has its own zero deviation.

use super::channels::runs;
use super::dataset::{Dataset, Movement, Row};
use super::stage::Interferometer;
use std::ops::Range;

/// Resets are rarer than one in this many rows.
const RARITY: usize = 100;
/// Rows on either side of a jump.
const ROWS: usize = 6;
/// The parabola through every other row on one side, half a row before the first.
const NEAR: [f64; 3] = [1.406_25, -0.562_5, 0.156_25];
/// The same without the first row.
const FAR: [f64; 3] = [2.406_25, -2.062_5, 0.656_25];
/// A jump without the rows beside it is the same within this part; a spike is not.
const STAYS_PART: f64 = 0.2;
/// Hall probes that jump by more than this part show a motion, ...
const HALL_PART: f64 = 0.4;
/// ... or jump by more than their noise, four standard deviations, m. A smaller jump of a beam may be a motion that starts
/// at once, which the noise hides. It costs less than 2 %.
const LEAST_M: f64 = 4.5e-6;

impl Dataset {
    /// Ends movements where beams jump and the probes do not, and returns the first rows of the new movements.
    pub fn split_at_resets(&mut self, interferometer: &Interferometer) -> Vec<usize> {
        let mut resets = Vec::new();
        for source in self.logs.iter().filter(|log| log.has_reference) {
            let run =
                |run: Range<usize>| source.rows.start + run.start..source.rows.start + run.end;
            let own = runs(self, source).into_iter().map(run).flat_map(|rows| {
                let found = in_run(&self.rows[rows.clone()], interferometer);
                found.into_iter().map(move |row| rows.start + row)
            });
            let own: Vec<usize> = own.collect();
            // Values that are held jump again and again.
            if own.len() * RARITY <= source.rows.len() {
                resets.extend(own);
            }
        }
        for &row in resets.iter().rev() {
            let number = self.rows[row].movement;
            let end = std::mem::replace(&mut self.movements[number].rows.end, row);
            let second = Movement {
                rows: row..end,
                ..self.movements[number]
            };
            self.movements.insert(number + 1, second);
            self.rows[row..]
                .iter_mut()
                .for_each(|row| row.movement += 1);
        }
        resets
    }
}

/// The first rows after jumps in consecutive rows.
fn in_run(rows: &[Row], interferometer: &Interferometer) -> Vec<usize> {
    let beams = |row: &Row| row.beams_m(interferometer);
    // The largest jump of a beam at a row, where it is no motion and stays.
    let jump = |here: usize| -> Option<f64> {
        let window = rows.get(here.checked_sub(ROWS)?..here + ROWS)?;
        let [near, far] = [NEAR, FAR].map(|weights| jumps(window, weights, beams));
        let most = near
            .iter()
            .fold(0.0, |most: f64, jump| most.max(jump.abs()));
        let stays = |k: usize| (far[k] - near[k]).abs() < STAYS_PART * most;
        let seen_m = jumps(window, NEAR, |row| row.signal_m).map(f64::abs);
        let is_seen = seen_m
            .iter()
            .any(|jump| *jump > f64::max(HALL_PART * most, LEAST_M));
        (most > LEAST_M && (0..3).all(stays) && !is_seen).then_some(most)
    };
    let all: Vec<Option<f64>> = (0..rows.len()).map(jump).collect();
    let is_largest = |here: &usize| {
        let around = &all[here.saturating_sub(ROWS)..(here + ROWS).min(all.len())];
        all[*here].is_some() && around.iter().all(|other| *other <= all[*here])
    };
    (0..rows.len()).filter(is_largest).collect()
}

/// Jumps in the middle of a window.
fn jumps(window: &[Row], weights: [f64; 3], of: impl Fn(&Row) -> [f64; 3]) -> [f64; 3] {
    let skipped = usize::from(weights == FAR);
    let mut sum = [0.0; 3];
    for (k, weight) in weights.into_iter().enumerate() {
        let away = skipped + 2 * k;
        let [before, after] = [ROWS - 1 - away, ROWS + away].map(|row| of(&window[row]));
        (0..3).for_each(|of| sum[of] += weight * (after[of] - before[of]));
    }
    sum
}

#[cfg(test)]
mod tests {
    use crate::dataset::{Dataset, Movement, Row};
    use crate::log::{self, ReadOptions};
    use crate::shipped::{RUN_GZ, stage};

    fn run() -> Dataset {
        let reading = log::read_bytes(RUN_GZ, "run".as_ref(), &stage(), &ReadOptions::FIT);
        reading.expect("a log").dataset
    }

    fn add(dataset: &mut Dataset, from: usize, to: usize, jump_um: [f64; 3]) {
        for row in &mut dataset.rows[from..to] {
            for (pose, jump_um) in row.reference.iter_mut().zip(jump_um) {
                *pose += 1e-6 * jump_um;
            }
        }
    }

    #[test]
    fn a_movement_ends_where_beams_jump_and_the_probes_do_not() {
        let interferometer = &stage().interferometer;
        let mut log = run();
        assert!(log.split_at_resets(interferometer).is_empty());
        let (end, count) = (log.rows.len(), log.movements.len());
        add(&mut log, 4321, end, [5.0, -3.0, 10.0]);
        add(&mut log, 9876, end, [-40.0, 0.0, 0.0]);
        assert_eq!(log.split_at_resets(interferometer), [4321, 9876]);
        assert_eq!(log.movements.len(), count + 2);
        for (number, movement) in log.movements.iter().enumerate() {
            let rows = &log.rows[movement.rows.clone()];
            assert!(rows.iter().all(|row| row.movement == number), "{number}");
        }
    }

    #[test]
    fn values_of_beams_that_are_held_end_no_movement() {
        let mut held = run();
        for rows in held.rows.chunks_mut(10) {
            let first = rows[0].reference;
            rows.iter_mut().for_each(|row| row.reference = first);
        }
        let mut sound = run();
        let rows = sound.rows.len();
        add(&mut sound, 4321, rows, [5.0, -3.0, 10.0]);
        // It is so for each log by itself.
        let (mut both, movements) = (held.clone(), held.movements.len());
        let later = |row: Row| Row {
            movement: row.movement + movements,
            ..row
        };
        both.rows.extend(sound.rows.into_iter().map(later));
        both.movements
            .extend(sound.movements.into_iter().map(|of| Movement {
                log: 1,
                rows: rows + of.rows.start..rows + of.rows.end,
                ..of
            }));
        both.end_log("sound");
        let interferometer = &stage().interferometer;
        assert!(held.split_at_resets(interferometer).is_empty());
        assert_eq!(both.split_at_resets(interferometer), [rows + 4321]);
    }

    #[test]
    fn spikes_and_motion_end_no_movement() {
        let interferometer = &stage().interferometer;
        let mut spike = run();
        add(&mut spike, 4321, 4322, [20.0, -15.0, 10.0]);
        assert!(spike.split_at_resets(interferometer).is_empty());
        let mut motion = run();
        let end = motion.rows.len();
        add(&mut motion, 4321, end, [20.0, -15.0, 0.0]);
        for row in &mut motion.rows[4321..] {
            let [a, b, c] = &mut row.signal_m;
            (*a, *b, *c) = (*a - 15e-6, *b - 15e-6, *c + 20e-6);
        }
        assert!(motion.split_at_resets(interferometer).is_empty());
        // A speed of 2 mm/s that starts at once.
        let mut start = run();
        for (k, row) in start.rows[4321..].iter_mut().enumerate() {
            row.reference[1] += 4e-6 * k as f64;
        }
        assert!(start.split_at_resets(interferometer).is_empty());
    }
}

//! Poses corrected by the motion that their log commands in X, Y, Rz and measures in Z, Rx, Ry.

use super::PoseRow;
use hallstage_input::dataset::{Dataset, Movement, Row};
use hallstage_input::log::LogRow;
use hallstage_solver::estimator::derivatives::SIDE_US;
use hallstage_solver::estimator::rows::measured_motion;
use runtime::{MotionCorrection, PlanarPose, Status};

/// Rows that are corrected at once.
const PIECE_ROWS: usize = 8192;

/// Poses of a movement. They wait for the next rows, which give speed and acceleration.
pub(super) struct Commanded<'a> {
    correction: &'a MotionCorrection,
    /// Rows with the commanded pose as reference; the last are the rows of the poses.
    rows: Vec<Row>,
    poses: Vec<PoseRow>,
    /// The last corrected pose: a held pose repeats it.
    last: PlanarPose<f32>,
}

impl<'a> Commanded<'a> {
    pub(super) const fn new(correction: &'a MotionCorrection) -> Self {
        Self {
            correction,
            rows: Vec::new(),
            poses: Vec::new(),
            last: PlanarPose::ZERO,
        }
    }

    /// Takes a pose with its row, and gives the poses of known motion.
    pub(super) fn take(&mut self, row: &LogRow, pose: PoseRow) -> Vec<PoseRow> {
        let is_due = row.begins || self.poses.len() >= PIECE_ROWS;
        let known = is_due.then(|| self.corrected(row.begins));
        self.rows.push(row.row);
        self.poses.push(pose);
        known.unwrap_or_default()
    }

    /// The corrected poses: all at the end of a movement, before it the poses of known motion.
    pub(super) fn corrected(&mut self, is_end: bool) -> Vec<PoseRow> {
        let known_us = match self.rows.last() {
            Some(last) if !is_end => last.t_us - SIDE_US,
            _ => i64::MAX,
        };
        let count = self.poses.partition_point(|pose| pose.t_us < known_us);
        let first = self.rows.len() - self.poses.len();
        let (log, index, rows) = (0, 0, 0..self.rows.len());
        let mut dataset = Dataset {
            rows: std::mem::take(&mut self.rows),
            movements: vec![Movement { log, index, rows }],
            ..Dataset::default()
        };
        let motion = measured_motion(&dataset, &vec![true; dataset.rows.len()]);
        let mut poses: Vec<PoseRow> = self.poses.drain(..count).collect();
        for (pose, motion) in poses.iter_mut().zip(&motion[first..]) {
            let (status, planar) = (pose.reading.status, &mut pose.reading.pose.planar);
            if !status.any(Status::PLANAR_INVALID) {
                self.last = (self.correction.correct(*planar, motion)).unwrap_or(*planar);
            }
            if !status.any(Status::PLANAR_INVALID) || status.any(Status::PLANAR_HELD) {
                *planar = self.last;
            }
        }
        let next = self.poses.first();
        let is_over = |row: &Row| next.is_none_or(|pose| row.t_us < pose.t_us - 2 * SIDE_US);
        self.rows = dataset
            .rows
            .split_off(dataset.rows.partition_point(is_over));
        poses
    }
}

//! The effect of an error of each channel on the Hall signals.

use hallstage_input::stage::Stage;
use hallstage_solver::estimator::probe::Probe;
use nalgebra::{Matrix3, Vector3};
use runtime::capacitive::vertical_per_gap;

/// The probes, and the changes of the pose by errors of the beams and the gaps.
pub(super) struct Slopes {
    probes: [Probe; 3],
    /// X, Y, Rz (m, m, rad) by an error of each beam, m.
    by_beam: Matrix3<f64>,
    /// Z, Rx, Ry (m, rad, rad) by an error of each gap, m.
    by_gap: Matrix3<f64>,
}

impl Slopes {
    pub(super) fn new(stage: &Stage, probes: [Probe; 3]) -> Self {
        Self {
            probes,
            by_beam: stage.interferometer.pose_per_beam(),
            // The sensors of a checked stage do not stand on one line.
            by_gap: vertical_per_gap(&stage.capacitive_probes_m).unwrap_or_default(),
        }
    }

    /// Changes of the residuals of A, B, C by an error of each of [`Channel::SINGLE`](hallstage_input::channel::Channel::SINGLE) at a pose.
    pub(super) fn at(&self, planar: [f64; 3], vertical: [f64; 3]) -> [Vector3<f64>; 9] {
        let here = self.probes.map(|probe| probe.read(planar, vertical));
        let by_beam = Matrix3::from_fn(|k, axis| here[k].by_pose[axis]) * self.by_beam;
        let by_gap = Matrix3::from_fn(|k, axis| here[k].by_vertical[axis]) * self.by_gap;
        std::array::from_fn(|channel| match channel {
            0..3 => Vector3::ith(channel, 1.0),
            3..6 => -by_beam.column(channel - 3),
            _ => -by_gap.column(channel - 6),
        })
    }
}

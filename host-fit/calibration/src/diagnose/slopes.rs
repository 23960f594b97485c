//! How an error of each channel shows in the Hall signals.

use crate::input::stage::Stage;
use crate::solve::field::probe::Probe;
use nalgebra::Vector3;
use runtime::capacitive::{vertical_pose, vertical_rows};

/// Hall A, B, C; beams X, Y1, Y2; gaps 1, 2, 3.
pub(super) const CHANNELS: [&str; 9] = [
    "hall_a", "hall_b", "hall_c", "ifm_x", "ifm_y1", "ifm_y2", "cap_1", "cap_2", "cap_3",
];

/// What a channel, or all of a kind, is called in a message.
pub(super) fn title(channel: &str) -> String {
    match channel.split_once('_') {
        Some(("hall", probe)) => format!("Hall {}", probe.to_uppercase()),
        Some(("cap", gap)) => format!("capacitive sensor {gap}"),
        Some((_, beam)) => format!("beam {}", beam.to_uppercase()),
        None if channel == "hall" => "all Hall probes".to_owned(),
        None if channel == "cap" => "all capacitive sensors".to_owned(),
        None => "all beams".to_owned(),
    }
}

/// Step of the derivative by Z, Rx, Ry: m, rad.
const STEP: f64 = 1e-6;

/// The probes, and the poses that errors of the reference and of the gaps make.
pub(super) struct Slopes {
    probes: [Probe; 3],
    /// X, Y, Rz (mm, mm, mrad) by an error of each beam, mm.
    per_beam: [[f64; 3]; 3],
    /// Z, Rx, Ry (m, rad, rad) by an error of each gap, mm.
    per_gap: [[f64; 3]; 3],
}

impl Slopes {
    pub(super) fn new(stage: &Stage, probes: [Probe; 3]) -> Self {
        // A checked stage has its sensors apart.
        let rows = vertical_rows(&stage.capacitive_probes_m).unwrap_or_default();
        let turn = 1.0 / stage.y_baseline_m;
        let of_gap = |gap: usize| {
            let gaps_m = [0, 1, 2].map(|k| if k == gap { 1e-3 } else { 0.0 });
            vertical_pose(&rows, gaps_m).to_array()
        };
        Self {
            probes,
            per_beam: [[1.0, 0.0, 0.0], [0.0, 0.5, turn], [0.0, 0.5, -turn]],
            per_gap: [0, 1, 2].map(of_gap),
        }
    }

    /// Changes of the residuals of A, B, C by an error of each of [`CHANNELS`] at a pose, both in mm.
    pub(super) fn at(&self, planar_mm: [f64; 3], vertical: [f64; 3]) -> [Vector3<f64>; 9] {
        let here = self.probes.map(|probe| probe.read(planar_mm, vertical));
        let by_planar = |axis: usize| Vector3::from(here.map(|reading| reading.by_pose[axis]));
        let by_planar = [0, 1, 2].map(by_planar);
        let by_vertical = [0, 1, 2].map(|axis| {
            let mut moved = vertical;
            moved[axis] += STEP;
            Vector3::from_fn(|k, _| {
                (self.probes[k].signal_mm(planar_mm, moved) - here[k].signal_mm) / STEP
            })
        });
        let along = |by: &[Vector3<f64>; 3], pose: [f64; 3]| {
            -(by[0] * pose[0] + by[1] * pose[1] + by[2] * pose[2])
        };
        std::array::from_fn(|channel| match channel {
            0..3 => Vector3::ith(channel, 1.0),
            3..6 => along(&by_planar, self.per_beam[channel - 3]),
            _ => along(&by_vertical, self.per_gap[channel - 6]),
        })
    }
}

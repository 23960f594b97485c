//! The interferometers: from the readings of the beams X, Y1, Y2 to the pose of the stage, and back.
//!
//! Without places of the beams the formulas of the paper hold: X = bx, Y = (b1 + b2)/2, Rz = atan((b1 - b2)/baseline).
//!
//! With places, each beam ends on a plane mirror of the rigid stage. At zero the mirror is square to the beam, and the
//! beam meets it at the place. The pose is the pose of the tool point. Places count from the tool point: it is the
//! origin of `stage.toml`. To first order, with the X beam at (y0, hx) and the Y beams at the height hy,
//!
//! X = bx - hx Ry + y0 Rz and Y = (b1 + b2)/2 + hy Rx.

use super::Input;
use crate::rotation::rotation;
use nalgebra::{Matrix3, Vector3};

/// A beam at zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Beam {
    /// Where it meets its mirror, from the tool point, m.
    pub(super) place_m: Vector3<f64>,
    /// Unit vector of its direction: the normal of its mirror.
    pub(super) direction: Vector3<f64>,
}

impl Beam {
    /// The displacement of the mirror along the beam, m.
    fn displacement_m(&self, rotation: &Matrix3<f64>, tool_m: &Vector3<f64>) -> f64 {
        let normal = rotation * self.direction;
        let moved = normal.dot(&(tool_m - self.place_m)) + self.direction.dot(&self.place_m);
        moved / normal.dot(&self.direction)
    }
}

/// The interferometers X, Y1, Y2 as `stage.toml` describes them.
#[derive(Clone, Debug, PartialEq)]
pub struct Interferometer {
    /// Distance between the two Y beams, m.
    pub y_baseline_m: f64,
    /// Displacements along the beams over their readings.
    scale: [f64; 3],
    /// The beams, where their places are known.
    beams: Option<[Beam; 3]>,
}

impl Interferometer {
    /// With these beams; `None` for the formulas of the paper.
    pub(super) const fn new(y_baseline_m: f64, scale: [f64; 3], beams: Option<[Beam; 3]>) -> Self {
        Self {
            y_baseline_m,
            scale,
            beams,
        }
    }

    /// Whether the places of the beams are known.
    pub const fn has_places(&self) -> bool {
        self.beams.is_some()
    }

    /// Whether poses differ from the formulas of the paper.
    pub fn corrects(&self) -> bool {
        self.has_places() || self.scale != [1.0; 3]
    }

    /// Where the beams X, Y1, Y2 meet their mirrors, from the tool point, m.
    pub fn places_m(&self) -> [[f64; 3]; 3] {
        let half_m = 0.5 * self.y_baseline_m;
        let on_axes = [[0.0; 3], [half_m, 0.0, 0.0], [-half_m, 0.0, 0.0]];
        let places = self
            .beams
            .map(|beams| beams.map(|beam| beam.place_m.into()));
        places.unwrap_or(on_axes)
    }

    /// This one with an error of one coordinate, one angle or the scale of its beams, one after the other, where the input
    /// is of the beams.
    pub fn with_error(&self, input: Input, error: f64) -> Vec<Self> {
        const X: [f64; 3] = [1.0, 0.0, 0.0];
        const Y1: [f64; 3] = [0.0, 1.0, 0.0];
        const Y2: [f64; 3] = [0.0, 0.0, 1.0];
        const BOTH: [f64; 3] = [0.0, 1.0, 1.0];
        let on_axes = |beam: usize| Beam {
            place_m: self.places_m()[beam].into(),
            direction: Vector3::ith(usize::from(beam > 0), 1.0),
        };
        let beams = self.beams.unwrap_or([0, 1, 2].map(on_axes));
        // The beams that are wrong, by how much, and along which axis.
        let moves: &[([f64; 3], usize)] = match input {
            Input::Baseline => &[([0.0, 0.5, -0.5], 0)],
            Input::BeamPlaces => &[(X, 1), (X, 2), (BOTH, 0), (Y1, 2), (Y2, 2)],
            Input::BeamAngles => &[(X, 1), (X, 2), (Y1, 0), (Y1, 2), (Y2, 0), (Y2, 2)],
            Input::BeamScale => {
                // Nobody knows how alike Y1 and Y2 are: in Y they add, in Rz they are independent.
                let apart = [0.0, 0.5f64.sqrt(), -0.5f64.sqrt()];
                let wrong = |shares: [f64; 3]| Self {
                    scale: [0, 1, 2].map(|k| self.scale[k] * (1.0 + 1e-6 * error * shares[k])),
                    ..self.clone()
                };
                return [X, BOTH, apart].map(wrong).to_vec();
            }
            _ => &[],
        };
        let moved = |(shares, axis): &([f64; 3], usize)| {
            let mut beams = beams;
            for (beam, share) in beams.iter_mut().zip(shares) {
                let off = Vector3::ith(*axis, share * error);
                match input {
                    Input::BeamAngles => beam.direction = (beam.direction + off).normalize(),
                    _ => beam.place_m += off,
                }
            }
            Self {
                beams: Some(beams),
                ..self.clone()
            }
        };
        moves.iter().map(moved).collect()
    }

    /// X, Y, Rz (m, m, rad) from the readings of the beams (m) and Z, Rx, Ry (m, rad, rad).
    pub fn pose(&self, readings_m: [f64; 3], vertical: [f64; 3]) -> [f64; 3] {
        let [x, y1, y2] = [0, 1, 2].map(|k| readings_m[k] * self.scale[k]);
        let Some(beams) = &self.beams else {
            // libm, not the platform's: the same bits everywhere.
            return [
                x,
                (y1 + y2) / 2.0,
                libm::atan((y1 - y2) / self.y_baseline_m),
            ];
        };
        // Newton's method with the slopes at zero: the error falls by the largest angle in each step.
        let inverse = self.pose_per_beam();
        let mut pose = inverse * Vector3::new(x, y1, y2);
        let mut last = f64::INFINITY;
        loop {
            let there = displacements_m(beams, pose.into(), vertical);
            let step = inverse * (Vector3::new(x, y1, y2) - Vector3::from(there));
            let size = step.amax();
            if size >= last || size.is_nan() {
                return pose.into();
            }
            pose += step;
            last = size;
        }
    }

    /// The readings of the beams (m) at a pose: X, Y, Rz (m, m, rad) and Z, Rx, Ry (m, rad, rad).
    pub fn beams_m(&self, planar: [f64; 3], vertical: [f64; 3]) -> [f64; 3] {
        let displacements_m = self.beams.as_ref().map_or_else(
            || {
                let [x, y, rz] = planar;
                let turned_m = 0.5 * self.y_baseline_m * libm::tan(rz);
                [x, y + turned_m, y - turned_m]
            },
            |beams| displacements_m(beams, planar, vertical),
        );
        self.readings_m(displacements_m)
    }

    /// The readings of the beams for displacements along them, m.
    pub fn readings_m(&self, displacements_m: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|k| displacements_m[k] / self.scale[k])
    }

    /// Change of the displacements along the beams by X, Y, Rz at zero.
    pub fn beams_per_pose(&self) -> Matrix3<f64> {
        let Some(beams) = &self.beams else {
            let half_m = 0.5 * self.y_baseline_m;
            return Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, half_m, 0.0, 1.0, -half_m);
        };
        let row = |Beam { place_m, direction }: &Beam| {
            let turned_m = place_m.x * direction.y - place_m.y * direction.x;
            nalgebra::RowVector3::new(direction.x, direction.y, turned_m)
        };
        Matrix3::from_rows(&beams.each_ref().map(row))
    }

    /// Change of X, Y, Rz by the displacements along the beams at zero.
    pub fn pose_per_beam(&self) -> Matrix3<f64> {
        let turn = 1.0 / self.y_baseline_m;
        let on_axes = Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0, turn, -turn);
        let inverse = self.beams.and_then(|_| self.beams_per_pose().try_inverse());
        // X, Y and Rz follow from the beams of a checked stage.
        inverse.unwrap_or(on_axes)
    }
}

fn displacements_m(beams: &[Beam; 3], [x, y, rz]: [f64; 3], [z, rx, ry]: [f64; 3]) -> [f64; 3] {
    let rotation = rotation([rx, ry, rz]);
    let tool_m = Vector3::new(x, y, z);
    beams.map(|beam| beam.displacement_m(&rotation, &tool_m))
}

#[cfg(test)]
mod tests;

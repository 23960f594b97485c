//! Poses corrected by the commanded motion, by the code that runs on the target.

use crate::arrays::{same_rows, slice, table};
use crate::decoder::WORDS;
use crate::error::wrong;
use numpy::PyReadonlyArray2;
use pyo3::prelude::*;
use runtime::{CommandedMotion, MotionCorrection, PlanarPose, Status};

/// The motion commanded at each row, and the correction of a blob.
pub struct Commanded<'py> {
    correction: MotionCorrection,
    velocity: PyReadonlyArray2<'py, f64>,
    acceleration: PyReadonlyArray2<'py, f64>,
}

impl<'py> Commanded<'py> {
    /// From the arguments of a call; `None` where they are not given.
    pub fn new(
        correction: Option<MotionCorrection>,
        velocity: Option<&Bound<'py, PyAny>>,
        acceleration: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Option<Self>> {
        let (velocity, acceleration) = match (velocity, acceleration) {
            (None, None) => return Ok(None),
            (Some(velocity), Some(acceleration)) => (velocity, acceleration),
            (Some(_), None) => return Err(wrong("acceleration", "is missing")),
            (None, Some(_)) => return Err(wrong("velocity", "is missing")),
        };
        let none = "the parameters have no motion correction";
        let correction = correction.ok_or_else(|| wrong("velocity, acceleration", none))?;
        Ok(Some(Self {
            correction,
            velocity: table("velocity", velocity, 3)?,
            acceleration: table("acceleration", acceleration, 6)?,
        }))
    }

    /// Corrects X, Y, Rz in the words of all rows. A held pose is the last corrected one.
    pub fn correct(&self, words: &mut [u32], of: &str) -> PyResult<()> {
        let (rows, _) = words.as_chunks_mut::<WORDS>();
        let (velocity, _) = slice(self.velocity.as_slice())?.as_chunks::<3>();
        let (acceleration, _) = slice(self.acceleration.as_slice())?.as_chunks::<6>();
        same_rows("velocity", velocity.len(), of, rows.len())?;
        same_rows("acceleration", acceleration.len(), of, rows.len())?;
        let mut last = [0; 3];
        let motions = velocity.iter().zip(acceleration);
        for (number, (row, (v, a))) in rows.iter_mut().zip(motions).enumerate() {
            let [x, y, rz, .., status] = row;
            let status = Status::from_bits(*status);
            if status.any(Status::PLANAR_INVALID) {
                if status.any(Status::PLANAR_HELD) {
                    [*x, *y, *rz] = last;
                }
                continue;
            }
            let commanded = CommandedMotion {
                velocity: v.map(|v| v as f32),
                acceleration: a.map(|a| a as f32),
            };
            let pose = PlanarPose::from_array([*x, *y, *rz].map(f32::from_bits));
            let corrected = self.correction.correct(pose, &commanded).ok_or_else(|| {
                wrong(
                    "velocity, acceleration",
                    format!("row {number}: not finite"),
                )
            })?;
            last = corrected.to_array().map(f32::to_bits);
            [*x, *y, *rz] = last;
        }
        Ok(())
    }
}

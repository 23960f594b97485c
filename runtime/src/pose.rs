//! The pose of the stage: its frame, its signs and the numbering of the sensors.
//!
//! ```text
//!                      Y
//!        B (-h2x, h2y) |      A (h1x, h1y)        A, B: Hall probes, sense +Y
//!              o       |       o                  C:    Hall probe, senses +X
//!                      |      C (h3x, h3y)        Z up, out of the page
//!                      |       o                  Rx, Ry, Rz right-handed
//!        g2            |             g1           g1, g2, g3: capacitive gaps
//!   -----+-------------O-------------+-----> X        g = Z + Rx y - Ry x
//!                      |
//!                      + g3
//! ```
//!
//! The origin O is the stage's centroid at its initial position; the pose is the stage's
//! displacement from there. Positions are given for the stage of `stage.toml`: the true
//! probe positions are what a calibration finds.

use crate::real::Real;
use serde::{Deserialize, Serialize};

/// `f` of each of three numbers with its counterpart. It is for code of every tick: at opt-level "s"
/// `array::from_fn` and nalgebra's operators become loops of three times the instructions.
#[inline(always)]
pub(crate) fn pairwise(a: [f32; 3], b: [f32; 3], f: impl Fn(f32, f32) -> f32) -> [f32; 3] {
    [f(a[0], b[0]), f(a[1], b[1]), f(a[2], b[2])]
}

/// Motion in the plane, by the Hall probes: X and Y in m, Rz in rad.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(C)]
pub struct PlanarPose<T> {
    /// Displacement along X, m.
    pub x_m: T,
    /// Displacement along Y, m.
    pub y_m: T,
    /// Rotation about Z, rad.
    pub rz_rad: T,
}

/// Motion out of the plane, by the capacitive sensors: Z in m, Rx and Ry in rad.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(C)]
pub struct VerticalPose<T> {
    /// Displacement along Z, m.
    pub z_m: T,
    /// Rotation about X, rad.
    pub rx_rad: T,
    /// Rotation about Y, rad.
    pub ry_rad: T,
}

/// All six degrees of freedom, as the target gives them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(C)]
pub struct Pose {
    /// X, Y, Rz.
    pub planar: PlanarPose<f32>,
    /// Z, Rx, Ry.
    pub vertical: VerticalPose<f32>,
}

impl<T: Real> PlanarPose<T> {
    /// No displacement.
    pub const ZERO: Self = Self {
        x_m: T::ZERO,
        y_m: T::ZERO,
        rz_rad: T::ZERO,
    };

    /// (X, Y, Rz) as an array, in m, m, rad.
    pub fn to_array(self) -> [T; 3] {
        [self.x_m, self.y_m, self.rz_rad]
    }

    /// From (X, Y, Rz) in m, m, rad.
    pub fn from_array([x_m, y_m, rz_rad]: [T; 3]) -> Self {
        Self { x_m, y_m, rz_rad }
    }
}

impl<T: Real> VerticalPose<T> {
    /// No displacement.
    pub const ZERO: Self = Self {
        z_m: T::ZERO,
        rx_rad: T::ZERO,
        ry_rad: T::ZERO,
    };

    /// (Z, Rx, Ry) as an array, in m, rad, rad.
    pub fn to_array(self) -> [T; 3] {
        [self.z_m, self.rx_rad, self.ry_rad]
    }

    /// From (Z, Rx, Ry) in m, rad, rad.
    pub fn from_array([z_m, rx_rad, ry_rad]: [T; 3]) -> Self {
        Self {
            z_m,
            rx_rad,
            ry_rad,
        }
    }
}

//! What a measurement model is, the models of the paper and the field model.
//!
//! A [`Model`] is a type: the coefficients of a probe, and the planar pose of one tick.
//! [`LinearModel`] is the paper's models; [`FieldModel`] adds the field beside the magnet's
//! centre line. A [`Decoder`](crate::Decoder) runs either without a choice in the tick. Two
//! enums name every model of a parameter set: [`ModelKind`] says which model was fitted,
//! [`Probes`] holds its coefficients.
//!
//! Sums are written out in a fixed order: they are the arithmetic of the target, to the bit.

mod field;
mod linear;

pub use field::{FieldModel, FieldProbe, Shape};
pub use linear::{
    LinearModel, Sensitivity, planar_pose, probe_displacement_m, sensitivity_at, zero_deviation_m,
    zero_pose,
};

use crate::pose::{PlanarPose, VerticalPose};
use crate::real::Real;
use core::fmt;
use core::fmt::Debug;
use serde::{Deserialize, Serialize};

/// A measurement model: how three Hall signals and a vertical pose become a planar pose.
///
/// One that the crate knows nothing of decodes as its own do:
///
/// ```
/// # use runtime::model::{LinearModel, Sensitivity, planar_pose, sensitivity_at, apply_gain};
/// # use runtime::{Decode, Decoder, Model, PlanarPose, RawFrame, VerticalPose, decoder::DecoderConstants, real::Real};
/// /// phi = eta + a Z + b Rx + c Ry + d Z^2.
/// #[derive(Clone, Copy, Debug, PartialEq)]
/// enum Bent {}
///
/// #[derive(Clone, Copy, Debug, PartialEq)]
/// struct BentProbe<T> {
///     linear: Sensitivity<T>,
///     per_z2_m2: T,
/// }
///
/// impl Model for Bent {
///     type Probe<T: Real> = BentProbe<T>;
///
///     fn planar_pose<T: Real>(
///         probes: &[BentProbe<T>; 3],
///         pose_rows: &[[T; 3]; 3],
///         signal: [T; 3],
///         gain_change: [T; 3],
///         vertical: &VerticalPose<T>,
///         zero: &PlanarPose<T>,
///     ) -> ([T; 3], PlanarPose<T>) {
///         let z2 = vertical.z_m * vertical.z_m;
///         let at = |p: &BentProbe<T>| sensitivity_at(&p.linear, vertical) + p.per_z2_m2 * z2;
///         let phi = [0, 1, 2].map(|k| apply_gain(at(&probes[k]), gain_change[k]));
///         (phi, planar_pose(pose_rows, signal, phi, zero))
///     }
/// }
///
/// // One code is 10 nm of Hall displacement or gap; PM and the capacitive plane are the simplest.
/// let rows = [[1e-8, 0.0, 0.0], [0.0, 1e-8, 0.0], [0.0, 0.0, 1e-8]];
/// let window = runtime::frame::CodeWindow { low: -32767, high: 32766 };
/// let constants = DecoderConstants {
///     vertical_per_code: rows,
///     planar_per_code: rows,
///     calibrated_vertical: [1e-3; 3],
///     calibrated_planar: [1e-3; 3],
///     sensitivity_min: 0.1,
///     hall_window: window,
///     capacitive_window: window,
///     ..DecoderConstants::default()
/// };
/// let linear = Sensitivity { eta: 1.0, per_z_m: 1000.0, per_rx_rad: 0.0, per_ry_rad: 0.0 };
/// // At Z = 0.1 mm.
/// let frame = RawFrame::new([1000, -500, 250], [10_000, 0, 0], 0, 0);
/// let read = |per_z2_m2| {
///     let decoder = Decoder::<Bent>::new(constants, [BentProbe { linear, per_z2_m2 }; 3]);
///     decoder.decode(&frame, &PlanarPose::ZERO)
/// };
/// // phi = 1 + 0.1 + 9e7 * 1e-8 = 2: half the displacement of the codes.
/// let pose = read(9e7).planar().expect("sound").to_array();
/// for (have, want) in pose.iter().zip([5e-6, -2.5e-6, 1.25e-6]) {
///     assert!((have - want).abs() < 1e-12);
/// }
/// let without = Decoder::<LinearModel>::new(constants, [linear; 3]);
/// assert_eq!(read(0.0), without.decode(&frame, &PlanarPose::ZERO));
/// // phi = 1 + 0.1 - 1.05: below the smallest one.
/// assert!(read(-1.05e8).planar().is_none());
/// ```
pub trait Model: Copy + Debug + PartialEq + 'static {
    /// The coefficients of one probe.
    type Probe<T: Real>: Copy + Debug + PartialEq + Send + Sync;

    /// The sensitivities G phi of the probes A, B, C at a vertical pose, and the planar pose less
    /// `zero`.
    ///
    /// `gain_change` is G - 1, 0 at the temperature of the calibration: see [`crate::temperature`].
    /// `pose_rows` are the rows X, Y, Rz of PM^-1 with the scale of `signal` in them, and
    /// `zero` is the zero deviation as a pose. To be straight-line code, the same
    /// instructions for every input: it is the heart of a tick. A phi near zero, or a result
    /// that is not finite, is the caller's to judge.
    fn planar_pose<T: Real>(
        probes: &[Self::Probe<T>; 3],
        pose_rows: &[[T; 3]; 3],
        signal: [T; 3],
        gain_change: [T; 3],
        vertical: &VerticalPose<T>,
        zero: &PlanarPose<T>,
    ) -> ([T; 3], PlanarPose<T>);
}

/// Which model was fitted.
///
/// The order is part of the blob's layout: add new kinds at the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(not(feature = "host"), non_exhaustive)]
pub enum ModelKind {
    /// Model (12): geometry only.
    M12,
    /// Model (15): geometry and constant sensitivity.
    M15,
    /// Model (30): as (15), with a zero deviation for each movement.
    M30,
    /// Model (31): as (30), with a sensitivity that follows the vertical pose.
    M31,
    /// The field model: as (31), with the field beside the magnet's centre line.
    Field,
}

impl fmt::Display for ModelKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::M12 => "Model (12)",
            Self::M15 => "Model (15)",
            Self::M30 => "Model (30)",
            Self::M31 => "Model (31)",
            Self::Field => "the field model",
        })
    }
}

/// The coefficients of the three probes, by the model that they belong to.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(not(feature = "host"), non_exhaustive)]
pub enum Probes<T> {
    /// Models (12), (15), (30) and (31): see [`LinearModel`].
    Linear([Sensitivity<T>; 3]),
    /// The field model: see [`FieldModel`].
    Field([FieldProbe<T>; 3]),
}

impl<T: Real> Probes<T> {
    /// [`Model::planar_pose`] of the model that the coefficients belong to: for tools. A tick
    /// does not choose its model, see [`crate::decoder::AnyDecoder`].
    pub fn planar_pose(
        &self,
        pose_rows: &[[T; 3]; 3],
        signal: [T; 3],
        gain_change: [T; 3],
        vertical: &VerticalPose<T>,
        zero: &PlanarPose<T>,
    ) -> ([T; 3], PlanarPose<T>) {
        match self {
            Self::Linear(probes) => {
                LinearModel::planar_pose(probes, pose_rows, signal, gain_change, vertical, zero)
            }
            Self::Field(probes) => {
                FieldModel::planar_pose(probes, pose_rows, signal, gain_change, vertical, zero)
            }
        }
    }

    /// eta, a, b, c of the probes A, B, C.
    pub const fn sensitivities(&self) -> [&Sensitivity<T>; 3] {
        match self {
            Self::Linear([a, b, c]) => [a, b, c],
            Self::Field([a, b, c]) => [&a.sensitivity, &b.sensitivity, &c.sensitivity],
        }
    }

    /// Each coefficient as another type of number, rounded to the nearest.
    #[must_use]
    pub fn rounded<U: Real>(&self) -> Probes<U> {
        match self {
            Self::Linear(probes) => Probes::Linear(probes.map(|probe| probe.rounded())),
            Self::Field(probes) => Probes::Field(probes.map(|probe| probe.rounded())),
        }
    }
}

/// G phi, from G - 1. At G = 1 it is phi, to the bit, if that is finite.
#[inline(always)]
pub fn apply_gain<T: Real>(phi: T, gain_change: T) -> T {
    phi + phi * gain_change
}

/// The product of a row and a column of three, summed from the left.
#[inline(always)]
pub fn dot<T: Real>(row: &[T; 3], column: [T; 3]) -> T {
    (row[0] * column[0] + row[1] * column[1]) + row[2] * column[2]
}

/// As [`dot`], less `offset`, which is subtracted from the first product: a core with a
/// multiply-and-subtract does both in one instruction.
#[inline(always)]
pub fn dot_less<T: Real>(row: &[T; 3], column: [T; 3], offset: T) -> T {
    ((row[0] * column[0] - offset) + row[1] * column[1]) + row[2] * column[2]
}

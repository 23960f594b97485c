//! The parameter set of one stage, as it lies in the blob, and the checks that it must pass.

use crate::decoder::{Decoder, DecoderConstants};
use crate::geometry::{ProbeGeometry, matrix};
use crate::model::{ModelKind, Sensitivity};
use heapless::String;
use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

/// A short text of a parameter set: at most 32 bytes of UTF-8.
pub type Text = String<32>;

/// Everything that the decoder needs, and what `inspect` and a later refit need.
///
/// The order of the fields is the blob's layout (see [`crate::blob`]).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParameterSet {
    /// Which model was fitted.
    pub model: ModelKind,
    /// Serial number of the stage; empty if none was given.
    pub serial: Text,
    /// When the set was made, as given by the user; empty if not given.
    pub created: Text,
    /// SHA-256 of the decompressed input logs, one after the other.
    pub logs_sha256: [u8; 32],
    /// How good the fit was.
    pub fit: FitRecord,
    /// Lever arms and misalignments.
    pub geometry: ProbeGeometry<f32>,
    /// Rows of PM (equation 32).
    pub plane: [[f32; 3]; 3],
    /// Rows of PM^-1.
    pub plane_inverse: [[f32; 3]; 3],
    /// Scale of the Hall codes.
    pub hall: HallInput,
    /// Scale and geometry of the capacitive codes.
    pub capacitive: CapacitiveInput,
    /// What the tick reads: the terms above, combined.
    pub constants: DecoderConstants<f32>,
}

/// How Hall codes become displacements at the designed sensitivity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HallInput {
    /// Displacement per code, m.
    pub m_per_code: f32,
}

/// How capacitive codes become the vertical pose.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CapacitiveInput {
    /// Rows Z, Rx, Ry of the plane matrix: m, rad, rad per m of gap change.
    pub vertical_per_m: [[f32; 3]; 3],
    /// Gap change per code, m.
    pub m_per_code: f32,
}

/// Errors of the fit over all rows of its logs, zero deviations refitted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FitRecord {
    /// Rows of the logs.
    pub rows: u32,
    /// Rows that the fit used.
    pub train_rows: u32,
    /// rms error of X, Y, Rz: m, m, rad.
    pub rms: [f32; 3],
    /// Peak error of X, Y, Rz: m, m, rad.
    pub peak: [f32; 3],
}

/// What is wrong with a parameter set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ParameterError {
    /// A number of this group is NaN or infinite.
    NotFinite {
        /// Which group of numbers.
        group: &'static str,
    },
    /// PM has no inverse: two probes sense the same motion.
    SingularPlane,
    /// The three capacitive sensors stand in one line and define no plane.
    CapacitiveProbesInLine,
    /// The stored PM^-1 is not the inverse of the stored PM.
    NotTheInverse {
        /// Largest element of PM PM^-1 - I, in magnitude.
        largest: f32,
    },
    /// A precomputed term does not follow from the terms that it was made of.
    Inconsistent {
        /// Which term.
        term: &'static str,
    },
    /// A value that must be above zero is not.
    NotPositive {
        /// Which value.
        value: &'static str,
    },
    /// phi comes nearer to zero than `sensitivity_min` within the calibrated vertical range.
    PoleInRange {
        /// Which probe, 0 to 2 for A to C.
        probe: u8,
    },
    /// A window of accepted codes is empty or reaches beyond 24 bits.
    UnsoundWindow {
        /// Which sensors' window.
        sensors: &'static str,
    },
}

impl core::fmt::Display for ParameterError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match *self {
            Self::NotFinite { group } => write!(f, "{group} holds a NaN or an infinity"),
            Self::SingularPlane => {
                f.write_str("the plane matrix PM has no inverse: two probes sense the same motion")
            }
            Self::CapacitiveProbesInLine => {
                f.write_str("the three capacitive sensors stand in one line and define no plane")
            }
            Self::NotTheInverse { largest } => write!(
                f,
                "the stored PM^-1 is not the inverse of PM (PM PM^-1 differs from I by {largest:e})"
            ),
            Self::Inconsistent { term } => {
                write!(
                    f,
                    "{term} does not follow from the values that it was made of"
                )
            }
            Self::NotPositive { value } => write!(f, "{value} must be above zero"),
            Self::PoleInRange { probe } => write!(
                f,
                "the sensitivity of probe {} comes too near zero within the calibrated range",
                ["A", "B", "C"].get(usize::from(probe)).unwrap_or(&"?")
            ),
            Self::UnsoundWindow { sensors } => write!(
                f,
                "the window of accepted {sensors} codes is empty or reaches beyond 24 bits"
            ),
        }
    }
}

impl core::error::Error for ParameterError {}

/// Largest element of PM PM^-1 - I that the check accepts: 100 times the rounding of `f32`
/// for lever arms of decimetres.
const INVERSE_TOLERANCE: f32 = 1e-5;

/// Largest relative difference between a precomputed term and the product of its parts:
/// four roundings of `f32`.
const PRODUCT_TOLERANCE: f32 = 5e-7;

impl ParameterSet {
    /// A decoder with this set's constants.
    pub const fn decoder(&self) -> Decoder {
        Decoder::new(self.constants)
    }

    /// PM as a matrix.
    pub fn plane_matrix(&self) -> Matrix3<f32> {
        matrix(&self.plane)
    }

    /// PM^-1 as a matrix.
    pub fn plane_inverse_matrix(&self) -> Matrix3<f32> {
        matrix(&self.plane_inverse)
    }

    /// eta of the probes A, B, C.
    pub const fn eta(&self) -> [f32; 3] {
        let [a, b, c] = &self.constants.sensitivity;
        [a.eta, b.eta, c.eta]
    }

    /// Checks that every number is finite, PM^-1 inverts PM, each precomputed term follows
    /// from its parts, scales and limits are above zero, code windows are sound and no phi
    /// comes near zero within the calibrated range.
    ///
    /// # Errors
    /// The first of these that does not hold.
    pub fn check(&self) -> Result<(), ParameterError> {
        self.check_finite()?;
        self.check_signs()?;
        self.check_products()?;
        let c = &self.constants;
        for (probe, s) in (0u8..).zip(&c.sensitivity) {
            if smallest_sensitivity(s, &c.calibrated_vertical) < c.sensitivity_min {
                return Err(ParameterError::PoleInRange { probe });
            }
        }
        Ok(())
    }

    fn check_finite(&self) -> Result<(), ParameterError> {
        let c = &self.constants;
        let sensitivity = |s: &Sensitivity<f32>| [s.eta, s.per_z_m, s.per_rx_rad, s.per_ry_rad];
        finite("the fit record", [self.fit.rms, self.fit.peak])?;
        finite(
            "the probe geometry",
            [self.geometry.lever_arm_m, self.geometry.misalignment_rad],
        )?;
        finite("PM", self.plane)?;
        finite("PM^-1", self.plane_inverse)?;
        finite(
            "the scales",
            [[self.hall.m_per_code, self.capacitive.m_per_code]],
        )?;
        finite(
            "the capacitive plane matrix",
            self.capacitive.vertical_per_m,
        )?;
        finite("the vertical constants", c.vertical_per_code)?;
        let [a, b, d] = &c.sensitivity;
        finite(
            "the sensitivities",
            [sensitivity(a), sensitivity(b), sensitivity(d)],
        )?;
        finite("the planar constants", c.planar_per_code)?;
        finite(
            "the calibrated range",
            [c.calibrated_vertical, c.calibrated_planar],
        )?;
        finite("the smallest sensitivity", [[c.sensitivity_min]])
    }

    fn check_signs(&self) -> Result<(), ParameterError> {
        let c = &self.constants;
        let positive = |value: &'static str, x: f32| {
            if x > 0.0 {
                Ok(())
            } else {
                Err(ParameterError::NotPositive { value })
            }
        };
        positive("the scale of the Hall codes", self.hall.m_per_code)?;
        positive(
            "the scale of the capacitive codes",
            self.capacitive.m_per_code,
        )?;
        positive("the smallest sensitivity", c.sensitivity_min)?;
        for limit in c.calibrated_planar.iter().chain(&c.calibrated_vertical) {
            if *limit < 0.0 {
                return Err(ParameterError::NotPositive {
                    value: "a calibrated range",
                });
            }
        }
        if !c.hall_window.is_sound() {
            return Err(ParameterError::UnsoundWindow { sensors: "Hall" });
        }
        if !c.capacitive_window.is_sound() {
            return Err(ParameterError::UnsoundWindow {
                sensors: "capacitive",
            });
        }
        Ok(())
    }

    fn check_products(&self) -> Result<(), ParameterError> {
        let difference = (self.plane_matrix() * self.plane_inverse_matrix() - Matrix3::identity())
            .iter()
            .fold(
                0.0f32,
                |largest, x| if x.abs() > largest { x.abs() } else { largest },
            );
        if difference > INVERSE_TOLERANCE {
            return Err(ParameterError::NotTheInverse {
                largest: difference,
            });
        }
        let c = &self.constants;
        let follows = |term, made: &[[f32; 3]; 3], from: &[[f32; 3]; 3], scale: f32| {
            for (made, from) in made.iter().flatten().zip(from.iter().flatten()) {
                let product = from * scale;
                if (made - product).abs() > PRODUCT_TOLERANCE * product.abs() + f32::MIN_POSITIVE {
                    return Err(ParameterError::Inconsistent { term });
                }
            }
            Ok(())
        };
        follows(
            "the planar constants",
            &c.planar_per_code,
            &self.plane_inverse,
            self.hall.m_per_code,
        )?;
        follows(
            "the vertical constants",
            &c.vertical_per_code,
            &self.capacitive.vertical_per_m,
            self.capacitive.m_per_code,
        )?;
        for (k, row) in self.plane.iter().enumerate() {
            let (sin, cos) = sin_cos_series(self.geometry.misalignment_rad[k]);
            let axis = if k < 2 { [-sin, cos] } else { [cos, sin] };
            let from = [axis[0], axis[1], self.geometry.lever_arm_m[k]];
            for (made, from) in row.iter().zip(from) {
                let near = (made - from).abs() <= INVERSE_TOLERANCE;
                if !near {
                    return Err(ParameterError::Inconsistent { term: "PM" });
                }
            }
        }
        Ok(())
    }
}

/// Sine and cosine of an angle in rad by their series, within 1e-6 up to a right angle and
/// wrong beyond it, where no misalignment lies. That is enough for a check, and a tenth of
/// the flash that functions for any angle take.
fn sin_cos_series(angle: f32) -> (f32, f32) {
    let square = angle * angle;
    let (mut sin, mut cos) = (1.0, 1.0);
    let mut k = 12.0;
    while k > 0.0 {
        cos = 1.0 - square / (k * (k - 1.0)) * cos;
        sin = 1.0 - square / (k * (k + 1.0)) * sin;
        k -= 2.0;
    }
    (angle * sin, cos)
}

/// The smallest |phi| over the box |Z|, |Rx|, |Ry| <= limits, or 0 when phi changes sign.
fn smallest_sensitivity(s: &Sensitivity<f32>, limits: &[f32; 3]) -> f32 {
    let swing = (s.per_z_m.abs() * limits[0] + s.per_rx_rad.abs() * limits[1])
        + s.per_ry_rad.abs() * limits[2];
    let smallest = s.eta.abs() - swing;
    if smallest > 0.0 { smallest } else { 0.0 }
}

fn finite<const N: usize, const M: usize>(
    group: &'static str,
    rows: [[f32; N]; M],
) -> Result<(), ParameterError> {
    if rows.iter().flatten().all(|x| x.is_finite()) {
        Ok(())
    } else {
        Err(ParameterError::NotFinite { group })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample;

    #[test]
    fn a_sensitivity_that_comes_near_zero_within_the_range_is_refused_and_its_probe_named() {
        let mut set = sample::parameters();
        assert_eq!(set.check(), Ok(()));
        set.constants.calibrated_vertical = [250e-6, 0.0, 0.0];
        for (probe, sensitivity) in (0u8..).zip([0, 1, 2]) {
            let mut set = set.clone();
            let s = &mut set.constants.sensitivity[sensitivity];
            s.eta = 0.85;
            s.per_z_m = 2900.0;
            assert_eq!(set.check(), Ok(()));
            set.constants.sensitivity[sensitivity].per_z_m = 3100.0;
            assert_eq!(set.check(), Err(ParameterError::PoleInRange { probe }));
        }
    }
}

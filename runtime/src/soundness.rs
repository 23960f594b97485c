//! The checks that a parameter set must pass, on the host as on the target.

use crate::frame::CODE_MAGNITUDE_MAX;
use crate::geometry::SensingAxes;
use crate::layout;
use crate::matrix::{from_rows, to_rows};
use crate::model::{FieldProbe, Probes, Sensitivity};
use crate::parameters::{ParameterError, ParameterSet, RANGE_MAX};
use core::f32::consts::{PI, TAU};
use nalgebra::Matrix3;

/// Largest element of PM PM^-1 - I that the check accepts: 100 times the rounding of `f32`
/// for lever arms of decimetres.
const INVERSE_TOLERANCE: f32 = 1e-5;

/// Largest relative difference between a precomputed term and the product of its parts:
/// four roundings of `f32`.
const PRODUCT_TOLERANCE: f32 = 5e-7;

/// Largest element of A that the check accepts. A coil at 5 cm or an arm of 80 Hz gives up to 1.1e-5 s2 in X
/// and Y, and 2e-4 rad per m/s2 where the probes stand 5 cm apart. The same in um would be 1 and more.
const ACCELERATION_MAX: f32 = 1e-2;

/// Largest element of L that the check accepts. A probe that is 2 ms late gives up to 2e-3 s in X and Y, and
/// 4e-2 rad/m where the probes stand 5 cm apart. The same in ms would be 1 and more.
const VELOCITY_MAX: f32 = 0.1;

impl ParameterSet {
    /// Checks that every number is finite, PM^-1 inverts PM, each precomputed term follows
    /// from its parts, scales and limits are above zero, ranges at most [`RANGE_MAX`], code windows
    /// sound, a motion correction as small as on a stage, and no phi comes near zero within the calibrated
    /// range. Of a field model lateral rows must be across the sensing axes, and the slopes of p below 1 in
    /// that range.
    ///
    /// # Errors
    /// The first condition that does not hold.
    pub fn check(&self) -> Result<(), ParameterError> {
        layout::check_finite(&mut self.clone())?;
        self.check_terms()
    }

    /// The checks of [`ParameterSet::check`] for a set of finite numbers.
    pub(crate) fn check_terms(&self) -> Result<(), ParameterError> {
        self.check_signs()?;
        self.check_inverse()?;
        self.check_products()?;
        self.check_motion()?;
        let c = &self.constants;
        for (probe, s) in (0u8..).zip(self.probes.sensitivities()) {
            if smallest_sensitivity(s, &c.calibrated_vertical) < c.sensitivity_min {
                return Err(ParameterError::PoleInRange { probe });
            }
        }
        let t = &c.temperature;
        let [mount, body] = t.reach_mk;
        let in_24_bits = (mount | body) < CODE_MAGNITUDE_MAX.cast_unsigned();
        for (probe, [k, h]) in (0u8..).zip(&t.per_mk) {
            let change = k.abs() * (mount as f32) + h.abs() * (body as f32);
            // A sensor that is not there has no effect.
            let unused = (mount == 0 && *k != 0.0) || (body == 0 && *h != 0.0);
            let moderate = in_24_bits && change < 0.5 && !unused;
            if !moderate {
                return Err(ParameterError::LargeTemperatureChange { probe });
            }
        }
        match &self.probes {
            Probes::Linear(_) => Ok(()),
            Probes::Field(probes) => self.check_slopes(probes),
        }
    }

    fn check_signs(&self) -> Result<(), ParameterError> {
        let c = &self.constants;
        let scales = [
            ("the scale of the Hall codes", self.hall.m_per_code),
            (
                "the scale of the capacitive codes",
                self.capacitive.m_per_code,
            ),
            ("the smallest sensitivity", c.sensitivity_min),
        ];
        for (value, x) in scales {
            if x <= 0.0 {
                return Err(ParameterError::NotPositive { value });
            }
        }
        for limit in c.calibrated_planar.iter().chain(&c.calibrated_vertical) {
            if *limit < 0.0 {
                return Err(ParameterError::NotPositive {
                    value: "a calibrated range",
                });
            }
            if *limit > RANGE_MAX {
                return Err(ParameterError::LargeRange { reach: *limit });
            }
        }
        for (sensors, window) in [
            ("Hall", &c.hall_window),
            ("capacitive", &c.capacitive_window),
        ] {
            if !window.is_sound() {
                return Err(ParameterError::UnsoundWindow { sensors });
            }
        }
        Ok(())
    }

    fn check_motion(&self) -> Result<(), ParameterError> {
        let Some(motion) = &self.motion_correction else {
            return Ok(());
        };
        let large = |matrix: &[f32], most| matrix.iter().any(|x| x.abs() > most);
        if large(motion.acceleration_s2.as_flattened(), ACCELERATION_MAX)
            || large(motion.velocity_s.as_flattened(), VELOCITY_MAX)
        {
            return Err(ParameterError::LargeMotionCorrection);
        }
        Ok(())
    }

    fn check_inverse(&self) -> Result<(), ParameterError> {
        let off = product(&self.plane, &self.plane_inverse) - Matrix3::identity();
        // A sum of overflows is no number, and larger than any.
        let larger = |largest, off| if off <= largest { largest } else { off };
        let largest = off.iter().map(|off| off.abs()).fold(0.0, larger);
        if largest <= INVERSE_TOLERANCE {
            Ok(())
        } else {
            Err(ParameterError::NotTheInverse { largest })
        }
    }

    fn check_products(&self) -> Result<(), ParameterError> {
        let c = &self.constants;
        check_scaled(
            "the planar constants",
            &c.planar_per_code,
            &self.plane_inverse,
            self.hall.m_per_code,
        )?;
        check_scaled(
            "the vertical constants",
            &c.vertical_per_code,
            &self.capacitive.vertical_per_m,
            self.capacitive.m_per_code,
        )?;
        let (axes, arms) = SensingAxes::from_plane(&self.plane);
        let lengths = axes.0.map(|[x, y]| x * x + y * y);
        let mut turned = axes.misalignment_rad();
        for (found, stored) in turned.iter_mut().zip(self.geometry.misalignment_rad) {
            // The theta of a probe mounted the other way round may go on beyond a half turn.
            if stored - *found > PI {
                *found += TAU;
            } else if *found - stored > PI {
                *found -= TAU;
            }
        }
        check_near("PM", &turned, &self.geometry.misalignment_rad)?;
        check_near("PM", &arms, &self.geometry.lever_arm_m)?;
        check_near("PM", &lengths, &[1.0; 3])?;
        match &self.probes {
            Probes::Linear(_) => Ok(()),
            Probes::Field(probes) => self.check_lateral(probes),
        }
    }

    /// Within the calibrated range the terms of a field model change a displacement by less than
    /// it changes itself.
    fn check_slopes(&self, probes: &[FieldProbe<f32>; 3]) -> Result<(), ParameterError> {
        let c = &self.constants;
        let codes = c.calibrated_planar.map(|q| q / self.hall.m_per_code);
        let (along, across) = (to_rows(&self.plane), to_rows(&self.lateral(probes)));
        for (k, ((probe, along), across)) in (0..).zip(probes.iter().zip(&along).zip(&across)) {
            let (u, w) = (reach(along, &codes), reach(across, &codes));
            let zr = swing(&probe.sensitivity, &c.calibrated_vertical);
            let [per_u, per_w] = probe.steepest_slopes(u, w, zr);
            let is_gentle = per_u < 1.0 && per_w < 1.0;
            if !is_gentle {
                return Err(ParameterError::SteepInRange { probe: k });
            }
        }
        Ok(())
    }

    /// W: displacement across the axes of the probes per (X, Y, Rz).
    #[inline(never)]
    fn lateral(&self, probes: &[FieldProbe<f32>; 3]) -> Matrix3<f32> {
        let rows = probes.each_ref().map(|probe| probe.lateral);
        product(&from_rows(&rows), &self.plane)
    }

    /// The lateral rows of a field model, times PM, begin with the unit vectors across the
    /// sensing axes; the rest is where the probes stand.
    fn check_lateral(&self, probes: &[FieldProbe<f32>; 3]) -> Result<(), ParameterError> {
        let [along_x, along_y, _]: [[f32; 3]; 3] = self.plane.into();
        let [across_x, across_y, _]: [[f32; 3]; 3] = self.lateral(probes).into();
        check_near("the lateral rows", &across_x, &along_y.map(|y| -y))?;
        check_near("the lateral rows", &across_y, &along_x)
    }
}

/// By columns: the product of the library may panic, for all that a compiler sees without link-time optimisation.
#[inline(never)]
fn product(a: &Matrix3<f32>, b: &Matrix3<f32>) -> Matrix3<f32> {
    let [[x0, x1, x2], [y0, y1, y2], [z0, z1, z2]]: [[f32; 3]; 3] = (*a).into();
    let columns: [[f32; 3]; 3] = (*b).into();
    let dot = |row: [f32; 3], [p, q, r]: [f32; 3]| row[0] * p + row[1] * q + row[2] * r;
    let rows = [[x0, y0, z0], [x1, y1, z1], [x2, y2, z2]];
    columns
        .map(|column| rows.map(|row| dot(row, column)))
        .into()
}

/// Refuses a difference beyond rounding from the values that a term was made of: m, rad or 1.
#[inline(never)]
fn check_near(term: &'static str, made: &[f32; 3], from: &[f32; 3]) -> Result<(), ParameterError> {
    for (made, from) in made.iter().zip(from) {
        let follows = (made - from).abs() <= INVERSE_TOLERANCE;
        if !follows {
            return Err(ParameterError::Inconsistent { term });
        }
    }
    Ok(())
}

#[inline(never)]
fn check_scaled(
    term: &'static str,
    made: &[[f32; 3]; 3],
    from: &Matrix3<f32>,
    scale: f32,
) -> Result<(), ParameterError> {
    for (made, from) in (made.as_flattened().iter()).zip(to_rows(from).as_flattened()) {
        let product = from * scale;
        let allowed = PRODUCT_TOLERANCE * product.abs() + f32::MIN_POSITIVE;
        let follows = (made - product).abs() <= allowed;
        if !follows {
            return Err(ParameterError::Inconsistent { term });
        }
    }
    Ok(())
}

/// The smallest |phi| over the box |Z|, |Rx|, |Ry| <= limits, or 0 when phi changes sign.
fn smallest_sensitivity(s: &Sensitivity<f32>, limits: &[f32; 3]) -> f32 {
    let smallest = s.eta.abs() - swing(s, limits);
    if smallest > 0.0 { smallest } else { 0.0 }
}

/// The largest |phi - eta| over that box.
fn swing(s: &Sensitivity<f32>, limits: &[f32; 3]) -> f32 {
    reach(&[s.per_z_m, s.per_rx_rad, s.per_ry_rad], limits)
}

/// The largest product of a row and a column of magnitudes up to `limits`.
#[inline(never)]
fn reach([a, b, c]: &[f32; 3], limits: &[f32; 3]) -> f32 {
    (a.abs() * limits[0] + b.abs() * limits[1]) + c.abs() * limits[2]
}

#[cfg(test)]
#[path = "soundness_tests.rs"]
mod tests;

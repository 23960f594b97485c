//! The checks that a parameter set must pass, on the host as on the target.

use crate::geometry::SensingAxes;
use crate::layout;
use crate::model::{FieldProbe, Probes, Sensitivity, dot};
use crate::parameters::{ParameterError, ParameterSet};

/// Largest element of PM PM^-1 - I that the check accepts: 100 times the rounding of `f32`
/// for lever arms of decimetres.
const INVERSE_TOLERANCE: f32 = 1e-5;

/// Largest relative difference between a precomputed term and the product of its parts:
/// four roundings of `f32`.
const PRODUCT_TOLERANCE: f32 = 5e-7;

impl ParameterSet {
    /// Checks that every number is finite, PM^-1 inverts PM, each precomputed term follows
    /// from its parts, scales and limits are above zero, code windows are sound and no phi
    /// comes near zero within the calibrated range. Of a field model lateral rows must be across
    /// the sensing axes, and the slopes of p below 1 in that range.
    ///
    /// # Errors
    /// The first of these that does not hold.
    pub fn check(&self) -> Result<(), ParameterError> {
        layout::check_finite(&mut self.clone())?;
        self.check_terms()
    }

    /// The checks of [`ParameterSet::check`] for a set whose numbers are finite.
    pub(crate) fn check_terms(&self) -> Result<(), ParameterError> {
        self.check_signs()?;
        self.check_inverse()?;
        self.check_products()?;
        let c = &self.constants;
        for (probe, s) in (0u8..).zip(self.probes.sensitivities()) {
            if smallest_sensitivity(s, &c.calibrated_vertical) < c.sensitivity_min {
                return Err(ParameterError::PoleInRange { probe });
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

    fn check_inverse(&self) -> Result<(), ParameterError> {
        let mut largest = 0.0f32;
        for j in 0..3 {
            let column = self.plane_inverse.map(|row| row[j]);
            for (i, row) in self.plane.iter().enumerate() {
                let off = (dot(row, column) - if i == j { 1.0 } else { 0.0 }).abs();
                // A sum of overflows is no number, and larger than any.
                largest = if off <= largest { largest } else { off };
            }
        }
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
            c.planar_per_code.as_flattened(),
            self.plane_inverse.as_flattened(),
            self.hall.m_per_code,
        )?;
        check_scaled(
            "the vertical constants",
            c.vertical_per_code.as_flattened(),
            self.capacitive.vertical_per_m.as_flattened(),
            self.capacitive.m_per_code,
        )?;
        let (axes, arms) = SensingAxes::of_rows(&self.plane);
        let lengths = axes.0.map(|[x, y]| x * x + y * y);
        check_near(
            "PM",
            &axes.misalignment_rad(),
            &self.geometry.misalignment_rad,
        )?;
        check_near("PM", &arms, &self.geometry.lever_arm_m)?;
        check_near("PM", &lengths, &[1.0; 3])?;
        match &self.probes {
            Probes::Linear(_) => Ok(()),
            Probes::Field(probes) => self.check_lateral(probes, &axes),
        }
    }

    /// Within the calibrated range the terms of a field model change a displacement by less than
    /// it changes itself.
    fn check_slopes(&self, probes: &[FieldProbe<f32>; 3]) -> Result<(), ParameterError> {
        let (planar, vertical) = (
            &self.constants.calibrated_planar,
            &self.constants.calibrated_vertical,
        );
        let [a, b, c] = &self.plane;
        for ((index, probe), along) in (0u8..).zip(probes).zip(&self.plane) {
            let (mut u, mut w) = (0.0, 0.0);
            for axis in 0..3 {
                let codes = planar[axis] / self.hall.m_per_code;
                u += along[axis].abs() * codes;
                w += dot(&probe.lateral, [a[axis], b[axis], c[axis]]).abs() * codes;
            }
            let zr = swing(&probe.sensitivity, vertical);
            let gentle = |slope: f32| slope < 1.0;
            if !probe.steepest_slopes(u, w, zr).into_iter().all(gentle) {
                return Err(ParameterError::SteepInRange { probe: index });
            }
        }
        Ok(())
    }

    /// The lateral rows of a field model, times PM, begin with the unit vectors across the
    /// sensing axes; the rest is where the probes stand.
    fn check_lateral(
        &self,
        probes: &[FieldProbe<f32>; 3],
        axes: &SensingAxes<f32>,
    ) -> Result<(), ParameterError> {
        for axis in 0..2 {
            let column = self.plane.map(|row| row[axis]);
            let made = probes.each_ref().map(|probe| dot(&probe.lateral, column));
            let across = axes.across().map(|pair| pair[axis]);
            check_near("the lateral rows", &made, &across)?;
        }
        Ok(())
    }
}

/// Refuses what differs by more than rounding from what it was made of: m, rad or 1.
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
    made: &[f32],
    from: &[f32],
    scale: f32,
) -> Result<(), ParameterError> {
    for (made, from) in made.iter().zip(from) {
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
    (s.per_z_m.abs() * limits[0] + s.per_rx_rad.abs() * limits[1]) + s.per_ry_rad.abs() * limits[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::CodeWindow;
    use crate::sample;

    fn refused(change: impl FnOnce(&mut ParameterSet)) -> ParameterError {
        let mut set = sample::parameters();
        change(&mut set);
        set.check().expect_err("an unusable set")
    }

    #[test]
    fn a_number_that_is_not_finite_is_refused_by_the_name_of_its_group() {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let group = |change: fn(&mut ParameterSet, f32)| match refused(|set| change(set, bad)) {
                ParameterError::NotFinite { group } => group,
                other => panic!("{other}"),
            };
            assert_eq!(group(|s, x| s.fit.peak[2] = x), "the fit record");
            assert_eq!(
                group(|s, x| s.geometry.lever_arm_m[0] = x),
                "the probe geometry"
            );
            assert_eq!(group(|s, x| s.plane[2][2] = x), "PM");
            assert_eq!(group(|s, x| s.plane_inverse[0][0] = x), "PM^-1");
            assert_eq!(
                group(|s, x| s.hall.m_per_code = x),
                "the scale of the Hall codes"
            );
            assert_eq!(
                group(|s, x| s.capacitive.vertical_per_m[1][1] = x),
                "the capacitive plane matrix"
            );
            assert_eq!(
                group(|s, x| s.capacitive.m_per_code = x),
                "the scale of the capacitive codes"
            );
            assert_eq!(
                group(|s, x| s.constants.vertical_per_code[2][2] = x),
                "the vertical constants"
            );
            assert_eq!(
                group(|s, x| sample::sensitivities(s)[2].per_ry_rad = x),
                "the sensitivities"
            );
            assert_eq!(
                group(|s, x| s.constants.planar_per_code[0][0] = x),
                "the planar constants"
            );
            assert_eq!(
                group(|s, x| s.constants.calibrated_planar[2] = x),
                "the calibrated range"
            );
            assert_eq!(
                group(|s, x| s.constants.sensitivity_min = x),
                "the smallest sensitivity"
            );
        }
    }

    #[test]
    fn terms_that_do_not_follow_from_each_other_are_refused() {
        assert!(matches!(
            refused(|set| set.plane_inverse[0][1] *= 1.001),
            ParameterError::NotTheInverse { largest } if largest > INVERSE_TOLERANCE
        ));
        assert!(matches!(
            refused(|set| set.plane_inverse = [[f32::MAX, f32::MAX, -f32::MAX]; 3]),
            ParameterError::NotTheInverse { .. }
        ));
        let term = "the planar constants";
        let inconsistent = ParameterError::Inconsistent { term };
        assert_eq!(
            refused(|set| set.constants.planar_per_code[2][0] *= 1.00001),
            inconsistent
        );
        let term = "the vertical constants";
        let inconsistent = ParameterError::Inconsistent { term };
        assert_eq!(
            refused(|set| set.capacitive.m_per_code *= 1.00001),
            inconsistent
        );
        let inconsistent = ParameterError::Inconsistent { term: "PM" };
        assert_eq!(
            refused(|set| set.geometry.misalignment_rad[2] += 1e-4),
            inconsistent
        );
        assert_eq!(
            refused(|set| set.geometry.lever_arm_m[1] += 1e-4),
            inconsistent
        );
        assert_eq!(
            refused(|set| set.geometry.misalignment_rad[0] = 1e30),
            inconsistent
        );
    }

    #[test]
    fn a_sensing_axis_that_is_no_unit_vector_is_refused() {
        let term = "PM";
        let longer = |set: &mut ParameterSet| {
            set.plane[0] = set.plane[0].map(|x| 2.0 * x);
            set.geometry.lever_arm_m[0] *= 2.0;
            for rows in [&mut set.plane_inverse, &mut set.constants.planar_per_code] {
                for row in rows {
                    row[0] *= 0.5;
                }
            }
        };
        assert_eq!(refused(longer), ParameterError::Inconsistent { term });
    }

    #[test]
    fn scales_limits_and_windows_must_make_sense() {
        let value = "the smallest sensitivity";
        assert_eq!(
            refused(|set| set.constants.sensitivity_min = 0.0),
            ParameterError::NotPositive { value }
        );
        let value = "the scale of the Hall codes";
        assert_eq!(
            refused(|set| set.hall.m_per_code = -6.25e-8),
            ParameterError::NotPositive { value }
        );
        let value = "a calibrated range";
        assert_eq!(
            refused(|set| set.constants.calibrated_vertical[1] = -1e-3),
            ParameterError::NotPositive { value }
        );
        let sensors = "capacitive";
        assert_eq!(
            refused(|set| set.constants.capacitive_window = CodeWindow { low: 5, high: 4 }),
            ParameterError::UnsoundWindow { sensors }
        );
    }

    #[test]
    fn a_pole_within_the_calibrated_range_is_refused() {
        assert_eq!(
            refused(|set| sample::sensitivities(set)[2].per_z_m = 5000.0),
            ParameterError::PoleInRange { probe: 2 }
        );
        assert_eq!(
            refused(|set| set.constants.calibrated_vertical[0] = 1.0),
            ParameterError::PoleInRange { probe: 0 }
        );
    }
    #[test]
    fn a_field_model_is_refused_for_what_is_wrong_with_it() {
        let refused = |change: fn(&mut ParameterSet)| {
            let mut set = sample::field_parameters();
            assert_eq!(set.check(), Ok(()));
            change(&mut set);
            set.check().expect_err("an unusable set")
        };
        let group = "the field terms";
        assert_eq!(
            refused(|set| sample::field_probes(set)[1].carry[2] = f32::NAN),
            ParameterError::NotFinite { group }
        );
        assert_eq!(
            refused(|set| sample::field_probes(set)[2].shape.w_w_w = f32::INFINITY),
            ParameterError::NotFinite { group }
        );
        let group = "the lateral rows";
        assert_eq!(
            refused(|set| sample::field_probes(set)[0].lateral[1] = f32::NAN),
            ParameterError::NotFinite { group }
        );
        assert_eq!(
            refused(|set| sample::field_probes(set)[0].sensitivity.per_z_m = 5000.0),
            ParameterError::PoleInRange { probe: 0 }
        );
        for change in [
            (|set| sample::field_probes(set)[1].shape.u_w[0] *= 100.0) as fn(&mut ParameterSet),
            |set| sample::field_probes(set)[1].shape.w_w[0] = -1e-3,
            |set| sample::field_probes(set)[1].shape.u_z_z[1] = f32::MAX,
            |set| set.constants.calibrated_planar[1] = 0.05,
        ] {
            assert!(matches!(
                refused(change),
                ParameterError::SteepInRange { probe: 0 | 1 }
            ));
        }
        let term = "the lateral rows";
        for change in [
            (|set| sample::field_probes(set)[2].lateral[1] += 1e-3) as fn(&mut ParameterSet),
            |set| sample::field_probes(set).swap(0, 2),
        ] {
            assert_eq!(refused(change), ParameterError::Inconsistent { term });
        }
        let term = "PM";
        assert_eq!(
            refused(|set| set.geometry.lever_arm_m[1] += 1e-4),
            ParameterError::Inconsistent { term }
        );
        assert!(matches!(
            refused(|set| set.plane = [[f32::NAN; 3]; 3]),
            ParameterError::NotTheInverse { .. }
        ));
    }
}

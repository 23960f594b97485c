//! What a fit yields, in SI units and `f64`, and how it becomes a parameter set.

use crate::capacitive::{ProbePositions, vertical_per_gap};
use crate::decoder::DecoderConstants;
use crate::frame::CodeWindow;
use crate::geometry::ProbeGeometry;
use crate::layout;
use crate::matrix::{inverse, to_rows};
use crate::model::{ModelKind, Probes};
use crate::motion::MotionCorrection;
use crate::parameters::{
    CapacitiveInput, FitRecord, HallInput, ParameterError, ParameterSet, Text,
};
use crate::real::Real;
use crate::temperature::Temperature;
use core::f64::consts::TAU;
use nalgebra::Matrix3;

/// A calibrated stage: the parameters of one model and the scales that they hold for.
///
/// ```
/// use runtime::calibration::{Calibration, Origin};
/// use runtime::frame::CodeWindow;
/// use runtime::geometry::ProbeGeometry;
/// use runtime::model::{ModelKind, Probes, Sensitivity};
/// use runtime::parameters::ParameterError;
///
/// # fn main() -> Result<(), ParameterError> {
/// let window = CodeWindow::between_rails(-32768, 32767).expect("a 16-bit converter");
/// let mut calibration = Calibration {
///     model: ModelKind::M30,
///     geometry: ProbeGeometry {
///         lever_arm_m: [0.2, -0.2, -0.35],
///         misalignment_rad: [0.01, -0.02, 0.03],
///     },
///     probes: Probes::Linear([0.87, 0.70, 0.86].map(Sensitivity::constant)),
///     hall_m_per_code: 6.25e-8,
///     hall_window: window,
///     capacitive_probes_m: [[0.12, 0.0], [-0.12, 0.0], [0.0, -0.12]],
///     capacitive_m_per_code: 1.5625e-8,
///     capacitive_window: window,
///     calibrated_planar: [550e-6, 550e-6, 350e-6],
///     calibrated_vertical: [280e-6, 1.2e-3, 1.2e-3],
///     sensitivity_min: Calibration::SENSITIVITY_MIN,
///     temperature: runtime::Temperature::NONE,
///     motion_correction: None,
/// };
/// let set = calibration.prepare(&Origin::default())?;
/// assert_eq!(set.check(), Ok(()));
///
/// calibration.sensitivity_min = 0.75; // probe B reads 0.70
/// let refused = calibration.prepare(&Origin::default());
/// assert_eq!(refused, Err(ParameterError::PoleInRange { probe: 1 }));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// Which model the parameters belong to. Models that fix a parameter store its value.
    pub model: ModelKind,
    /// Lever arms and misalignments of the probes A, B, C.
    pub geometry: ProbeGeometry<f64>,
    /// The model's coefficients of the probes A, B, C. The coefficients of the field model contain
    /// `hall_m_per_code` and `geometry`, see [`FieldProbe`](crate::model::FieldProbe).
    pub probes: Probes<f64>,
    /// Designed displacement per Hall code, m.
    pub hall_m_per_code: f64,
    /// Hall codes that are decoded.
    pub hall_window: CodeWindow,
    /// Where the capacitive sensors stand, m.
    pub capacitive_probes_m: ProbePositions<f64>,
    /// Gap change per capacitive code, m.
    pub capacitive_m_per_code: f64,
    /// Capacitive codes that are decoded.
    pub capacitive_window: CodeWindow,
    /// Largest magnitude of X, Y, Rz that the calibration covers, m, m, rad.
    pub calibrated_planar: [f64; 3],
    /// Largest magnitude of Z, Rx, Ry that the calibration covers, m, rad, rad.
    pub calibrated_vertical: [f64; 3],
    /// Smallest magnitude of phi that is decoded; [`Calibration::SENSITIVITY_MIN`] if in doubt.
    pub sensitivity_min: f64,
    /// How the sensitivities follow temperature.
    pub temperature: Temperature<f64>,
    /// Corrects poses by commanded velocity and acceleration, if the log has shown such errors.
    pub motion_correction: Option<MotionCorrection>,
}

/// Where a parameter set comes from: text and figures for [`Calibration::prepare`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Origin {
    /// Serial number of the stage; empty if none was given.
    pub serial: Text,
    /// When the set was made, as given by the user; empty if not given.
    pub created: Text,
    /// SHA-256 of the decompressed input logs, one after the other.
    pub logs_sha256: [u8; 32],
    /// How good the fit was.
    pub fit: FitRecord,
}

impl Calibration {
    /// Default of `sensitivity_min`: a tenth of the designed sensitivity. A sound probe reads
    /// 0.65 to 1; at 0.1 a noise of 0.5 um already makes 5 um.
    pub const SENSITIVITY_MIN: f64 = 0.1;

    /// The decoder's constants in `f64`: for a high-precision reference, and to be rounded.
    ///
    /// # Errors
    /// [`ParameterError::SingularPlane`] when PM has no inverse,
    /// [`ParameterError::CapacitiveProbesInLine`] when the three gaps define no plane, or one that
    /// the largest codes turn by more than a whole turn.
    pub fn constants(&self) -> Result<DecoderConstants<f64>, ParameterError> {
        let [plane_inverse, vertical_per_m] = self.inverses()?;
        Ok(DecoderConstants {
            vertical_per_code: to_rows(&(vertical_per_m * self.capacitive_m_per_code)),
            planar_per_code: to_rows(&(plane_inverse * self.hall_m_per_code)),
            calibrated_vertical: self.calibrated_vertical,
            calibrated_planar: self.calibrated_planar,
            sensitivity_min: self.sensitivity_min,
            hall_window: self.hall_window,
            capacitive_window: self.capacitive_window,
            temperature: self.temperature,
        })
    }

    /// PM^-1, and the vertical pose per m of gap change.
    fn inverses(&self) -> Result<[Matrix3<f64>; 2], ParameterError> {
        let plane_inverse = inverse(&self.geometry.plane()).ok_or(ParameterError::SingularPlane)?;
        let vertical_per_m = vertical_per_gap(&self.capacitive_probes_m)
            .filter(|per_m| self.largest_tilt_rad(per_m) <= TAU)
            .ok_or(ParameterError::CapacitiveProbesInLine)?;
        Ok([plane_inverse, vertical_per_m])
    }

    /// The largest Rx or Ry that codes within the window stand for, rad.
    fn largest_tilt_rad(&self, vertical_per_m: &Matrix3<f64>) -> f64 {
        let window = &self.capacitive_window;
        let code = f64::from(window.low.unsigned_abs().max(window.high.unsigned_abs()));
        let per_m = |axis| vertical_per_m.row(axis).abs().sum();
        per_m(1).max(per_m(2)) * (self.capacitive_m_per_code * code)
    }

    /// The parameter set for the target: everything computed in `f64`, rounded once to `f32`,
    /// then checked as the target will check it.
    ///
    /// # Errors
    /// As [`Calibration::constants`], and every error of [`ParameterSet::check`].
    pub fn prepare(&self, origin: &Origin) -> Result<ParameterSet, ParameterError> {
        let [plane_inverse, vertical_per_m] = self.inverses()?;
        let mut set = ParameterSet {
            model: self.model,
            serial: origin.serial.clone(),
            created: origin.created.clone(),
            logs_sha256: origin.logs_sha256,
            fit: origin.fit,
            geometry: ProbeGeometry {
                lever_arm_m: self.geometry.lever_arm_m.map(round),
                misalignment_rad: self.geometry.misalignment_rad.map(round),
            },
            plane: self.geometry.plane().map(round),
            plane_inverse: plane_inverse.map(round),
            hall: HallInput {
                m_per_code: round(self.hall_m_per_code),
            },
            capacitive: CapacitiveInput {
                vertical_per_m: vertical_per_m.map(round),
                m_per_code: round(self.capacitive_m_per_code),
            },
            probes: self.probes.rounded(),
            constants: self.constants()?.rounded(),
            motion_correction: self.motion_correction,
        };
        layout::restore(&mut set);
        set.check()?;
        Ok(set)
    }
}

fn round(x: f64) -> f32 {
    f32::from_f64(x)
}

impl DecoderConstants<f64> {
    /// Each constant rounded to the nearest `f32`.
    pub fn rounded(&self) -> DecoderConstants<f32> {
        DecoderConstants {
            vertical_per_code: self.vertical_per_code.map(|row| row.map(round)),
            planar_per_code: self.planar_per_code.map(|row| row.map(round)),
            calibrated_vertical: self.calibrated_vertical.map(round),
            calibrated_planar: self.calibrated_planar.map(round),
            sensitivity_min: round(self.sensitivity_min),
            hall_window: self.hall_window,
            capacitive_window: self.capacitive_window,
            temperature: self.temperature.rounded(),
        }
    }
}

//! A stage for tests: the designed geometry a little off, sensitivities as a fit finds them.

use crate::calibration::{Calibration, Origin};
use crate::frame::CodeWindow;
use crate::geometry::{ProbeGeometry, SensingAxes};
use crate::matrix::inverse;
use crate::model::{FieldProbe, ModelKind, Probes, Sensitivity, Shape};
use crate::motion::MotionCorrection;
use crate::parameters::{FitRecord, ParameterSet, Text};
use crate::temperature::Temperature;
use nalgebra::RowVector3;

/// Codes strictly between the rails of a 16-bit converter.
pub(crate) const WINDOW: CodeWindow = CodeWindow {
    low: -32767,
    high: 32766,
};

/// The stage's calibration.
pub(crate) fn calibration() -> Calibration {
    let probe = |eta, per_z_m, per_rx_rad, per_ry_rad| Sensitivity {
        eta,
        per_z_m,
        per_rx_rad,
        per_ry_rad,
    };
    Calibration {
        model: ModelKind::M31,
        geometry: ProbeGeometry {
            lever_arm_m: [0.2, -0.2, -0.35],
            misalignment_rad: [0.01, -0.02, 0.03],
        },
        probes: Probes::Linear([
            probe(0.87, -190.0, -70.0, 15.0),
            probe(0.7, -160.0, -57.0, -55.0),
            probe(0.86, -180.0, -63.0, 13.0),
        ]),
        hall_m_per_code: 6.25e-8,
        hall_window: WINDOW,
        capacitive_probes_m: [[0.12, 0.0], [-0.12, 0.0], [0.0, -0.12]],
        capacitive_m_per_code: 1.5625e-8,
        capacitive_window: WINDOW,
        calibrated_planar: [550e-6, 550e-6, 350e-6],
        calibrated_vertical: [280e-6, 1.2e-3, 1.2e-3],
        sensitivity_min: Calibration::SENSITIVITY_MIN,
        temperature: Temperature::NONE,
        motion_correction: None,
    }
}

/// Where the stage's parameters come from.
pub(crate) fn origin() -> Origin {
    let text = |text| Text::try_from(text).expect("at most 32 bytes");
    Origin {
        serial: text("HS-0007"),
        created: text("2026-11-21T10:00:00Z"),
        logs_sha256: core::array::from_fn(|k| u8::try_from(k).expect("below 32")),
        fit: FitRecord {
            rows: 57_000,
            train_rows: 200,
            rms: [0.95e-6, 0.48e-6, 2.3e-6],
            peak: [4e-6, 2e-6, 10e-6],
            forced: false,
        },
    }
}

/// The stage's parameter set.
pub(crate) fn parameters() -> ParameterSet {
    calibration().prepare(&origin()).expect("a sound stage")
}

/// The stage's coefficients, to be changed.
pub(crate) fn sensitivities(set: &mut ParameterSet) -> &mut [Sensitivity<f32>; 3] {
    match &mut set.probes {
        Probes::Linear(probes) => probes,
        Probes::Field(_) => panic!("a set of the field model"),
    }
}

/// The same stage by the field model: each term a third of the deviation of its prior, with
/// signs that change, and the probes where their sensitivities put them.
pub(crate) fn field_calibration() -> Calibration {
    let linear = calibration();
    let plane_inverse = inverse(&linear.geometry.plane()).expect("a sound stage");
    let across = SensingAxes::at(linear.geometry.misalignment_rad).across();
    let probe = |k: usize, sign: f64| {
        let sensitivity = *linear.probes.sensitivities()[k];
        let (a, b, c) = (
            sensitivity.per_z_m,
            sensitivity.per_rx_rad,
            sensitivity.per_ry_rad,
        );
        let [x, y] = across[k];
        let row = RowVector3::new(x, y, y * (-c / a) - x * (b / a));
        let m = linear.hall_m_per_code;
        FieldProbe {
            sensitivity,
            carry: [0.06 * sign / m, -0.022 * sign / m, 0.013 * sign / m],
            shape: shape(sign / 3.0, m * 1e3, sensitivity.eta),
            lateral: (row * plane_inverse).into(),
        }
    };
    Calibration {
        model: ModelKind::Field,
        probes: Probes::Field([probe(0, 1.0), probe(1, -1.0), probe(2, 1.0)]),
        ..linear
    }
}

/// The deviations of the priors in mm, times `part` and with signs that change, in codes and
/// for zr.
fn shape(part: f64, mm: f64, eta: f64) -> Shape<f64> {
    let square = [part * mm, -part * mm / eta];
    let cube = [part * mm * mm, -part * mm * mm / eta];
    let pair = |[first, second]: [f64; 2], unit: [f64; 2]| [first * unit[0], second * unit[1]];
    let height = 1.0 / (eta * eta);
    Shape {
        u_w_w: pair([0.042, 0.018], cube),
        u_w: pair([0.05, 0.025], square),
        u_z_z: pair([0.47, 0.92], [part * height, -part * height / eta]),
        u_u_u: pair([0.0069, 0.054], cube),
        u_u: pair([0.009, 0.016], square),
        w_w: pair([0.022, 0.021], square),
        w_z: pair([0.094, 0.11], [part / eta, -part * height]),
        z_z: pair(
            [0.26, 0.53],
            [part * height / mm, -part * height / (eta * mm)],
        ),
        u_u_w: 0.0014 * part * mm * mm,
        w_w_w: -0.0026 * part * mm * mm,
    }
}

/// The parameter set of [`field_calibration`].
pub(crate) fn field_parameters() -> ParameterSet {
    field_calibration()
        .prepare(&origin())
        .expect("a sound stage")
}

/// k and h as of a stage with NdFeB magnets and sensors on mount and body.
pub(crate) fn temperature() -> Temperature<f64> {
    Temperature {
        per_mk: [[-1.1e-6, 5e-8], [-1.2e-6, -4e-8], [-1.15e-6, 3e-8]],
        zero_mc: [20_125, 21_250],
        reach_mk: [Temperature::<f64>::REACH_MK; 2],
    }
}

/// [`field_calibration`] with [`temperature`].
pub(crate) fn warm_calibration() -> Calibration {
    Calibration {
        temperature: temperature(),
        ..field_calibration()
    }
}

/// Its parameter set.
pub(crate) fn warm_parameters() -> ParameterSet {
    warm_calibration()
        .prepare(&origin())
        .expect("a sound stage")
}

/// A and L as of a coil 5 cm from probe A, and of probes that are read up to 0.3 ms apart.
pub(crate) const MOTION: MotionCorrection = MotionCorrection {
    acceleration_s2: [
        [-6e-6, 2e-6, -3e-7, 4e-6, -7e-7, 6e-7],
        [-3e-6, -1e-6, 2e-7, -2e-6, 9e-7, 5e-7],
        [-1.5e-5, 5e-6, -8e-7, 8e-6, 1e-6, -2e-6],
    ],
    velocity_s: [
        [1e-4, 2.5e-4, 9e-5],
        [3e-5, -2e-4, 6e-5],
        [-7e-5, 1.4e-3, 1e-4],
    ],
};

/// The parameter set of a calibration with [`MOTION`].
pub(crate) fn with_motion(calibration: Calibration) -> ParameterSet {
    Calibration {
        motion_correction: Some(MOTION),
        ..calibration
    }
    .prepare(&origin())
    .expect("a sound stage")
}

/// The coefficients of [`field_parameters`], to be changed.
pub(crate) fn field_probes(set: &mut ParameterSet) -> &mut [FieldProbe<f32>; 3] {
    match &mut set.probes {
        Probes::Field(probes) => probes,
        Probes::Linear(_) => panic!("a set of Model (31)"),
    }
}

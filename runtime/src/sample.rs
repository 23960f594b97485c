//! A stage for tests: the designed geometry a little off, sensitivities as a fit finds them.

use crate::calibration::{Calibration, Origin};
use crate::frame::CodeWindow;
use crate::geometry::ProbeGeometry;
use crate::model::{ModelKind, Probes, Sensitivity};
use crate::parameters::{FitRecord, ParameterSet, Text};

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
        },
    }
}

/// The stage's parameter set.
pub(crate) fn parameters() -> ParameterSet {
    calibration().prepare(&origin()).expect("a sound stage")
}

/// The stage's coefficients, to be changed.
pub(crate) fn sensitivities(set: &mut ParameterSet) -> &mut [Sensitivity<f32>; 3] {
    let Probes::Linear(probes) = &mut set.probes;
    probes
}

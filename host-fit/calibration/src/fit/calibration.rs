//! The calibration that fitted parameters make.

use hallstage_input::dataset::Row;
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::parameters::FieldParameters;
use runtime::model::Probes;
use runtime::parameters::ParameterError;
use runtime::{Calibration, ModelKind, Temperature};

/// The calibrated range over the range of the log: offsets of the reference and overshoot are well inside.
pub(crate) const RANGE_MARGIN: f64 = 1.1;

/// The calibration that `parameters` make with the stage's scales, calibrated over the motion
/// of the rows and a tenth more.
///
/// # Errors
/// [`ParameterError::SingularPlane`], of the field model.
pub fn calibration<'r>(
    rows: impl IntoIterator<Item = &'r Row>,
    stage: &Stage,
    model: ModelKind,
    parameters: &FieldParameters,
) -> Result<Calibration, ParameterError> {
    let (planar, vertical) = reach(rows);
    let model_31 = parameters.model_31();
    let probes = match model {
        ModelKind::Field => {
            let constants = parameters.constants(stage.hall.m_per_count);
            Probes::Field(constants.ok_or(ParameterError::SingularPlane)?.probes)
        }
        _ => Probes::Linear(model_31.sensitivity()),
    };
    Ok(Calibration {
        model,
        geometry: model_31.geometry(),
        probes,
        hall_m_per_code: stage.hall.m_per_count,
        hall_window: stage.hall.window,
        capacitive_probes_m: stage.capacitive_probes_m,
        capacitive_m_per_code: stage.capacitive.m_per_count,
        capacitive_window: stage.capacitive.window,
        calibrated_planar: planar.map(|x| x * RANGE_MARGIN),
        calibrated_vertical: vertical.map(|x| x * RANGE_MARGIN),
        sensitivity_min: Calibration::SENSITIVITY_MIN,
        temperature: Temperature::NONE,
        motion_correction: None,
    })
}

/// Largest magnitudes of X, Y, Rz and of Z, Rx, Ry in some rows: m, rad.
pub(super) fn reach<'r>(rows: impl IntoIterator<Item = &'r Row>) -> ([f64; 3], [f64; 3]) {
    let mut planar = [0.0f64; 3];
    let mut vertical = [0.0f64; 3];
    for row in rows {
        for axis in 0..3 {
            planar[axis] = planar[axis].max(row.reference[axis].abs());
            vertical[axis] = vertical[axis].max(row.vertical[axis].abs());
        }
    }
    (planar, vertical)
}

//! The calibration that fitted parameters make.

use hallstage_input::dataset::Row;
use hallstage_input::stage::Stage;
use hallstage_solver::problem::model::Model;
use hallstage_solver::problem::parameters::Parameters;
use runtime::model::Probes;
use runtime::{Calibration, Temperature};

/// Room around the motion of the log in which the calibration still holds: offsets of
/// the reference and overshoot are well inside it.
pub(crate) const RANGE_MARGIN: f64 = 1.1;

/// The calibration that `parameters` make with the stage's scales, calibrated over the motion
/// of the rows and a tenth more.
pub fn calibration<'r>(
    rows: impl IntoIterator<Item = &'r Row>,
    stage: &Stage,
    model: &Model,
    parameters: &Parameters,
) -> Calibration {
    let mut planar = [0.0f64; 3];
    let mut vertical = [0.0f64; 3];
    for row in rows {
        for axis in 0..3 {
            planar[axis] = planar[axis].max(row.reference[axis].abs());
            vertical[axis] = vertical[axis].max(row.vertical[axis].abs());
        }
    }
    Calibration {
        model: model.kind,
        geometry: parameters.geometry(),
        probes: Probes::Linear(parameters.sensitivity()),
        hall_m_per_code: stage.hall.m_per_count,
        hall_window: stage.hall.window,
        capacitive_probes_m: stage.capacitive_probes_m,
        capacitive_m_per_code: stage.capacitive.m_per_count,
        capacitive_window: stage.capacitive.window,
        calibrated_planar: planar.map(|x| x * RANGE_MARGIN),
        calibrated_vertical: vertical.map(|x| x * RANGE_MARGIN),
        sensitivity_min: Calibration::SENSITIVITY_MIN,
        temperature: Temperature::NONE,
    }
}

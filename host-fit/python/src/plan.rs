//! The run to make, and its rehearsal on a simulated stage.

use crate::arrays::{slice, table};
use crate::choice::chosen;
use crate::error::{internal, log_error, output_error, wrong};
use crate::log::Log;
use crate::minimize::whole;
use crate::pickle::restored;
use crate::source::Source;
use crate::stage::Stage;
use crate::text::How;
use crate::work;
use host_fit::calibration::plan::{self, PERIODS_MAX, SECONDS_MAX};
use host_fit::input::stage::Stage as Designed;
use host_fit::input::text::TextReader;
use host_fit::output::write_atomically;
use host_fit::report::plan::{figures, tables};
use host_fit::report::text::as_text;
use host_fit::simulate::dynamics::MotionEffects;
use host_fit::simulate::log_text::log_csv;
use host_fit::simulate::plan_file;
use host_fit::simulate::pose::StagePose;
use host_fit::simulate::protocol::{Protocol, Run, Trajectory};
use host_fit::simulate::recording::{RecordError, record_stage};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A run of the stage for the field model, and the forecast of a fit to its log. Made by `plan`.
#[pyclass(frozen, module = "hallstage")]
pub struct Plan {
    plan: plan::Plan,
    designed: Arc<Designed>,
}

impl Plan {
    /// The trajectory as a file, to 10 pm and prad.
    fn csv(&self) -> String {
        let period_s = self.designed.servo_period_s;
        plan_file::to_csv(&self.plan.run.trajectory(period_s), period_s)
    }
}

#[pymethods]
impl Plan {
    /// Length, s.
    #[getter]
    fn seconds(&self) -> f64 {
        self.plan.run.seconds
    }

    /// The poses, a row for each servo period: float64, (n, 6), X, Y, Rz, Z, Rx, Ry in m and rad.
    #[getter]
    fn trajectory<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        poses(py, &self.plan.run.trajectory(self.designed.servo_period_s))
    }

    /// Amplitudes, frequencies, speeds, errors predicted for service and standard errors of the parameters: the
    /// JSON of `host-fit plan` as a dict, in SI.
    #[getter]
    fn details<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        crate::finding::figures(py, &figures(&self.plan, &[], &self.designed))
    }

    /// Writes the trajectory: columns t_us, x_um, y_um, rz_urad, z_um, rx_urad, ry_urad, a row for each servo
    /// period. Raises `OSError` where it cannot be written.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        write_atomically(&path, self.csv().as_bytes()).map_err(|error| output_error(&error))
    }

    fn __repr__(&self) -> String {
        as_text(&tables(&self.plan, &[], &self.designed))
    }
}

/// Plans the run to make for the field model: all six axes at once, a slow and a fast sine each, within the limits that
/// `[motion]` of the stage gives.
///
/// `seconds`: its length, s, above 0 and up to 600; 20 are plenty for a stage of the usual limits.
///
/// Raises `ValueError` where no run of that length within the limits determines the model; it says what to change.
#[pyfunction]
#[pyo3(signature = (stage, *, seconds = 20.0), name = "plan")]
pub fn plan_run(py: Python<'_>, stage: PyRef<'_, Stage>, seconds: f64) -> PyResult<Plan> {
    let designed = Arc::clone(&stage.designed);
    let most = SECONDS_MAX.min(PERIODS_MAX * designed.servo_period_s);
    if !(seconds > 0.0 && seconds <= most) {
        let problem = format!("a number above 0 and up to {most} is needed, not {seconds}");
        return Err(wrong("seconds", problem));
    }
    let of_plan = Arc::clone(&designed);
    let planned = work::run(py, move |_| plan::plan(&of_plan, seconds))?;
    let plan = planned.map_err(|error| wrong("seconds", error))?;
    Ok(Plan { plan, designed })
}

/// The log of a simulated stage, and its true poses. Made by `simulate`.
#[pyclass(frozen, extends = Log, module = "hallstage")]
pub struct SimulatedLog {
    /// The true poses, a row for each row that was recorded: float64, (n, 6), X, Y, Rz, Z, Rx, Ry in m and rad.
    #[pyo3(get)]
    truth: Py<PyArray2<f64>>,
}

/// Records a run of a simulated stage: magnets and their fields, rigid motion, noise, drift, converters. The
/// simulation uses none of the models that are fitted.
///
/// `run`: a `Plan`; "paper", "combined", "service", "day" or "fast", the protocols of the program; or poses, (n, 6), X, Y, Rz,
/// Z, Rx, Ry in m and rad, one for each servo period. `seed`: stage and noise; an even seed has magnets
/// as designed, an odd seed imperfect magnets. `hour`: begins the run at this hour of a working day, -24 to 24
/// (work begins at 0); the log then has the temperature columns of `[temperature]` in the stage file. `host-fit
/// simulate` gives the same log to the bit.
///
/// Raises `ValueError` where a probe would hit its magnet, and for an `hour` of a stage without `[temperature]`.
#[pyfunction]
#[pyo3(signature = (stage, run, *, seed = 1, hour = None))]
pub fn simulate<'py>(
    py: Python<'py>,
    stage: Py<Stage>,
    run: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = read_seed)] seed: u64,
    hour: Option<f64>,
) -> PyResult<Bound<'py, SimulatedLog>> {
    let designed = Arc::clone(&stage.get().designed);
    let run = read_run(run, designed.servo_period_s, seed)?;
    if hour.is_some_and(|hour| !(-24.0..=24.0).contains(&hour)) {
        return Err(wrong("hour", "-24 to 24 h of the day are possible"));
    }
    let recorded = work::run(py, move |_| {
        let recording = record_stage(&designed, run, hour, MotionEffects::NONE, seed)?;
        Ok((log_csv(&recording, &designed), recording.truth.concat()))
    })?;
    let (csv, truth) = recorded.map_err(|error: RecordError| match error {
        RecordError::NoTemperature => wrong("hour", error),
        error => wrong("run", error),
    })?;
    let source = Source::text(Path::new("simulated"), csv.into_bytes(), false);
    let log = Log::read(py, source, stage, How::WHOLE, |error| log_error(py, error))?;
    SimulatedLog::of(py, log, poses(py, &truth)?.unbind())
}

#[pymethods]
impl SimulatedLog {
    fn __reduce__<'py>(slf: PyRef<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let py = slf.py();
        let log = Bound::new(py, slf.as_super().clone_ref(py))?;
        restored(py, (py.get_type::<Self>(), log, slf.truth.clone_ref(py)))
    }

    #[staticmethod]
    #[pyo3(name = "_restore")]
    fn restore_simulated<'py>(
        log: &Bound<'py, Log>,
        truth: Py<PyArray2<f64>>,
    ) -> PyResult<Bound<'py, Self>> {
        let py = log.py();
        Self::of(py, log.get().clone_ref(py), truth)
    }
}

impl SimulatedLog {
    /// A log with its true poses.
    fn of(py: Python<'_>, log: Log, truth: Py<PyArray2<f64>>) -> PyResult<Bound<'_, Self>> {
        Bound::new(
            py,
            PyClassInitializer::from(log).add_subclass(Self { truth }),
        )
    }
}

fn read_seed(given: &Bound<'_, PyAny>) -> PyResult<u64> {
    whole("seed", given, 0, u64::MAX)
}

/// The run to simulate. Poses are rounded as in a file, since the noise follows from the poses.
fn read_run(run: &Bound<'_, PyAny>, period_s: f64, seed: u64) -> PyResult<Run> {
    if let Ok(name) = run.extract::<String>() {
        return Ok(chosen::<Protocol>("run", &name)?.run(period_s, seed));
    }
    let csv = match run.cast::<Plan>() {
        Ok(plan) => plan.get().csv(),
        Err(_) => plan_file::to_csv(&given_poses(run)?, period_s),
    };
    let text = TextReader::from_reader(csv.as_bytes(), Path::new("run")).map_err(internal)?;
    let trajectory = plan_file::from_text(text, period_s).map_err(|error| wrong("run", error))?;
    Ok(Run::planned(trajectory))
}

/// Poses of a caller.
fn given_poses(run: &Bound<'_, PyAny>) -> PyResult<Trajectory> {
    let read = table("run", run, 6)?;
    let (rows, _) = slice(read.as_slice())?.as_chunks::<6>();
    if !rows.as_flattened().iter().all(|x| x.is_finite()) {
        return Err(wrong("run", "its poses must be finite numbers"));
    }
    Ok(rows.iter().copied().map(StagePose::from_array).collect())
}

/// Poses as rows of an array.
fn poses<'py>(py: Python<'py>, poses: &[StagePose]) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let flat: Vec<f64> = poses.iter().flat_map(StagePose::to_array).collect();
    PyArray1::from_vec(py, flat).reshape([poses.len(), 6])
}

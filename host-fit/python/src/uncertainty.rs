//! The standard uncertainty of each pose.

use crate::decoder::{Decoder, ROWS_AT_ONCE};
use crate::error::{log_error, wrong};
use crate::held::rows_of_three;
use crate::log::Log;
use crate::rows::Given;
use crate::work;
use host_fit::input::dataset::LoggedFrame;
use host_fit::input::log::{LogReading, ReadOptions};
use host_fit::output::pose_file::KnownErrors;
use host_fit::solver::estimator::model::Model;
use host_fit::solver::estimator::parameters::FieldParameters;
use host_fit::solver::estimator::posterior::Posterior;
use numpy::PyArray2;
use pyo3::prelude::*;
use rayon::prelude::*;
use runtime::PlanarPose;

#[pymethods]
impl Decoder {
    /// Standard uncertainty of X, Y, Rz of each row, float64, (n, 3), m, m, rad: by the parameters and by the
    /// noise of the probes together, at the pose that is decoded; NaN where none is. With `whole` by all sources of the
    /// budget. Codes and temperatures, or a `log`, as for a call.
    ///
    /// Raises `ValueError` without a posterior: of other models than the field model, or where
    /// `params.bin.posterior` does not stand beside the blob; with `whole` also without a budget in it.
    #[pyo3(signature = (log = None, *, hall = None, caps = None, mount = None, body = None, whole = false))]
    #[expect(
        clippy::too_many_arguments,
        reason = "each is named where it is called"
    )]
    fn uncertainty<'py>(
        &self,
        py: Python<'py>,
        log: Option<&Bound<'py, Log>>,
        hall: Option<&Bound<'py, PyAny>>,
        caps: Option<&Bound<'py, PyAny>>,
        mount: Option<&Bound<'py, PyAny>>,
        body: Option<&Bound<'py, PyAny>>,
        whole: bool,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let known = self.known_errors()?;
        if whole && known.budget.is_none() {
            return Err(wrong("whole", "the posterior has no budget; fit again"));
        }
        let decoder = self.decoder;
        let at = move |frame: &LoggedFrame| {
            let known = known.at(&frame.decode(&decoder, &PlanarPose::ZERO));
            known.map_or([f64::NAN; 3], |[own, all]| if whole { all } else { own })
        };
        let frames: Vec<LoggedFrame> = match Given::new(log, hall, caps, [mount, body])? {
            Given::Log(log) => {
                let text = log.text.clone();
                let read = work::run(py, move |watch| {
                    let mut frames = Vec::new();
                    let read = text.read(ReadOptions::DECODE, watch, |_, row| {
                        frames.push(row.row.frame);
                    });
                    read.map(|_: LogReading| frames)
                })?;
                read.map_err(|error| log_error(py, &error))?
            }
            Given::Codes(given) => {
                let rows = given.rows()?;
                rows.frames(0..rows.len()).map(LoggedFrame::from).collect()
            }
        };
        let mut found = Vec::new();
        for frames in frames.chunks(ROWS_AT_ONCE) {
            found.extend(py.detach(|| frames.par_iter().map(&at).collect::<Vec<_>>()));
            py.check_signals()?;
        }
        rows_of_three(py, found)
    }
}

impl Decoder {
    fn known_errors(&self) -> PyResult<KnownErrors> {
        let parameters = FieldParameters::from_blob(&self.set).ok_or_else(|| {
            let model = Model::from_kind(self.set.model).name;
            wrong(
                "model",
                format!("({model}) does not know its errors in service; fit the field model"),
            )
        })?;
        let known = self.known.as_ref().ok_or_else(|| {
            wrong(
                "posterior",
                "none stands beside the blob, or the calibration has none",
            )
        })?;
        let covariance = known.covariance.clone();
        Ok(KnownErrors {
            posterior: Posterior::from_covariance(covariance, &parameters, &known.noise),
            budget: known.budget.clone(),
        })
    }
}

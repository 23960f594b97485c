//! Poses from codes, by the code that runs on the target.

use crate::calibration::{files, from_files};
use crate::error::{blob_error, log_error, posterior_error, wrong};
use crate::log::Log;
use crate::motion::Commanded;
use crate::pickle::restored;
use crate::rows::Given;
use crate::work;
use host_fit::calibration::recalibrate::StoredPosterior;
use host_fit::input::log::{LogReading, ReadOptions};
use host_fit::output::{blob_file, posterior_file};
use host_fit::solver::estimator::model::Model;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use runtime::{
    AnyDecoder, Decode, OnInvalid, ParameterSet, PlanarPose, PoseTracker, RawFrame, Reading, Status,
};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Words of a record: X, Y, Rz, Z, Rx, Ry, status.
pub const WORDS: usize = 7;
/// The fields of a record, as in `host-fit decode --format npy`.
const FIELDS: [(&str, &str); WORDS] = [
    ("x_m", "<f4"),
    ("y_m", "<f4"),
    ("rz_rad", "<f4"),
    ("z_m", "<f4"),
    ("rx_rad", "<f4"),
    ("ry_rad", "<f4"),
    ("status", "<u4"),
];
/// So many rows are decoded without a look at signals.
pub const ROWS_AT_ONCE: usize = 1 << 16;

/// Decodes as the controller does, bit for bit: equations (31) to (33) of the paper, or the field model.
///
/// `Decoder.load("params.bin")` reads a parameter blob; `Calibration.decoder()` gives the decoder of a fit.
///
/// A call gives the pose of each row, as a structured array, (n,): `x_m`, `y_m`, `rz_rad`, `z_m`, `rx_rad`, `ry_rad` in
/// float32 and `status` in uint32, 0 when all is good (see `hallstage.STATUS`). An invalid pose is NaN, with
/// `invalid="zero"` 0 as on the controller, or the last valid pose for at most `hold` rows.
///
/// Give codes: `hall` of the probes A, B, C and `caps` of the gaps 1, 2, 3, whole numbers or NaN, (n, 3), a row every
/// servo period; `mount`, `body`: temperatures, degC, (n,), NaN where there is none. int32 in C order
/// is read where it lies. Or give a `log`: all its rows, as `host-fit decode` does; a gap in its times
/// shows as missed frames.
///
/// `velocity`, `acceleration`: commanded motion at each row, of X, Y, Rz, (n, 3), m/s, m/s, rad/s, and of X, Y, Rz, Z, Rx,
/// Ry, (n, 6), m/s2 and rad/s2, in the frame of the pose. The motion correction of the parameters then takes off the errors that
/// follow motion. Both come from the trajectory, for the sample of the row. A held pose is the last corrected one.
///
/// Raises `ValueError` with the name of an argument of wrong shape or dtype, of a motion without the other, and of one
/// that is not finite or meets parameters without a motion correction.
#[pyclass(frozen, module = "hallstage")]
pub struct Decoder {
    pub set: ParameterSet,
    pub decoder: AnyDecoder,
    pub known: Option<StoredPosterior>,
}

impl Decoder {
    pub fn new(set: ParameterSet, known: Option<StoredPosterior>) -> Self {
        Self {
            decoder: set.decoder(),
            set,
            known,
        }
    }
}

#[pymethods]
impl Decoder {
    /// Reads a parameter blob, and what is known of its errors if `params.bin.posterior` stands beside it.
    ///
    /// Raises `OSError` where it cannot be read, `ValueError` where it is no sound blob.
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        let (set, known) = read(&path)?;
        Ok(Self::new(set, known))
    }

    #[pyo3(signature = (
        log = None, *, hall = None, caps = None, mount = None, body = None, velocity = None, acceleration = None, hold = 0,
        invalid = "nan"
    ))]
    #[expect(
        clippy::too_many_arguments,
        reason = "each is named where it is called"
    )]
    fn __call__<'py>(
        &self,
        py: Python<'py>,
        log: Option<&Bound<'py, Log>>,
        hall: Option<&Bound<'py, PyAny>>,
        caps: Option<&Bound<'py, PyAny>>,
        mount: Option<&Bound<'py, PyAny>>,
        body: Option<&Bound<'py, PyAny>>,
        velocity: Option<&Bound<'py, PyAny>>,
        acceleration: Option<&Bound<'py, PyAny>>,
        hold: u16,
        invalid: &str,
    ) -> PyResult<Bound<'py, PyAny>> {
        let is_nan = match invalid {
            "nan" => true,
            "zero" => false,
            _ => return Err(wrong("invalid", "\"nan\" or \"zero\" is needed")),
        };
        let on_invalid = match hold {
            0 => OnInvalid::Zero,
            ticks => OnInvalid::Hold { ticks },
        };
        let commanded = Commanded::new(self.set.motion_correction, velocity, acceleration)?;
        let given = match Given::new(log, hall, caps, [mount, body])? {
            Given::Log(log) => {
                let words = self.statuses(py, log, on_invalid)?;
                return records(py, words, ("log", commanded), is_nan);
            }
            Given::Codes(given) => given,
        };
        let rows = given.rows()?;
        let mut words = Vec::with_capacity(rows.len() * WORDS);
        let mut tracker = PoseTracker::new(self.decoder, on_invalid);
        for start in (0..rows.len()).step_by(ROWS_AT_ONCE) {
            let frames = rows.frames(start..rows.len().min(start + ROWS_AT_ONCE));
            py.detach(|| match (&self.decoder, on_invalid) {
                (AnyDecoder::Linear(decoder), OnInvalid::Zero) => {
                    decode(decoder, frames, &mut words);
                }
                (AnyDecoder::Field(decoder), OnInvalid::Zero) => {
                    decode(decoder, frames, &mut words);
                }
                _ => frames.for_each(|frame| words.extend(words_of(&tracker.tick(&frame)))),
            });
            py.check_signals()?;
        }
        records(py, words, ("hall", commanded), is_nan)
    }

    /// Equation of the model: "12", "15", "30", "31", or "field".
    #[getter]
    fn model(&self) -> &'static str {
        Model::from_kind(self.set.model).name
    }

    /// Serial number of the stage.
    #[getter]
    fn serial(&self) -> &str {
        &self.set.serial
    }

    /// Creation time, as given.
    #[getter]
    fn created(&self) -> &str {
        &self.set.created
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let (blob, posterior) = files(py, &self.set, self.known.as_ref())?;
        restored(py, (py.get_type::<Self>(), blob, posterior))
    }

    #[staticmethod]
    fn _restore(blob: &[u8], posterior: Option<&[u8]>) -> PyResult<Self> {
        let (set, known) = from_files(blob, posterior)?;
        Ok(Self::new(set, known))
    }

    fn __repr__(&self) -> String {
        let (model, serial) = (Model::from_kind(self.set.model).title(), &self.set.serial);
        match serial.as_str() {
            "" => format!("<Decoder, {model}>"),
            serial => format!("<Decoder of {serial}, {model}>"),
        }
    }
}

impl Decoder {
    /// The words of all rows of a log.
    fn statuses(&self, py: Python<'_>, log: &Log, on_invalid: OnInvalid) -> PyResult<Vec<u32>> {
        let (decoder, text) = (self.decoder, log.text.clone());
        let decoded = work::run(py, move |watch| {
            let mut tracker = PoseTracker::new(&decoder, on_invalid);
            let mut words = Vec::new();
            let read = text.read(ReadOptions::DECODE, watch, |_, row| {
                if row.begins {
                    tracker.forget();
                }
                let frame = &row.row.frame;
                let reading =
                    tracker.tick_with(frame.sequence(), |zero| frame.decode(&decoder, zero));
                words.extend(words_of(&reading));
            });
            read.map(|_: LogReading| words)
        })?;
        decoded.map_err(|error| log_error(py, &error))
    }
}

/// A blob, and what stands beside it.
pub fn read(path: &Path) -> PyResult<(ParameterSet, Option<StoredPosterior>)> {
    let set = blob_file::read(path).map_err(|error| blob_error(&error))?;
    let known = posterior_file::read(&set, path).map_err(|error| posterior_error(&error))?;
    Ok((set, known))
}

/// Adds the words of all frames, invalid fields 0.
fn decode(decoder: &impl Decode, frames: impl Iterator<Item = RawFrame>, words: &mut Vec<u32>) {
    for frame in frames {
        words.extend(words_of(&decoder.decode(&frame, &PlanarPose::ZERO)));
    }
}

#[inline(always)]
fn words_of(reading: &Reading) -> [u32; WORDS] {
    let [x, y, rz] = reading.pose.planar.to_array().map(f32::to_bits);
    let [z, rx, ry] = reading.pose.vertical.to_array().map(f32::to_bits);
    [x, y, rz, z, rx, ry, reading.status.bits()]
}

/// Writes NaN in place of a pose that is invalid and not held.
fn hide_invalid([x, y, rz, z, rx, ry, status]: &mut [u32; WORDS]) {
    let status = Status::from_bits(*status);
    let is_hidden = |invalid, held| status.any(invalid) && !status.any(held);
    let nan = f32::NAN.to_bits();
    if is_hidden(Status::PLANAR_INVALID, Status::PLANAR_HELD) {
        [*x, *y, *rz] = [nan; 3];
    }
    if is_hidden(Status::VERTICAL_INVALID, Status::VERTICAL_HELD) {
        [*z, *rx, *ry] = [nan; 3];
    }
}

/// Words as an array of records, without a copy, corrected by the motion commanded at each row of an argument.
fn records<'py>(
    py: Python<'py>,
    mut words: Vec<u32>,
    (argument, commanded): (&str, Option<Commanded<'_>>),
    is_nan: bool,
) -> PyResult<Bound<'py, PyAny>> {
    if let Some(commanded) = commanded {
        commanded.correct(&mut words, argument)?;
    }
    if is_nan {
        words.as_chunks_mut().0.iter_mut().for_each(hide_invalid);
    }
    let dtype = py
        .import("numpy")?
        .getattr("dtype")?
        .call1((FIELDS.to_vec(),))?;
    let words = PyArray1::from_vec(py, words);
    words.call_method1("view", (dtype,))
}

/// What each bit of a status means, by its value.
#[pyfunction]
pub fn status_names() -> BTreeMap<u32, &'static str> {
    let names = runtime::Status::NAMES.iter();
    names.map(|(bit, name)| (bit.bits(), *name)).collect()
}

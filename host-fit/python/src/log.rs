//! Logs: from files, and from arrays.

use crate::choice::chosen;
use crate::error::{arrays_error, log_error, wrong};
use crate::finding;
use crate::stage::Stage;
use crate::work;
use host_fit::calibration::words;
use host_fit::input::axis::counted;
use host_fit::input::channels::columns;
use host_fit::input::dataset::Row;
use host_fit::input::log::layout::LogLayout;
use host_fit::input::log::{
    self, BadRows, LogError, LogReading, LogRow, ReadOptions, ReferenceUse,
};
use host_fit::input::stage::{Stage as Designed, TemperatureTable};
use host_fit::report::channels::channels;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use runtime::frame::MISSING_CODE;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Where a log can be read again.
pub enum Source {
    /// Its files.
    Files(Vec<PathBuf>),
    /// The text of a log in memory, and its name.
    Text(Vec<u8>, PathBuf),
}

/// Logs of a stage, read and checked: rows in SI units, by movement.
///
/// If there are more than 125,000 rows, it holds a sample, of whole runs; `fit` works on these. `evaluate` and a decoder
/// go through all rows. Made by `read_log` and `Log.from_arrays`.
#[pyclass(frozen, subclass, module = "hallstage")]
pub struct Log {
    pub reading: Arc<LogReading>,
    pub source: Source,
    pub options: ReadOptions,
    /// The stage with the columns of this log.
    pub designed: Arc<Designed>,
    pub stage: Py<Stage>,
}

fn options(bad_rows: &str) -> PyResult<ReadOptions> {
    Ok(ReadOptions {
        bad_rows: chosen::<BadRows>("bad_rows", bad_rows)?,
        // A log that is only decoded has none.
        reference: ReferenceUse::IfPresent,
        watch: work::WATCH,
        ..ReadOptions::FIT
    })
}

/// Reads logs of a stage, in every form that the program `host-fit` takes: CSV or CSV.gz, any separator,
/// decimal commas, units in the header, UTF-16, dates as times.
///
/// `paths`: one file or several, which are calibrated together. `bad_rows`: "refuse", or "skip" to count rows with a
/// bad cell and go on without them.
///
/// Raises `LogError` with `.file`, `.line`, `.column` where something is wrong, `OSError` where a file cannot
/// be read.
#[pyfunction]
#[pyo3(signature = (paths, stage, *, bad_rows = "refuse"))]
pub fn read_log(
    py: Python<'_>,
    paths: &Bound<'_, PyAny>,
    stage: Py<Stage>,
    bad_rows: &str,
) -> PyResult<Log> {
    let paths: Vec<PathBuf> = match paths.extract::<PathBuf>() {
        Ok(one) => vec![one],
        Err(_) => paths
            .extract()
            .map_err(|_| wrong("paths", "a path, or a list of paths, is needed"))?,
    };
    if paths.iter().any(|path| path.as_os_str() == "-") {
        return Err(wrong(
            "paths",
            "`-` is no file; read standard input by sys.stdin",
        ));
    }
    let options = options(bad_rows)?;
    let designed = Arc::clone(&stage.get().designed);
    let reading = work::run(py, || log::read(&paths, &designed, &options))?;
    let reading = reading.map_err(|error| log_error(py, &error))?;
    Ok(Log {
        reading: Arc::new(reading),
        source: Source::Files(paths),
        options,
        designed,
        stage,
    })
}

#[pymethods]
impl Log {
    /// A log of arrays, by the checks that files pass.
    ///
    /// `t_us`: time, us, (n,). `hall`, `caps`: codes of the Hall probes A, B, C and of the gaps 1, 2, 3, whole
    /// numbers, (n, 3); in place of `caps` the vertical pose `z`, `rx`, `ry`, (n,). Reference, (n,): the beams
    /// `x`, `y1`, `y2`, or the pose `x`, `y`, `rz`; a log that is only decoded needs none. `movement`: its number,
    /// whole, (n,); without it movements end at gaps in time. `mount`, `body`: temperatures, degC, (n,), NaN
    /// where there is none. `units` of lengths: m, mm, um, nm, pm; `angles`: rad, mrad, urad, nrad, deg.
    /// `name` stands for the file in reports; `bad_rows` as for `read_log`.
    ///
    /// Raises `ValueError` with the name of an argument of wrong shape, dtype or unit, and `LogError` for a
    /// row, with `.line` the row from 0 and `.name` the argument.
    #[staticmethod]
    #[pyo3(
        signature = (stage, *, name = "arrays", bad_rows = "refuse", **arrays),
        text_signature = "(stage, *, t_us, hall, caps=None, z=None, rx=None, ry=None, x=None, y1=None, y2=None, y=None, \
                          rz=None, movement=None, mount=None, body=None, units='m', angles='rad', name='arrays', \
                          bad_rows='refuse')"
    )]
    fn from_arrays(
        py: Python<'_>,
        stage: Py<Stage>,
        name: &str,
        bad_rows: &str,
        arrays: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let options = options(bad_rows)?;
        let made = py.import("hallstage._arrays")?.getattr("log_text")?;
        let (text, arguments): (String, Vec<(String, String)>) =
            made.call((), arrays)?.extract()?;
        let name = Path::new(name);
        Self::from_text(py, text.as_bytes(), name, stage, &options, &arguments)
    }

    /// Rows that are held.
    fn __len__(&self) -> usize {
        self.reading.dataset.rows.len()
    }

    /// Rows that were read; more than are held of a long log.
    #[getter]
    fn rows_read(&self) -> usize {
        self.reading.dataset.read().0
    }

    /// The stage.
    #[getter]
    fn stage(&self, py: Python<'_>) -> Py<Stage> {
        self.stage.clone_ref(py)
    }

    /// What is odd about the logs, in words.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        words::messages(&self.reading.warnings)
    }

    /// The properties of each channel, as `host-fit check --json` writes them: a list of dicts.
    #[getter]
    fn channels<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let dataset = &self.reading.dataset;
        finding::figures(py, &channels(&columns(dataset, &self.designed), dataset))
    }

    /// Time of the rows within their log, us: int64, (n,).
    #[getter]
    fn t_us<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        PyArray1::from_iter(py, self.rows().iter().map(|row| row.t_us))
    }

    /// Number of the movement of the rows: int64, (n,).
    #[getter]
    fn movement<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        let movements = &self.reading.dataset.movements;
        PyArray1::from_iter(
            py,
            self.rows().iter().map(|row| movements[row.movement].index),
        )
    }

    /// Codes of the Hall probes A, B, C: int32, (n, 3).
    #[getter]
    fn hall<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i32>>> {
        rows_of_three(py, self.rows().iter().map(|row| row.frame.hall()))
    }

    /// Codes of the gaps 1, 2, 3: int32, (n, 3); None of a log that has gaps or the vertical pose itself.
    #[getter]
    fn caps<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<i32>>>> {
        let codes = self.rows().iter().map(|row| row.frame.capacitive());
        let codes: Option<Vec<[i32; 3]>> = codes.collect();
        codes.map(|codes| rows_of_three(py, codes)).transpose()
    }

    /// X, Y, Rz by the interferometers: float64, (n, 3), m, m, rad; zeros in a log without reference.
    #[getter]
    fn reference<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        rows_of_three(py, self.rows().iter().map(|row| row.reference))
    }

    /// Z, Rx, Ry by the capacitive sensors: float64, (n, 3), m, rad, rad.
    #[getter]
    fn vertical<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        rows_of_three(py, self.rows().iter().map(|row| row.vertical))
    }

    /// Temperature of the magnets' mount: float64, (n,), degC, NaN where there is none.
    #[getter]
    fn mount<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.temperature(py, 0)
    }

    /// Temperature of the stage body at the Hall elements, as `mount`.
    #[getter]
    fn body<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.temperature(py, 1)
    }

    /// The rows as a `pandas.DataFrame`: number of the log, movement, time, codes, poses, temperatures, in SI
    /// units but for `t_us` and degC. Needs pandas.
    #[getter]
    fn df<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let (py, this) = (slf.py(), slf.get());
        let movements = &this.reading.dataset.movements;
        let logs = this
            .rows()
            .iter()
            .map(|row| movements[row.movement].log as i64);
        let logs = PyArray1::from_iter(py, logs);
        let has_temperatures = [0, 1].map(|sensor| {
            let all = 0..this.rows().len();
            this.reading
                .dataset
                .temperature_range_mc(sensor, all)
                .is_some()
        });
        let frame = py.import("hallstage._results")?.getattr("frame")?;
        frame.call1((slf, logs, this.has_reference(), has_temperatures))
    }

    fn __repr__(&self) -> String {
        let dataset = &self.reading.dataset;
        let (rows, movements) = dataset.read();
        let names = dataset
            .logs
            .iter()
            .map(|log| log.path.display().to_string());
        let names = names.collect::<Vec<_>>().join(", ");
        let held = match dataset.rows.len() {
            held if held < rows => format!(", {held} of them held"),
            _ => String::new(),
        };
        let movements = counted(movements, "movement");
        format!("<Log {names}: {rows} rows in {movements}{held}>")
    }
}

/// Columns of temperatures in a log of arrays, and in a table.
const MOUNT: &str = "mount_c";
const BODY: &str = "body_c";

impl Log {
    /// A log from its text, and where its columns come from if arrays made it: name in the header and name
    /// of the argument.
    pub fn from_text(
        py: Python<'_>,
        text: &[u8],
        name: &Path,
        stage: Py<Stage>,
        options: &ReadOptions,
        arguments: &[(String, String)],
    ) -> PyResult<Self> {
        let base = &stage.get().designed;
        // The columns of arrays have their own names.
        let mut layout = LogLayout::default();
        // Temperatures are none of its quantities.
        layout.ignored = vec![MOUNT.to_owned(), BODY.to_owned()];
        let designed = Arc::new(Designed {
            log: layout,
            temperature: TemperatureTable {
                columns: [Some(MOUNT.to_owned()), Some(BODY.to_owned())],
                scale_mc: [1e3, 0.0],
                ..base.temperature.clone()
            },
            ..Designed::clone(base)
        });
        let reading = work::run(py, || log::read_bytes(text, name, &designed, options))?;
        let reading = reading.map_err(|error| arrays_error(py, &error, arguments))?;
        Ok(Self {
            reading: Arc::new(reading),
            source: Source::Text(text.to_vec(), name.to_owned()),
            options: *options,
            designed,
            stage,
        })
    }

    fn rows(&self) -> &[Row] {
        &self.reading.dataset.rows
    }

    fn temperature<'py>(&self, py: Python<'py>, sensor: usize) -> Bound<'py, PyArray1<f64>> {
        let celsius = |row: &Row| match row.frame.temperature_mc()[sensor] {
            MISSING_CODE => f64::NAN,
            code => f64::from(code) * 1e-3,
        };
        PyArray1::from_iter(py, self.rows().iter().map(celsius))
    }

    pub fn has_reference(&self) -> bool {
        self.reading
            .dataset
            .logs
            .iter()
            .all(|log| log.has_reference)
    }

    /// Reads the log again for a command, with the options of the user; `take` gets every row with the number
    /// of its log.
    ///
    /// # Errors
    /// See [`LogError`].
    pub fn read_for(
        &self,
        command: ReadOptions,
        take: impl FnMut(usize, &LogRow),
    ) -> Result<LogReading, LogError> {
        let options = &ReadOptions {
            bad_rows: self.options.bad_rows,
            watch: self.options.watch,
            ..command
        };
        let stage = &self.designed;
        match &self.source {
            Source::Files(paths) => log::read_each(paths, stage, options, take),
            Source::Text(text, name) => log::read_each_of_bytes(text, name, stage, options, take),
        }
    }

    /// Raises the error of a log without reference, where one is needed.
    pub fn check_reference(&self, py: Python<'_>) -> PyResult<()> {
        if self.has_reference() {
            return Ok(());
        }
        match self.read_for(ReadOptions::FIT, |_, _| ()) {
            Ok(_) => Ok(()),
            Err(error) => Err(log_error(py, &error)),
        }
    }
}

/// An array of rows of three.
pub fn rows_of_three<'py, T: numpy::Element + Copy>(
    py: Python<'py>,
    rows: impl IntoIterator<Item = [T; 3]>,
) -> PyResult<Bound<'py, PyArray2<T>>> {
    let flat: Vec<T> = rows.into_iter().flatten().collect();
    let rows = flat.len() / 3;
    PyArray1::from_vec(py, flat).reshape([rows, 3])
}

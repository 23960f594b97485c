//! Logs: from files, arrays and frames.

use crate::error::{arrays_error, log_error, output_error, wrong};
use crate::held::HeldRows;
use crate::pickle::restored;
use crate::source::{Logs, Source, is_own};
use crate::stage::Stage;
use crate::table::csv;
use crate::text::{How, LogText};
use crate::work;
use host_fit::calibration::words;
use host_fit::input::log::{LogError, LogReading, ReadOptions};
use host_fit::input::text::TextReader;
use host_fit::input::watch::Watch;
use host_fit::output::write_atomically;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyTuple};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Logs of a stage, read and checked: rows in SI units, by movement.
///
/// Made by `Log.load`, `Log.from_frame` and `Log.from_arrays`. `log[rows]` is the log of some of its rows: a mask, a slice or
/// numbers of rows. `fit` and `check` work on a sample of a log of more than 125,000 rows; all else works on all rows.
#[pyclass(frozen, subclass, module = "hallstage")]
pub struct Log {
    pub reading: Arc<LogReading>,
    pub text: LogText,
    pub stage: Py<Stage>,
    pub held: Arc<HeldRows>,
}

#[pymethods]
impl Log {
    /// Reads logs of a stage, in every form that the program `host-fit` takes: CSV or CSV.gz, any separator,
    /// decimal commas, units in the header, UTF-16, dates as times; and in the form of `log.save` and `log.df.to_csv`.
    ///
    /// `paths`: one file or several, which are calibrated together. `bad_rows`: "refuse", or "skip" to count rows with a
    /// bad cell and go on without them. `rows`: "all", or "sample" to hold, in little memory, the sample that `fit`
    /// works on.
    ///
    /// Raises `LogError` with `.file`, `.line`, `.column` where something is wrong, `OSError` where a file cannot
    /// be read.
    #[staticmethod]
    #[pyo3(signature = (paths, stage, *, bad_rows = "refuse", rows = "all"))]
    fn load(
        py: Python<'_>,
        paths: &Bound<'_, PyAny>,
        stage: Py<Stage>,
        bad_rows: &str,
        rows: &str,
    ) -> PyResult<Self> {
        let paths: Vec<PathBuf> = match paths.extract::<PathBuf>() {
            Ok(one) => vec![one],
            Err(_) => paths
                .extract()
                .map_err(|_| wrong("paths", "a path, or a list of paths, is needed"))?,
        };
        if paths.iter().any(|path| path.as_os_str() == "-") {
            let problem = "`-` is no file; read standard input by sys.stdin";
            return Err(wrong("paths", problem));
        }
        let how = How::new(bad_rows, rows)?;
        let source = Source::files(paths, &stage.get().designed);
        Self::read(py, source, stage, how, |error| log_error(py, error))
    }

    /// A log of a `pandas.DataFrame`, with the columns of a file: the columns of `log.df`, or the columns that the stage
    /// names. A named index is a column.
    ///
    /// `name` stands for the file in reports; `bad_rows` as for `load`. Raises `LogError` with `.line`, the row from 0, and
    /// `.name`, the column.
    #[staticmethod]
    #[pyo3(signature = (frame, stage, *, name = "frame", bad_rows = "refuse"))]
    fn from_frame(
        py: Python<'_>,
        frame: &Bound<'_, PyAny>,
        stage: Py<Stage>,
        name: &str,
        bad_rows: &str,
    ) -> PyResult<Self> {
        let how = How::new(bad_rows, "all")?;
        let made = py.import("hallstage._arrays")?.getattr("frame_text")?;
        let (text, columns): (String, Vec<(String, String)>) = made.call1((frame,))?.extract()?;
        let name = Path::new(name);
        let reader = TextReader::from_reader(text.as_bytes(), name);
        let reader = reader.map_err(|error| log_error(py, &error.into()))?;
        let is_own = is_own(reader, &stage.get().designed.log);
        let source = Source::text(name, text.into_bytes(), is_own);
        Self::read(py, source, stage, how, |error| {
            arrays_error(py, error, &columns)
        })
    }

    /// A log of arrays, by the checks that files pass.
    ///
    /// `time`: s, (n,). `hall`, `caps`: codes of the Hall probes A, B, C and of the gaps 1, 2, 3, whole
    /// numbers, (n, 3); in place of `caps` the vertical pose `z`, `rx`, `ry`, (n,). Reference, (n,): the beams
    /// `x`, `y1`, `y2`, or the pose `x`, `y`, `rz`; a log that is only decoded needs none. `movement`: its number,
    /// whole, (n,); without it movements end at gaps in time. `mount`, `body`: temperatures, degC, (n,), NaN
    /// where there is none. `units` of lengths: m, mm, um, nm, pm; `angles`: rad, mrad, urad, nrad, deg.
    /// `name` stands for the file in reports; `bad_rows` as for `load`.
    ///
    /// Raises `ValueError` with the name of an argument of wrong shape, dtype or unit, and `LogError` for a
    /// row, with `.line` the row from 0 and `.name` the argument.
    #[staticmethod]
    #[pyo3(
        signature = (stage, *, name = "arrays", bad_rows = "refuse", **arrays),
        text_signature = "(stage, *, time, hall, caps=None, z=None, rx=None, ry=None, x=None, y1=None, y2=None, y=None, \
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
        let how = How::new(bad_rows, "all")?;
        let made = py.import("hallstage._arrays")?.getattr("from_arrays")?;
        let (columns, arguments): (Bound<'_, PyDict>, Vec<(String, String)>) =
            made.call((), arrays)?.extract()?;
        let source = Source::text(Path::new(name), csv(&columns, None)?, true);
        Self::read(py, source, stage, how, |error| {
            arrays_error(py, error, &arguments)
        })
    }

    /// Writes the rows as CSV, with the columns of `log.df`; `Log.load` reads it. Raises `OSError` where it cannot be written.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let text = csv(&self.columns(py)?, None)?;
        write_atomically(&path, &text).map_err(|error| output_error(&error))
    }

    fn __getitem__(&self, py: Python<'_>, rows: &Bound<'_, PyAny>) -> PyResult<Self> {
        let text = csv(&self.columns(py)?, Some(rows))?;
        let name = format!("{}[rows]", self.reading.dataset.logs[0].path.display());
        let source = Source::text(Path::new(&name), text, true);
        let stage = self.stage.clone_ref(py);
        Self::read(py, source, stage, How::WHOLE, |error| log_error(py, error))
    }

    /// Rows that are held.
    fn __len__(&self) -> usize {
        self.held.rows.len()
    }

    fn __repr__(&self) -> String {
        let dataset = &self.reading.dataset;
        let (rows, movements) = dataset.read();
        let names = dataset
            .logs
            .iter()
            .map(|log| log.path.display().to_string());
        let names = names.collect::<Vec<_>>().join(", ");
        let held = match self.held.rows.len() {
            held if held < rows => format!(", {held} of them held"),
            _ => String::new(),
        };
        let movements = host_fit::input::axis::counted(movements, "movement");
        format!("<Log {names}: {rows} rows in {movements}{held}>")
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let LogText { source, how, .. } = &self.text;
        let texts = source.texts()?.into_iter();
        let texts: Vec<_> = texts
            .map(|(name, text)| (name, PyBytes::new(py, &text)))
            .collect();
        let (bad_rows, rows) = how.words();
        let stage = self.stage.clone_ref(py);
        let arguments = (
            py.get_type::<Self>(),
            texts,
            source.is_own,
            stage,
            bad_rows,
            rows,
        );
        restored(py, arguments)
    }

    #[staticmethod]
    fn _restore(
        py: Python<'_>,
        texts: Vec<(PathBuf, Vec<u8>)>,
        is_own: bool,
        stage: Py<Stage>,
        bad_rows: &str,
        rows: &str,
    ) -> PyResult<Self> {
        let source = Source {
            logs: Logs::Texts(texts),
            is_own,
        };
        let how = How::new(bad_rows, rows)?;
        Self::read(py, source, stage, how, |error| log_error(py, error))
    }
}

impl Log {
    /// Reads logs; `raised` is the exception for an error.
    pub fn read(
        py: Python<'_>,
        source: Source,
        stage: Py<Stage>,
        how: How,
        raised: impl FnOnce(&LogError) -> PyErr,
    ) -> PyResult<Self> {
        let text = LogText::new(source, &stage.get().designed, how);
        let again = text.clone();
        let read = work::run(py, move |watch| {
            let mut all = HeldRows::default();
            // A log that is only decoded has no reference.
            let reading = text.read(ReadOptions::SENSORS, watch, |log, row| {
                if !how.is_sample {
                    all.push(log, row.movement, &row.row);
                }
            })?;
            let held = if how.is_sample {
                HeldRows::of(&reading.dataset)
            } else {
                all
            };
            Ok((reading, held))
        })?;
        let (reading, held) = read.map_err(|error| raised(&error))?;
        Ok(Self {
            reading: Arc::new(reading),
            text: again,
            stage,
            held: Arc::new(held),
        })
    }

    /// The same log.
    pub fn clone_ref(&self, py: Python<'_>) -> Self {
        Self {
            reading: Arc::clone(&self.reading),
            text: self.text.clone(),
            stage: self.stage.clone_ref(py),
            held: Arc::clone(&self.held),
        }
    }

    /// Whether all logs hold the interferometers' reference.
    pub fn has_reference(&self) -> bool {
        let mut logs = self.reading.dataset.logs.iter();
        logs.all(|log| log.has_reference)
    }

    /// Raises the error of a log without reference, where one is needed.
    pub fn check_reference(&self, py: Python<'_>) -> PyResult<()> {
        if self.has_reference() {
            return Ok(());
        }
        match self.text.read(ReadOptions::FIT, Watch::NONE, |_, _| ()) {
            Ok(_) => Ok(()),
            Err(error) => Err(log_error(py, &error)),
        }
    }

    /// The messages of its warnings.
    pub fn warnings(&self) -> Vec<String> {
        let messages = words::messages(&self.reading.warnings);
        messages
            .iter()
            .map(|message| words::python(message))
            .collect()
    }
}

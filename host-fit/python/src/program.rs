//! The program `host-fit`, and the logs that it brings.

use crate::error::output_error;
use host_fit::input::shipped::FILES;
use host_fit::output::{make_folder, write_atomically};
use pyo3::prelude::*;
use std::ffi::OsString;
use std::io::{self, Write};
use std::path::PathBuf;

/// Runs the program `host-fit`.
///
/// `arguments` begins with the program's name. Gives the exit status: 0 good, 2 wrong usage, 3 bad
/// input or output, 4 the fit failed its own checks, 130 interrupted.
#[pyfunction]
pub fn main_of(python: Python<'_>, arguments: Vec<OsString>) -> u8 {
    python.detach(|| {
        let status = host_fit::cli::main_of(arguments);
        // Python ends this process without Rust's own end.
        let _ = io::stdout().flush();
        status
    })
}

/// Writes the logs of a simulated stage and its `stage.toml` into `folder`, which is made.
///
/// `paper.csv.gz`: 57,000 rows of the paper's protocol; `run30.csv.gz`: one run of 30 s with all axes moving;
/// `service.csv.gz`: other motions, with the true pose as reference. Raises `OSError` where they
/// cannot be written.
#[pyfunction]
pub fn write_demo(folder: PathBuf) -> PyResult<()> {
    make_folder(&folder).map_err(|error| output_error(&error))?;
    for (name, bytes) in FILES {
        let written = write_atomically(&folder.join(name), bytes);
        written.map_err(|error| output_error(&error))?;
    }
    Ok(())
}

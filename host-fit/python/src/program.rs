//! The program `host-fit`, and the logs that it brings.

use host_fit::input::shipped::{LOG_GZ, RUN_GZ, SERVICE_GZ, STAGE_TOML};
use pyo3::prelude::*;
use std::ffi::OsString;
use std::fs;
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
    fs::create_dir_all(&folder)?;
    for (name, bytes) in [
        ("paper.csv.gz", LOG_GZ),
        ("run30.csv.gz", RUN_GZ),
        ("service.csv.gz", SERVICE_GZ),
        ("stage.toml", STAGE_TOML.as_bytes()),
    ] {
        fs::write(folder.join(name), bytes)?;
    }
    Ok(())
}

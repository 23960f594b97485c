//! The Python package `hallstage`: the library [`host_fit`] for NumPy and notebooks.
//!
//! One file a group of classes; each function reads its arguments, calls the library without the GIL,
//! and returns its result. The package computes nothing itself.

mod arrays;
mod calibration;
mod choice;
mod columns;
mod decoder;
mod error;
mod evaluation;
mod finding;
mod fit;
mod held;
mod judged;
mod known;
mod log;
mod minimize;
mod motion;
mod origin;
mod pickle;
mod plan;
mod program;
mod report;
mod rows;
mod si;
mod source;
mod stage;
mod statistics;
mod table;
mod text;
mod uncertainty;
mod work;

use pyo3::prelude::*;

/// The library in Rust behind the package `hallstage`.
#[pymodule]
mod _hallstage {
    #[pymodule_export]
    use crate::calibration::Calibration;
    #[pymodule_export]
    use crate::decoder::{Decoder, status_names};
    #[pymodule_export]
    use crate::evaluation::Evaluation;
    #[pymodule_export]
    use crate::fit::{check, fit};
    #[pymodule_export]
    use crate::log::Log;
    #[pymodule_export]
    use crate::minimize::minimize;
    #[pymodule_export]
    use crate::plan::{Plan, SimulatedLog, plan_run, simulate};
    #[pymodule_export]
    use crate::program::{main_of, write_demo};
    #[pymodule_export]
    use crate::stage::Stage;
}

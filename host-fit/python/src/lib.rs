//! The Python package `hallstage`: the library [`host_fit`] for NumPy and notebooks.
//!
//! One file a group of classes; each function reads its arguments, calls the library without the GIL,
//! and hands over what it gives. Nothing is computed here.

mod minimize;
mod program;

use pyo3::prelude::*;

/// The library in Rust behind the package `hallstage`.
#[pymodule]
mod _hallstage {
    #[pymodule_export]
    use crate::minimize::{OptimizeResult, minimize};
    #[pymodule_export]
    use crate::program::{main_of, write_demo};
}

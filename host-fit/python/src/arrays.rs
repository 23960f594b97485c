//! Arguments that are arrays: checked by `hallstage._arrays`, and read in place if their layout allows it.

use crate::error::wrong;
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

/// The argument as a checked array. `kinds` are the accepted kinds of its dtype.
fn checked<'py>(
    argument: &str,
    given: &Bound<'py, PyAny>,
    columns: Option<usize>,
    (kinds, wanted): (&str, &str),
    dtype: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let module = given.py().import("hallstage._arrays")?;
    let arguments = (argument, given, columns, kinds, wanted, dtype);
    module.call_method1("checked", arguments)
}

/// Codes of three sensors a row, (n, 3), in `i32`.
pub fn codes<'py>(
    argument: &str,
    given: &Bound<'py, PyAny>,
) -> PyResult<PyReadonlyArray2<'py, i32>> {
    let whole = ("iu", "codes (whole numbers)");
    let array = checked(argument, given, Some(3), whole, "int32")?;
    Ok(array.cast_into::<PyArray2<i32>>()?.try_readonly()?)
}

/// Numbers, (n,), in `f64`.
pub fn reals<'py>(
    argument: &str,
    given: &Bound<'py, PyAny>,
) -> PyResult<PyReadonlyArray1<'py, f64>> {
    let array = checked(argument, given, None, ("iuf", "numbers"), "float64")?;
    Ok(array.cast_into::<PyArray1<f64>>()?.try_readonly()?)
}

/// Numbers, (n, columns), in `f64`.
pub fn table<'py>(
    argument: &str,
    given: &Bound<'py, PyAny>,
    columns: usize,
) -> PyResult<PyReadonlyArray2<'py, f64>> {
    let numbers = ("iuf", "numbers");
    let array = checked(argument, given, Some(columns), numbers, "float64")?;
    Ok(array.cast_into::<PyArray2<f64>>()?.try_readonly()?)
}

/// Raises where an argument has another number of rows than another argument.
pub fn same_rows(argument: &str, rows: usize, other: &str, wanted: usize) -> PyResult<()> {
    match rows == wanted {
        true => Ok(()),
        false => Err(wrong(
            argument,
            format!("{rows} rows, but {other} has {wanted}"),
        )),
    }
}

/// The numbers of a checked array.
pub fn slice<T>(made: Result<&[T], impl std::fmt::Display>) -> PyResult<&[T]> {
    made.map_err(crate::error::internal)
}

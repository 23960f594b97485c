//! Arguments that are arrays: checked, and read where they lie if their layout allows it.

use crate::error::wrong;
use numpy::{
    PyArray1, PyArray2, PyArrayDescrMethods, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2,
    PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::intern;
use pyo3::prelude::*;

/// The argument as an array of numbers with at least one row, each of one number or of `columns`. `kinds` are the accepted
/// kinds of its dtype.
fn array<'py>(
    argument: &str,
    given: &Bound<'py, PyAny>,
    columns: Option<usize>,
    kinds: &str,
    wanted: &str,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    let py = given.py();
    let numpy = py.import("numpy")?;
    let masked = numpy.getattr("ma")?.getattr("MaskedArray")?;
    if given.is_instance(&masked)? {
        return Err(wrong(
            argument,
            "a masked array; remove the masked rows, since the mask would be lost",
        ));
    }
    let made = numpy.call_method1("asarray", (given,));
    let made = made.map_err(|error| wrong(argument, format!("no array of {wanted}: {error}")))?;
    let made = made.cast_into::<PyUntypedArray>()?;
    let dtype = made.dtype();
    let kind: String = dtype.getattr("kind")?.extract()?;
    let (fits, want) = match (made.shape(), columns) {
        (shape, None) => (shape.len() == 1, "one number a row, (n,)".to_owned()),
        (shape, Some(columns)) => (
            matches!(shape, [_, found] if *found == columns),
            format!("{columns} numbers a row, (n, {columns})"),
        ),
    };
    if !fits {
        let shape = shape(&made);
        return Err(wrong(argument, format!("shape {shape}: {want}, is needed")));
    }
    if made.is_empty() {
        return Err(wrong(argument, "no rows"));
    }
    if !kinds.contains(&kind) {
        return Err(wrong(
            argument,
            format!("dtype {dtype}: {wanted} are needed"),
        ));
    }
    Ok(made)
}

fn shape(array: &Bound<'_, PyUntypedArray>) -> String {
    let sizes: Vec<String> = array.shape().iter().map(usize::to_string).collect();
    match &sizes[..] {
        [one] => format!("({one},)"),
        sizes => format!("({})", sizes.join(", ")),
    }
}

/// In C order, of this dtype; the same array where it is that already.
fn laid_out<'py>(array: &Bound<'py, PyUntypedArray>, dtype: &str) -> PyResult<Bound<'py, PyAny>> {
    let numpy = array.py().import("numpy")?;
    numpy.call_method1("ascontiguousarray", (array, dtype))
}

/// That all whole numbers fit into this range.
fn check_range(
    argument: &str,
    array: &Bound<'_, PyUntypedArray>,
    low: i64,
    high: i64,
) -> PyResult<()> {
    let end = |which| -> PyResult<i128> { array.call_method0(which)?.extract() };
    let [least, most] = [
        end(intern!(array.py(), "min"))?,
        end(intern!(array.py(), "max"))?,
    ];
    if least < low.into() || most > high.into() {
        let problem = format!("numbers from {least} to {most}, but {low} to {high} is what fits");
        return Err(wrong(argument, problem));
    }
    Ok(())
}

/// Codes of three sensors a row, (n, 3), in `i32`.
pub fn codes<'py>(
    argument: &str,
    given: &Bound<'py, PyAny>,
) -> PyResult<PyReadonlyArray2<'py, i32>> {
    let array = array(argument, given, Some(3), "iu", "codes (whole numbers)")?;
    if array.dtype().itemsize() >= 4 {
        check_range(argument, &array, i32::MIN.into(), i32::MAX.into())?;
    }
    let laid_out = laid_out(&array, "int32")?.cast_into::<PyArray2<i32>>()?;
    Ok(laid_out.try_readonly()?)
}

/// Whole numbers, (n,), in `i64`.
pub fn whole<'py>(
    argument: &str,
    given: &Bound<'py, PyAny>,
) -> PyResult<PyReadonlyArray1<'py, i64>> {
    let array = array(argument, given, None, "iu", "whole numbers")?;
    check_range(argument, &array, i64::MIN, i64::MAX)?;
    let laid_out = laid_out(&array, "int64")?.cast_into::<PyArray1<i64>>()?;
    Ok(laid_out.try_readonly()?)
}

/// Numbers, (n,), in `f64`.
pub fn reals<'py>(
    argument: &str,
    given: &Bound<'py, PyAny>,
) -> PyResult<PyReadonlyArray1<'py, f64>> {
    let array = array(argument, given, None, "iuf", "numbers")?;
    let laid_out = laid_out(&array, "float64")?.cast_into::<PyArray1<f64>>()?;
    Ok(laid_out.try_readonly()?)
}

/// Numbers, (n, columns), in `f64`.
pub fn table<'py>(
    argument: &str,
    given: &Bound<'py, PyAny>,
    columns: usize,
) -> PyResult<PyReadonlyArray2<'py, f64>> {
    let array = array(argument, given, Some(columns), "iuf", "numbers")?;
    let laid_out = laid_out(&array, "float64")?.cast_into::<PyArray2<f64>>()?;
    Ok(laid_out.try_readonly()?)
}

/// That an argument has as many rows as another one.
pub fn same_rows(argument: &str, rows: usize, other: &str, wanted: usize) -> PyResult<()> {
    match rows == wanted {
        true => Ok(()),
        false => Err(wrong(
            argument,
            format!("{rows} rows, but {other} has {wanted}"),
        )),
    }
}

/// The numbers of an array that [`codes`], [`whole`], [`reals`] or [`table`] has laid out.
pub fn slice<T>(made: Result<&[T], impl std::fmt::Display>) -> PyResult<&[T]> {
    made.map_err(crate::error::internal)
}

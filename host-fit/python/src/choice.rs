//! Settings by name.

use crate::error::wrong;
use host_fit::calibrate::Choice;
use pyo3::PyResult;

/// The value of this name.
pub fn chosen<T: Choice>(argument: &str, name: &str) -> PyResult<T> {
    let all = T::all();
    let names: Vec<&str> = all.iter().map(|(_, name, _)| *name).collect();
    let problem = format!("`{name}` is none of {}", names.join(", "));
    let found = all.into_iter().find(|(_, known, _)| *known == name);
    found
        .map(|(value, ..)| value)
        .ok_or_else(|| wrong(argument, problem))
}

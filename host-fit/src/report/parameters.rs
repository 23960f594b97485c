//! Parameters by name in JSON.

use crate::problem::model::{COUNT, Model, ParameterId};
use crate::problem::parameters::Parameters;
use crate::solve::field::parameters::values_of;
use crate::solve::field::terms::{self, PER_PROBE};
use runtime::ParameterSet;
use runtime::geometry::ProbeCoordinates;
use serde::Serialize;
use std::collections::BTreeMap;

/// One parameter.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Parameter {
    /// SI value.
    pub value: f64,
    /// SI unit.
    pub unit: &'static str,
    /// Standard error, SI; null where the model fixes the parameter, where it stands at an end of
    /// its range, or where it is not known (`eval`, `inspect`).
    pub standard_error: Option<f64>,
}

/// The six coordinates nearest to the designed ones: a choice, not a measurement.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Coordinates {
    /// m.
    pub h1x_m: f64,
    /// m.
    pub h1y_m: f64,
    /// m.
    pub h2x_m: f64,
    /// m.
    pub h2y_m: f64,
    /// m.
    pub h3x_m: f64,
    /// m.
    pub h3y_m: f64,
    /// What they are.
    pub note: &'static str,
}

impl From<ProbeCoordinates<f64>> for Coordinates {
    fn from(h: ProbeCoordinates<f64>) -> Self {
        Self {
            h1x_m: h.h1x_m,
            h1y_m: h.h1y_m,
            h2x_m: h.h2x_m,
            h2y_m: h.h2y_m,
            h3x_m: h.h3x_m,
            h3y_m: h.h3y_m,
            note: "smallest change from the designed values that gives the lever arms; data cannot tell the two coordinates of a probe apart",
        }
    }
}

/// The parameters of a model by name, with their standard errors where they are known.
pub fn parameters(
    model: &'static Model,
    values: &Parameters,
    standard_error: &[Option<f64>; COUNT],
) -> BTreeMap<String, Parameter> {
    let one = |id: ParameterId| {
        let parameter = Parameter {
            value: values.values[id.index],
            unit: id.term.unit,
            standard_error: standard_error[id.index],
        };
        (id.name(), parameter)
    };
    model.parameters().map(one).collect()
}

/// All 81 parameters of a field model, A's first, by name, with their standard errors where they
/// are known.
pub fn field_parameters(
    values: &[[f64; PER_PROBE]; 3],
    standard_error: Option<&[f64; terms::COUNT]>,
) -> BTreeMap<String, Parameter> {
    let one = |(k, &value): (usize, &f64)| {
        let parameter = Parameter {
            value,
            unit: terms::TERMS[k % PER_PROBE].unit,
            standard_error: standard_error.map(|errors| errors[k]),
        };
        (terms::name(k), parameter)
    };
    values.as_flattened().iter().enumerate().map(one).collect()
}

/// The parameters that a blob carries, by name.
pub fn parameters_in(set: &ParameterSet) -> BTreeMap<String, Parameter> {
    match values_of(set) {
        Some(values) => field_parameters(&values, None),
        None => parameters(
            Model::of(set.model),
            &Parameters::of_set(set),
            &[None; COUNT],
        ),
    }
}

//! Parameters by name in JSON.

use crate::report::table::{Table, number, with_error};
use hallstage_input::stage::{Stage, paper_signs};
use hallstage_solver::problem::model::{COUNT, Model, ParameterId};
use hallstage_solver::problem::parameters::Parameters;
use hallstage_solver::problem::terms::shown;
use hallstage_solver::solve::field::parameters::values_of;
use hallstage_solver::solve::field::terms::{self, BEYOND_MODEL_31, PER_PROBE};
use runtime::{ModelKind, ParameterSet};
use serde::Serialize;
use serde_json::{Value, json};
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
pub fn coordinates(places_m: [[f64; 2]; 3]) -> Value {
    let [[h1x_m, h1y_m], [h2x_m, h2y_m], [h3x_m, h3y_m]] = paper_signs(places_m);
    json!({
        "h1x_m": h1x_m,
        "h1y_m": h1y_m,
        "h2x_m": h2x_m,
        "h2y_m": h2y_m,
        "h3x_m": h3x_m,
        "h3y_m": h3y_m,
        "note": "smallest change from the designed values that gives the lever arms; data cannot tell the two coordinates of a probe apart",
    })
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

/// k and h of the temperatures, where a blob has them, by name.
pub fn temperature_parameters_in(set: &ParameterSet) -> BTreeMap<String, Parameter> {
    let temperature = &set.constants.temperature;
    let names = terms::names(usize::MAX).split_off(terms::COUNT);
    let one = |(name, per_mk): (String, &f32)| {
        let parameter = Parameter {
            value: f64::from(*per_mk) * 1e3,
            unit: "1/K",
            standard_error: None,
        };
        (name, parameter)
    };
    let named = names.into_iter().zip(temperature.per_mk.as_flattened());
    named.map(one).filter(|_| temperature.is_used()).collect()
}

/// A table with a row for each term, and with the given columns for each probe. `cells` gives
/// them for a parameter by its name and the factor from SI to the unit of the row, as
/// misalignments are in mrad; a term that it gives none for is left out.
pub fn by_probe<'c>(
    title: &str,
    terms: std::ops::Range<usize>,
    columns: &[&'c str],
    cells: impl Fn(&str, f64) -> Option<Vec<String>>,
) -> Table {
    let of_probe = |probe: &'static str| {
        let title = |column: &&'c str| if column.is_empty() { probe } else { *column };
        columns.iter().map(title).collect::<Vec<_>>()
    };
    let titles = ["A", "B", "C"].into_iter().flat_map(of_probe);
    let titles: Vec<&str> = titles.chain(["unit"]).collect();
    let mut table = Table::new(title, &titles);
    for term in terms {
        let (scale, unit) = shown(1.0, terms::TERMS[term].unit);
        let probes = [0, 1, 2].map(|probe| cells(&terms::name(probe * PER_PROBE + term), scale));
        if let [Some(a), Some(b), Some(c)] = probes {
            table.row(
                terms::TERMS[term].name,
                [a, b, c, vec![unit.to_owned()]].concat(),
            );
        }
    }
    table
}

/// Parameters with their standard errors in the last digits: those of Model (31), beside values of the
/// same names if there are any, and those beyond it.
pub fn tables(
    parameters: &BTreeMap<String, Parameter>,
    beside: &[(&str, BTreeMap<String, f64>)],
) -> Vec<Table> {
    let value = |name: &str, scale: f64| {
        let p = parameters.get(name)?;
        Some(with_error(
            p.value * scale,
            p.standard_error.map(|error| error * scale),
        ))
    };
    let columns: Vec<&str> = [""]
        .into_iter()
        .chain(beside.iter().map(|(title, _)| *title))
        .collect();
    let of_31 = by_probe("parameters", 0..BEYOND_MODEL_31, &columns, |name, scale| {
        let beside = beside.iter().map(|(_, values)| {
            values
                .get(name)
                .map_or("-".to_owned(), |x| number(x * scale, ""))
        });
        Some(std::iter::once(value(name, scale)?).chain(beside).collect())
    });
    let beyond = by_probe(
        "field terms",
        BEYOND_MODEL_31..PER_PROBE,
        &[""],
        |name, scale| Some(vec![value(name, scale)?]),
    );
    [of_31, beyond]
        .into_iter()
        .filter(|table| !table.rows.is_empty())
        .collect()
}

/// What a term means, in a line.
pub fn meaning(name: &str) -> String {
    let meaning = match name {
        "lever_arm" => {
            "distance of the line along which the probe senses from the centre of the stage"
        }
        "theta" => "angle between that line and its designed direction",
        "eta" => "sensitivity at rest over the designed one",
        "a" => "change of the sensitivity with height Z",
        "b" => "change of the sensitivity with tilt Rx",
        "c" => "change of the sensitivity with tilt Ry",
        "e_z" => "how far height Z carries the probe sideways",
        "e_rx" => "how far tilt Rx carries the probe sideways",
        "e_ry" => "how far tilt Ry carries the probe sideways",
        // u, w and z with their powers.
        _ => {
            return format!(
                "shape of the field: the part that goes with {}",
                powers(name)
            );
        }
    };
    meaning.to_owned()
}

/// `uw2` as u w².
fn powers(name: &str) -> String {
    let sign = |c: char| match c {
        '2' => "²".to_owned(),
        '3' => "³".to_owned(),
        letter => format!(" {letter}"),
    };
    name.chars().map(sign).collect::<String>().trim().to_owned()
}

/// The designed values by name, SI.
pub fn designed(stage: &Stage) -> BTreeMap<String, f64> {
    let values = Parameters::designed(stage).values;
    let ids = Model::of(ModelKind::M31).parameters();
    ids.map(|id| (id.name(), values[id.index])).collect()
}

//! The parameters of a model by name.

use super::figure::{Figure, Group, bare, figure, group};
use super::table::Table;
use hallstage_input::axis::{AXES, PROBES};
use hallstage_input::stage::{Stage, paper_signs};
use hallstage_solver::estimator::model::{COUNT, Model, ParameterId};
use hallstage_solver::estimator::paper::Parameters;
use hallstage_solver::estimator::parameters::values_of;
use hallstage_solver::estimator::terms::{self, BEYOND_MODEL_31, PER_PROBE};
use runtime::{ModelKind, ParameterSet};
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

impl From<Parameter> for Figure {
    fn from(parameter: Parameter) -> Self {
        bare(parameter.value, parameter.unit).with_error(parameter.standard_error)
    }
}

/// The six coordinates nearest to the designed ones: a choice, not a measurement.
pub fn coordinates(places_m: [[f64; 2]; 3]) -> Group {
    let [[h1x, h1y], [h2x, h2y], [h3x, h3y]] = paper_signs(places_m);
    let m = |x: f64| figure(x, "m");
    group! {
        "h1x" => m(h1x), "h1y" => m(h1y), "h2x" => m(h2x), "h2y" => m(h2y), "h3x" => m(h3x), "h3y" => m(h3y),
        "note" => "smallest change from the designed values that gives the lever arms; data cannot separate the two coordinates of a probe",
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
            Model::from_kind(set.model),
            &Parameters::from_set(set),
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

/// A and L of the motion correction, where a blob has one, by name.
pub fn motion_parameters_in(set: &ParameterSet) -> Vec<(String, Parameter)> {
    let Some(motion) = &set.motion_correction else {
        return Vec::new();
    };
    let mut all = Vec::new();
    let mut add = |letter: &str, numbers: &[f32], [unit, by_angle, of_angle]: [&'static str; 3]| {
        for (k, &value) in numbers.iter().enumerate() {
            let columns = numbers.len() / 3;
            let (row, column) = (&AXES[k / columns], &AXES[k % columns]);
            let parameter = Parameter {
                value: value.into(),
                unit: match (row.unit, column.unit) {
                    ("rad", "m") => of_angle,
                    ("m", "rad") => by_angle,
                    _ => unit,
                },
                standard_error: None,
            };
            all.push((format!("{letter}_{}_{}", row.key, column.key), parameter));
        }
    };
    let (a, l) = (
        motion.acceleration_s2.as_flattened(),
        motion.velocity_s.as_flattened(),
    );
    add("A", a, ["s2", "m s2", "s2/m"]);
    add("L", l, ["s", "m s", "s/m"]);
    all
}

/// A table with a row for each term, and with the given columns for each probe. `figures` gives them for a parameter by
/// its name and unit. A term without figures is left out.
pub fn probe_table<'c>(
    title: &str,
    terms: std::ops::Range<usize>,
    columns: &[&'c str],
    figures: impl Fn(&str, &'static str) -> Option<Vec<Figure>>,
) -> Table {
    let titled = |probe: &'static str| {
        let title = |column: &&'c str| if column.is_empty() { probe } else { *column };
        columns.iter().map(title).collect::<Vec<_>>()
    };
    let titles: Vec<&str> = PROBES.into_iter().flat_map(titled).collect();
    let mut table = Table::new(title, &titles);
    for term in terms {
        let (name, unit) = (terms::TERMS[term].name, terms::TERMS[term].unit);
        let probes = [0, 1, 2].map(|probe| figures(&terms::name(probe * PER_PROBE + term), unit));
        if let [Some(a), Some(b), Some(c)] = probes {
            let figures = [a, b, c].concat();
            table.row(name, figures.iter().map(|figure| figure.readable(false)));
        }
    }
    table
}

/// Parameters with their standard errors: the parameters of Model (31), beside values of the same names if there are any,
/// and those beyond it.
pub fn tables(
    parameters: &BTreeMap<String, Parameter>,
    beside: &[(&str, BTreeMap<String, f64>)],
) -> Vec<Table> {
    let titles = beside.iter().map(|(title, _)| *title);
    let columns: Vec<&str> = [""].into_iter().chain(titles).collect();
    let model_31_table = probe_table("parameters", 0..BEYOND_MODEL_31, &columns, |name, unit| {
        let beside = beside.iter().map(|(_, values)| {
            let value = values.get(name);
            value.map_or(Figure::None, |x| bare(*x, unit))
        });
        let own = Figure::from(*parameters.get(name)?);
        Some(std::iter::once(own).chain(beside).collect())
    });
    let beyond = probe_table(
        "field terms",
        BEYOND_MODEL_31..PER_PROBE,
        &[""],
        |name, _| Some(vec![Figure::from(*parameters.get(name)?)]),
    );
    let tables = [model_31_table, beyond].into_iter();
    tables.filter(|table| !table.rows.is_empty()).collect()
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
    let ids = Model::from_kind(ModelKind::M31).parameters();
    ids.map(|id| (id.name(), values[id.index])).collect()
}

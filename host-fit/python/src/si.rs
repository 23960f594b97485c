//! Figures in SI: the program's JSON has um, urad, us and mm in its keys and units.

use host_fit::calibration::words::python;
use serde_json::{Map, Value};

/// Units that are not SI, as keys and as figures name them: SI units in one, and the SI unit.
const UNITS: [(&str, f64, &str); 6] = [
    ("um", 1e-6, "m"),
    ("urad", 1e-6, "rad"),
    ("us", 1e-6, "s"),
    ("mm", 1e-3, "m"),
    ("1/mm", 1e3, "1/m"),
    ("1/mm2", 1e6, "1/m2"),
];

/// SI units in a unit, and the SI unit.
pub fn unit(name: &str) -> (f64, &str) {
    let known = UNITS.iter().find(|(known, ..)| *known == name);
    known.map_or((1.0, name), |(_, factor, si)| (*factor, si))
}

/// All figures of a report, its texts in the words of the package.
pub fn figures(value: Value) -> Value {
    match value {
        Value::Object(members) => Value::Object(group(members)),
        Value::Array(all) => all.into_iter().map(figures).collect(),
        Value::String(text) => python(&text).into(),
        other => other,
    }
}

fn group(members: Map<String, Value>) -> Map<String, Value> {
    let own = members
        .get("unit")
        .and_then(Value::as_str)
        .map(str::to_owned);
    let (own_factor, own_unit) = unit(own.as_deref().unwrap_or_default());
    let member = |(key, value): (String, Value)| match key.as_str() {
        "unit" if own.is_some() => (key, own_unit.into()),
        "value" | "standard_error" | "a" | "b" | "change" => {
            (key, scaled(figures(value), own_factor))
        }
        _ => {
            let words: Vec<(f64, &str)> = key.split('_').map(unit).collect();
            let factor = words.iter().map(|(factor, _)| factor).product();
            let words: Vec<&str> = words.into_iter().map(|(_, word)| word).collect();
            (words.join("_"), scaled(figures(value), factor))
        }
    };
    members.into_iter().map(member).collect()
}

/// A number, or all numbers of a list, in SI.
fn scaled(value: Value, factor: f64) -> Value {
    match value {
        _ if factor == 1.0 => value,
        Value::Array(all) => all.into_iter().map(|one| scaled(one, factor)).collect(),
        Value::Number(number) => number.as_f64().map(|x| x * factor).into(),
        other => other,
    }
}

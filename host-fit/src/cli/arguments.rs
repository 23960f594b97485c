//! Parsers of arguments that several commands take.

use crate::calibrate::Choice;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use runtime::OnInvalid;
use runtime::parameters::Text;
use std::num::ParseIntError;
use std::time::Duration;

/// Parses a [`Choice`].
pub(crate) fn choice<T: Choice>() -> impl TypedValueParser<Value = T> {
    let value = |(_, name, help): (T, &'static str, &'static str)| match help {
        "" => PossibleValue::new(name),
        help => PossibleValue::new(name).help(help),
    };
    PossibleValuesParser::new(T::all().into_iter().map(value)).try_map(|name| {
        let found = T::all().into_iter().find(|(_, known, _)| *known == name);
        found.map(|(value, ..)| value).ok_or("not a known value")
    })
}

/// A number between two ends, both included.
pub(crate) fn between(text: &str, low: f64, high: f64, what: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if (low..=high).contains(&number) => Ok(number),
        _ => Err(format!("expected {what} from {low} to {high}")),
    }
}

/// How long a bus is watched.
pub(crate) fn seconds(text: &str) -> Result<Duration, String> {
    between(text, 1e-9, 1e9, "a number of seconds").map(Duration::from_secs_f64)
}

/// What an invalid field reads: `--hold N`.
pub(crate) fn hold(text: &str) -> Result<OnInvalid, ParseIntError> {
    Ok(match text.parse()? {
        0 => OnInvalid::Zero,
        ticks => OnInvalid::Hold { ticks },
    })
}

/// How many rows are fitted: a number, or `None` for `all`.
pub(crate) fn train(text: &str) -> Result<Option<usize>, &'static str> {
    match (text, text.parse()) {
        ("all", _) => Ok(None),
        (_, Ok(rows)) if rows > 0 => Ok(Some(rows)),
        _ => Err("expected `all` or a number of rows, 1 or more"),
    }
}

/// A text that goes into a blob.
pub(crate) fn blob_text(value: &str) -> Result<Text, &'static str> {
    Text::try_from(value).map_err(|_| "at most 32 bytes fit in the blob")
}

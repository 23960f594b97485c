//! Arguments of more than one group: the stage file, numbers, the library's own choices by name.

use crate::calibrate::Choice;
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use runtime::OnInvalid;
use std::num::ParseIntError;
use std::path::PathBuf;
use std::time::Duration;

/// The stage file of a command.
#[derive(Clone, Debug, Args)]
pub(crate) struct StageFile {
    /// The stage as designed.
    #[arg(
        id = "stage",
        long = "stage",
        value_name = "FILE",
        default_value = "stage.toml"
    )]
    pub(crate) path: PathBuf,
}

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

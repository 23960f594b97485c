//! What several commands take: numbers of rows, the library's own choices by name.

use crate::compare::Case;
use crate::input::log::BadRows;
use crate::input::memory::half_of_the_machine;
use crate::problem::draw::Draw;
use crate::solve::robust::Loss;
use crate::solve::search::kind::SearchKind;
use crate::solve::{Projection, Solver};
use clap::builder::PossibleValue;
use clap::{Args, ValueEnum};
use hal_adapters::can::Layout;
use runtime::OnInvalid;
use std::str::FromStr;
use std::time::Duration;

/// How many rows are fitted: a number, or `None` for `all`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Train(pub(super) Option<usize>);

impl FromStr for Train {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match (text, text.parse()) {
            ("all", _) => Ok(Self(None)),
            (_, Ok(rows)) if rows > 0 => Ok(Self(Some(rows))),
            _ => Err("expected `all` or a number of rows, 1 or more"),
        }
    }
}

/// How much memory logs may take.
#[derive(Clone, Copy, Debug, Args)]
pub(super) struct Memory {
    /// Refuse logs whose rows take more memory than this, as 500MB or 2GiB; half of this machine's
    /// if not given. The work on them is not counted.
    #[arg(long = "memory", value_name = "SIZE", value_parser = bytes)]
    memory_bytes: Option<u64>,
}

impl Memory {
    /// The limit, bytes; `None` where neither the user nor the system names one.
    pub(super) fn limit_bytes(self) -> Option<u64> {
        self.memory_bytes.or_else(half_of_the_machine)
    }
}

/// A number of bytes with its unit.
fn bytes(text: &str) -> Result<u64, &'static str> {
    const UNITS: [(&str, f64); 7] = [
        ("kB", 1e3),
        ("MB", 1e6),
        ("GB", 1e9),
        ("KiB", 1024.0),
        ("MiB", 1_048_576.0),
        ("GiB", 1_073_741_824.0),
        ("B", 1.0),
    ];
    let with_unit = |(unit, bytes): &(&str, f64)| Some((text.strip_suffix(unit)?, *bytes));
    let (number, unit) = UNITS.iter().find_map(with_unit).unwrap_or((text, 1.0));
    match number.trim().parse::<f64>().map(|number| number * unit) {
        Ok(bytes) if (1.0..1e18).contains(&bytes) => Ok(bytes as u64),
        _ => Err("expected a size, as 500MB or 2GiB"),
    }
}

/// How long a bus is watched.
pub(super) fn seconds(text: &str) -> Result<Duration, &'static str> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds > 0.0 && seconds <= 1e9 => Ok(Duration::from_secs_f64(seconds)),
        _ => Err("expected a number of seconds above 0"),
    }
}

/// A length of movements: `--split`.
pub(super) fn movement_seconds(text: &str) -> Result<f64, &'static str> {
    match text.parse::<f64>() {
        Ok(seconds) if (1e-3..=1e6).contains(&seconds) => Ok(seconds),
        _ => Err("expected a number of seconds from 0.001 to 1000000"),
    }
}

impl ValueEnum for Projection {
    fn value_variants<'a>() -> &'a [Self] {
        &[Self::None, Self::Delta, Self::Linear]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let help = match self {
            Self::None => {
                "Nothing: every zero deviation is an unknown of its own, within its range (the paper)"
            }
            Self::Delta => "The zero deviations",
            Self::Linear => {
                "Everything linear: the gain G and one offset for each movement. Nine unknowns of model 31 are left"
            }
        };
        Some(PossibleValue::new(self.name()).help(help))
    }
}

impl ValueEnum for Case {
    fn value_variants<'a>() -> &'a [Self] {
        &Self::ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        match self {
            Self::Model31(projection) => projection.to_possible_value(),
            Self::Field => Some(PossibleValue::new(self.name()).help(
                "The field model, which the log must carry: nine unknowns are left, the same as with linear",
            )),
        }
    }
}

impl ValueEnum for SearchKind {
    fn value_variants<'a>() -> &'a [Self] {
        &Self::ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(PossibleValue::new(self.name()))
    }
}

impl ValueEnum for Solver {
    fn value_variants<'a>() -> &'a [Self] {
        &Self::ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(PossibleValue::new(self.name()))
    }
}

impl ValueEnum for Loss {
    fn value_variants<'a>() -> &'a [Self] {
        &Self::ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let help = match self {
            Self::Cauchy => "Hardly at all (the default)",
            Self::Huber => "As rows at the limit of 6 robust standard deviations do",
            Self::None => "As any other: plain least squares",
        };
        Some(PossibleValue::new(self.name()).help(help))
    }
}

impl ValueEnum for Draw {
    fn value_variants<'a>() -> &'a [Self] {
        &[Self::Stratified, Self::Plain]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(match self {
            Self::Stratified => PossibleValue::new("stratified").help(
                "Each movement gives its share, so that none is missed while N is at least their number",
            ),
            Self::Plain => PossibleValue::new("plain").help(
                "As the paper draws: any row with the same chance. Most draws of 200 rows out of 57 movements miss \
                 one, whose zero deviation then is free",
            ),
        })
    }
}

impl ValueEnum for BadRows {
    fn value_variants<'a>() -> &'a [Self] {
        &[Self::Refuse, Self::Skip]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(match self {
            Self::Refuse => {
                PossibleValue::new("refuse").help("Stop at the first and say where it is")
            }
            Self::Skip => PossibleValue::new("skip").help("Leave them out and count them"),
        })
    }
}

/// How codes are put into frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum LayoutChoice {
    /// As the converters' codes, or the record, need it.
    Auto,
    /// 16 bits: two frames a tick.
    #[value(name = "16")]
    Bits16,
    /// 24 bits: three frames a tick.
    #[value(name = "24")]
    Bits24,
}

impl LayoutChoice {
    /// The layout; `None` for the one that is needed.
    pub(super) const fn layout(self) -> Option<Layout> {
        match self {
            Self::Auto => None,
            Self::Bits16 => Some(Layout::Bits16),
            Self::Bits24 => Some(Layout::Bits24),
        }
    }
}

/// What an invalid field reads with `--hold N`.
pub(super) const fn on_invalid(hold: u16) -> OnInvalid {
    match hold {
        0 => OnInvalid::Zero,
        ticks => OnInvalid::Hold { ticks },
    }
}

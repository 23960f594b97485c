//! The mistakes that explain a log, and what sets it right.

use hallstage_input::channel::Channel;
use hallstage_input::finding::{Cause, Code, Correction};

/// The evidence of a mistake.
pub(super) fn mistake(causes: &[Cause], is_sure: bool, may_be_magnets: bool) -> String {
    if let (
        [
            Cause {
                correction: Correction::Exchange(pair),
                ..
            },
        ],
        false,
    ) = (causes, may_be_magnets)
    {
        return format!(
            "{} seem to be swapped; exchanged, the log fits stage.toml",
            titles(pair)
        );
    }
    let does_fit = match is_sure {
        true => "the log does not match stage.toml. It fits",
        false => "the log is consistent but does not match stage.toml. It would fit",
    };
    let mut causes: Vec<String> = causes.iter().map(cause).collect();
    if may_be_magnets {
        causes.push(
            "the field of the magnets falls as much faster with height than designed".to_owned(),
        );
    }
    let undecided = if causes.len() > 1 {
        ". The log does not show which"
    } else {
        ""
    };
    format!("{does_fit} if {}{undecided}", causes.join(", or if "))
}

/// What to do about a mistake.
pub(super) fn mistake_remedy(code: Code, causes: &[Cause], may_be_magnets: bool) -> String {
    let what = match causes.len() > 1 || may_be_magnets {
        true => {
            "find out which before you change anything: check wiring, columns, units and stage.toml"
        }
        false => code.entry().remedy,
    };
    let is_other_pass = |cause: &Cause| {
        let holds =
            |[_, low, high]: [f64; 3]| [0.5, 2.0].iter().any(|by| (low..=high).contains(by));
        cause.correction.is_scale_of_beams() && cause.values.is_some_and(holds)
    };
    if causes.iter().any(is_other_pass) {
        let first = "check first whether each interferometer is read in single or in double pass. If the reference is right, write the \
             sensitivities into [search] of stage.toml";
        return match causes.len() {
            1 => first.to_owned(),
            _ => format!("{first}. Otherwise {what}"),
        };
    }
    let is_rough = causes.iter().any(|cause| cause.values.is_some());
    let rough = if is_rough {
        ". The values are rough: find the exact ones"
    } else {
        ""
    };
    format!("{what}{rough}")
}

fn cause(cause: &Cause) -> String {
    let what = correction(&cause.correction);
    let Some(values) = cause.values else {
        return what;
    };
    // A factor has two digits, and its distance from 1 has one.
    let is_factor = cause.correction.unit().is_empty();
    let place = |value: f64| value.log10().floor() as i32;
    let shown = |value: f64| {
        let from_one = (value - 1.0).abs().max(1e-3);
        let digits = match is_factor {
            true => (1 - place(value)).max(-place(from_one)),
            false => 0,
        };
        let place = 10f64.powi(-digits);
        let rounded = (value / place).round() * place;
        format!("{rounded:.*}", digits.max(0) as usize)
    };
    let unit = if is_factor { "" } else { " degrees" };
    let [best, low, high] = values.map(shown);
    match low == high {
        true => format!("{what} about {best}{unit}"),
        false => format!("{what} about {best}{unit} ({low} to {high})"),
    }
}

fn correction(correction: &Correction) -> String {
    match correction {
        Correction::Exchange(pair) => format!("{} are exchanged", titles(pair)),
        Correction::Order(all, order) => format!("{} are read as {}", all.title(), titles(order)),
        Correction::Scale(some) => format!("the scale of {} is multiplied by", titles(some)),
        Correction::Sign(some) => format!("the sign of {} is inverted", titles(some)),
        Correction::BaselineScale => {
            "Rz of the reference (1 / interferometer.y_baseline_m) is multiplied by".to_owned()
        }
        Correction::HallPlaces => "the places of the Hall probes are multiplied by".to_owned(),
        Correction::GapPlaces => {
            "the places of the capacitive sensors are multiplied by".to_owned()
        }
        Correction::GapPlace(sensor, axis, place_m) => {
            format!(
                "the {axis} of {} in stage.toml is {place_m} m",
                sensor.title()
            )
        }
        Correction::GapsTurned => "the places of the capacitive sensors are turned by".to_owned(),
        Correction::GapsMirrored => {
            "the places of the capacitive sensors are mirrored along x and turned by".to_owned()
        }
    }
}

fn titles(channels: &[Channel]) -> String {
    let titles: Vec<&str> = channels.iter().map(|channel| channel.title()).collect();
    titles.join(" and ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_factor_shows_how_far_it_is_from_one() {
        for (factor, shown) in [
            (1.0526, "1.05"),
            (0.952, "0.95"),
            (2.04, "2.0"),
            (0.497, "0.50"),
        ] {
            let values = Some([factor; 3]);
            let correction = Correction::Scale(vec![Channel::BeamX]);
            let said = cause(&Cause { correction, values });
            assert!(said.ends_with(&format!("about {shown}")), "{said}");
        }
    }
}

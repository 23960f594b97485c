//! Units that are read as others, by the ratio of a value to its design.

use hallstage_input::finding::{Finding, Kind, Severity};

/// Times over their design where a unit is read as another.
const TIMES: [(f64, &str); 4] = [
    (1e-6, "s are read as µs"),
    (1e-3, "ms are read as µs"),
    (1e3, "ns are read as µs"),
    (1e6, "ps are read as µs"),
];
/// The same of temperatures.
const TEMPERATURES: [(f64, &str); 3] = [
    (1e-3, "°C are read as m°C"),
    (1e3, "m°C are read as °C"),
    (1.8, "°F are read as °C"),
];
/// Clocks differ by less than this part.
const CLOCK_PART: f64 = 0.02;
/// The design is for about this temperature, degC; ...
const ROOM_C: f64 = 20.0;
/// ... a room or a warm stage is within this factor of it.
const ROOM_FACTOR: f64 = 2.5;

fn found(
    what: &'static str,
    units: &[(f64, &'static str)],
    is: impl Fn(f64) -> bool,
) -> Option<Finding> {
    let &(ratio, units) = units.iter().find(|(ratio, _)| is(*ratio))?;
    let kind = Kind::OtherUnit { what, ratio, units };
    Some(Finding::new(kind).with_severity(Severity::Refuse))
}

/// Times between rows that are this many servo periods. A log may be thinned to one of 2, 5 or 100 rows, but not of
/// 1000.
pub(super) fn of_times(periods: f64) -> Option<Finding> {
    found("the times", &TIMES, |ratio| {
        (periods / ratio - 1.0).abs() < CLOCK_PART
    })
}

/// A mean temperature as read, degC, and where the log determines it the mean k over its expected value.
pub(super) fn of_temperature(mean_c: f64, k_part: Option<f64>) -> Option<Finding> {
    let is_room = |c: f64| (ROOM_C / ROOM_FACTOR..ROOM_C * ROOM_FACTOR).contains(&c);
    found("the temperatures", &TEMPERATURES, |ratio| match ratio {
        _ if is_room(mean_c) => false,
        // degF have another zero. A field that falls per degF falls by 5/9 as much.
        1.8 => {
            is_room((mean_c - 32.0) / ratio) && k_part.is_none_or(|part| part * part < 1.0 / ratio)
        }
        _ => is_room(mean_c / ratio),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ratio(found: Option<Finding>) -> Option<f64> {
        found.and_then(|found| found.value())
    }

    #[test]
    fn times_of_another_unit_are_named_and_thinned_logs_are_not() {
        for (periods, want) in [
            (1.0, None),
            (0.5, None),
            (2.0, None),
            (10.0, None),
            (100.0, None),
            (999.0, Some(1e3)),
            (1.001e-3, Some(1e-3)),
            (1e6, Some(1e6)),
        ] {
            assert_eq!(ratio(of_times(periods)), want, "{periods}");
        }
    }

    #[test]
    fn temperatures_of_another_unit_are_named_unless_k_says_that_they_are_right() {
        for (mean_c, k_part, want) in [
            (17.0, None, None),
            (41.0, Some(0.5), None),
            (0.021, None, Some(1e-3)),
            (69.8, None, Some(1.8)),
            (69.8, Some(0.58), Some(1.8)),
            (69.8, Some(1.05), None),
            (-40.0, None, None),
        ] {
            assert_eq!(
                ratio(of_temperature(mean_c, k_part)),
                want,
                "{mean_c} {k_part:?}"
            );
        }
    }
}

//! Times of a log in us: numbers in a unit, dates and times, and durations.
//!
//! A date has its year first (ISO 8601, also with `/` or `.`), or its day first with points (German), or the name of
//! its month, or a number above 12 that shows the day. A duration is `h:mm:ss.s`, or a number and its unit.

use super::cell::{Cell, CellFault, WHOLE_MAX, shown};
use super::layout::Dimension;
use jiff::civil::DateTime;
use jiff::fmt::temporal::DateTimeParser;
use jiff::tz::TimeZone;

static PARSER: DateTimeParser = DateTimeParser::new();

/// Months by the first letters of their names.
const MONTHS: [&str; 12] = [
    "jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec",
];

/// How a cell writes the time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Number,
    /// Date and time with an offset from UTC, or `Z`.
    Zoned,
    /// Date and time without one.
    Local,
    Duration,
}

/// Reads the times of one log.
#[derive(Clone, Copy, Debug, Default)]
pub struct Clock {
    form: Option<Form>,
}

impl Clock {
    /// The time in us: a number times `scale`, a duration, or the time since 1970-01-01T00:00 of a date and
    /// time, in UTC where the cell has no zone. All cells must be written in the same way.
    pub fn t_us(&mut self, cell: Cell<'_>, scale: f64) -> Result<f64, CellFault> {
        let (t_us, form) = match written_us(cell.text) {
            Some(found) => found,
            None => {
                let t_us = cell.scaled(scale, WHOLE_MAX, "us");
                let not_a_time = |fault| match fault {
                    CellFault::NotANumber { text } => CellFault::NotATime { text },
                    fault => fault,
                };
                (t_us.map_err(not_a_time)?, Form::Number)
            }
        };
        if *self.form.get_or_insert(form) != form {
            return Err(CellFault::OtherTime {
                text: shown(cell.text),
            });
        }
        Ok(t_us)
    }
}

/// Whether a cell holds a date and time, or a duration with its unit.
pub(super) fn is_time(cell: &[u8]) -> bool {
    written_us(cell).is_some()
}

/// The time of a cell that is more than a number.
fn written_us(cell: &[u8]) -> Option<(f64, Form)> {
    // Most times are plain numbers.
    if cell.iter().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let text = core::str::from_utf8(cell).ok()?.trim();
    let (t_us, form) = date_time(text).or_else(|| Some((duration_us(text)?, Form::Duration)))?;
    (t_us.abs() <= WHOLE_MAX).then_some((t_us, form))
}

fn date_time(text: &str) -> Option<(f64, Form)> {
    // A date and at least a minute: 1.2.2026 3:04. A number has no colon.
    if text.len() < 13 || !text.contains(':') {
        return None;
    }
    let iso = iso(text);
    let text = iso.as_deref().unwrap_or(text);
    let (time, form) = match PARSER.parse_timestamp(text) {
        Ok(time) => (time, Form::Zoned),
        Err(_) => {
            let local: DateTime = PARSER.parse_datetime(text).ok()?;
            (TimeZone::UTC.to_timestamp(local).ok()?, Form::Local)
        }
    };
    Some(((time.as_nanosecond() + 500).div_euclid(1000) as f64, form))
}

/// A date and time by ISO 8601, from another form of it.
fn iso(text: &str) -> Option<String> {
    // The clock begins with the digits before the first colon.
    let clock = text[..text.find(':')?]
        .trim_end_matches(|c: char| c.is_ascii_digit())
        .len();
    let (date, clock) = text.split_at(clock);
    let upper = clock.to_ascii_uppercase();
    let half = ["AM", "PM"]
        .into_iter()
        .find_map(|half| Some((upper.strip_suffix(half)?.trim_end(), half)));
    let (hour, rest) = half.map_or(clock, |(clock, _)| clock).split_once(':')?;
    let hour: u32 = match (hour.parse().ok()?, half) {
        (hour, None) => hour,
        (0 | 13.., Some(_)) => return None,
        (hour, Some((_, half))) => hour % 12 + if half == "PM" { 12 } else { 0 },
    };
    let date = date.trim_end_matches(['T', 't', ' ', ',']);
    let parts: Vec<&str> = date
        .split(['-', '/', '.', ',', ' '])
        .filter(|part| !part.is_empty())
        .collect();
    let [a, b, c] = parts[..] else { return None };
    let number = |part: &str| part.parse::<u32>().ok();
    let (year, month, day) = match (month(a), month(b)) {
        _ if a.len() == 4 && number(a).is_some() => (a, number(b).or(month(b))?, number(c)?),
        _ if c.len() != 4 => return None,
        (Some(month), _) => (c, month, number(b)?),
        (_, Some(month)) => (c, month, number(a)?),
        _ => match (number(a)?, number(b)?) {
            (day, month) if day > 12 || day == month || date.contains('.') => (c, month, day),
            (month, day) if day > 12 => (c, month, day),
            _ => return None,
        },
    };
    Some(format!("{year}-{month:02}-{day:02}T{hour:02}:{rest}"))
}

/// The number of a month by its name.
fn month(name: &str) -> Option<u32> {
    let start = name.get(..3)?.to_ascii_lowercase();
    let at = MONTHS.iter().position(|month| *month == start)?;
    Some(at as u32 + 1)
}

/// A duration in us: `h:mm:ss.s`, `mm:ss.s`, or a number, a space and a unit.
fn duration_us(text: &str) -> Option<f64> {
    let number = |text: &str| fast_float2::parse::<f64, _>(text.replace(',', ".")).ok();
    if let Some((text, unit)) = text.rsplit_once(' ') {
        let unit = match unit.to_ascii_lowercase().as_str() {
            "min" => 6e7,
            "h" | "hr" | "hrs" | "hours" => 3.6e9,
            _ => Dimension::Time.unit(unit)?,
        };
        return Some(number(text.trim())? * unit);
    }
    let parts: Vec<&str> = text.split(':').collect();
    let (hours, minutes, seconds) = match parts[..] {
        [hours, minutes, seconds] => (hours, minutes, seconds),
        [minutes, seconds] if seconds.contains(['.', ',']) => ("0", minutes, seconds),
        _ => return None,
    };
    let whole = |text: &str| text.parse::<u32>().ok().map(f64::from);
    let (minutes, seconds) = (whole(minutes)?, number(seconds)?);
    let is_clock = (0.0..60.0).contains(&seconds) && (minutes < 60.0 || parts.len() == 2);
    is_clock.then_some(((whole(hours)? * 60.0 + minutes) * 60.0 + seconds) * 1e6)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn t_us(cell: &str) -> Result<f64, CellFault> {
        Clock::default().t_us(Cell::new(cell), 1e3)
    }

    #[test]
    fn numbers_and_iso_8601_lead_to_microseconds() {
        assert_eq!(t_us("2.5"), Ok(2500.0));
        for (text, want) in [
            ("1970-01-01T00:00:00.000001Z", 1.0),
            ("2026-01-02T03:04:05.678901Z", 1_767_323_045_678_901.0),
            ("2026-01-02 03:04:05.678901", 1_767_323_045_678_901.0),
            ("2026-01-02T03:04:05,678901", 1_767_323_045_678_901.0),
            ("2026-01-02T04:04:05.678901+01:00", 1_767_323_045_678_901.0),
            ("2026-01-02T03:04:05.6789005Z", 1_767_323_045_678_901.0),
            ("1969-12-31T23:59:59.9999994Z", -1.0),
            ("2024-02-29T00:00:00Z", 1_709_164_800_000_000.0),
            ("2026-01-02T03:04", 1_767_323_040_000_000.0),
        ] {
            assert_eq!(t_us(text), Ok(want), "{text}");
        }
    }

    #[test]
    fn dates_are_read_in_every_order_that_is_unambiguous() {
        for text in [
            "2026/01/02 03:04:05.678901",
            "2026/1/2 3:04:05.678901",
            "2026.01.02T03:04:05.678901",
            "02.01.2026 03:04:05,678901",
            "2-Jan-2026 03:04:05.678901",
            "2 January 2026, 3:04:05.678901 AM",
            "Jan 2, 2026 3:04:05.678901 am",
            "2026-JAN-02 03:04:05.678901",
        ] {
            assert_eq!(t_us(text), Ok(1_767_323_045_678_901.0), "{text}");
        }
        assert_eq!(t_us("June 2, 2026 3:00:00"), t_us("2026-06-02 03:00:00"));
        assert!(t_us("June 2, 2026 3:00:00").is_ok());
        let afternoon = t_us("2026-05-13 15:00:00");
        for text in [
            "5/13/2026 3:00:00 PM",
            "13/5/2026 15:00",
            "13-05-2026 15:00:00",
        ] {
            assert_eq!(t_us(text), afternoon, "{text}");
        }
        assert_eq!(t_us("5/13/2026 12:00:00 AM"), t_us("2026-05-13 00:00:00"));
        assert!(
            t_us("5/5/2026 12:00:00").is_ok(),
            "both orders are the same"
        );
        for text in [
            "05/12/2026 10:00:00",
            "2025-02-29T00:00:00Z",
            "2026-01-02",
            "12:00:00 on 2026-01-02",
            "13/13/2026 10:00:00",
            "2026-01-02 13:00:00 PM",
        ] {
            assert!(
                matches!(t_us(text), Err(CellFault::NotATime { .. })),
                "{text}"
            );
        }
    }

    #[test]
    fn durations_have_colons_or_a_unit() {
        for (text, want) in [
            ("0.002 sec", 2e3),
            ("1.5 ms", 1.5e3),
            ("2,5 s", 2.5e6),
            ("2 min", 1.2e8),
            ("1:02:03.5", 3_723.5e6),
            ("00:00:00.002", 2e3),
            ("02:03,5", 123.5e6),
        ] {
            assert_eq!(t_us(text), Ok(want), "{text}");
        }
        for text in ["2 apples", "10:00", "1:02:61", "1:75:03.5", "0.5 V"] {
            assert!(
                matches!(t_us(text), Err(CellFault::NotATime { .. })),
                "{text}"
            );
        }
        let mut clock = Clock::default();
        assert!(clock.t_us(Cell::new("0.002 sec"), 1.0).is_ok());
        assert!(matches!(
            clock.t_us(Cell::new("0.002"), 1.0),
            Err(CellFault::OtherTime { .. })
        ));
    }
}

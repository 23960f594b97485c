//! Times of a log in us: numbers in a unit, or date and time by ISO 8601.

use super::cell::{Cell, CellFault, WHOLE_MAX, shown};
use jiff::civil::DateTime;
use jiff::fmt::temporal::DateTimeParser;
use jiff::tz::TimeZone;

static PARSER: DateTimeParser = DateTimeParser::new();

/// How a cell writes the time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Number,
    /// Date and time with an offset from UTC, or `Z`.
    Zoned,
    /// Date and time without one.
    Local,
}

/// Reads the times of one log.
#[derive(Clone, Copy, Debug, Default)]
pub struct Clock {
    form: Option<Form>,
}

impl Clock {
    /// The time in us: a number times `scale`, or the time since 1970-01-01T00:00 of a date and
    /// time, in UTC where the cell has no zone. All cells must be written in the same way.
    pub fn t_us(&mut self, cell: Cell<'_>, scale: f64) -> Result<f64, CellFault> {
        let (t_us, form) = match date_time_us(cell.text) {
            Some(found) => found,
            None => {
                let t_us = cell.scaled(scale, WHOLE_MAX, "us")?;
                (t_us, Form::Number)
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

/// Whether a cell holds date and time.
pub(super) fn is_date_time(cell: &[u8]) -> bool {
    date_time_us(cell).is_some()
}

fn date_time_us(cell: &[u8]) -> Option<(f64, Form)> {
    let cell = cell.trim_ascii();
    // A date and at least a minute: 2026-01-02T03:04. A number has no colon.
    if cell.len() < 16 || !cell.contains(&b':') {
        return None;
    }
    let (time, form) = match PARSER.parse_timestamp(cell) {
        Ok(time) => (time, Form::Zoned),
        Err(_) => {
            let local: DateTime = PARSER.parse_datetime(cell).ok()?;
            (TimeZone::UTC.to_timestamp(local).ok()?, Form::Local)
        }
    };
    let t_us = (time.as_nanosecond() + 500).div_euclid(1000) as f64;
    (t_us.abs() <= WHOLE_MAX).then_some((t_us, form))
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
        for text in [
            "2025-02-29T00:00:00Z",
            "2026-01-02",
            "03:04:05.5",
            "12:00:00 on 2026-01-02",
        ] {
            assert!(
                matches!(t_us(text), Err(CellFault::NotANumber { .. })),
                "{text}"
            );
        }
    }
}

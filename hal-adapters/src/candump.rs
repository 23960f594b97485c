//! One line of a `candump -L` log: `(seconds.microseconds) interface identifier#data`.
//!
//! ```
//! use hal_adapters::candump::LogLine;
//!
//! let line = LogLine::parse("(1735270496.916858) can0 110#00112233").unwrap();
//! assert_eq!((line.time_us, line.interface), (1_735_270_496_916_858, "can0"));
//! assert_eq!(line.to_string(), "(1735270496.916858) can0 110#00112233");
//! ```

use crate::can::{BusFrame, StampedFrame};
use core::fmt::{Display, Formatter, Result as FmtResult};
use embedded_can::{ExtendedId, Frame, Id, StandardId};

/// A frame of a log, with the interface that it came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogLine<'l> {
    /// Receive time, us since 1970.
    pub time_us: u64,
    /// Name of the interface.
    pub interface: &'l str,
    /// The frame.
    pub frame: BusFrame,
}

/// What is wrong with a line. Columns count characters from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LineError {
    /// The line does not start with `(seconds.microseconds)`.
    #[error("no time: a line starts with (seconds.microseconds)")]
    BadTime,
    /// The interface or the frame is missing: the line is cut short.
    #[error("cut short: time, interface and frame belong here")]
    CutShort,
    /// Neither three nor eight hexadecimal digits, or a value beyond 11 or 29 bits.
    #[error("column {column}: an identifier has three or eight hexadecimal digits")]
    BadIdentifier {
        /// Where the identifier starts.
        column: usize,
    },
    /// No `#` after the identifier.
    #[error("column {column}: `#` belongs after the identifier")]
    NoSeparator {
        /// Where it should be.
        column: usize,
    },
    /// Not pairs of hexadecimal digits, or more than eight.
    #[error("column {column}: data are up to eight pairs of hexadecimal digits")]
    BadData {
        /// Where the data start.
        column: usize,
    },
    /// A frame of CAN FD: this protocol is classic CAN.
    #[error("a frame of CAN FD, where classic CAN belongs")]
    FlexibleDataRate,
    /// An error frame of the controller, not a frame of the bus.
    #[error("an error frame of the controller")]
    ErrorFrame,
    /// Something follows the frame.
    #[error("column {column}: nothing belongs here")]
    Trailing {
        /// Where it starts.
        column: usize,
    },
}

/// Bit of a logged identifier that marks an error frame.
const ERROR_FLAG: u32 = 0x2000_0000;

impl<'l> LogLine<'l> {
    /// Reads one line, without its line end.
    ///
    /// # Errors
    /// [`LineError`]. `ErrorFrame` and `FlexibleDataRate` are correct lines of another kind.
    pub fn parse(line: &'l str) -> Result<Self, LineError> {
        let column_of = |part: &str| part.as_ptr() as usize - line.as_ptr() as usize + 1;
        let mut parts = line.split_ascii_whitespace();
        let time_us = parts
            .next()
            .and_then(parse_time)
            .ok_or(LineError::BadTime)?;
        let interface = parts.next().ok_or(LineError::CutShort)?;
        let text = parts.next().ok_or(LineError::CutShort)?;
        let column = column_of(text);
        // A fourth part, R or T, is the direction (candump -x).
        let rest = parts.find(|part| !matches!(*part, "R" | "T"));
        if let Some(rest) = rest {
            let column = column_of(rest);
            return Err(LineError::Trailing { column });
        }
        let (id, data) = text.split_once('#').ok_or(LineError::NoSeparator {
            column: column + text.len(),
        })?;
        if data.starts_with('#') {
            return Err(LineError::FlexibleDataRate);
        }
        let id = parse_id(id).ok_or(LineError::BadIdentifier { column })??;
        let column = column_of(data);
        let frame = parse_data(id, data).ok_or(LineError::BadData { column })?;
        Ok(Self {
            time_us,
            interface,
            frame,
        })
    }

    /// Time and frame alone.
    pub const fn stamped(&self) -> StampedFrame {
        StampedFrame {
            time_us: self.time_us,
            frame: self.frame,
        }
    }
}

fn parse_time(text: &str) -> Option<u64> {
    let (seconds, micros) = text.strip_prefix('(')?.strip_suffix(')')?.split_once('.')?;
    let digits = |s: &str| s.bytes().all(|b| b.is_ascii_digit());
    if micros.len() != 6 || !digits(micros) || !digits(seconds) {
        return None;
    }
    let seconds: u64 = seconds.parse().ok()?;
    let micros: u64 = micros.parse().ok()?;
    seconds.checked_mul(1_000_000)?.checked_add(micros)
}

/// `None` if this is no identifier, an error if it is that of an error frame.
fn parse_id(text: &str) -> Option<Result<Id, LineError>> {
    if !text.bytes().all(|b| b.is_ascii_hexdigit()) {
        return None;
    }
    let value = u32::from_str_radix(text, 16).ok()?;
    match text.len() {
        3 => {
            let id = StandardId::new(u16::try_from(value).ok()?)?;
            Some(Ok(Id::Standard(id)))
        }
        8 if value & ERROR_FLAG != 0 => Some(Err(LineError::ErrorFrame)),
        8 => Some(Ok(Id::Extended(ExtendedId::new(value)?))),
        _ => None,
    }
}

fn parse_data(id: Id, text: &str) -> Option<BusFrame> {
    if let Some(length) = text.strip_prefix('R') {
        let dlc = if length.is_empty() {
            0
        } else {
            length.parse().ok()?
        };
        return BusFrame::new_remote(id, dlc);
    }
    let digits = text.as_bytes();
    let (pairs, rest) = digits.as_chunks::<2>();
    if !rest.is_empty() || pairs.len() > 8 {
        return None;
    }
    let digit = |b: u8| char::from(b).to_digit(16).map(|d| d as u8);
    let mut bytes = [0; 8];
    for (byte, [high, low]) in bytes.iter_mut().zip(pairs) {
        *byte = digit(*high)? << 4 | digit(*low)?;
    }
    BusFrame::new(id, bytes.get(..pairs.len())?)
}

impl Display for LogLine<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> FmtResult {
        let (seconds, micros) = (self.time_us / 1_000_000, self.time_us % 1_000_000);
        write!(f, "({seconds:010}.{micros:06}) {} ", self.interface)?;
        match self.frame.id {
            Id::Standard(id) => write!(f, "{:03X}#", id.as_raw())?,
            Id::Extended(id) => write!(f, "{:08X}#", id.as_raw())?,
        }
        if self.frame.is_remote_frame() {
            return match self.frame.dlc() {
                0 => f.write_str("R"),
                dlc => write!(f, "R{dlc}"),
            };
        }
        for byte in self.frame.data() {
            write!(f, "{byte:02X}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use proptest::prelude::*;
    use std::string::ToString;

    #[test]
    fn each_broken_line_has_its_own_reason() {
        use LineError as E;
        for (line, error) in [
            ("", E::BadTime),
            ("1735270496.916858 can0 110#00", E::BadTime),
            ("(1735270496.9168) can0 110#00", E::BadTime),
            ("(+1.000000) can0 110#00", E::BadTime),
            ("(99999999999999999999.000000) can0 110#00", E::BadTime),
            ("(1.000000)", E::CutShort),
            ("(1.000000) can0", E::CutShort),
            ("(1.000000) can0 110", E::NoSeparator { column: 20 }),
            ("(1.000000) can0 11#00", E::BadIdentifier { column: 17 }),
            ("(1.000000) can0 800#00", E::BadIdentifier { column: 17 }),
            ("(1.000000) can0 +10#00", E::BadIdentifier { column: 17 }),
            ("(1.000000) can0 110#0", E::BadData { column: 21 }),
            ("(1.000000) can0 110#0g", E::BadData { column: 21 }),
            (
                "(1.000000) can0 110#001122334455667788",
                E::BadData { column: 21 },
            ),
            ("(1.000000) can0 110#R9", E::BadData { column: 21 }),
            ("(1.000000) can0 110##100", E::FlexibleDataRate),
            ("(1.000000) can0 20000004#000C000000000000", E::ErrorFrame),
            ("(1.000000) can0 110#00 x", E::Trailing { column: 24 }),
        ] {
            assert_eq!(LogLine::parse(line), Err(error), "{line}");
        }
    }

    #[test]
    fn the_direction_of_candump_x_is_accepted() {
        let line = LogLine::parse("(1.000000) can0 110#00 R").expect("sound");
        assert_eq!(line.frame.data(), [0]);
    }

    proptest! {
        #[test]
        fn lines_are_read_as_they_were_written(
            time_us in 0..u64::from(u32::MAX) * 1_000_000, raw in 0u32..1 << 29, extended: bool,
            remote: bool, data in prop::collection::vec(any::<u8>(), 0..=8),
        ) {
            let id = match StandardId::new((raw & 0x7ff) as u16) {
                Some(id) if !extended => Id::Standard(id),
                _ => Id::Extended(ExtendedId::new(raw).expect("29 bits")),
            };
            let frame = if remote { BusFrame::new_remote(id, data.len()) } else { BusFrame::new(id, &data) };
            let line = LogLine { time_us, interface: "vcan0", frame: frame.expect("up to eight") };
            let text = line.to_string();
            prop_assert_eq!(LogLine::parse(&text), Ok(line));
        }

        #[test]
        fn any_text_is_read_or_refused(line: std::string::String) {
            let _ = LogLine::parse(&line);
        }
    }
}

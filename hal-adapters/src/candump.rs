//! One line of a `candump -L` log: `(seconds.microseconds) interface identifier#data`; or of candump's screen:
//! `(seconds.microseconds)  interface  identifier   [length]  data`.
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

/// Why a line is no data frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LineError {
    /// The line breaks a rule of the format.
    #[error("column {column}: {rule}")]
    Malformed {
        /// Where, in characters from 1.
        column: usize,
        /// The rule.
        rule: &'static str,
    },
    /// A frame of CAN FD: this protocol is classic CAN.
    #[error("a frame of CAN FD, where classic CAN belongs")]
    FlexibleDataRate,
    /// An error frame of the controller, not a frame of the bus.
    #[error("an error frame of the controller")]
    ErrorFrame,
}

const TIME: &str = "a line starts with (seconds.microseconds)";
const PARTS: &str = "a line has a time, an interface and a frame";
const IDENTIFIER: &str = "an identifier has three or eight hexadecimal digits, and `#` follows";
const SCREEN: &str =
    "an identifier has three or eight hexadecimal digits, and `#` or [length] and data follow";
const DATA: &str = "data are up to eight pairs of hexadecimal digits";

/// Bit of a logged identifier that marks an error frame.
const ERROR_FLAG: u32 = 0x2000_0000;

impl<'l> LogLine<'l> {
    /// Reads one line, without its line end.
    ///
    /// # Errors
    /// [`LineError`]. `ErrorFrame` and `FlexibleDataRate` are correct lines of another kind.
    pub fn parse(line: &'l str) -> Result<Self, LineError> {
        let broken = |rest: &str, rule| LineError::Malformed {
            column: rest.as_ptr() as usize - line.as_ptr() as usize + 1,
            rule,
        };
        let end = line.get(line.len()..).unwrap_or_default();
        let mut parts = line.split_ascii_whitespace();
        let time_us = parts.next().and_then(parse_time);
        let time_us = time_us.ok_or_else(|| broken(line, TIME))?;
        let (Some(interface), Some(text)) = (parts.next(), parts.next()) else {
            return Err(broken(end, PARTS));
        };
        let frame = match text.split_once('#') {
            None => parse_screen(text, parts).ok_or_else(|| broken(text, SCREEN))??,
            Some((id, data)) => {
                // A fourth part, R or T, is the direction (candump -x).
                if let Some(rest) = parts.find(|part| !matches!(*part, "R" | "T")) {
                    return Err(broken(rest, PARTS));
                }
                if data.starts_with('#') {
                    return Err(LineError::FlexibleDataRate);
                }
                let id = parse_id(id).ok_or_else(|| broken(text, IDENTIFIER))??;
                parse_data(id, data).ok_or_else(|| broken(data, DATA))?
            }
        };
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

/// `None` if this is no identifier, an error for the identifier of an error frame.
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

/// The frame of a line of the screen, from its identifier and the rest of the line.
fn parse_screen<'l>(
    id: &str,
    mut rest: impl Iterator<Item = &'l str>,
) -> Option<Result<BusFrame, LineError>> {
    let length = rest.next()?.strip_prefix('[')?.strip_suffix(']')?;
    let id = match (length.len(), parse_id(id)?) {
        // Lengths of CAN FD have two digits.
        (2, _) => return Some(Err(LineError::FlexibleDataRate)),
        (_, Err(error)) => return Some(Err(error)),
        (_, Ok(id)) => id,
    };
    let length = length.parse().ok()?;
    let mut pairs = rest.peekable();
    if pairs.peek() == Some(&"remote") {
        return BusFrame::new_remote(id, length).map(Ok);
    }
    let frame = parse_bytes(id, pairs.map(|pair| pair.as_bytes().try_into().ok()))?;
    (frame.dlc() == length).then_some(Ok(frame))
}

/// The frame of these pairs of digits.
fn parse_bytes(id: Id, pairs: impl Iterator<Item = Option<[u8; 2]>>) -> Option<BusFrame> {
    let digit = |b: u8| char::from(b).to_digit(16).map(|d| d as u8);
    let (mut bytes, mut length) = ([0; 8], 0);
    for pair in pairs {
        let [high, low] = pair?;
        *bytes.get_mut(length)? = digit(high)? << 4 | digit(low)?;
        length += 1;
    }
    BusFrame::new(id, bytes.get(..length)?)
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
    let (pairs, rest) = text.as_bytes().as_chunks();
    rest.is_empty().then_some(())?;
    parse_bytes(id, pairs.iter().map(|pair| Some(*pair)))
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
        let broken = |column, rule| LineError::Malformed { column, rule };
        for (line, error) in [
            ("", broken(1, TIME)),
            ("1735270496.916858 can0 110#00", broken(1, TIME)),
            ("(1735270496.9168) can0 110#00", broken(1, TIME)),
            ("(+1.000000) can0 110#00", broken(1, TIME)),
            ("(99999999999999999999.000000) can0 110#00", broken(1, TIME)),
            ("(1.000000)", broken(11, PARTS)),
            ("(1.000000) can0", broken(16, PARTS)),
            ("(1.000000) can0 110", broken(17, SCREEN)),
            ("(1.000000) can0 110 [2] 00", broken(17, SCREEN)),
            ("(1.000000) can0 110 [1] 0g", broken(17, SCREEN)),
            ("(1.000000) can0 110 [1] +1", broken(17, SCREEN)),
            (
                "(1.000000) can0 110 [9] 00 00 00 00 00 00 00 00 00",
                broken(17, SCREEN),
            ),
            ("(1.000000) can0 110 [01] 00", LineError::FlexibleDataRate),
            ("(1.000000) can0 20000004 [1] 00", LineError::ErrorFrame),
            ("(1.000000) can0 11#00", broken(17, IDENTIFIER)),
            ("(1.000000) can0 800#00", broken(17, IDENTIFIER)),
            ("(1.000000) can0 +10#00", broken(17, IDENTIFIER)),
            ("(1.000000) can0 110#0", broken(21, DATA)),
            ("(1.000000) can0 110#0g", broken(21, DATA)),
            ("(1.000000) can0 110#001122334455667788", broken(21, DATA)),
            ("(1.000000) can0 110#R9", broken(21, DATA)),
            ("(1.000000) can0 110##100", LineError::FlexibleDataRate),
            (
                "(1.000000) can0 20000004#000C000000000000",
                LineError::ErrorFrame,
            ),
            ("(1.000000) can0 110#00 x", broken(24, PARTS)),
        ] {
            assert_eq!(LogLine::parse(line), Err(error), "{line}");
        }
    }

    #[test]
    fn the_direction_of_candump_x_is_accepted() {
        let line = LogLine::parse("(1.000000) can0 110#00 R").expect("sound");
        assert_eq!(line.frame.data(), [0]);
    }

    #[test]
    fn a_line_of_the_screen_is_the_line_of_the_log() {
        for (screen, log) in [
            (
                " (1.000000)  can0  15A   [8]  6C 00 01 02 03 04 05 FF",
                "(1.000000) can0 15A#6C000102030405FF",
            ),
            (
                "(1.000000) vcan0 00000001 [0]",
                "(1.000000) vcan0 00000001#",
            ),
            (
                "(1.000000) vcan0 123 [2] remote request",
                "(1.000000) vcan0 123#R2",
            ),
        ] {
            assert_eq!(
                LogLine::parse(screen.trim_start()),
                LogLine::parse(log),
                "{screen}"
            );
            assert!(LogLine::parse(log).is_ok(), "{log}");
        }
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

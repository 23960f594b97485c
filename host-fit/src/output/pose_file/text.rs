//! Poses as text.

use super::{HEADER, PoseRow};
use std::io::Write;

/// What [`with_uncertainties`] adds to the first line.
const UNCERTAINTIES: &str = ",u_x_um,u_y_um,u_rz_urad";

/// Significant digits of a field. Nine tell any two `f32` apart, and leave a margin of six
/// for the rounding of the scale in `f64`.
const DIGITS: usize = 9;

/// Bytes of a typical line, for the buffer.
const LINE_BYTES: usize = 96;

/// The pose file of these rows.
pub fn to_text(rows: &[PoseRow]) -> Vec<u8> {
    let mut text = Vec::with_capacity(HEADER.len() + 1 + rows.len() * LINE_BYTES);
    text.extend_from_slice(HEADER.as_bytes());
    text.push(b'\n');
    for row in rows {
        line(&mut text, row);
        text.push(b'\n');
    }
    text
}

/// The same with the standard uncertainty of X, Y, Rz (m, m, rad) of each row.
pub fn with_uncertainties(rows: &[PoseRow], uncertainties: &[[f64; 3]]) -> Vec<u8> {
    let mut text = Vec::with_capacity(HEADER.len() + 1 + rows.len() * 2 * LINE_BYTES);
    text.extend_from_slice(HEADER.as_bytes());
    text.extend_from_slice(UNCERTAINTIES.as_bytes());
    text.push(b'\n');
    for (row, uncertainty) in rows.iter().zip(uncertainties) {
        line(&mut text, row);
        for u in uncertainty {
            // Writing to memory does not fail.
            let _ = write!(text, ",{:.3e}", u * 1e6);
        }
        text.push(b'\n');
    }
    text
}

/// One line without its end.
fn line(text: &mut Vec<u8>, row: &PoseRow) {
    let mut scratch = Vec::with_capacity(2 * DIGITS);
    let reading = &row.reading;
    integer(text, row.movement);
    text.push(b',');
    integer(text, row.t_us);
    let planar = reading.pose.planar.to_array();
    let vertical = reading.pose.vertical.to_array();
    for word in planar.into_iter().chain(vertical) {
        text.push(b',');
        micro(text, &mut scratch, word);
    }
    text.push(b',');
    integer(text, i64::from(reading.status.bits()));
}

fn integer(text: &mut Vec<u8>, value: i64) {
    // Writing to memory does not fail.
    let _ = write!(text, "{value}");
}

/// A word in m or rad as um or urad.
pub(super) fn micro(text: &mut Vec<u8>, scratch: &mut Vec<u8>, word: f32) {
    let micro = f64::from(word) * 1e6;
    if micro == 0.0 {
        text.extend_from_slice(if word.is_sign_negative() { b"-0" } else { b"0" });
        return;
    }
    // As -d.dddddddde-xx first: the exponent decides the notation.
    scratch.clear();
    let _ = write!(scratch, "{micro:.*e}", DIGITS - 1);
    let (negative, number) = match scratch.as_slice() {
        [b'-', rest @ ..] => (true, rest),
        rest => (false, rest),
    };
    let mut parts = number.split(|b| *b == b'e');
    let (mantissa, exponent) = (parts.next(), parts.next());
    let exponent: Option<i32> = exponent
        .and_then(|digits| core::str::from_utf8(digits).ok())
        .and_then(|digits| digits.parse().ok());
    if negative {
        text.push(b'-');
    }
    match (mantissa, exponent) {
        (Some([first, b'.', rest @ ..]), Some(exponent)) => {
            let kept = rest.len() - rest.iter().rev().take_while(|b| **b == b'0').count();
            positional_or_exponent(text, *first, rest.get(..kept).unwrap_or(rest), exponent);
        }
        // Not a finite number: the decoder never gives one.
        _ => text.extend_from_slice(number),
    }
}

/// Writes d.ddd times 10^exponent, positional while that is short.
fn positional_or_exponent(text: &mut Vec<u8>, first: u8, rest: &[u8], exponent: i32) {
    match usize::try_from(exponent) {
        Ok(whole) if whole < DIGITS => {
            text.push(first);
            let (digits, fraction) = rest.split_at(whole.min(rest.len()));
            text.extend_from_slice(digits);
            text.extend(core::iter::repeat_n(b'0', whole - digits.len()));
            if !fraction.is_empty() {
                text.push(b'.');
                text.extend_from_slice(fraction);
            }
        }
        Err(_) if exponent >= -4 => {
            text.extend_from_slice(b"0.");
            let zeros = exponent.unsigned_abs().saturating_sub(1);
            text.extend(core::iter::repeat_n(b'0', zeros as usize));
            text.push(first);
            text.extend_from_slice(rest);
        }
        _ => {
            text.push(first);
            if !rest.is_empty() {
                text.push(b'.');
                text.extend_from_slice(rest);
            }
            let _ = write!(text, "e{exponent}");
        }
    }
}

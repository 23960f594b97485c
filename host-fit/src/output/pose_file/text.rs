//! Poses as text.

use super::{HEADER, PoseRow};

/// Names of the uncertainties in the first line.
const UNCERTAINTIES: [&str; 6] = [
    "u_x_um",
    "u_y_um",
    "u_rz_urad",
    "uc_x_um",
    "uc_y_um",
    "uc_rz_urad",
];

/// Exponents of the first digit within the table of powers.
const EXPONENTS: std::ops::Range<i32> = -12..9;

/// Powers of ten from 1e-12 to 1e20; from 1 on they are exact.
const POWERS: [f64; 33] = [
    1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1e0, 1e1, 1e2, 1e3,
    1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
];

/// The first line, with so many uncertainties.
pub(super) fn header(uncertainties: usize) -> Vec<u8> {
    let names = [&[HEADER], &UNCERTAINTIES[..uncertainties]].concat();
    format!("{}\n", names.join(",")).into_bytes()
}

/// Adds the line of a row, with standard uncertainties of X, Y, Rz (m, m, rad).
pub(super) fn line(bytes: &mut Vec<u8>, row: &PoseRow, uncertainties: &[f64]) {
    let reading = &row.reading;
    integer(bytes, row.movement);
    bytes.push(b',');
    integer(bytes, row.t_us);
    let planar = reading.pose.planar.to_array();
    let vertical = reading.pose.vertical.to_array();
    for word in planar.into_iter().chain(vertical) {
        bytes.push(b',');
        if word.is_sign_negative() {
            bytes.push(b'-');
        }
        number(bytes, (f64::from(word) * 1e6).abs());
    }
    bytes.push(b',');
    integer(bytes, reading.status.bits());
    for u in uncertainties {
        bytes.extend(format!(",{:.3e}", u * 1e6).bytes());
    }
    bytes.push(b'\n');
}

fn integer(bytes: &mut Vec<u8>, value: impl itoa::Integer) {
    bytes.extend_from_slice(itoa::Buffer::new().format(value).as_bytes());
}

/// A number of zero or more in nine significant digits. Nine digits distinguish any two `f32`, with a margin of six for
/// the rounding of the scale in `f64`. Positional while that is short, without zeros at the end.
fn number(bytes: &mut Vec<u8>, value: f64) {
    if value == 0.0 {
        return bytes.push(b'0');
    }
    let power = |exponent: i32| POWERS[(exponent - EXPONENTS.start) as usize];
    if !(power(EXPONENTS.start)..power(EXPONENTS.end)).contains(&value) {
        return rare(bytes, value);
    }
    // By the binary exponent times the logarithm of 2, the exponent or one less.
    let low = (((value.to_bits() >> 52) as i32 - 1023) * 1233) >> 12;
    let exponent = low + i32::from(value >= power(low + 1));
    let number = (value * power(8 - exponent)).round() as u32;
    let (number, exponent) = match number {
        1_000_000_000.. => (100_000_000, exponent + 1),
        number => (number, exponent),
    };
    let mut buffer = itoa::Buffer::new();
    let digits = buffer.format(number).as_bytes();
    let kept = digits.iter().rposition(|digit| *digit != b'0');
    let kept = kept.map_or(1, |last| last + 1);
    // How many digits stand before the point.
    let whole = match exponent {
        0..=8 => exponent as usize + 1,
        -4..0 => {
            bytes.extend_from_slice(&b"0.000"[..1 + exponent.unsigned_abs() as usize]);
            return bytes.extend_from_slice(&digits[..kept]);
        }
        _ => 1,
    };
    bytes.extend_from_slice(&digits[..whole]);
    if kept > whole {
        bytes.push(b'.');
        bytes.extend_from_slice(&digits[whole..kept]);
    }
    if !(0..=8).contains(&exponent) {
        bytes.push(b'e');
        integer(bytes, exponent);
    }
}

/// What is very small or very large.
#[cold]
fn rare(bytes: &mut Vec<u8>, value: f64) {
    let text = format!("{value:.8e}");
    let (digits, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let digits = digits.trim_end_matches('0').trim_end_matches('.');
    bytes.extend(format!("{digits}e{exponent}").bytes());
}

//! Poses as text.

use super::{HEADER, PoseRow};

/// What uncertainties add to the first line.
const UNCERTAINTIES: &str = ",u_x_um,u_y_um,u_rz_urad";

/// The first line.
pub(super) fn header(with_uncertainties: bool) -> Vec<u8> {
    let uncertainties = if with_uncertainties {
        UNCERTAINTIES
    } else {
        ""
    };
    format!("{HEADER}{uncertainties}\n").into_bytes()
}

/// Adds the line of a row, with the standard uncertainty of X, Y, Rz (m, m, rad) if there is one.
pub(super) fn line(bytes: &mut Vec<u8>, row: &PoseRow, uncertainty: Option<[f64; 3]>) {
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
    for u in uncertainty.iter().flatten() {
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
    let text = format!("{value:.8e}");
    let (digits, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let digits = digits.replace('.', "");
    let kept = digits.trim_end_matches('0').len().max(1);
    let power: i32 = exponent.parse().unwrap_or(0);
    // How many digits stand before the point.
    let whole = match power {
        0..=8 => power as usize + 1,
        -4..0 => {
            bytes.extend_from_slice(&b"0.000"[..1 + power.unsigned_abs() as usize]);
            return bytes.extend_from_slice(&digits.as_bytes()[..kept]);
        }
        _ => 1,
    };
    bytes.extend_from_slice(&digits.as_bytes()[..whole]);
    if kept > whole {
        bytes.push(b'.');
        bytes.extend_from_slice(&digits.as_bytes()[whole..kept]);
    }
    if !(0..=8).contains(&power) {
        bytes.push(b'e');
        bytes.extend_from_slice(exponent.as_bytes());
    }
}

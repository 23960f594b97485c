//! Poses as text.

use super::{HEADER, PoseRow};
use std::io::Write;

/// What uncertainties add to the first line.
const UNCERTAINTIES: &str = ",u_x_um,u_y_um,u_rz_urad";

/// Significant digits of a field. Nine tell any two `f32` apart, and leave a margin of six
/// for the rounding of the scale in `f64`.
const DIGITS: usize = 9;

/// Bytes of a typical line, for the buffer.
pub(super) const LINE_BYTES: usize = 96;

/// The pose file of these rows.
pub fn to_text(rows: &[PoseRow]) -> Vec<u8> {
    let mut text = header(false);
    text.reserve(rows.len() * LINE_BYTES);
    for row in rows {
        line(&mut text, row, None);
    }
    text
}

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
pub(super) fn line(text: &mut Vec<u8>, row: &PoseRow, uncertainty: Option<[f64; 3]>) {
    let mut integers = itoa::Buffer::new();
    let reading = &row.reading;
    text.extend_from_slice(integers.format(row.movement).as_bytes());
    text.push(b',');
    text.extend_from_slice(integers.format(row.t_us).as_bytes());
    let planar = reading.pose.planar.to_array();
    let vertical = reading.pose.vertical.to_array();
    for word in planar.into_iter().chain(vertical) {
        text.push(b',');
        micro(text, word);
    }
    text.push(b',');
    text.extend_from_slice(integers.format(reading.status.bits()).as_bytes());
    for u in uncertainty.iter().flatten() {
        // Writing to memory does not fail.
        let _ = write!(text, ",{:.3e}", u * 1e6);
    }
    text.push(b'\n');
}

/// A word in m or rad as um or urad.
pub(super) fn micro(text: &mut Vec<u8>, word: f32) {
    let micro = f64::from(word) * 1e6;
    if micro == 0.0 {
        text.extend_from_slice(if word.is_sign_negative() { b"-0" } else { b"0" });
        return;
    }
    let (number, exponent) = match digits(micro.abs()) {
        Some(found) => found,
        None => match digits_of_any(micro.abs()) {
            Some(found) => found,
            // Not a finite number: the decoder never gives one.
            None => {
                let _ = write!(text, "{micro}");
                return;
            }
        },
    };
    if micro < 0.0 {
        text.push(b'-');
    }
    let mut integers = itoa::Buffer::new();
    let number = integers.format(number).as_bytes();
    let kept = number.len() - number.iter().rev().take_while(|b| **b == b'0').count();
    if let Some((first, rest)) = number.get(..kept).and_then(<[u8]>::split_first) {
        positional_or_exponent(text, *first, rest, exponent);
    }
}

/// Powers of ten from 1e-4 to 1e9.
const POWERS: [f64; 14] = [
    1e-4, 1e-3, 1e-2, 1e-1, 1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9,
];

/// Powers of ten from 1 to 1e12.
const TENS: [u64; 13] = {
    let mut tens = [1; 13];
    let mut k = 1;
    while k < 13 {
        tens[k] = 10 * tens[k - 1];
        k += 1;
    }
    tens
};

/// Nine digits, the first not 0, and the exponent of the first: those of `{:.8e}`, rounded to the
/// nearest, ties to even. `None` outside 1e-4 to 1e9.
fn digits(value: f64) -> Option<(u32, i32)> {
    let above = POWERS.partition_point(|power| *power <= value);
    let (1..=13, exponent) = (above, above as i32 - 5) else {
        return None;
    };
    // value = mantissa / 2^shift, with a shift from 23 to 66; times 10^(8 - exponent) that has 93
    // bits at most.
    let bits = value.to_bits();
    let mantissa = (bits & ((1 << 52) - 1)) | 1 << 52;
    let shift = 1075 - (bits >> 52) as u32;
    let ten_to = *TENS.get((8 - exponent) as usize)?;
    let scaled = u128::from(mantissa) * u128::from(ten_to);
    let whole = (scaled >> shift) as u32;
    let (rest, half) = (scaled & ((1 << shift) - 1), 1 << (shift - 1));
    let up = rest > half || (rest == half && whole % 2 == 1);
    match whole + u32::from(up) {
        1_000_000_000 => Some((100_000_000, exponent + 1)),
        rounded => Some((rounded, exponent)),
    }
}

/// The same of any finite value, slowly.
fn digits_of_any(value: f64) -> Option<(u32, i32)> {
    let text = format!("{value:.*e}", DIGITS - 1);
    let (mantissa, exponent) = text.split_once('e')?;
    let number = mantissa.replace('.', "").parse().ok()?;
    Some((number, exponent.parse().ok()?))
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[track_caller]
    fn same(value: f64) {
        if let Some(found) = digits(value) {
            assert_eq!(Some(found), digits_of_any(value), "{value:e}");
        }
    }

    #[test]
    fn digits_by_integers_are_those_of_the_standard_library() {
        // Around every power of ten, ties, and words of all magnitudes.
        for power in POWERS {
            let bits = power.to_bits();
            (bits - 200..bits + 200).for_each(|bits| same(f64::from_bits(bits)));
        }
        for k in 0..2000 {
            let odd = f64::from(2 * k + 1);
            [2.0, 4.0, 8.0, 16.0].map(|part| same(1e8 + odd / part));
            same(123_456_000.0 + odd / 2.0);
            same((1e7 + odd / 4.0).next_up());
        }
        for bits in (0..u32::MAX / 2).step_by(9973) {
            same(f64::from(f32::from_bits(bits)) * 1e6);
        }
        assert_eq!(digits(100_000_000.5), Some((100_000_000, 8)));
        assert_eq!(digits(999_999_999.6), Some((100_000_000, 9)));
        assert_eq!(digits(9.99e-5), None);
        assert_eq!(digits(1e9), None);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        #[test]
        fn digits_of_any_value_are_those_of_the_standard_library(value in 1e-5..2e9, small in 1e-5..1e2) {
            for value in [value, small] {
                if let Some(found) = digits(value) {
                    prop_assert_eq!(Some(found), digits_of_any(value));
                }
            }
        }
    }
}

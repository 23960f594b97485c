//! Poses as text.

use super::{HEADER, PoseRow};

/// What uncertainties add to the first line.
const UNCERTAINTIES: &str = ",u_x_um,u_y_um,u_rz_urad";

/// Significant digits of a field. Nine tell any two `f32` apart, and leave a margin of six
/// for the rounding of the scale in `f64`.
const DIGITS: usize = 9;

/// Bytes of a typical line, for the buffer.
pub(super) const LINE_BYTES: usize = 96;

/// The longest line: two `i64`, six fields, the status and three uncertainties.
const LINE_MAX: usize = 2 * 20 + 6 * 16 + 10 + 3 * 12 + 12;

/// The pose file of these rows.
pub fn to_text(rows: &[PoseRow]) -> Vec<u8> {
    let mut text = header(false);
    text.reserve(rows.len() * LINE_BYTES);
    let mut line = Line::default();
    for row in rows {
        text.extend_from_slice(line.of(row, None));
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

/// A line that is written. Fields are stored 16 bytes at a time, so there is room for as many more.
#[derive(Debug)]
pub(super) struct Line {
    bytes: [u8; LINE_MAX + 16],
    length: usize,
}

impl Default for Line {
    fn default() -> Self {
        Self {
            bytes: [0; LINE_MAX + 16],
            length: 0,
        }
    }
}

impl Line {
    /// The line of a row, with the standard uncertainty of X, Y, Rz (m, m, rad) if there is one.
    pub(super) fn of(&mut self, row: &PoseRow, uncertainty: Option<[f64; 3]>) -> &[u8] {
        self.length = 0;
        let reading = &row.reading;
        self.integer(row.movement);
        self.push(b',');
        self.integer(row.t_us);
        let planar = reading.pose.planar.to_array();
        let vertical = reading.pose.vertical.to_array();
        for word in planar.into_iter().chain(vertical) {
            self.push(b',');
            self.micro(word);
        }
        self.push(b',');
        self.integer(reading.status.bits());
        for u in uncertainty.iter().flatten() {
            self.extend(format!(",{:.3e}", u * 1e6).as_bytes());
        }
        self.push(b'\n');
        self.bytes.get(..self.length).unwrap_or_default()
    }

    #[inline]
    fn push(&mut self, byte: u8) {
        if let Some(next) = self.bytes.get_mut(self.length) {
            *next = byte;
            self.length += 1;
        }
    }

    #[inline]
    fn extend(&mut self, bytes: &[u8]) {
        let end = self.length + bytes.len();
        if let Some(next) = self.bytes.get_mut(self.length..end) {
            next.copy_from_slice(bytes);
            self.length = end;
        }
    }

    /// Stores 16 bytes, the lowest first, so many bytes further on; the length stays.
    #[inline]
    fn store(&mut self, after: usize, bytes: u128) {
        let rest = self.bytes.get_mut(self.length + after..);
        if let Some(next) = rest.and_then(|rest| rest.first_chunk_mut()) {
            *next = bytes.to_le_bytes();
        }
    }

    fn integer(&mut self, value: impl itoa::Integer) {
        self.extend(itoa::Buffer::new().format(value).as_bytes());
    }

    /// A word in m or rad as um or urad.
    #[inline]
    fn micro(&mut self, word: f32) {
        let micro = (f64::from(word) * 1e6).abs();
        self.store(0, u128::from(b'-'));
        self.length += usize::from(word.is_sign_negative());
        if micro == 0.0 {
            return self.push(b'0');
        }
        match digits(micro) {
            Some((number, exponent)) => self.number(number, exponent),
            None => self.rare(micro),
        }
    }

    /// Nine digits times a power of ten, positional while that is short.
    #[inline]
    fn number(&mut self, number: u32, exponent: i32) {
        let (digits, kept) = ascii(number);
        match exponent {
            // Without branches, which would often be guessed wrong: four zeros before the digits, as
            // many of them skipped as the number does not need, and then a point in its place.
            -4..=8 => {
                let (below, whole) = (exponent.min(0).unsigned_abs(), exponent.max(0) as usize + 1);
                let zeros = u128::from(u32::from_le_bytes(*b"0000"));
                let digits = (digits << 32 | zeros) >> (8 * (4 - below));
                let kept = kept + below as usize;
                self.store(0, digits);
                self.store(whole, (digits >> (8 * whole)) << 8 | u128::from(b'.'));
                self.length += if kept > whole { kept + 1 } else { whole };
            }
            _ => {
                self.store(0, digits);
                self.store(1, (digits >> 8) << 8 | u128::from(b'.'));
                self.length += if kept > 1 { kept + 1 } else { 1 };
                self.push(b'e');
                self.integer(exponent);
            }
        }
    }

    /// What is very small or very large.
    #[cold]
    fn rare(&mut self, micro: f64) {
        match digits_of_any(micro) {
            Some((number, exponent)) => self.number(number, exponent),
            // Not a finite number: the decoder never gives one.
            None => self.extend(micro.to_string().as_bytes()),
        }
    }
}

/// Nine digits as text, the first in the lowest byte, and how many there are without the zeros at
/// the end.
const fn ascii(number: u32) -> (u128, usize) {
    let (first, eight) = (number / 100_000_000, number % 100_000_000);
    // Two numbers of four digits, then four of two, then eight of one, beside each other.
    let fours = (eight / 10_000) as u64 | ((eight % 10_000) as u64) << 32;
    let hundreds = ((fours * 10_486) >> 20) & 0x0000_007f_0000_007f;
    let twos = hundreds | (fours - 100 * hundreds) << 16;
    let tens = ((twos * 103) >> 10) & 0x000f_000f_000f_000f;
    let ones = tens | (twos - 10 * tens) << 8;
    let kept = DIGITS - ones.leading_zeros() as usize / 8;
    let digits = (ones | 0x3030_3030_3030_3030) as u128;
    (digits << 8 | (first + b'0' as u32) as u128, kept)
}

/// The smallest value that [`digits`] takes.
const SMALLEST: f64 = 1e-12;

/// Powers of ten from that to 1e9.
const POWERS: [f64; 22] = [
    1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1e0, 1e1, 1e2, 1e3,
    1e4, 1e5, 1e6, 1e7, 1e8, 1e9,
];

/// Powers of ten from 1 to 1e20.
const TENS: [u128; 21] = {
    let mut tens = [1; 21];
    let mut k = 1;
    while k < tens.len() {
        tens[k] = 10 * tens[k - 1];
        k += 1;
    }
    tens
};

/// Nine digits, the first not 0, and the exponent of the first: those of `{:.8e}`, rounded to the
/// nearest, ties to even. `None` outside 1e-12 to 1e9.
#[inline]
fn digits(value: f64) -> Option<(u32, i32)> {
    if !(SMALLEST..1e9).contains(&value) {
        return None;
    }
    // value = mantissa / 2^shift, with a shift from 23 to 92; times 10^(8 - exponent) that has 120
    // bits at most.
    let bits = value.to_bits();
    let mantissa = (bits & ((1 << 52) - 1)) | 1 << 52;
    let binary_exponent = (bits >> 52) as i32 - 1023;
    let shift = (52 - binary_exponent) as u32;
    // By the binary exponent times the logarithm of 2, the exponent or one less.
    let low = (binary_exponent * 1233) >> 12;
    let above = POWERS.get((low + 13) as usize)?;
    let exponent = low + i32::from(value >= *above);
    let ten_to = TENS.get((8 - exponent) as usize)?;
    let scaled = u128::from(mantissa) * ten_to;
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
            [2.0, 4.0, 8.0, 16.0]
                .into_iter()
                .for_each(|part| same(1e8 + odd / part));
            same(123_456_000.0 + odd / 2.0);
            same((1e7 + odd / 4.0).next_up());
        }
        for bits in (0..u32::MAX / 2).step_by(9973) {
            same(f64::from(f32::from_bits(bits)) * 1e6);
        }
        assert_eq!(digits(100_000_000.5), Some((100_000_000, 8)));
        assert_eq!(digits(999_999_999.6), Some((100_000_000, 9)));
        assert_eq!(digits(9.99e-13), None);
        assert_eq!(digits(1e9), None);
    }

    #[test]
    fn nine_digits_as_text_are_those_of_the_standard_library() {
        let same = |number: u32| {
            let (text, kept) = ascii(number);
            let want = number.to_string();
            assert_eq!(&text.to_le_bytes()[..DIGITS], want.as_bytes());
            assert_eq!(kept, want.trim_end_matches('0').len());
        };
        (100_000_000..1_000_000_000).step_by(9973).for_each(same);
        (0..10_000).for_each(|k| same(500_000_000 + k));
        (0..10_000).for_each(|k| same(500_000_000 + 10_000 * k));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        #[test]
        fn digits_of_any_value_are_those_of_the_standard_library(value in 1e-5..2e9, power in -13..1i32) {
            for value in [value, value * 1e-9 * 10f64.powi(power)] {
                if let Some(found) = digits(value) {
                    prop_assert_eq!(Some(found), digits_of_any(value));
                }
            }
        }
    }
}

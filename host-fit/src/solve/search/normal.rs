//! Standard normal numbers by inversion: one uniform number gives one normal number.
//!
//! N(0, 1) = sqrt(2) erfinv(2 u - 1), with the two polynomials of M. Giles, "Approximating the
//! erfinv function" (GPU Computing Gems, 2011). The result is good to 1e-6 of its size, far
//! finer than a mutation needs; only once in ten million draws, beyond 5.3 deviations, it is
//! up to a ninth too small. Only core operators and a written order are used, so that a
//! search takes the same path on every machine, and whole slices run in SIMD registers
//! (about a third of the time of a ziggurat here).

/// Numbers that are worked on together.
const CHUNK: usize = 16;

/// From here on, the second polynomial (u within 0.0017 of 0 or 1).
const TAIL: f64 = 5.0;

/// Natural logarithm of a positive, normal number, to 1e-10 of its size or 1e-10 absolutely,
/// without a branch.
#[inline(always)]
fn ln(x: f64) -> f64 {
    // x = 2^e m with m in [sqrt(1/2), sqrt(2)); e + 1023 is kept positive throughout.
    const ONE: u64 = 1023 << 52;
    const ROOT_HALF: u64 = 0x3fe6_a09e_667f_3bcd;
    let shifted = x.to_bits() + (ONE - ROOT_HALF);
    let biased = shifted >> 52;
    let m = f64::from_bits((shifted & ((1 << 52) - 1)) + ROOT_HALF);
    // The exponent as a number: in the low bits of 2^52 it needs no conversion.
    const TWO_52: u64 = 0x4330_0000_0000_0000;
    let e = f64::from_bits(TWO_52 | biased) - (4_503_599_627_370_496.0 + 1023.0);
    // ln m = 2 artanh f, f = (m - 1) / (m + 1), |f| <= 0.172.
    let f = (m - 1.0) / (m + 1.0);
    let g = f * f;
    let series = 1.0 + g * (1.0 / 3.0 + g * (0.2 + g * (1.0 / 7.0 + g * (1.0 / 9.0 + g / 11.0))));
    e * core::f64::consts::LN_2 + (2.0 * f) * series
}

/// -ln(1 - x^2) for x = 2 u - 1: what both polynomials are in.
#[inline(always)]
fn depth(u: f64) -> f64 {
    -ln(4.0 * u * (1.0 - u))
}

#[inline(always)]
fn horner<const N: usize>(coefficients: &[f64; N], w: f64) -> f64 {
    let mut sum = coefficients[0];
    for c in &coefficients[1..] {
        sum = sum * w + c;
    }
    sum
}

/// erfinv(x) / x where 1 - x^2 > exp(-5).
#[inline(always)]
fn centre(w: f64) -> f64 {
    const P: [f64; 9] = [
        2.81022636e-08,
        3.43273939e-07,
        -3.5233877e-06,
        -4.39150654e-06,
        0.00021858087,
        -0.00125372503,
        -0.00417768164,
        0.246640727,
        1.50140941,
    ];
    horner(&P, w - 2.5)
}

/// erfinv(x) / x nearer to the ends.
#[cold]
fn tail(w: f64) -> f64 {
    const P: [f64; 9] = [
        -0.000200214257,
        0.000100950558,
        0.00134934322,
        -0.00367342844,
        0.00573950773,
        -0.0076224613,
        0.00943887047,
        1.00167406,
        2.83297682,
    ];
    horner(&P, w.sqrt() - 3.0)
}

/// The standard normal number of which a share `u` of all lie below; 0 < u < 1.
#[inline(always)]
pub fn normal_of(u: f64) -> f64 {
    let w = depth(u);
    let ratio = if w < TAIL { centre(w) } else { tail(w) };
    core::f64::consts::SQRT_2 * (2.0 * u - 1.0) * ratio
}

/// [`normal_of`] each number of a slice, to the same bits.
#[inline(always)]
pub fn normals_of(numbers: &mut [f64]) {
    let (chunks, rest) = numbers.as_chunks_mut::<CHUNK>();
    for chunk in chunks {
        let u = *chunk;
        let w: [f64; CHUNK] = core::array::from_fn(|k| depth(u[k]));
        let mut ratio: [f64; CHUNK] = core::array::from_fn(|k| centre(w[k]));
        let deepest = w.iter().fold(0.0f64, |a, &b| if b > a { b } else { a });
        if deepest >= TAIL {
            for k in 0..CHUNK {
                if w[k] >= TAIL {
                    ratio[k] = tail(w[k]);
                }
            }
        }
        *chunk =
            core::array::from_fn(|k| core::f64::consts::SQRT_2 * (2.0 * u[k] - 1.0) * ratio[k]);
    }
    for number in rest {
        *number = normal_of(*number);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_normal_distribution_function_undoes_the_inversion() {
        for k in 1..20_000 {
            let u = f64::from(k) / 20_000.0;
            let x = normal_of(u);
            let back = 0.5 * libm::erfc(-x / core::f64::consts::SQRT_2);
            // dx = du / density.
            let density = 0.398_942_280_4 * libm::exp(-0.5 * x * x);
            assert!(
                (back - u).abs() / density < 1e-6 * x.abs().max(0.1),
                "u {u}: {x}, back {back}"
            );
        }
        for u in [1e-7, 1e-5, 1.0 - 1e-6] {
            let x = normal_of(u);
            let back = 0.5 * libm::erfc(-x / core::f64::consts::SQRT_2);
            let side = if u < 0.5 {
                back / u
            } else {
                (1.0 - back) / (1.0 - u)
            };
            assert!(
                (side - 1.0).abs() < 1e-4,
                "u {u}: {x}, share beyond {side} of that asked"
            );
        }
        // The smallest number that is drawn; exactly, it would be -8.21.
        let last = normal_of(2f64.powi(-53));
        assert!((-8.3..-7.2).contains(&last), "{last}");
    }

    #[test]
    fn a_slice_and_single_numbers_have_the_same_bits() {
        let single: Vec<f64> = (1..1000).map(|k| f64::from(k) / 1000.0).collect();
        let mut slice = single.clone();
        normals_of(&mut slice);
        for (u, x) in single.iter().zip(&slice) {
            assert_eq!(normal_of(*u).to_bits(), x.to_bits());
        }
    }

    #[test]
    fn the_logarithm_is_good_to_ten_digits() {
        for k in 1..10_000 {
            let x = f64::from(k) / 10_000.0;
            assert!((ln(x) - libm::log(x)).abs() < 2e-10, "{x}");
        }
        assert_eq!(ln(1.0), 0.0);
    }
}

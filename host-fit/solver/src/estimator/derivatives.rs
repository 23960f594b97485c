//! Acceleration of a sampled motion: a polynomial of degree 4 through the samples of a short window, as in the filter of
//! Savitzky and Golay (Analytical Chemistry 36, 1964), at any times. Plain second differences turn 5 nm of noise into
//! 3 mm/s2 at rows of 2 ms.

use nalgebra::{SMatrix, SVector};

/// The window reaches this far to either side, us: 6 rows of 2 ms, 3 rows of 4 ms. Moves of 60 ms keep 96 % of their
/// acceleration. 5 nm of noise are 0.2 mm/s2.
pub const SIDE_US: i64 = 12_500;
/// Most samples of a window, and fewest.
pub const SAMPLES: [usize; 2] = [13, 7];

/// The second derivatives at time zero of samples at times about it, s; `None` for few samples.
pub fn second_derivatives<const N: usize>(
    samples: impl Iterator<Item = (f64, [f64; N])> + Clone,
) -> Option<[f64; N]> {
    let times_s = samples.clone().map(|(t_s, _)| t_s);
    let half_s = (times_s.clone()).fold(0.0, |most, t_s| f64::max(most, t_s.abs()));
    let mut moments = [0.0; 9];
    for t_s in times_s {
        let mut power = 1.0;
        for moment in &mut moments {
            *moment += power;
            power *= t_s / half_s;
        }
    }
    if moments[0] < SAMPLES[1] as f64 {
        return None;
    }
    let squares = SMatrix::<f64, 5, 5>::from_fn(|i, k| moments[i + k]);
    let mut wanted = SVector::<f64, 5>::zeros();
    wanted[2] = 2.0 / (half_s * half_s);
    let c = squares.cholesky()?.solve(&wanted);
    let mut sum = [0.0; N];
    for (t_s, values) in samples {
        let t = t_s / half_s;
        let weight = c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * c[4])));
        for (sum, x) in sum.iter_mut().zip(values) {
            *sum += weight * x;
        }
    }
    Some(sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The derivative by 13 samples every 2 ms without two.
    fn found(motion: impl Fn(f64) -> f64 + Clone) -> f64 {
        let rows = (-6..=6).filter(|k| ![-5, 3].contains(k));
        let samples = rows.map(|k| 2e-3 * f64::from(k));
        let [found] = second_derivatives(samples.map(|t_s| (t_s, [motion(t_s)]))).expect("found");
        found
    }

    #[test]
    fn a_polynomial_of_degree_four_has_its_exact_second_derivative_also_beside_gaps() {
        let motion = |t: f64| 3.0 + t * (0.5 + t * (-0.25 + t * (20.0 + 3000.0 * t)));
        assert!((found(motion) + 0.5).abs() < 1e-8);
    }

    #[test]
    fn a_sine_of_9_hz_keeps_its_amplitude() {
        let rate = std::f64::consts::TAU * 9.0;
        let part = -found(|t_s| libm::cos(rate * t_s)) / (rate * rate);
        assert!((part - 1.0).abs() < 1e-3, "{part}");
    }

    #[test]
    fn few_samples_have_none() {
        let samples = |count: i32| {
            let rows = (0..count).map(|k| (2e-3 * f64::from(k - count / 2), [1.0]));
            second_derivatives(rows)
        };
        assert!(samples(7).is_some() && samples(6).is_none());
    }
}

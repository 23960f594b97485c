//! The channel whose error explains what residuals show.

/// Part of a shift that the slopes of the model may miss.
const SLOPE_ERROR: f64 = 0.1;
/// How much worse, in units of chi-squared, an error that is seen in its channel may explain the
/// residuals than one that a probe may have at will.
const SEEN_BONUS: f64 = 9.0;

/// An error of one channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Blame {
    pub(super) channel: usize,
    pub(super) size_m: f64,
    /// Chi-squared that is left, less the bonus.
    pub(super) left: f64,
}

/// The channel whose error leaves the least of what the three residuals show (m, of these standard
/// deviations). `of_errors`: what an error of 1 m of each channel shows. `seen_m`: by how much each
/// channel itself is off where that is clear, m; beams and gaps are blamed for nothing else. Noise
/// hides the error of a probe, so that is taken from its residual.
pub(super) fn blame(
    shown_m: [f64; 3],
    deviation_m: [f64; 3],
    of_errors: &[[f64; 3]],
    seen_m: &[Option<f64>],
) -> Blame {
    let largest_m = shown_m.iter().fold(0.0, |most: f64, m| most.max(m.abs()));
    let left = |channel: usize, size_m: f64| {
        (0..3)
            .map(|k| {
                let error_m = libm::hypot(deviation_m[k], SLOPE_ERROR * largest_m);
                let left_m = shown_m[k] - of_errors[channel][k] * size_m;
                (left_m / error_m) * (left_m / error_m)
            })
            .sum::<f64>()
    };
    let of = |channel: usize, size_m: f64, bonus: f64| Blame {
        channel,
        size_m,
        left: left(channel, size_m) - bonus,
    };
    let mut best = of(0, shown_m[0], 0.0);
    for (channel, seen_m) in seen_m.iter().enumerate() {
        let next = match (channel, seen_m) {
            (0..3, _) => of(channel, shown_m[channel], 0.0),
            (_, &Some(size_m)) => of(channel, size_m, SEEN_BONUS),
            _ => continue,
        };
        if next.left < best.left {
            best = next;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Slopes of a nominal stage: A, B, C; X, Y1, Y2.
    const OF_ERRORS: [[f64; 3]; 6] = [
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.05, -0.03, -0.8],
        [-2.2, 1.1, 3.0],
        [1.3, -1.8, -3.0],
    ];
    const NOISE_M: [f64; 3] = [0.2e-6; 3];

    #[test]
    fn each_channel_is_blamed_for_its_own_error() {
        for (channel, slopes) in OF_ERRORS.iter().enumerate() {
            for size_m in [-10e-6, 2e-6] {
                let shown_m = slopes.map(|slope| 1.03 * slope * size_m + 0.1e-6);
                let mut seen_m = [None; 6];
                if channel > 2 {
                    seen_m[channel] = Some(size_m);
                }
                let blamed = blame(shown_m, NOISE_M, &OF_ERRORS, &seen_m);
                assert_eq!(blamed.channel, channel, "{blamed:?}");
                assert!((blamed.size_m / size_m - 1.0).abs() < 0.1, "{blamed:?}");
            }
        }
    }

    #[test]
    fn a_beam_that_moves_without_its_residuals_is_not_blamed() {
        let mut seen_m = [None; 6];
        seen_m[4] = Some(5e-6);
        let blamed = blame([0.0, 0.0, 4e-6], NOISE_M, &OF_ERRORS, &seen_m);
        assert_eq!(blamed.channel, 2);
    }
}

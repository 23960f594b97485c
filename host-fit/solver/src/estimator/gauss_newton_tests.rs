use super::*;
use proptest::prelude::*;

proptest! {
    /// Kuhn and Tucker: no way within the ranges lowers the predicted sum any further.
    #[test]
    fn a_step_ends_at_the_least_sum_within_the_ranges(
        factor in prop::array::uniform25(-1.0..1.0f64),
        descent in prop::array::uniform5(-1.0..1.0f64),
        low in prop::array::uniform5(-0.5..=0.0f64),
    ) {
        let factor = DMatrix::from_column_slice(5, 5, &factor);
        let curvature = &factor * factor.transpose() + DMatrix::identity(5, 5) * 0.01;
        let descent = DVector::from_column_slice(&descent);
        let mut unknowns = Unknowns::some(DVector::zeros(5), &[0, 1, 2, 3, 4]);
        unknowns.ranges = low.map(|low| Range { low, high: low + 0.5 }).to_vec();
        let x = DVector::zeros(5);
        let step = unknowns.step(&x, &curvature, 0.0, &descent, 1e-12).expect("regular");
        let left = descent - curvature * &step;
        for (k, range) in unknowns.ranges.iter().enumerate() {
            prop_assert!(range.contains(step[k]));
            prop_assert!(left[k] < 1e-5 || step[k] == range.high, "{k}: {}", left[k]);
            prop_assert!(left[k] > -1e-5 || step[k] == range.low, "{k}: {}", left[k]);
        }
    }
}

#[test]
fn what_nothing_shows_stays_as_it_is() {
    let vector = |numbers: [f64; 2]| DVector::from_column_slice(&numbers);
    let curvature = DMatrix::from_diagonal(&vector([4.0, 0.0]));
    let factor = Factor::new(&curvature, 0.0).expect("regular");
    assert_eq!(factor.solve(&vector([8.0, 0.0])), vector([2.0, 0.0]));
}

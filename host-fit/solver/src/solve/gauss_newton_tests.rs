use super::*;
use proptest::prelude::*;

/// y = v0 exp(v1 t) at some t, with the third value of no effect.
struct Growth;

impl Equations<8> for Growth {
    fn normal(&self, at: &Point) -> Option<Normal<8>> {
        let (scale, rate) = (at.values[0], at.values[1]);
        let mut normal = Normal::none();
        for k in 0..20 {
            let t = 0.1 * f64::from(k);
            let mut columns = [[0.0; 8]; 3];
            columns[0][0] = (rate * t).exp();
            columns[0][1] = scale * t * (rate * t).exp();
            columns[0][7] = 2.0 * (0.7 * t).exp() - scale * (rate * t).exp();
            normal.add_row(&columns, 1.0);
        }
        (rate < 5.0).then_some(normal)
    }
}

const LIMITS: Limits = Limits {
    steps: 50,
    gain: 1e-20,
};

fn origin() -> DVector<f64> {
    DVector::from_column_slice(&[1.0, 0.0, 3.0])
}

#[test]
fn free_values_reach_the_truth_and_what_nothing_shows_stays() {
    let unknowns = Unknowns::some(origin(), &[0, 1, 2]);
    let solved = solve(&Growth, &unknowns, DVector::zeros(3), Vec::new(), LIMITS);
    let solved = solved.expect("a value at the start");
    let found = solved.point.values;
    assert!(
        (found[0] - 2.0).abs() < 1e-8 && (found[1] - 0.7).abs() < 1e-8,
        "{found}"
    );
    assert_eq!(found[2], 3.0);
}

#[test]
fn a_masked_value_is_held_and_a_prior_holds_what_is_free() {
    let masked = Unknowns::some(origin(), &[0]);
    let solved = solve(&Growth, &masked, DVector::zeros(1), Vec::new(), LIMITS);
    let point = solved.expect("a value").point;
    assert!(
        point.values[1] == 0.0 && point.values[0] > 3.0,
        "{}",
        point.values
    );
    let mut held = Unknowns::some(origin(), &[0, 1]);
    held.prior[(1, 1)] = 1e12;
    let solved = solve(&Growth, &held, DVector::zeros(2), Vec::new(), LIMITS);
    let values = solved.expect("a value").point.values;
    assert!(
        values[1].abs() < 1e-6 && (values[0] - point.values[0]).abs() < 1e-3,
        "{values}"
    );
}

#[test]
fn what_would_leave_its_range_is_held_at_its_end_and_the_rest_is_at_its_minimum() {
    let held = |scale: f64| {
        let origin = DVector::from_column_slice(&[scale, 0.0, 3.0]);
        let held = Unknowns::some(origin, &[1]);
        solve(&Growth, &held, DVector::zeros(1), Vec::new(), LIMITS).expect("a value")
    };
    let mut within = Unknowns::some(origin(), &[0, 1]);
    // The truth is 2, the start 1.
    for (low, high, end) in [(-0.5, 0.5, 1.5), (1.5, 9.0, 2.5)] {
        let anywhere = Range {
            low: -9.0,
            high: 9.0,
        };
        within.ranges = vec![Range { low, high }, anywhere];
        let x = DVector::from_column_slice(&[low.max(0.0), 0.0]);
        let found = solve(&Growth, &within, x, Vec::new(), LIMITS).expect("a value");
        let change = found.point.values - held(end).point.values;
        assert!(change.amax() < 1e-7, "{end}: {change}");
    }
}

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
fn a_start_without_a_value_is_refused() {
    let unknowns = Unknowns::some(DVector::from_column_slice(&[1.0, 6.0, 0.0]), &[0]);
    assert!(solve(&Growth, &unknowns, DVector::zeros(1), Vec::new(), LIMITS).is_none());
}

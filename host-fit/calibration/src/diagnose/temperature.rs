//! Findings about temperature: k and h, the cost of a drift in the log, rows without a temperature, and when to zero
//! again.

use super::limits::{RARITY, UNDECIDED};
use super::units;
use crate::fit::Fit;
use crate::judge::predicted::{Predicted, declared_service};
use crate::judge::verdict::severity;
use hallstage_input::dataset::Dataset;
use hallstage_input::finding::{Finding, Kind, Severity};
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::posterior::covariance_at;
use hallstage_solver::estimator::temperature::Coefficient;
use nalgebra::{DMatrix, Matrix2, Vector2};
use runtime::Temperature;
use runtime::real::Real;

/// The stage is zeroed again after a change of this many kelvin: offsets of Hall elements and expansion move its zero.
const REZERO_K: f64 = 5.0;

/// A coefficient is wrong if it is this many standard deviations from the value in the stage file.
const DEVIATIONS_MAX: f64 = 4.0;
/// Largest share of rows without a temperature for a fit of k and h.
const MISSING_MAX: f64 = 0.01;

/// The fitted k and h, a finding for each sensor. The cost is the error in service from the drift of the temperature in
/// the log and the uncertainty of k and h.
pub(super) fn findings(
    fit: &Fit,
    dataset: &Dataset,
    stage: &Stage,
    predicted: Option<&Predicted>,
) -> Vec<Finding> {
    let temperature = &fit.calibration.temperature;
    let parameters = fit.estimate.parameters;
    let (error_per_k, spans_k) = match &fit.field {
        Some(field) => (field.temperature.error_per_k, field.temperature.spans_k),
        // Other models take k and h as the stage file expects them.
        None => {
            let expected = stage
                .temperature
                .prior_per_k
                .map(|[_, deviation]| deviation);
            ([expected; 3], [0.0; 2])
        }
    };
    let cost_of = |sensor: usize| {
        let mut covariance = DMatrix::zeros(Coefficient::ROWS, Coefficient::ROWS);
        for (probe, errors) in error_per_k.iter().enumerate() {
            let k = Coefficient::new(probe, sensor).row();
            covariance[(k, k)] = errors[sensor] * errors[sensor];
        }
        let changes_k = [drift_k(dataset, temperature, sensor); 2];
        let changes = covariance_at(&covariance, &parameters, changes_k);
        let service = declared_service(stage, &parameters, [0.0; 3])?.variance(&changes);
        Some(predicted?.cost_of(service.systematic))
    };
    let there = (0..2).filter(|sensor| temperature.reach_mk[*sensor] != 0);
    let finding = |sensor: usize| {
        let per_k = |probe: usize| {
            let value = temperature.per_mk[probe][sensor] * 1e3;
            [value, error_per_k[probe][sensor]]
        };
        let [expected, deviation] = stage.temperature.prior_per_k[sensor];
        let deviations = |probe: usize| {
            let [value, error] = per_k(probe);
            ((value - expected) / deviation.hypot(error)).abs()
        };
        let deviations = [0, 1, 2].map(deviations).into_iter().fold(0.0, f64::max);
        let span_k = spans_k[sensor];
        let is_other = span_k > 0.0 && deviations > DEVIATIONS_MAX;
        let found = Finding::new(Kind::Coefficients {
            sensor,
            percent_per_k: [0, 1, 2].map(|probe| per_k(probe).map(|x| 100.0 * x)),
            zero_c: f64::from(temperature.zero_mc[sensor]) * 1e-3,
            span_k,
            is_field: fit.field.is_some(),
            deviations: is_other.then_some(deviations),
        });
        let found = match cost_of(sensor) {
            Some(cost) => found.with_severity(severity(cost)).with_cost(cost),
            None => found,
        };
        // The calibration is wrong at any other temperature.
        match is_other {
            true => found.with_severity(Severity::Refuse),
            false => found,
        }
    };
    let incomplete = missing(temperature, dataset).map(|found| {
        let share = found.value().unwrap_or(0.0) / dataset.rows.len() as f64;
        match share > MISSING_MAX {
            true => found.with_severity(Severity::Refuse),
            false => found,
        }
    });
    // k of all probes over its expected value.
    let k_part = |sensor: usize| {
        let [expected, _] = stage.temperature.prior_per_k[sensor];
        let sum: f64 = (0..3).map(|probe| temperature.per_mk[probe][sensor]).sum();
        (spans_k[sensor] > 0.0 && expected != 0.0).then(|| sum * 1e3 / (3.0 * expected))
    };
    let unit = |sensor: usize| {
        let mean_c = f64::from(temperature.zero_mc[sensor]) * 1e-3;
        units::of_temperature(mean_c, k_part(sensor))
    };
    let are_fitted = fit.field.is_some() && spans_k.iter().all(|span_k| *span_k > 0.0);
    let exchanged = are_fitted.then(|| exchanged(fit, stage)).flatten();
    let units = there.clone().find_map(unit).into_iter();
    let mistakes = units.chain(exchanged).chain(incomplete);
    there.map(finding).chain(mistakes).collect()
}

/// The columns of mount and body, exchanged, where they explain k and h better.
fn exchanged(fit: &Fit, stage: &Stage) -> Option<Finding> {
    let covariance = &fit.estimate.posterior.covariance;
    let of_probe = |probe: usize| {
        let rows = [0, 1].map(|sensor| Coefficient::new(probe, sensor).row());
        let errors = Matrix2::from_fn(|i, j| covariance[(rows[i], rows[j])]);
        let found = fit.calibration.temperature.per_mk[probe].map(|per_mk| per_mk * 1e3);
        odds_of_exchange(found, &errors, stage.temperature.prior_per_k)
    };
    let log_odds = of_probe(0)? + of_probe(1)? + of_probe(2)?;
    let found = Finding::new(Kind::TemperaturesExchanged { log_odds });
    let is_clear = 2.0 * log_odds > UNDECIDED + 2.0 * libm::log(RARITY);
    is_clear.then(|| found.with_severity(Severity::Refuse))
}

/// How much more likely, as a logarithm, k and h of a probe are with the priors exchanged, 1/K.
fn odds_of_exchange(found: [f64; 2], errors: &Matrix2<f64>, prior: [[f64; 2]; 2]) -> Option<f64> {
    let precision = |prior: [[f64; 2]; 2]| {
        let of = prior.map(|[_, deviation]| 1.0 / (deviation * deviation));
        let (of, mean) = (
            Matrix2::from_diagonal(&of.into()),
            prior.map(|[mean, _]| mean),
        );
        (of, of * Vector2::from(mean), Vector2::from(mean))
    };
    // What the logs say is the result of the fit without its prior.
    let (own, own_sum, _) = precision(prior);
    let all = errors.try_inverse()?;
    let (said, said_sum) = (all - own, all * Vector2::from(found) - own_sum);
    let evidence = |prior: [[f64; 2]; 2]| {
        let (own, own_sum, mean) = precision(prior);
        let (all, sum) = (said + own, said_sum + own_sum);
        let spread = libm::log(own.determinant() / all.determinant());
        Some(0.5 * (spread + sum.dot(&(all.try_inverse()? * sum)) - own_sum.dot(&mean)))
    };
    let [k, h] = prior;
    Some(evidence([h, k])? - evidence([k, h])?)
}

/// Rows without a temperature that the calibration needs, or with a temperature too far from T0 to be true.
pub(super) fn missing<T: Real>(temperature: &Temperature<T>, dataset: &Dataset) -> Option<Finding> {
    let mut rows =
        (dataset.rows.iter()).filter(|row| !temperature.is_plausible(row.frame.temperature_mc()));
    let first = rows.next()?;
    let found = Finding::new(Kind::NoTemperature {
        rows: 1 + rows.count(),
        of: dataset.rows.len(),
        reach_k: Temperature::<T>::REACH_MK / 1000,
    });
    let name = dataset.movement_name(&dataset.movements[first.movement]);
    Some(
        found
            .with_severity(Severity::Warn)
            .with_place(name, first.t_us),
    )
}

/// rms distance of a sensor's temperature from T0 over the log, K.
fn drift_k(dataset: &Dataset, temperature: &Temperature<f64>, sensor: usize) -> f64 {
    let change_k = |row: &hallstage_input::dataset::Row| {
        temperature.changes_k(row.frame.temperature_mc())[sensor]
    };
    let squares: f64 = dataset
        .rows
        .iter()
        .map(change_k)
        .map(|change| change * change)
        .sum();
    (squares / dataset.rows.len().max(1) as f64).sqrt()
}

/// A change of the temperature after which a stage is zeroed again: since the begin of a movement if its zero deviation
/// is `refitted`, else since the calibration.
pub fn rezero(
    temperature: &Temperature<f32>,
    dataset: &Dataset,
    refitted: bool,
) -> Option<Finding> {
    let zero_mc = temperature.zero_mc;
    let logged = |sensor: usize| temperature.reach_mk[sensor] != 0 || refitted;
    let of_movement = |(movement, sensor): (usize, usize)| {
        let rows = dataset.movements[movement].rows.clone();
        let [low, high] = dataset.temperature_range_mc(sensor, rows)?;
        let change_mc = match refitted {
            true => high - low,
            false => (high - zero_mc[sensor]).max(zero_mc[sensor] - low),
        };
        Some((f64::from(change_mc) * 1e-3, movement, sensor))
    };
    let sensors = (0..2).filter(|sensor| logged(*sensor));
    let all = sensors.flat_map(|sensor| (0..dataset.movements.len()).map(move |m| (m, sensor)));
    let changes = all.filter_map(of_movement);
    let (change_k, movement, sensor) = changes.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (change_k > REZERO_K).then(|| {
        let movement = &dataset.movements[movement];
        let t_us = dataset.rows[movement.rows.start].t_us;
        let found = Finding::new(Kind::TemperatureChange {
            sensor,
            change_k,
            is_in_movement: refitted,
            rezero_k: REZERO_K,
        });
        let found = found.with_severity(Severity::Warn);
        found.with_place(dataset.movement_name(movement), t_us)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use hallstage_input::dataset::{LoggedFrame, Movement, Row};
    use runtime::RawFrame;
    use runtime::frame::MISSING_CODE;

    /// Two movements, at these temperatures of the mount, m degC.
    fn dataset(movements: [[i32; 2]; 2]) -> Dataset {
        let mut dataset = Dataset::default();
        for (movement, read_mc) in movements.into_iter().enumerate() {
            let start = dataset.rows.len();
            dataset.rows.extend(read_mc.map(|mount_mc| {
                let frame = RawFrame::new([0; 3], [0; 3], 0, 0);
                Row {
                    movement,
                    t_us: 7,
                    frame: LoggedFrame::from(frame.with_temperature_mc([mount_mc, MISSING_CODE])),
                    signal_m: [0.0; 3],
                    vertical: [0.0; 3],
                    reference: [0.0; 3],
                }
            }));
            dataset.movements.push(Movement {
                log: 0,
                index: movement as i64,
                rows: start..dataset.rows.len(),
            });
        }
        dataset
    }

    #[test]
    fn a_zero_holds_for_five_kelvin_from_the_begin_of_a_movement_or_from_the_calibration() {
        let temperature = Temperature {
            zero_mc: [20_000, 0],
            reach_mk: [30_000, 0],
            ..Temperature::NONE
        };
        for (movements, refitted, movement) in [
            ([[20_000, 24_000], [26_000, 29_000]], true, None),
            ([[20_000, 24_000], [26_000, 29_000]], false, Some("1")),
            ([[20_000, 24_000], [22_000, 28_000]], true, Some("1")),
            ([[14_000, 16_000], [20_000, 24_000]], false, Some("0")),
            ([[MISSING_CODE; 2]; 2], false, None),
        ] {
            let found = rezero(&temperature, &dataset(movements), refitted);
            let found = found
                .as_ref()
                .map(|found| found.movement().expect("a movement"));
            assert_eq!(found, movement, "{movements:?} {refitted}");
        }
    }

    #[test]
    fn exchanged_temperatures_are_likely_only_where_logs_determine_k_or_h() {
        let prior = [[-1.2e-3, 3e-4], [0.0, 2e-4]];
        let errors = |deviation: f64| Matrix2::from_diagonal_element(deviation * deviation);
        let odds = |found, error| odds_of_exchange(found, &errors(error), prior).expect("odds");
        assert!(odds([-1.1e-3, 1e-4], 4e-5) < -10.0);
        assert!(odds([1e-4, -1.1e-3], 4e-5) > 10.0);
        assert!(odds([-6e-4, -6e-4], 4e-5).abs() < 1.0);
        // The prior alone.
        let errors = Matrix2::from_diagonal(&[9e-8, 4e-8].into());
        let by_prior = odds_of_exchange([-1.2e-3, 0.0], &errors, prior).expect("odds");
        assert!(by_prior.abs() < 1e-9, "{by_prior}");
    }

    #[test]
    fn rows_without_a_temperature_that_may_be_true_are_counted() {
        let mut temperature = Temperature {
            zero_mc: [20_000, 0],
            reach_mk: [30_000, 0],
            ..Temperature::<f32>::NONE
        };
        let dataset = dataset([[20_000, MISSING_CODE], [21_000, 293_000]]);
        let found = missing(&temperature, &dataset).expect("two");
        assert_eq!((found.value(), found.movement()), (Some(2.0), Some("0")));
        temperature.reach_mk = [0; 2];
        assert_eq!(
            missing(&temperature, &dataset),
            None,
            "no sensor, nothing missing"
        );
    }
}

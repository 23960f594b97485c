//! A fit to a log with a lag of the reference. The lag is estimated with the parameters, the reference is read
//! later by the lag, and the fit is repeated until no lag remains.

use super::job::fit_once;
use super::{Fit, FitError, FitSettings, ModelChoice, warning};
use hallstage_input::dataset::{Dataset, Movement, Row};
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::model::Model;
use runtime::ModelKind;

/// Rounds of fit and interpolation. After the first, a hundredth of a lag of several rows remains.
const ROUNDS_MAX: u32 = 4;
/// A lag below this part of its standard error is none.
const LEFT: f64 = 0.1;
/// Longest step between two rows that is interpolated over, in terms of the shortest of the three:
/// one row may be missing.
const STEP_MAX: i64 = 2;

/// Fits with a clear lag of the reference taken off. The lag of the fit is the whole of it.
///
/// # Errors
/// See [`FitError`].
pub(super) fn without_lag(
    dataset: &Dataset,
    stage: &Stage,
    settings: &FitSettings,
) -> Result<Fit, FitError> {
    let found = match (fit_once(dataset, stage, settings), settings.model) {
        // A lag of many rows is more than the field model can follow: Model (31) finds it.
        (Err(FitError::Field(error)), ModelChoice::Named(_)) => {
            let model = ModelChoice::Named(Model::from_kind(ModelKind::M31));
            let with_model_31 = FitSettings {
                model,
                ..settings.clone()
            };
            let found = fit_once(dataset, stage, &with_model_31).ok();
            let found = found.filter(|found| is_clear(found, stage));
            return match found {
                Some(found) => again(found, dataset, stage, settings),
                None => Err(FitError::Field(error)),
            };
        }
        (found, _) => found?,
    };
    match is_clear(&found, stage) {
        true => again(found, dataset, stage, settings),
        false => Ok(found),
    }
}

fn is_clear(found: &Fit, stage: &Stage) -> bool {
    (found.estimate.lag.as_ref()).is_some_and(|lag| warning::is_clear(lag, stage))
}

/// Fits again until no lag remains.
fn again(
    mut found: Fit,
    dataset: &Dataset,
    stage: &Stage,
    settings: &FitSettings,
) -> Result<Fit, FitError> {
    let mut total_s = 0.0;
    for _ in 0..ROUNDS_MAX {
        let Some(lag) = found.estimate.lag else { break };
        if lag.value_s.abs() < LEFT * lag.standard_error_s {
            break;
        }
        total_s += lag.value_s;
        let later = with_beams_later(dataset, stage, total_s);
        found = fit_once(&later, stage, settings)?;
        found.later = Some(later);
    }
    if let Some(lag) = &mut found.estimate.lag {
        lag.value_s += total_s;
    }
    Ok(found)
}

/// The rows with the beams X, Y1, Y2 of `later_s` after them, interpolated between their neighbours (cubic);
/// rows that lack neighbours, at the ends of a movement and beside gaps, are left out.
fn with_beams_later(dataset: &Dataset, stage: &Stage, later_s: f64) -> Dataset {
    let mut out = Dataset {
        rows: Vec::with_capacity(dataset.rows.len()),
        movements: Vec::new(),
        logs: dataset.logs.clone(),
        sha256: dataset.sha256,
        temperature: dataset.temperature,
    };
    for movement in &dataset.movements {
        let rows = &dataset.rows[movement.rows.clone()];
        let (start, number) = (out.rows.len(), out.movements.len());
        let interferometer = &stage.interferometer;
        let beams_m = |row: &Row| row.beams_m(interferometer);
        let beams_m: Vec<[f64; 3]> = rows.iter().map(beams_m).collect();
        for row in rows {
            let later = |beam: usize| {
                let t_us = row.t_us as f64 + later_s * 1e6;
                let next = rows.partition_point(|row| row.t_us as f64 <= t_us);
                let four = next.checked_sub(2)?..next + 2;
                let of_beam = beams_m
                    .get(four.clone())?
                    .iter()
                    .map(|beams_m| beams_m[beam]);
                between(&rows[four], of_beam, t_us)
            };
            if let [Some(x), Some(y1), Some(y2)] = [0, 1, 2].map(later) {
                out.rows.push(Row {
                    movement: number,
                    reference: interferometer.pose([x, y1, y2], row.vertical),
                    ..*row
                });
            }
        }
        if out.rows.len() > start {
            out.movements.push(Movement {
                rows: start..out.rows.len(),
                ..movement.clone()
            });
        }
    }
    for (log, source) in out.logs.iter_mut().enumerate() {
        let own = || out.movements.iter().filter(|movement| movement.log == log);
        let start = own().next().map_or(0, |movement| movement.rows.start);
        let end = own().next_back().map_or(0, |movement| movement.rows.end);
        source.rows = start..end;
        (source.rows_read, source.movements_read) = (end - start, own().count());
    }
    out
}

/// The value at a time within four rows, by the cubic through their values; `None` across a gap.
fn between(four: &[Row], values: impl Iterator<Item = f64>, t_us: f64) -> Option<f64> {
    let steps = || four.windows(2).map(|pair| pair[1].t_us - pair[0].t_us);
    if steps().max() > steps().min().map(|shortest| STEP_MAX * shortest) {
        return None;
    }
    let mut sum = 0.0;
    for (i, (row, value)) in four.iter().zip(values).enumerate() {
        let mut weight = 1.0;
        for (k, other) in four.iter().enumerate() {
            if k != i {
                weight *= (t_us - other.t_us as f64) / (row.t_us - other.t_us) as f64;
            }
        }
        sum += weight * value;
    }
    Some(sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hallstage_input::dataset::LoggedFrame;
    use hallstage_input::shipped::stage;
    use runtime::RawFrame;

    /// A pose of third order in time, s.
    fn pose(t_s: f64) -> [f64; 3] {
        [1e-3, -3e-4, 2e-3].map(|a| a * (t_s * (1.0 + t_s * (0.5 - 7.0 * t_s))))
    }

    /// Two movements of ten rows; the second lacks its sixth and seventh. The reference shows
    /// where the stage was `lag_s` before, and that stands in the signal as well.
    fn dataset(lag_s: f64) -> Dataset {
        let mut dataset = Dataset::default();
        for movement in 0..2 {
            let start = dataset.rows.len();
            for k in (0..10).filter(|k| movement == 0 || ![5, 6].contains(k)) {
                let t_us = 2000 * k;
                dataset.rows.push(Row {
                    movement,
                    t_us,
                    frame: LoggedFrame::from(RawFrame::new([0; 3], [0; 3], 0, 0)),
                    signal_m: pose(t_us as f64 * 1e-6),
                    vertical: [0.0; 3],
                    reference: pose(t_us as f64 * 1e-6 - lag_s),
                });
            }
            dataset.movements.push(Movement {
                log: 0,
                index: movement as i64,
                rows: start..dataset.rows.len(),
            });
        }
        dataset.end_log("log.csv");
        dataset
    }

    #[test]
    fn the_reference_is_read_later_by_the_lag_and_never_across_a_gap() {
        for (lag_s, left) in [(1.3e-3, 7), (4.6e-3, 6), (-2.7e-3, 7)] {
            let after = with_beams_later(&dataset(lag_s), &stage(), lag_s);
            for row in &after.rows {
                for (found, wanted) in row.reference.iter().zip(row.signal_m) {
                    assert!((found - wanted).abs() < 1e-15, "{found} {wanted}");
                }
            }
            let rows: Vec<_> = after.movements.iter().map(|m| m.rows.clone()).collect();
            // Of ten rows; the second movement has two less, and more of them lack neighbours.
            assert_eq!(rows[0], 0..left);
            assert_eq!(rows[1].start, rows[0].end);
            assert!(rows[1].len() < rows[0].len() && after.rows.len() == rows[1].end);
            assert_eq!(after.logs[0].rows, 0..after.rows.len());
            let movements = after.rows.iter().map(|row| row.movement);
            assert!(
                movements.eq(rows
                    .iter()
                    .enumerate()
                    .flat_map(|(m, r)| r.clone().map(move |_| m)))
            );
        }
    }
}

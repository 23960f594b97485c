//! A planned run: its figures, and its tables.

use super::errors::per_axis;
use super::figure::{Figure, Group, Item, bare, figure, group, micro};
use super::parameters::probe_table;
use super::table::Table;
use hallstage_calibration::plan::Plan;
use hallstage_calibration::plan::forecast::acceleration_error;
use hallstage_calibration::plan::run::TONES_HZ;
use hallstage_calibration::plan::temperature::WarmLog;
use hallstage_input::axis::{AXES, PLANAR};
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::dynamics::ACCELERATION_ERROR_MAX;
use hallstage_solver::estimator::terms::{COUNT, PER_PROBE, TERMS, name};
use serde_json::{Map, Value, json};

/// Number of the least determined parameters that are named.
const NAMED: usize = 5;

/// Predicted standard error of a parameter over the deviation of its prior: 1 where the log adds nothing. `None` without
/// prior.
fn over_prior(errors: &[f64; COUNT], k: usize) -> Option<f64> {
    TERMS[k % PER_PROBE].prior.map(|prior| errors[k] / prior)
}

/// The motion of an axis: key in JSON, title in the table, value in SI units, and whether it is a motion and no frequency.
fn motion(plan: &Plan, stage: &Stage, k: usize) -> [(&'static str, &'static str, f64, bool); 9] {
    let (run, limits) = (&plan.run, &stage.motion.axes[k]);
    let [speed, acceleration] = run.peaks(k);
    let hz = "frequency, Hz";
    [
        ("amplitude", "amplitude", run.amplitudes[k], true),
        ("service", "in service", limits.service, true),
        ("frequency_hz", hz, run.frequency_hz(k), false),
        ("tone", "fast tone", run.tones[k], true),
        ("tone_frequency_hz", hz, TONES_HZ[k], false),
        ("peak_speed", "speed, per s", speed, true),
        ("speed_limit", "limit", limits.speed, true),
        (
            "peak_acceleration",
            "acceleration, per s2",
            acceleration,
            true,
        ),
        ("acceleration_limit", "limit", limits.acceleration, true),
    ]
}

/// The figures of a plan. In JSON the axes are in m and rad.
pub fn figures(plan: &Plan, protocol: &[WarmLog], stage: &Stage) -> Group {
    let run = &plan.run;
    let axis = |k: usize| {
        let mut object = json!({ "axis": AXES[k].key, "unit": AXES[k].unit });
        for (key, _, value, _) in motion(plan, stage, k) {
            object[key] = value.into();
        }
        object
    };
    let service = &plan.forecast.service;
    let (ratios, floor) = (service.ratios(), service.noise.map(f64::sqrt));
    let predicted = |k: usize| {
        let rmse = ratios[k] * floor[k];
        group! { "rmse" => micro(&PLANAR[k], rmse), "floor" => micro(&PLANAR[k], floor[k]), "ratio" => ratios[k] }
    };
    let errors = plan.forecast.posterior.standard_errors();
    let parameter = |k: usize| {
        let unit = TERMS[k % PER_PROBE].unit;
        let prior_share = over_prior(&errors, k);
        (
            name(k),
            json!({ "standard_error": errors[k], "unit": unit, "of_prior": prior_share }),
        )
    };
    let mut worst: Vec<(f64, usize)> = (0..COUNT)
        .filter_map(|k| Some((over_prior(&errors, k)?, k)))
        .collect();
    worst.sort_by(|a, b| b.0.total_cmp(&a.0));
    let worst: Figure = worst.iter().take(NAMED).map(|&(_, k)| name(k)).collect();
    group! {
        "seconds" => bare(run.seconds, "s"),
        "taper" => figure(run.taper_s, "s"),
        "rows" => run.rows(stage.servo_period_s),
        "axes" => json!((0..6).map(axis).collect::<Vec<_>>()),
        "service" => per_axis(predicted),
        "acceleration" => Group((0..6).map(|k| per_acceleration(plan, k, stage)).collect()),
        "parameters" => Value::from((0..COUNT).map(parameter).collect::<Map<_, _>>()),
        "least_determined" => worst,
        "temperature" => protocol.iter().map(warm_log).collect::<Vec<_>>(),
    }
}

/// Standard error of the change of a probe's signal by the acceleration of an axis, by its key.
fn per_acceleration(plan: &Plan, k: usize, stage: &Stage) -> (String, Item) {
    let error = acceleration_error(&plan.run, k, stage.servo_period_s);
    let error = bare(rounded(error * 1e6, 2), "um/(m/s2)");
    (
        AXES[k].key.to_owned(),
        group! { "standard_error" => error }.into(),
    )
}

/// What the run cannot tell, if there is something: errors that follow an acceleration.
pub fn untold(plan: &Plan, stage: &Stage) -> String {
    let is_unknown = |k: &usize| {
        let error = acceleration_error(&plan.run, *k, stage.servo_period_s);
        error > ACCELERATION_ERROR_MAX
    };
    let axes: Vec<&str> = (0..6).filter(is_unknown).map(|k| AXES[k].key).collect();
    if axes.is_empty() {
        return String::new();
    }
    format!(
        "the run cannot tell errors that follow the acceleration of {}: the limits in [motion] of stage.toml leave its \
         fast tone too small\n",
        axes.join(", ")
    )
}

/// A log at a temperature, and what is expected of a fit to all logs up to it: the standard errors of k and h, and the
/// errors in service over the noise floor.
fn warm_log(log: &WarmLog) -> Group {
    let [k, h] = log.error_per_k;
    let at = |distance: usize| per_axis(|axis| log.ratios[distance][axis]);
    group! {
        "log" => log.name,
        "seconds" => log.seconds,
        "mount" => figure(log.warmer_k[0], "K"),
        "body" => figure(log.warmer_k[1], "K"),
        "error_of_k" => figure(k, "1/K"),
        "error_of_h" => figure(h, "1/K"),
        "ratio_at_5_kelvin" => at(0),
        "ratio_at_10_kelvin" => at(1),
    }
}

/// How the logs of a protocol are made.
pub fn steps(protocol: &[WarmLog]) -> String {
    if protocol.is_empty() {
        return String::new();
    }
    let step = |log: &WarmLog| format!("  {}: {} s, {}\n", log.name, log.seconds, log.when);
    let names = protocol.iter().map(|log| format!("{}.csv", log.name));
    let names: Vec<String> = names.collect();
    format!(
        "logs for temperature, of runs by host-fit plan --seconds\n{}next: host-fit fit {}, with the columns of the sensors in [temperature] of stage.toml; at work zero \
         the stage again after every 5 K\n",
        protocol.iter().map(step).collect::<String>(),
        names.join(" ")
    )
}

/// A value with this many significant digits.
fn rounded(value: f64, digits: usize) -> f64 {
    let text = format!("{value:.*e}", digits - 1);
    text.parse().unwrap_or(value)
}

/// The tables of a plan: the run, errors predicted for service, standard errors.
pub fn tables(plan: &Plan, protocol: &[WarmLog], stage: &Stage) -> Vec<Table> {
    let titles = motion(plan, stage, 0).map(|(_, title, ..)| title);
    let mut moves = Table {
        decimals: Some(1),
        ..Table::new("motion", &titles)
    };
    for (k, axis) in AXES.iter().enumerate() {
        let figures = motion(plan, stage, k).map(|(.., value, is_motion)| match is_motion {
            true => micro(axis, value),
            false => value.into(),
        });
        moves.row(axis.name, figures);
    }
    let standard_errors = plan.forecast.posterior.standard_errors();
    let index = |parameter: &str| (0..COUNT).find(|k| name(*k) == parameter);
    let title = "standard errors predicted";
    let errors = probe_table(title, 0..PER_PROBE, &["", "of prior"], |name, unit| {
        let k = index(name)?;
        let prior_share = over_prior(&standard_errors, k);
        let prior_share = prior_share.map_or(Figure::None, |x| rounded(x, 2).into());
        Some(vec![
            bare(rounded(standard_errors[k], 2), unit),
            prior_share,
        ])
    });
    let mut all = figures(plan, protocol, stage).tables();
    all.splice(1..1, [moves]);
    all.push(errors);
    all
}

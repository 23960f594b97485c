//! The figures of a planned run: as JSON and as tables.

use super::parameters::by_probe;
use super::table::{Table, number};
use hallstage_calibration::plan::Plan;
use hallstage_calibration::plan::temperature::WarmLog;
use hallstage_input::axis::{AXES, Axis};
use hallstage_input::stage::Stage;
use hallstage_solver::solve::field::terms::{COUNT, PER_PROBE, TERMS, name};
use serde_json::{Map, Value, json};

/// How many of the least determined parameters are named.
const NAMED: usize = 5;
/// The figures of a plan. Axes are in m and rad; `of_prior` is the standard error over the deviation of
/// the prior, 1 where the log adds nothing.
pub fn figures(plan: &Plan, protocol: &[WarmLog], stage: &Stage) -> Value {
    let run = &plan.run;
    let axis = |(k, (Axis { key, unit, .. }, motion)): (
        usize,
        (&Axis, &hallstage_input::stage::AxisMotion),
    )| {
        let [peak_speed, peak_acceleration] = run.peaks(k);
        json!({
            "axis": key,
            "unit": unit,
            "amplitude": run.amplitudes[k],
            "service": motion.service,
            "frequency_hz": run.frequency_hz(k),
            "peak_speed": peak_speed,
            "speed_limit": motion.speed,
            "peak_acceleration": peak_acceleration,
            "acceleration_limit": motion.acceleration,
        })
    };
    let axes = AXES.iter().zip(&stage.motion.axes).enumerate().map(axis);
    let service = &plan.forecast.service;
    let (ratios, floor) = (
        service.ratios(),
        service.noise.map(|variance| variance.sqrt() * 1e6),
    );
    let predicted = |k: usize, unit: &str| {
        json!({
            format!("rmse_{unit}"): ratios[k] * floor[k],
            format!("floor_{unit}"): floor[k],
            "ratio": ratios[k],
        })
    };
    let errors = plan.forecast.posterior.standard_errors();
    let of_prior = |k: usize| TERMS[k % PER_PROBE].prior.map(|prior| errors[k] / prior);
    let parameter = |k: usize| {
        let unit = TERMS[k % PER_PROBE].unit;
        let value = json!({ "standard_error": errors[k], "unit": unit, "of_prior": of_prior(k) });
        (name(k), value)
    };
    let mut worst: Vec<(f64, usize)> = (0..COUNT).filter_map(|k| Some((of_prior(k)?, k))).collect();
    worst.sort_by(|a, b| b.0.total_cmp(&a.0));
    let worst = worst.iter().take(NAMED).map(|&(_, k)| name(k));
    json!({
        "seconds": run.seconds,
        "taper_s": run.taper_s,
        "rows": run.rows(stage.servo_period_s),
        "axes": axes.collect::<Vec<_>>(),
        "service": { "x": predicted(0, "um"), "y": predicted(1, "um"), "rz": predicted(2, "urad") },
        "parameters": (0..COUNT).map(parameter).collect::<Map<_, _>>(),
        "least_determined": worst.collect::<Vec<_>>(),
        "temperature": protocol.iter().map(of_log).collect::<Vec<_>>(),
    })
}

/// A log at a temperature, and what is expected of a fit of all up to it.
fn of_log(log: &WarmLog) -> Value {
    let [k, h] = log.error_per_k;
    let at = |distance: usize| {
        let [x, y, rz] = log.ratios[distance];
        json!({ "x": x, "y": y, "rz": rz })
    };
    json!({
        "log": log.name,
        "seconds": log.seconds,
        "mount_k": log.warmer_k[0],
        "body_k": log.warmer_k[1],
        "error_of_k_per_k": k,
        "error_of_h_per_k": h,
        "ratio_at_5_k": at(0),
        "ratio_at_10_k": at(1),
    })
}

/// How the logs of a protocol are made.
pub fn steps(protocol: &[WarmLog]) -> String {
    if protocol.is_empty() {
        return String::new();
    }
    let step = |log: &WarmLog| format!("  {}: {} s, {}\n", log.name, log.seconds, log.when);
    let names: Vec<String> = protocol
        .iter()
        .map(|log| format!("{}.csv", log.name))
        .collect();
    format!(
        "logs for temperature, of runs by host-fit plan --seconds\n{}next: host-fit fit {}, with the columns of the sensors in [temperature] of stage.toml; at work zero \
         the stage again after every 5 K\n",
        protocol.iter().map(step).collect::<String>(),
        names.join(" ")
    )
}

/// Errors in service over the noise floor, as expected after each log.
fn of_protocol(figures: &Value) -> Option<Table> {
    let titles = [
        "k, %/K",
        "h, %/K",
        "X at 5 K",
        "Y",
        "Rz",
        "X at 10 K",
        "Y",
        "Rz",
    ];
    let mut table = Table::new(
        "temperature: standard errors, and errors in service over the noise",
        &titles,
    );
    for log in figures["temperature"].as_array()? {
        let of = |group: &str| {
            ["x", "y", "rz"]
                .map(|axis| format!("{:.2}", log[group][axis].as_f64().unwrap_or(f64::NAN)))
        };
        let error = |key: &str| match log[key].as_f64() {
            Some(error) if error > 1e-8 => format!("{:.4}", error * 1e2),
            _ => "-".to_owned(),
        };
        let errors = [error("error_of_k_per_k"), error("error_of_h_per_k")];
        let ratios = [of("ratio_at_5_k"), of("ratio_at_10_k")].concat();
        let name = log["log"].as_str().unwrap_or_default();
        table.row(name, errors.into_iter().chain(ratios));
    }
    (!table.rows.is_empty()).then_some(table)
}

/// The tables of these figures: the run, errors predicted for service, standard errors.
pub fn tables(figures: &Value) -> Vec<Table> {
    let titles = [
        "amplitude",
        "in service",
        "frequency, Hz",
        "speed, per s",
        "limit",
        "acceleration, per s2",
        "limit",
        "unit",
    ];
    let mut motion = Table::new("motion", &titles);
    for axis in figures["axes"].as_array().into_iter().flatten() {
        let micro = |key: &str| format!("{:.1}", axis[key].as_f64().unwrap_or_default() * 1e6);
        let unit = if axis["unit"] == "m" { "um" } else { "urad" };
        motion.row(
            axis["axis"].as_str().unwrap_or_default(),
            [
                micro("amplitude"),
                micro("service"),
                number(axis["frequency_hz"].as_f64().unwrap_or_default(), "Hz"),
                micro("peak_speed"),
                micro("speed_limit"),
                micro("peak_acceleration"),
                micro("acceleration_limit"),
                unit.to_owned(),
            ],
        );
    }
    let parameters = &figures["parameters"];
    let errors = by_probe(
        "standard errors predicted",
        0..PER_PROBE,
        &["", "of prior"],
        |name, scale| {
            let p = parameters.get(name)?;
            let of_prior = p["of_prior"]
                .as_f64()
                .map_or("-".to_owned(), |x| format!("{x:.2}"));
            Some(vec![
                format!("{:.1e}", p["standard_error"].as_f64()? * scale),
                of_prior,
            ])
        },
    );
    let mut all = super::table::tables(figures, &["axes", "parameters", "temperature"]);
    all.splice(1..1, [motion]);
    all.push(errors);
    all.extend(of_protocol(figures));
    all
}

//! The message of a finding: the evidence with its size, the place, and the remedy.

use super::causes::mistake;
use super::{sentence, sign};
use hallstage_input::finding::{Finding, Kind, Place, Quantity, TimeCourse};

/// Names in a list at most.
const NAMED_MAX: usize = 10;

/// The sensors of temperature: their place, the symbol of their coefficient, and its key in `[temperature]`.
const SENSORS: [(&str, &str, &str); 2] = [("mount", "k", "magnet"), ("body", "h", "hall")];

/// The message.
pub fn message(found: &Finding) -> String {
    let (evidence, remedy) = evidence(found);
    let mut text = source(found);
    text += &sentence(&evidence);
    if let Some(Place { movement, t_us }) = &found.place {
        text += &format!(" See movement {movement} at t_us = {t_us}.");
    }
    if let Some([rows, all]) = found.sample {
        text += &format!(" This is from {rows} of {all} rows.");
    }
    if found.is_repaired {
        text += " The calibration is free of this fault and describes the stage at the end of the log: zero the stage before use.";
    }
    if !remedy.is_empty() {
        text += " ";
        text += &sentence(&remedy);
    }
    text
}

/// The file or the log in which it stands.
fn source(found: &Finding) -> String {
    match &found.kind {
        Kind::FileCut { file, line } => format!("{file}:{line}: "),
        Kind::SingleRows { file, .. }
        | Kind::MovementsByTime { file, .. }
        | Kind::BetweenCodes { file, .. }
        | Kind::RowsSkipped { file, .. }
        | Kind::MovementsSkipped { file, .. } => format!("{file}: "),
        _ => found
            .log
            .as_ref()
            .map_or(String::new(), |log| format!("{log}: ")),
    }
}

/// The evidence, and the remedy: the usual one of the code, unless the evidence says more.
fn evidence(found: &Finding) -> (String, String) {
    let usual = found.code().entry().remedy;
    let channel = found.channels.first().map_or("", |channel| channel.title());
    let (evidence, remedy) = match &found.kind {
        Kind::Mistake {
            code,
            causes,
            is_sure,
            may_be_magnets,
        } => {
            return mistake(*code, causes, *is_sure, *may_be_magnets);
        }
        Kind::SingleRows {
            first, movements, ..
        } => {
            let others = match movements {
                0 | 1 => String::new(),
                several => format!(", and so have {} more", several - 1),
            };
            (
                format!(
                    "movement {first} has one row{others}. It adds nothing to the fit, because its zero deviation fits it exactly"
                ),
                "check the movement column",
            )
        }
        Kind::FileCut { .. } => (
            "the last line has no line break, so its last number may be cut".to_owned(),
            usual,
        ),
        Kind::MovementsByTime {
            movements,
            split_s,
            gap_rows,
            ..
        } => {
            let every = split_s.map_or(String::new(), |seconds| format!("every {seconds} s, "));
            (
                format!(
                    "there is no column for the movement. The times separate {movements} movements: one begins {every}after a gap of more than {gap_rows} rows and where the time starts again"
                ),
                usual,
            )
        }
        Kind::BetweenCodes { mean_codes, .. } => (
            format!("voltages are {mean_codes:.2} codes from whole codes on average"),
            usual,
        ),
        Kind::Excerpt { rows, taken, runs } => (
            format!("the fit and the diagnosis use {taken} of {rows} rows, in {runs} runs"),
            "",
        ),
        Kind::RowsSkipped {
            reason,
            rows,
            line,
            column,
            name,
            ..
        } => (
            format!(
                "rows skipped because of {reason}: {rows} (the first: line {line}, column {column}, {name})"
            ),
            usual,
        ),
        Kind::MovementsSkipped {
            movements, rows, ..
        } => {
            let names: Vec<String> = movements.iter().map(i64::to_string).collect();
            (
                format!("all rows of movement {} are bad ({rows})", listed(&names)),
                usual,
            )
        }
        Kind::RowsMissing { rows, share, gaps } => (
            format!(
                "{rows} rows are missing ({:.2} %), in {gaps} gaps",
                100.0 * share
            ),
            "look for frames that the recorder lost",
        ),
        Kind::UnevenTimes { rms_us } => (
            format!("rows come at uneven times, {rms_us:.0} µs rms off an even rate"),
            usual,
        ),
        Kind::OtherRate {
            period_us,
            servo_us,
            periods,
        } => {
            let thinned = periods.map_or(String::new(), |periods| {
                format!("the log is thinned to one of {periods} servo periods: ")
            });
            (
                format!(
                    "{thinned}rows are {period_us:.1} µs apart, the servo period in stage.toml is {servo_us:.1} µs"
                ),
                "log every period, or correct servo.period_s",
            )
        }
        Kind::IdleMovements { movements, of } => (
            format!(
                "nothing moves in {movements} of {of} movements, so they add nothing to the fit"
            ),
            usual,
        ),
        Kind::Stands {
            rows,
            share,
            longest_s,
        }
        | Kind::StandsAtEnd {
            rows,
            share,
            longest_s,
        } => match *share < 1.0 {
            true => (
                format!(
                    "{channel} stands still in {rows} rows ({:.1} % of the log), for up to {longest_s:.3} s at a time",
                    100.0 * share
                ),
                usual,
            ),
            false => (format!("{channel} never changes"), "is it connected?"),
        },
        Kind::OutlierRows { rows, largest_m } => (
            format!(
                "{rows} {} of {channel} far outside the noise, by up to {:.1} µm. The default --loss cauchy gives such rows no weight",
                if *rows == 1 { "row" } else { "rows" },
                largest_m * 1e6
            ),
            usual,
        ),
        Kind::Hum {
            frequency_hz,
            amplitude_m,
        } => (
            format!(
                "{channel} hums at {frequency_hz:.1} Hz with an amplitude of {:.2} µm",
                amplitude_m * 1e6
            ),
            usual,
        ),
        Kind::Change {
            quantity,
            course,
            size,
        } => (change(found, *quantity, course, *size), usual),
        Kind::OtherState { log } => {
            let what = log.as_deref().unwrap_or("the log from here on");
            (
                format!(
                    "{what} does not fit to what comes before: two stages, or everything changed{}",
                    cost(found)
                ),
                usual,
            )
        }
        Kind::ChangesOften {} => (
            format!(
                "{channel} changes more than twice. Its course between the changes is unknown, so the calibration is not free of it"
            ),
            "let it warm up, look for loose contacts, and record the log again",
        ),
        Kind::Inconsistent { ratio } => (
            format!(
                "the log is inconsistent: the Hall residuals are {ratio:.1} times the noise, and no single fault explains them"
            ),
            "fit it in parts",
        ),
        Kind::NotDetermined { ratios: [x, y, rz] } => (
            format!(
                "the log does not determine the calibration: errors in service of {x:.2} / {y:.2} / {rz:.2} times the noise floor are to be expected in X / Y / Rz, over the range of [motion] in stage.toml"
            ),
            usual,
        ),
        Kind::FaultsTogether { ratio } => (
            format!(
                "all faults of the log together make errors in service of {ratio:.2} times the noise floor"
            ),
            "see the other findings, and record the log again",
        ),
        Kind::OtherProbes { tolerances } => (
            format!(
                "the fitted probes are not those of stage.toml: they differ by {tolerances:.1} times the tolerances of directions, sensitivities and places, and no single mistake explains it"
            ),
            "check order and signs of all channels, the scales and the designed values in stage.toml",
        ),
        Kind::LeftOut { rows, of, end } => (
            format!(
                "{rows} of {of} rows ({:.1} %) are so far from the fitted model that they count little or nothing in the fit; the last is in movement {} at t_us = {}. With --loss none every row counts",
                100.0 * *rows as f64 / *of as f64,
                end.movement,
                end.t_us
            ),
            usual,
        ),
        Kind::ShortMovements { mean_rows, hidden } => (
            format!(
                "the movements have {mean_rows:.1} rows on average. Each has a zero deviation of its own, which hides about {:.0} % of the errors",
                100.0 * hidden
            ),
            "check the times and the movement column; a log without this column begins a movement after every gap of more than ten rows",
        ),
        Kind::OtherModel {
            reason,
            in_service,
            over_noise,
        } => {
            let service = in_service.map_or(String::new(), |ranges| {
                let [x, y, rz] = ranges.map(|[low, high]| format!("{:.1} to {:.1}", low * 1e6, high * 1e6));
                format!(". It is good on movements like those of the log; in service expect {x} µm in X, {y} µm in Y, {rz} µrad in Rz")
            });
            match over_noise {
                None => (format!("{reason}{service}"), ""),
                Some(ratio) => (
                    format!(
                        "{reason}{service}. Its errors are {ratio:.1} times the noise from row to row: the log shows something that the model lacks"
                    ),
                    "if all six axes move at once, take --model field or auto; else see the errors over the log in the report",
                ),
            }
        }
        Kind::NotDescribed {
            model,
            error,
            motion,
        } => {
            let unit = found
                .channels
                .first()
                .map_or("um", |axis| axis.micro_unit());
            let unit = sign(unit);
            (
                format!(
                    "the fitted model ({model}) does not describe the log: its errors are {:.1} {unit} rms in {channel}, the motion itself has {:.1} {unit} rms",
                    error * 1e6,
                    motion * 1e6
                ),
                "check the columns, the order and signs of the sensors, and the scales in stage.toml",
            )
        }
        Kind::ZerosClipped {
            movements,
            of,
            largest_m,
        } => (
            format!(
                "the zero deviation of {movements} of {of} movements is beyond its range (largest {:.1} µm)",
                largest_m * 1e6
            ),
            usual,
        ),
        Kind::CodesRefused { rows } => (
            format!(
                "the decoder refuses the codes of {rows} rows, so they are not part of the errors"
            ),
            "",
        ),
        Kind::LateReference { lag_s, periods } => {
            let way = if *lag_s > 0.0 { "behind" } else { "ahead of" };
            (
                format!(
                    "the reference is {:.0} µs ({:.2} servo periods) {way} the probes. The fit takes this into account",
                    lag_s.abs() * 1e6,
                    periods.abs()
                ),
                "set the delay of the interferometers to zero",
            )
        }
        Kind::AtLimit {
            parameter,
            shown: (value, unit),
            ..
        } => (
            format!(
                "parameter {parameter} stands at an end of its search range or beyond ({value:.6} {unit})"
            ),
            "check the scales and signs of that probe and of the beams; if they are right, widen the range in stage.toml",
        ),
        Kind::VerticalAtLimit { parameters } => (
            format!("{parameters} of the vertical terms stand at an end of their ranges"),
            "check the order and the signs of the capacitive sensors in the log and in stage.toml",
        ),
        Kind::MovementsMissed { movements } => (
            format!(
                "the draw has no row of {} movement(s) ({}), so their zero deviations are not fitted, and zero is taken",
                movements.len(),
                listed(movements)
            ),
            "use --draw stratified, or a larger --train",
        ),
        Kind::WildRow { micro, unit, ratio } => (
            format!(
                "the largest error, {micro:.1} {} in {channel}, is {ratio:.0} times the rms",
                sign(unit)
            ),
            "if the row is wrong, take it out of the log and fit again",
        ),
        Kind::OtherMotion {
            micro,
            service_micro,
            unit,
            is_scale,
        } => {
            let unit = sign(unit);
            (
                format!(
                    "the log moves {channel} by {micro:.0} {unit} to either side, service by {service_micro:.0} {unit} ([motion] in stage.toml)"
                ),
                match is_scale {
                    true => {
                        "check units and scales, because nothing else shows a wrong scale of all channels of a kind; or declare the motion"
                    }
                    false => {
                        "errors beyond the range of the log are larger than predicted; host-fit plan makes a run of the full range"
                    }
                },
            )
        }
        Kind::BeyondRange { rows, of } => (
            format!(
                "{rows} of {of} rows are beyond the range of the logs that the parameter blob was fitted to, so the blob extrapolates"
            ),
            "fit logs of the whole range of service",
        ),
        Kind::Coefficients {
            sensor,
            percent_per_k,
            zero_c,
            span_k,
            is_field,
            deviations,
        } => {
            let (place, symbol, key) = SENSORS[*sensor];
            let [a, b, c] = percent_per_k.map(|[value, error]| format!("{value:.4}({error:.4})"));
            let origin = match (*span_k > 0.0, is_field) {
                (true, _) => format!("from logs {span_k:.1} K apart"),
                (false, false) => {
                    "as stage.toml expects, because only the field model fits it".to_owned()
                }
                (false, true) => {
                    "as stage.toml expects, because the temperature hardly changes".to_owned()
                }
            };
            let mut evidence = format!(
                "the coefficient {symbol} of A, B, C is {a}, {b}, {c} %/K of the {place} temperature from {zero_c:.2} °C, {origin}"
            );
            let Some(deviations) = deviations else {
                return (
                    evidence,
                    if origin.ends_with("changes") {
                        usual
                    } else {
                        ""
                    }
                    .to_owned(),
                );
            };
            evidence += &format!(
                ". This is {deviations:.0} standard deviations from `{key}` in [temperature]"
            );
            return (
                evidence,
                format!("check the sensor, its column, unit and sign, and `{key}`"),
            );
        }
        Kind::NoTemperature { rows, of, reach_k } => (
            format!(
                "{rows} of {of} rows have no temperature, or one more than {reach_k} K from the calibration, and count as if they had the temperature of the calibration"
            ),
            "check the columns of [temperature], their units and the sensors",
        ),
        Kind::TemperatureChange {
            sensor,
            change_k,
            is_in_movement,
            rezero_k,
        } => {
            let since = if *is_in_movement {
                "within a movement"
            } else {
                "since the calibration"
            };
            return (
                format!(
                    "the temperature of the {} changes by {change_k:.1} K {since}",
                    SENSORS[*sensor].0
                ),
                format!(
                    "zero the stage again after every {rezero_k} K, because offsets and expansion are not in the model"
                ),
            );
        }
    };
    (evidence, remedy.to_owned())
}

/// A change of a channel, or of several that explain the log alike.
fn change(found: &Finding, quantity: Quantity, course: &TimeCourse, size: f64) -> String {
    let causes = found.channels.iter().chain(&found.alike);
    let titles: Vec<&str> = causes.map(|channel| channel.title()).collect();
    let what = match quantity {
        Quantity::Gain => "gain",
        Quantity::Zero => "zero",
        Quantity::Time => "time",
    };
    let unit = sign(quantity.unit());
    let how = match course {
        TimeCourse::Constant => {
            let way = if size > 0.0 { "behind" } else { "ahead of" };
            format!("is {:.2} {unit} {way} the other channels", size.abs())
        }
        TimeCourse::Log(log) => format!("in {log} differs by {size:+.2} {unit} from before"),
        TimeCourse::Onset => format!("changes by {size:+.2} {unit}"),
        TimeCourse::OverLog => format!("drifts by {size:+.2} {unit} over the log"),
        TimeCourse::OverMovement => format!("drifts by {size:+.2} {unit}/s within movements"),
    };
    let undecided = match titles.len() {
        1 => "",
        _ => ". The log does not show which",
    };
    format!(
        "the {what} of {} {how}{undecided}{}",
        titles.join(" or "),
        cost(found)
    )
}

/// The errors in service that a fault makes by itself.
fn cost(found: &Finding) -> String {
    let words = |cost: f64| {
        format!(". Alone it makes errors in service of {cost:.2} times the noise floor")
    };
    found.cost.map_or(String::new(), words)
}

/// The first names of a list.
fn listed(names: &[String]) -> String {
    let shown = &names[..names.len().min(NAMED_MAX)];
    match names.len() - shown.len() {
        0 => shown.join(", "),
        more => format!("{} and {more} more", shown.join(", ")),
    }
}

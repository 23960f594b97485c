//! The evidence of a finding: what happened, and how large it is.

use super::causes::mistake;
use super::finding::is_late_sensor;
use hallstage_input::axis::{counted, sign};
use hallstage_input::finding::{Finding, Kind, Quantity, TimeCourse};

/// Names in a list at most.
const NAMED_MAX: usize = 10;

/// The sensors of temperature: their place, the symbol of their coefficient, and its key in `[temperature]`.
pub(super) const SENSORS: [(&str, &str, &str); 2] =
    [("mount", "k", "magnet"), ("body", "h", "hall")];

/// The evidence, without a capital at its start.
#[rustfmt::skip]
pub(super) fn evidence(found: &Finding) -> String {
    let on = found.channels.first().map_or("", |channel| channel.title());
    match &found.kind {
        Kind::SingleRows { first, movements, .. } => {
            let others = match movements {
                0 | 1 => String::new(),
                several => format!(", and so have {} more", several - 1),
            };
            format!("movement {first} has one row{others}. It adds nothing to the fit, because its zero deviation fits it exactly")
        }
        Kind::FileCut { .. } => "the last line has no line break, so its last number may be cut".to_owned(),
        Kind::ColumnsLeftOut { columns, .. } => format!("left out: {}", listed(columns)),
        Kind::MovementsByTime { movements, gap_rows, .. } => {
            format!("there is no column for the movement. The times separate {}: one begins after a gap of more than {gap_rows} rows and where the time starts again", counted(*movements, "movement"))
        }
        Kind::Resets { resets } => format!("beams jump {} and the Hall probes do not, as where an interferometer is reset or slips. A movement ends there", counted(*resets, "time")),
        Kind::BetweenCodes { mean_codes, .. } => format!("voltages are {mean_codes:.2} codes from whole codes on average"),
        Kind::Excerpt { rows, taken, runs } => format!("the fit and the diagnosis use {taken} of {rows} rows, in {}", counted(*runs, "run")),
        Kind::RowsSkipped { reason, rows, line, column, name, .. } => {
            format!("rows skipped because of {reason}: {rows} (the first: line {line}, column {column}, {name})")
        }
        Kind::MovementsSkipped { movements, rows, .. } => {
            let names: Vec<String> = movements.iter().map(i64::to_string).collect();
            format!("all rows of movement {} are bad ({rows})", listed(&names))
        }
        Kind::RowsMissing { rows, percent, gaps } => format!("{} missing ({percent:.2} %), in {}", counted(*rows as usize, "row"), counted(*gaps, "gap")),
        Kind::UnevenTimes { rms_us } => format!("rows come at uneven times, {rms_us:.0} µs rms off an even rate"),
        Kind::OtherRate { period_us, servo_us, periods } => {
            let thinned = periods.map_or(String::new(), |periods| format!("the log is thinned to one of {periods} servo periods: "));
            format!("{thinned}rows are {period_us:.1} µs apart, the servo period in stage.toml is {servo_us:.1} µs")
        }
        Kind::OtherUnit { what, ratio, units } => format!("{what} are {ratio} times what stage.toml expects, as where {units}"),
        Kind::IdleMovements { movements, of } => format!("nothing moves in {movements} of {}, and rows without motion show nothing", counted(*of, "movement")),
        Kind::Stands { percent: 100.0, .. } => format!("{on} never changes"),
        Kind::Stands { rows, percent, longest_s, .. } => {
            format!("{on} stands still in {} ({percent:.1} % of the log), for up to {longest_s:.3} s at a time", counted(*rows, "row"))
        }
        Kind::OutlierRows { rows, largest_um } => {
            let rows = format!("{rows} {}", if *rows == 1 { "row is" } else { "rows are" });
            format!("{rows} far outside the noise of {on}, by up to {largest_um:.1} µm. The default --loss cauchy gives them no weight{}", cost(found))
        }
        Kind::Hum { frequency_hz, amplitude_um } => format!("{on} hums at {frequency_hz:.1} Hz with an amplitude of {amplitude_um:.2} µm{}", cost(found)),
        Kind::CoarseSteps { step_um, noise_um } => format!("{on} is written in steps of {step_um:.2} µm, and a Hall probe has {noise_um:.2} µm of noise{}", cost(found)),
        Kind::StuckBits { bits, step_um } => {
            let numbers: Vec<String> = bits.iter().map(u32::to_string).collect();
            let (which, change) = if bits.len() == 1 { ("bit", "changes") } else { ("bits", "change") };
            format!("{which} {} of {on} never {change}, so the values have gaps of up to {step_um:.2} µm{}", listed(&numbers), cost(found))
        }
        Kind::Noisy { noise_um, ratio } => format!("the noise of {on} is {noise_um:.2} µm, {ratio:.1} times the noise of the others{}", cost(found)),
        Kind::GroupNoise { percent: 0.0 } => format!("the noise of {on} is not even: it has lines, or times with more{}", cost(found)),
        Kind::GroupNoise { percent } => format!("{percent:.0} % of the noise of {on} is the same in all of them{}", cost(found)),
        Kind::SlowRate { rows, is_held } => {
            let between = if *is_held { "hold the last one" } else { "are interpolated" };
            format!("{on} has a new value in one of {rows} rows, and the rows between {between}{}", cost(found))
        }
        Kind::LowPass {} => format!("the noise of {on} falls towards high frequencies like the noise of an average or a low-pass filter, which weakens and delays fast motion, too"),
        Kind::Filled { rows } => format!("{on} runs on a straight line in {}, as where a gap was filled", counted(*rows, "row")),
        Kind::Overflows { bits, times } => format!("{on} jumps by 2^{bits} codes {}: its counter of {bits} bits overflows", counted(*times, "time")),
        Kind::Change { quantity, course, size } => change(found, *quantity, course, *size),
        Kind::OtherState { log } => {
            let what = log.as_deref().unwrap_or("the log from here on");
            format!("{what} does not fit to what comes before: two stages, or everything changed{}", cost(found))
        }
        Kind::NotLinear {} => {
            let titles: Vec<&str> = found.channels.iter().map(|channel| channel.title()).collect();
            format!("the signal of {} does not follow the motion of the reference, in this log or in a part of it, and no order, sign or scale explains it", titles.join(" and "))
        }
        Kind::Inconsistent { ratio } => {
            let like = match on {
                "" => String::new(),
                on => format!(". They look like an error of {on} that follows the motion"),
            };
            format!("no known fault explains the residuals{like}. In service such errors are up to {ratio:.2} times the noise floor")
        }
        Kind::NotDetermined { ratios: [x, y, rz] } => {
            format!("the log does not determine the calibration: in service over the range of [motion] in stage.toml, expect errors of {x:.2} / {y:.2} / {rz:.2} times the noise floor in X / Y / Rz")
        }
        Kind::FaultsTogether { ratio } => format!("all faults of the log together make errors in service of {ratio:.2} times the noise floor"),
        Kind::Mistake { causes, is_sure, may_be_magnets, .. } => mistake(causes, *is_sure, *may_be_magnets),
        Kind::OtherProbes { tolerances } => {
            format!("the fitted probes differ from stage.toml by {tolerances:.1} times the tolerances of directions, sensitivities and places, and no single mistake explains it")
        }
        Kind::ShortMovements { mean_rows, hidden_percent } => {
            format!("the movements have {mean_rows:.1} rows on average. Each has a zero deviation of its own, which hides about {hidden_percent:.0} % of the errors")
        }
        Kind::OtherModel { reason, in_service_micro } => {
            let service = in_service_micro.map_or(String::new(), |ranges| {
                let [x, y, rz] = ranges.map(|[low, high]| format!("{low:.1} to {high:.1}"));
                format!(". Expect the errors of the log for similar movements; in service expect {x} µm in X, {y} µm in Y, {rz} µrad in Rz")
            });
            format!("{reason}{service}")
        }
        Kind::ZerosClipped { movements, of, largest_um } => {
            format!("the zero deviation of {movements} of {} is beyond its range (largest {largest_um:.1} µm)", counted(*of, "movement"))
        }
        Kind::CodesRefused { rows } => format!("the decoder refuses the codes of {}, which the errors leave out", counted(*rows, "row")),
        Kind::LateReference { lag_us, periods, is_declared } => {
            let in_motion = found.cost.map_or(String::new(), |cost| format!("errors of {cost:.2} times the noise floor in the motion that [motion] in stage.toml declares"));
            let (us, periods) = (lag_us.abs(), periods.abs());
            match is_declared {
                true => format!("all probes are {us:.0} µs ({periods:.2} servo periods) {} the reference, whose declared latency is taken off. In service this makes {in_motion}", way(-lag_us)),
                false => format!("the reference is {us:.0} µs ({periods:.2} servo periods) {} the probes. The log does not show which of them has the wrong time. If it is the reference, the calibration is right and this costs nothing in service. If it is all probes, service has {in_motion}", way(*lag_us)),
            }
        }
        Kind::AtLimit { parameter, shown: (value, unit), .. } => {
            format!("the parameter {parameter} stands at an end of its search range or beyond ({value:.6} {unit})")
        }
        Kind::MovementsMissed { movements } => {
            format!("the draw has no row of {} ({}), so their zero deviations are not fitted, and zero is taken", counted(movements.len(), "movement"), listed(movements))
        }
        Kind::OtherMotion { micro, service_micro, unit, .. } => {
            let unit = sign(unit);
            format!("{on} moves ±{micro:.0} {unit}; [motion] says ±{service_micro:.0} {unit}")
        }
        Kind::InMotion { ratio, corrected_ratio, acceleration_m_s2, speed_mm_s, shows_acceleration, lag_us: [a, b, c] } => {
            let (corrected, known) = match shows_acceleration {
                true => (format!(", and {corrected_ratio:.2} times with the correction by commanded speed and acceleration"), ""),
                false => (String::new(), ". The log does not show what acceleration does to the probes"),
            };
            format!("in the motion that [motion] in stage.toml declares for service, errors are {ratio:.2} times the noise floor{corrected}. Uncorrected errors are good up to {acceleration_m_s2:.2} m/s² and {speed_mm_s:.1} mm/s rms. Probes A, B, C are read {a:.0}, {b:.0}, {c:.0} µs after the middle probe{known}")
        }
        Kind::FasterLog { acceleration_m_s2: [a, declared_a], speed_mm_s: [v, declared_v], ratio, corrected_ratio } => {
            let corrected = corrected_ratio.map_or(String::new(), |ratio| format!(", and {ratio:.2} times with the correction by speed and acceleration"));
            format!("the log moves faster than [motion] in stage.toml declares for service: {a:.2} m/s² and {v:.1} mm/s rms, declared {declared_a:.3} m/s² and {declared_v:.1} mm/s. Errors on it are {ratio:.2} times the noise floor{corrected}")
        }
        Kind::BeyondRange { rows, of } => {
            format!("{rows} of {of} rows are beyond the range of the logs that the parameter blob was fitted to, so the blob extrapolates")
        }
        Kind::Coefficients { sensor, percent_per_k, zero_c, span_k, is_field, deviations } => {
            let (place, symbol, key) = SENSORS[*sensor];
            let [a, b, c] = percent_per_k.map(|[value, error]| format!("{value:.4}({error:.4})"));
            let origin = match (*span_k > 0.0, is_field) {
                (true, _) => format!(", from logs {span_k:.1} K apart"),
                (false, false) => format!(". Not measured: only the field model fits it. The value expected by `{key}` in [temperature] is used"),
                (false, true) => format!(". Not measured: the temperature changed by less than 2 K. The value expected by `{key}` in [temperature] is used"),
            };
            let other = deviations.map_or(String::new(), |deviations| {
                format!(". This is {deviations:.0} standard deviations from `{key}` in [temperature]")
            });
            format!("the coefficient {symbol} of A, B, C is {a}, {b}, {c} %/K of the {place} temperature from {zero_c:.2} °C{origin}{other}")
        }
        Kind::TemperaturesExchanged { log_odds } => {
            let odds = libm::exp(log_odds.min(libm::log(1e6)));
            format!("the gains of the probes follow the temperatures better if the columns of mount and body are exchanged (odds of {odds:.0} to 1)")
        }
        Kind::NoTemperature { rows, of, reach_k } => {
            format!("{rows} of {of} rows have no temperature, or one more than {reach_k} K from the calibration, and count as if they had the temperature of the calibration")
        }
        Kind::TemperatureChange { sensor, change_k, is_in_movement, .. } => {
            let since = if *is_in_movement { "within a movement" } else { "since the calibration" };
            format!("the temperature of the {} changes by {change_k:.1} K {since}", SENSORS[*sensor].0)
        }
    }
}

/// A change of a channel, of several together, or of others that explain the log alike.
fn change(found: &Finding, quantity: Quantity, course: &TimeCourse, size: f64) -> String {
    let titles: Vec<&str> = found
        .channels
        .iter()
        .map(|channel| channel.title())
        .collect();
    let others = found.alike.iter().map(|channel| channel.title());
    let whose: Vec<String> = [titles.join(" and ")]
        .into_iter()
        .chain(others.map(str::to_owned))
        .collect();
    let what = match quantity {
        Quantity::Gain => "gain",
        Quantity::Zero => "zero",
        Quantity::Time => "time",
    };
    let unit = sign(quantity.unit());
    let how = match course {
        TimeCourse::Constant => format!(
            "is {:.2} {unit} {} the other channels",
            size.abs(),
            way(size)
        ),
        TimeCourse::Log(log) => format!("in {log} differs by {size:+.2} {unit} from before"),
        TimeCourse::Onset if titles.len() > 1 => {
            format!("change together by up to {size:+.2} {unit}")
        }
        TimeCourse::Onset => format!("changes by {size:+.2} {unit}"),
        TimeCourse::OverLog => format!("drifts by {size:+.2} {unit} over the log"),
        TimeCourse::OverMovement => format!("drifts by {size:+.2} {unit}/s within movements"),
    };
    let undecided = if whose.len() > 1 {
        ". The log does not show which"
    } else {
        ""
    };
    format!(
        "the {what} of {} {how}{undecided}{}",
        whose.join(" or "),
        cost(found)
    )
}

/// How something late stands to the others.
fn way(late: f64) -> &'static str {
    if late > 0.0 { "behind" } else { "ahead of" }
}

/// The errors in service that a fault makes by itself. A late sensor makes most of them in service: see `motion`.
fn cost(found: &Finding) -> String {
    let words = |cost: f64| {
        format!(". Alone it makes errors in service of {cost:.2} times the noise floor")
    };
    let cost = found.cost.filter(|_| !is_late_sensor(found));
    cost.map_or(String::new(), words)
}

/// The first names of a list.
fn listed(names: &[String]) -> String {
    let shown = &names[..names.len().min(NAMED_MAX)];
    match names.len() - shown.len() {
        0 => shown.join(", "),
        more => format!("{} and {more} more", shown.join(", ")),
    }
}

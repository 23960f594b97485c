//! The trend as figures and as a page.

use super::{Calibration, Drift, Trend};
use crate::report::axis;
use crate::report::chart::{Chart, Mark, Tone};
use crate::report::errors::pose;
use crate::report::figure::{Group, figure, group, micro};
use crate::report::html::{Page, Section};
use crate::report::provenance::Provenance;
use crate::report::verdict::Summary;
use hallstage_input::axis::{Axis, PLANAR, sign};
use minijinja::Error;

/// A month, days.
const MONTH: f64 = 365.25 / 12.0;
/// Points of a curve.
const POINTS: u32 = 50;

/// The first axis whose errors may reach their limit, and its drift.
fn first_to_end(trend: &Trend) -> Option<(usize, &Drift)> {
    let days = |drift: &Drift| drift.days[1].unwrap_or(f64::INFINITY);
    let drifts = trend.drifts.iter().enumerate();
    let ending = drifts.filter(|(_, drift)| days(drift).is_finite());
    ending.min_by(|a, b| days(a.1).total_cmp(&days(b.1)))
}

/// The dates of a limit: by the line, at the earliest and at the latest.
fn dates(trend: &Trend, drift: &Drift) -> [Option<String>; 3] {
    drift
        .days
        .map(|days| Some(trend.date_after(days?)?.to_string()))
}

/// The dates between which an axis has jumped, and the jump.
fn jump(trend: &Trend, (axis, drift): (usize, &Drift)) -> Option<String> {
    let (first, size) = drift.jump?;
    let [from, to] = [first - 1, first].map(|k| trend.calibrations[k].date.date());
    let Axis { name, micro, .. } = &PLANAR[axis];
    let (size, unit) = (size * 1e6, sign(micro));
    Some(format!(
        "{name} jumped by {size:.2} {unit} (rms) between {from} and {to}"
    ))
}

/// What the trend says, in a line.
pub fn answer(trend: &Trend) -> String {
    let jumps = trend.drifts.iter().enumerate();
    let jumps: Vec<String> = jumps.filter_map(|drift| jump(trend, drift)).collect();
    let off_line = trend.drifts.iter().zip(&PLANAR);
    let off_line =
        off_line.filter(|(drift, _)| drift.is_line == Some(false) && drift.jump.is_none());
    let off_line = off_line.map(|(drift, axis)| {
        let (residual, unit) = (drift.residual * 1e6, sign(axis.micro));
        let name = axis.name;
        format!("{name} is {residual:.2} {unit} (rms) off its line, beyond the errors of the calibrations")
    });
    let said: Vec<String> = jumps.into_iter().chain(off_line).collect();
    let jumped = match said.is_empty() {
        true => String::new(),
        false => format!(
            "{}: a line does not describe this, and gives no date. ",
            said.join(", ")
        ),
    };
    let reached = match first_to_end(trend) {
        Some(first) => reached(trend, first),
        None if !jumped.is_empty() => String::new(),
        None => "No limit will be reached: there is none, or no drift.".to_owned(),
    };
    format!("{jumped}{reached}").trim_end().to_owned()
}

/// When an axis reaches its limit.
fn reached(trend: &Trend, (axis, drift): (usize, &Drift)) -> String {
    let axis = &PLANAR[axis];
    let limit = drift.limit.unwrap_or_default() * 1e6;
    let (name, unit) = (axis.name, sign(axis.micro));
    let errors = format!("Errors of {name} in service");
    if drift.days[0] == Some(0.0) {
        return format!("{errors} are beyond their limit of {limit:.2} {unit}.");
    }
    let limit = format!("their limit of {limit:.2} {unit}");
    match (dates(trend, drift), drift.interval) {
        ([Some(date), ..], None) => format!(
            "{errors} reach {limit} on {date}; a line through two calibrations has no interval."
        ),
        ([Some(date), Some(earliest), Some(latest)], _) => {
            format!("{errors} reach {limit} on {date}; between {earliest} and {latest} (95 %).")
        }
        ([Some(date), Some(earliest), None], _) => {
            format!("{errors} reach {limit} on {date}; not before {earliest}, or never (95 %).")
        }
        ([None, Some(earliest), _], _) => {
            format!(
                "{errors} may reach {limit} from {earliest} on (95 %); by the line they do not."
            )
        }
        _ => format!("{errors} reach {limit} after the last year of the calendar."),
    }
}

/// What the user should know: forced blobs; without the posterior of the last blob, errors and limits are other ones.
pub fn warnings(trend: &Trend) -> Vec<String> {
    let warning = trend.unknown.iter().map(|name| {
        format!(
            "{name}, the last blob, has no posterior beside it: its errors are those on its log, not in service, and 1.30 times the \
             noise is no limit. Copy {name}.posterior there."
        )
    });
    let forced = trend.forced.iter().map(|name| {
        format!("{name} was refused and written by --force: its errors are beyond a limit, or its log has a fault")
    });
    let not_judged = trend.drifts.iter().any(|drift| drift.is_line.is_none());
    let not_judged = not_judged.then(|| {
        "whether the changes are on a line is not known: a blob has no posterior beside it"
            .to_owned()
    });
    warning.chain(not_judged).chain(forced).collect()
}

/// All figures: a row for each axis, and one for each calibration.
pub fn figures(trend: &Trend) -> Group {
    let axis = |(k, drift): (usize, &Drift)| {
        let axis = &PLANAR[k];
        let [reached, earliest, latest] = dates(trend, drift);
        // A figure that is not there has the key of its unit all the same.
        let or_null = |x: Option<f64>| micro(axis, x.unwrap_or(f64::NAN));
        let a_month = |x: Option<f64>| or_null(x.map(|x| x * MONTH));
        // A line does not describe a jump.
        let interval = drift.interval.filter(|_| drift.jump.is_none());
        let per_day = drift.jump.is_none().then_some(drift.per_day);
        group! {
            "axis" => axis.name,
            "error" => or_null(trend.calibrations.last().map(|last| last.errors[k])),
            "limit" => or_null(drift.limit),
            "drift_a_month" => a_month(per_day),
            "from" => a_month(interval.map(|[low, _]| low)),
            "to" => a_month(interval.map(|[_, high]| high)),
            "off_line" => micro(axis, drift.residual),
            "is_line" => drift.is_line,
            "reached" => reached,
            "earliest" => interval.and(earliest),
            "latest" => interval.and(latest),
            "jump" => or_null(drift.jump.map(|(_, size)| size)),
            "after" => drift.jump.map(|(first, _)| trend.calibrations[first - 1].date.date().to_string()),
        }
    };
    let calibration = |of: &Calibration| {
        let [a, b, c] = of.gains.map(|(change, error)| {
            let change = figure(change * 100.0, "%");
            group! { "gain" => change.with_error(error.map(|error| error * 100.0)) }
        });
        group! {
            "date" => of.date.date().to_string(),
            "a" => a, "b" => b, "c" => c,
            "moved" => pose(of.moved),
            "error" => pose(of.errors),
        }
    };
    group! {
        "axes" => trend.drifts.iter().enumerate().map(axis).collect::<Vec<_>>(),
        "calibrations" => trend.calibrations.iter().map(calibration).collect::<Vec<_>>(),
    }
}

/// Gains of the probes over time, with two standard errors to both sides.
fn gains(trend: &Trend, days: axis::Axis) -> Chart {
    let panel = |probe: usize| {
        let points = trend
            .calibrations
            .iter()
            .map(|of| (of.day, of.gains[probe]));
        let (line, band) = points
            .map(|(day, (gain, error))| {
                let (gain, half) = (100.0 * gain, 200.0 * error.unwrap_or(0.0));
                ((day, gain), (day, gain - half, gain + half))
            })
            .unzip();
        let marks = vec![Mark::Band(Tone::Noise, band), Mark::Line(Tone::Data, line)];
        (["A, %", "B, %", "C, %"][probe], marks)
    };
    let caption =
        "Gains since the first calibration, with two standard errors to both sides (grey)";
    Chart::new(caption, ("days since the first calibration", days), panel)
}

/// The errors of an axis from the last calibration to a day, as they grow with the drift: um or urad.
pub(super) fn forecast(trend: &Trend, axis: usize, end: f64) -> Vec<(f64, f64)> {
    let Some(last) = trend.calibrations.last() else {
        return Vec::new();
    };
    let point = |k: u32| {
        let after = (end - last.day) * f64::from(k) / f64::from(POINTS);
        let error = last.errors[axis].hypot(trend.drifts[axis].per_day * after);
        (last.day + after, error * 1e6)
    };
    (0..=POINTS).map(point).collect()
}

/// Poses and errors over time; the errors go on with the drift.
fn errors(trend: &Trend, days: axis::Axis) -> Chart {
    let panel = |axis: usize| {
        let drift = &trend.drifts[axis];
        let points = |of: fn(&Calibration) -> [f64; 3]| -> Vec<(f64, f64)> {
            let points = trend.calibrations.iter();
            points.map(|at| (at.day, of(at)[axis] * 1e6)).collect()
        };
        let mut errors = points(|of| of.errors);
        // A line does not go on from a jump, or where it is none.
        if drift.is_line != Some(false) {
            errors.extend(forecast(trend, axis, days.1));
        }
        let mut marks = vec![
            Mark::Line(Tone::Data, points(|of| of.moved)),
            Mark::Line(Tone::Second, errors),
        ];
        let limit = drift.limit.map(|limit| limit * 1e6);
        let limit = limit.map(|limit| vec![(days.0, limit), (days.1, limit)]);
        marks.extend(limit.map(|limit| Mark::Line(Tone::Noise, limit)));
        (["X, µm", "Y, µm", "Rz, µrad"][axis], marks)
    };
    let caption =
        "Poses since the first calibration (blue), errors (orange) and their limit (grey), rms";
    Chart::new(caption, ("days since the first calibration", days), panel)
}

/// The page.
///
/// # Errors
/// As [`Page::html`].
pub fn page(
    trend: &Trend,
    facts: Vec<[String; 2]>,
    mut provenance: Provenance,
) -> Result<String, Error> {
    let last_day = trend.calibrations.last().map_or(0.0, |last| last.day);
    let first = first_to_end(trend).map(|(_, drift)| drift);
    let end = first.and_then(|drift| drift.days[0]);
    let is_open = first.is_some()
        || trend
            .drifts
            .iter()
            .any(|drift| drift.is_line == Some(false));
    // As far again as the calibrations reach, or a little beyond the limit.
    let beyond = end.map_or(last_day, |end| (1.1 * end).min(2.0 * last_day));
    let days = axis::Axis(0.0, last_day + beyond);
    let mark = if is_open { "limited" } else { "good" };
    let note = "Moved: the pose that the same codes give, against the first calibration, rms over service. Error: rms in service, or on \
                the log of a calibration without a posterior. From and to: 95 % of the drift.";
    let number = provenance.document(&facts);
    provenance.0.title = "Provenance".to_owned();
    let mut tables = figures(trend).tables();
    tables.push(provenance.0);
    let page = Page {
        title: "Trend of the calibrations of a stage",
        number,
        verdict: Summary::plain(mark, "Trend", answer(trend)),
        first: Vec::new(),
        facts,
        causes: None,
        warnings: &warnings(trend),
        sections: vec![
            Section {
                title: "Over time",
                charts: vec![gains(trend, days), errors(trend, days)],
                ..Section::default()
            },
            Section {
                title: "Figures",
                notes: vec![note.to_owned()],
                tables,
                ..Section::default()
            },
        ],
    };
    page.html()
}

//! The trend as figures and as a page.

use super::{Calibration, Drift, Trend};
use crate::report::axis::Axis;
use crate::report::chart::{Chart, Mark, Tone};
use crate::report::errors::pose;
use crate::report::figure::{Group, figure, group, micro};
use crate::report::html::{Page, Section};
use crate::report::provenance::Provenance;
use crate::report::verdict::Summary;
use hallstage_input::axis::{PLANAR, sign};
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
fn dates(trend: &Trend, drift: &Drift) -> [String; 3] {
    drift.days.map(|days| {
        let date = days.and_then(|days| trend.date_after(days));
        date.map_or("no date".to_owned(), |date| date.to_string())
    })
}

/// What the trend says, in a line.
pub fn answer(trend: &Trend) -> String {
    let Some((axis, drift)) = first_to_end(trend) else {
        return "No limit will be reached: there is none, or no drift.".to_owned();
    };
    let [date, earliest, latest] = dates(trend, drift);
    let axis = &PLANAR[axis];
    let limit = drift.limit.unwrap_or_default() * 1e6;
    let interval = match drift.interval {
        Some(_) => format!("between {earliest} and {latest} (95 %)"),
        None => "a line through two calibrations has no interval".to_owned(),
    };
    let (name, unit) = (axis.name, sign(axis.micro));
    if drift.days[0] == Some(0.0) {
        return format!("Errors of {name} in service are beyond their limit of {limit:.2} {unit}.");
    }
    format!(
        "Errors of {name} in service reach their limit of {limit:.2} {unit} on {date}; {interval}."
    )
}

/// All figures: a row for each axis, and one for each calibration.
pub fn figures(trend: &Trend) -> Group {
    let axis = |(k, drift): (usize, &Drift)| {
        let axis = &PLANAR[k];
        let [reached, earliest, latest] = dates(trend, drift);
        let a_month = |x: f64| micro(axis, x * MONTH);
        let interval = drift.interval;
        group! {
            "axis" => axis.name,
            "error" => trend.calibrations.last().map(|last| micro(axis, last.errors[k])),
            "limit" => drift.limit.map(|limit| micro(axis, limit)),
            "drift_a_month" => a_month(drift.per_day),
            "from" => interval.map(|[low, _]| a_month(low)),
            "to" => interval.map(|[_, high]| a_month(high)),
            "reached" => reached,
            "earliest" => interval.map(|_| earliest),
            "latest" => interval.map(|_| latest),
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
fn gains(trend: &Trend, days: Axis) -> Chart {
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

/// Poses and errors over time; the errors go on with the drift.
fn errors(trend: &Trend, days: Axis) -> Chart {
    let panel = |axis: usize| {
        let drift = &trend.drifts[axis];
        let points = |of: fn(&Calibration) -> [f64; 3]| -> Vec<(f64, f64)> {
            let points = trend.calibrations.iter();
            points.map(|at| (at.day, of(at)[axis] * 1e6)).collect()
        };
        let mut errors = points(|of| of.errors);
        if let Some((from, error)) = errors.last().copied() {
            errors.extend((1..=POINTS).map(|k| {
                let after = (days.1 - from) * f64::from(k) / f64::from(POINTS);
                (from + after, error.hypot(drift.per_day * after * 1e6))
            }));
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
    let end = first_to_end(trend).and_then(|(_, drift)| drift.days[0]);
    // As far again as the calibrations reach, or a little beyond the limit.
    let beyond = end.map_or(last_day, |end| (1.1 * end).min(2.0 * last_day));
    let days = Axis(0.0, last_day + beyond);
    let mark = if end.is_some() { "limited" } else { "good" };
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
        warnings: &[],
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

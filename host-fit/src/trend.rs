//! The trend of the calibrations of a stage: how its gains and its poses drift, and when its errors reach a limit.
//!
//! The same codes are decoded by each blob. For each pose of a grid over the service of `[motion]`, the changes since the first
//! blob are a line over time, by least squares. The drift of an axis is the slope, rms over the grid. The errors e in service of
//! the last blob grow with it, to sqrt(e^2 + (drift t)^2) after the time t. Where two levels describe the changes far better than
//! a line, the axis has jumped, and has no drift. Where the changes are farther from the line than the errors of the calibrations
//! allow, the line gives no date.

pub mod shown;

use crate::diff::on_grid;
use crate::report::decision::Decision;
use hallstage_calibration::budget::Budget;
use hallstage_calibration::judge::verdict::Verdict;
use hallstage_calibration::recalibrate::StoredPosterior;
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::paper::Parameters;
use hallstage_solver::estimator::terms::{ETA, PER_PROBE};
use jiff::civil::{Date, DateTime};
use jiff::tz::TimeZone;
use jiff::{SignedDuration, Timestamp};
use nalgebra::{DMatrix, DVector};
use runtime::ParameterSet;

/// A later date is none.
const DAYS_MAX: f64 = 36_525.0;
const DAY_S: f64 = 86_400.0;
/// Odds of two levels against a line above which an axis has jumped, for each place where it may have.
const JUMP_MIN: f64 = 20.0;
/// Errors of a calibration above which a change is not on the line, rms.
const OFF_LINE_MIN: f64 = 3.0;

/// A blob with its name, and what is known of it.
pub type Blob = (String, ParameterSet, Option<StoredPosterior>);

/// Why there is no trend.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TrendError {
    /// A blob has no date.
    #[error("{name} has the date `{created}`; a trend needs a date as 2026-11-26 (fit --created)")]
    NoDate {
        /// The blob.
        name: String,
        /// What it has.
        created: String,
    },
    /// The blobs are not of one stage.
    #[error("{name} is of stage `{serial}`, others are of `{first}`; a trend is of one stage")]
    OtherStage {
        /// The blob.
        name: String,
        /// Its serial number.
        serial: String,
        /// The serial number of the first blob.
        first: String,
    },
    /// A log counts twice.
    #[error("{name} and {other} are calibrations by the same log: name one of them")]
    SameLog {
        /// A blob.
        name: String,
        /// Another one.
        other: String,
    },
    /// The blobs have one date, or decode no pose.
    #[error("a trend needs blobs of two dates that decode the poses of the service of [motion]")]
    NoLine,
}

/// A calibration of the stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// When it was made.
    pub date: DateTime,
    /// Days since the first.
    pub day: f64,
    /// Changes of the gains of A, B, C since the first, as parts, with their standard errors.
    pub gains: [(f64, Option<f64>); 3],
    /// Changes of X, Y, Rz since the first, rms over service: m, m, rad.
    pub moved: [f64; 3],
    /// Errors of X, Y, Rz in service, rms, or on its log where these are not known: m, m, rad.
    pub errors: [f64; 3],
    /// Its errors in service without the noise of the sensors and the declared inputs, which all calibrations have, if known.
    pub own_errors: Option<[f64; 3]>,
}

/// How X, Y or Rz changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drift {
    /// Change in a day, rms over service: m or rad.
    pub per_day: f64,
    /// The ends of its 95 % interval; `None` of two calibrations, where a line has no scatter.
    pub interval: Option<[f64; 2]>,
    /// The standard deviation of the calibrations from the line, rms over service: m or rad.
    pub residual: f64,
    /// Whether the changes are on the line, within the errors of the calibrations; `None` where these are not all known.
    pub is_line: Option<bool>,
    /// The largest rms error in service: m or rad.
    pub limit: Option<f64>,
    /// Days from the last calibration to the limit: by the line, at the earliest and at the latest.
    pub days: [Option<f64>; 3],
    /// The first calibration after a jump, and the jump, rms over service, m or rad. A line does not describe it.
    pub jump: Option<(usize, f64)>,
}

/// Calibrations of one stage in the order of their dates.
#[derive(Clone, Debug, PartialEq)]
pub struct Trend {
    /// The calibrations.
    pub calibrations: Vec<Calibration>,
    /// The drift of X, Y, Rz.
    pub drifts: [Drift; 3],
    /// The name of the last blob if its errors in service are not known.
    pub unknown: Option<String>,
    /// The names of blobs that were refused and written all the same.
    pub forced: Vec<String>,
}

/// The date of a blob, as 2026-11-26, with or without a time. A time with a zone is an instant, and has the date of UTC.
pub fn date(created: &str) -> Option<DateTime> {
    let dashes = [4, 7].map(|at| created.as_bytes().get(at) == Some(&b'-'));
    // The parser takes other forms too, and the second 60 as 59.
    if dashes != [true; 2] || created.starts_with("0000") || created.contains(":60") {
        return None;
    }
    let instant = created
        .parse()
        .map(|time: Timestamp| TimeZone::UTC.to_datetime(time));
    instant.or_else(|_| created.parse()).ok()
}

/// Whether a date is before another one: of two times with a zone the instants count, else the days as they are written.
pub fn is_before(created: &str, other: &str) -> bool {
    let instant = |text: &str| text.parse::<Timestamp>().ok();
    let dated = [created, other].map(|text| date(text).and(text.get(..10)));
    match (instant(created).zip(instant(other)), dated) {
        (Some((own, other)), _) => own < other,
        (None, [Some(own), Some(other)]) => own < other,
        _ => false,
    }
}

impl Trend {
    /// The trend of blobs. Their errors have the limits of a calibration that is left as the last blob is.
    ///
    /// # Errors
    /// See [`TrendError`].
    pub fn new(blobs: &[Blob], stage: &Stage) -> Result<Self, TrendError> {
        let mut dated = Vec::new();
        for (k, blob) in blobs.iter().enumerate() {
            let (name, set, _) = blob;
            let date = date(&set.created).ok_or_else(|| TrendError::NoDate {
                name: name.clone(),
                created: set.created.to_string(),
            })?;
            let (_, first, _) = &blobs[0];
            if set.serial != first.serial {
                return Err(TrendError::OtherStage {
                    name: name.clone(),
                    serial: set.serial.to_string(),
                    first: first.serial.to_string(),
                });
            }
            let same = |(_, other, _): &&Blob| other.logs_sha256 == set.logs_sha256;
            if let Some((other, ..)) = blobs[..k].iter().find(same) {
                let (name, other) = (name.clone(), other.clone());
                return Err(TrendError::SameLog { name, other });
            }
            dated.push((date, blob));
        }
        dated.sort_by_key(|(date, _)| *date);
        let [
            (start, (_, first, first_known)),
            ..,
            (_, (last, _, last_known)),
        ] = dated.as_slice()
        else {
            return Err(TrendError::NoLine);
        };
        let gains = |set: &ParameterSet, known: Option<&StoredPosterior>| {
            let eta = Parameters::from_set(set).eta();
            [0, 1, 2].map(|probe: usize| {
                let row = probe * PER_PROBE + ETA;
                (eta[probe], known.map(|known| known.covariance[(row, row)]))
            })
        };
        let before = gains(first, first_known.as_ref());
        let calibration = |(date, (_, set, known)): &(DateTime, &Blob)| {
            let after = gains(set, known.as_ref());
            let change = |probe: usize| {
                let ((old, of_old), (new, of_new)) = (before[probe], after[probe]);
                let error = of_old.zip(of_new).filter(|_| date != start);
                let error = error.map(|(old, new)| (old + new).sqrt());
                (new / old - 1.0, error.map(|error| error / old))
            };
            let budget = known.as_ref().and_then(|known| known.budget.as_ref());
            let on_log = set.fit.rms.map(f64::from);
            let own = |of: &Budget| {
                let (errors, noise, declared) = (of.in_service(), of.noise(), of.declared());
                let square = |k: usize| errors[k].powi(2) - noise[k].powi(2) - declared[k].powi(2);
                [0, 1, 2].map(|k| square(k).max(0.0).sqrt())
            };
            Calibration {
                date: *date,
                day: date.duration_since(*start).as_secs_f64() / DAY_S,
                gains: [0, 1, 2].map(change),
                moved: [0.0; 3],
                errors: budget.map_or(on_log, Budget::in_service),
                own_errors: budget.map(own),
            }
        };
        let mut calibrations: Vec<_> = dated.iter().map(calibration).collect();
        let sets: Vec<_> = dated.iter().map(|(_, blob)| &blob.1).collect();
        let products = products(&sets, stage).ok_or(TrendError::NoLine)?;
        let days: Vec<f64> = calibrations.iter().map(|of| of.day).collect();
        for (k, of) in calibrations.iter_mut().enumerate() {
            of.moved = products.each_ref().map(|products| products[(k, k)].sqrt());
        }
        let table = &stage.certificate;
        // A forced blob may be beyond the limit of the noise, which then holds as well.
        let is_forced = sets.last().is_some_and(|set| set.fit.forced);
        let verdict = is_forced.then_some(Verdict::Refused);
        let budget = last_known.as_ref().and_then(|known| known.budget.as_ref());
        let decision = budget.map_or(Decision::on_log(table.limits), |budget| {
            let by = (&budget.predicted(), Some(budget));
            Decision::in_service(table.limits, table.is_guarded, by, verdict)
        });
        let errors = calibrations[sets.len() - 1].errors;
        let drift = |axis: usize| {
            let reached = (errors[axis], decision.accepted(axis));
            let squares = calibrations
                .iter()
                .map(|of| Some(of.own_errors?[axis].powi(2)));
            let square: Option<f64> = squares.sum();
            let own = square.map(|square| (square / days.len() as f64).sqrt());
            drift(&products[axis], &days, own, reached).ok_or(TrendError::NoLine)
        };
        Ok(Self {
            drifts: [drift(0)?, drift(1)?, drift(2)?],
            calibrations,
            unknown: budget.is_none().then(|| last.clone()),
            forced: (dated.iter().filter(|(_, (_, set, _))| set.fit.forced))
                .map(|(_, (name, ..))| name.clone())
                .collect(),
        })
    }

    /// The date a number of days after the last calibration.
    pub fn date_after(&self, days: f64) -> Option<Date> {
        let time = SignedDuration::from_secs((days * DAY_S) as i64);
        let last = self.calibrations.last()?;
        Some(last.date.checked_add(time).ok()?.date())
    }
}

/// For X, Y, Rz the products of the changes of two calibrations since the first, as means over the grid; `None` where a blob
/// decodes no pose.
fn products(sets: &[&ParameterSet], stage: &Stage) -> Option<[DMatrix<f64>; 3]> {
    let (mut poses, mut products) = (0.0, [0; 3].map(|_| DMatrix::zeros(sets.len(), sets.len())));
    // Levels with half the range as their rms, as in service.
    let range_si = stage.motion.axes.map(|axis| 0.5f64.sqrt() * axis.service);
    on_grid(sets, range_si, |read| {
        let Some(read) = read else { return };
        poses += 1.0;
        for (axis, sum) in products.iter_mut().enumerate() {
            let changes = read.iter().map(|pose| pose[axis] - read[0][axis]);
            let changes = DVector::from_iterator(sets.len(), changes);
            *sum += &changes * changes.transpose();
        }
    })?;
    Some(products.map(|sum| sum / poses)).filter(|_| poses > 0.0)
}

/// The drift of an axis by the products of its changes on these days, with the rms error of a calibration, if known, and when an
/// error in service reaches its limit. `None` without a line.
fn drift(
    products: &DMatrix<f64>,
    days: &[f64],
    own_error: Option<f64>,
    (error, limit): (f64, Option<f64>),
) -> Option<Drift> {
    let count = days.len();
    // The square of what the changes have of a course about its mean, the square of its length, and the changes without it.
    let fitted = |course: &dyn Fn(usize) -> f64| {
        let course = DVector::from_fn(count, |k, _| course(k));
        let course = course.add_scalar(-course.mean());
        let square = course.norm_squared();
        let part = (course.transpose() * products * &course)[0] / square;
        let all = products.trace() - products.sum() / count as f64;
        (part, square, (all - part).max(0.0))
    };
    let (part, spread, scatter) = fitted(&|k| days[k]);
    if !(part.is_finite() && scatter.is_finite()) {
        return None;
    }
    let jump = |first: usize| {
        let (part, square, left) = fitted(&|k| f64::from(k >= first));
        (first, (part / square).sqrt(), left)
    };
    let jumps = (1..count).map(jump);
    let jump = jumps
        .min_by(|a, b| a.2.total_cmp(&b.2))
        .filter(|(.., left)| {
            // Odds by the likelihoods, each with its own variance.
            let places = (count - 1) as f64;
            count > 2 && scatter > left * (JUMP_MIN * places).powf(2.0 / count as f64)
        });
    let jump = jump.map(|(first, size, _)| (first, size));
    let freedom = count - 2;
    let variance = scatter / spread / freedom.max(1) as f64;
    let per_day = (part / spread).max(0.0).sqrt();
    let off_line = (scatter / freedom.max(1) as f64).sqrt();
    let is_line = match (jump, own_error) {
        (Some(_), _) => Some(false),
        (None, own) => own.map(|own| off_line <= OFF_LINE_MIN * own),
    };
    let half = student(freedom) * variance.sqrt();
    let ends = [(per_day - half).max(0.0), per_day + half];
    let interval = (freedom > 0).then_some(ends);
    let days = |per_day: f64| {
        let limit = limit?;
        let room = (limit * limit - error * error).max(0.0).sqrt();
        // Beyond the limit no drift is needed.
        let days = if room > 0.0 { room / per_day } else { 0.0 };
        Some(days).filter(|days| *days < DAYS_MAX && (is_line != Some(false) || *days == 0.0))
    };
    let [latest, earliest] = interval.unwrap_or([per_day; 2]);
    Some(Drift {
        per_day,
        interval,
        residual: off_line,
        is_line,
        limit,
        days: [per_day, earliest, latest].map(days),
        jump,
    })
}

/// The two-sided 95 % quantile of Student's t.
fn student(freedom: usize) -> f64 {
    const FEW: [f64; 6] = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447];
    let few = freedom.checked_sub(1).and_then(|k| FEW.get(k));
    few.map_or(1.96 + 2.65 / freedom.max(1) as f64, |few| *few)
}

#[cfg(test)]
mod tests;

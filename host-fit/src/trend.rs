//! The trend of the calibrations of a stage: how its gains and its poses drift, and when its errors reach a limit.
//!
//! The same codes are decoded by each blob. For each pose of a grid over the service of `[motion]`, the changes since the first
//! blob are a line over time, by least squares. The drift of an axis is the slope, rms over the grid. The errors e in service of
//! the last blob grow with it, to sqrt(e^2 + (drift t)^2) after the time t.

pub mod shown;

use crate::diff::on_grid;
use hallstage_calibration::judge::verdict::LIMITED_MAX;
use hallstage_calibration::recalibrate::StoredPosterior;
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::paper::Parameters;
use hallstage_solver::estimator::terms::{ETA, PER_PROBE};
use jiff::civil::{Date, DateTime};
use jiff::tz::TimeZone;
use jiff::{SignedDuration, Timestamp};
use runtime::ParameterSet;

/// A later date is none.
const DAYS_MAX: f64 = 36_525.0;
const DAY_S: f64 = 86_400.0;

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
}

/// How X, Y or Rz changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drift {
    /// Change in a day, rms over service: m or rad.
    pub per_day: f64,
    /// The ends of its 95 % interval; `None` of two calibrations, where a line has no scatter.
    pub interval: Option<[f64; 2]>,
    /// The largest rms error in service: m or rad.
    pub limit: Option<f64>,
    /// Days from the last calibration to the limit: by the line, at the earliest and at the latest.
    pub days: [Option<f64>; 3],
}

/// Calibrations of one stage in the order of their dates.
#[derive(Clone, Debug, PartialEq)]
pub struct Trend {
    /// The calibrations.
    pub calibrations: Vec<Calibration>,
    /// The drift of X, Y, Rz.
    pub drifts: [Drift; 3],
}

impl Trend {
    /// The trend of blobs. Errors have the limits of `[certificate]` without guard bands, and 1.30 times the noise floor.
    ///
    /// # Errors
    /// See [`TrendError`].
    pub fn new(blobs: &[Blob], stage: &Stage) -> Result<Self, TrendError> {
        let dated = |blob| -> Result<(DateTime, &Blob), TrendError> {
            let (name, set, _): &Blob = blob;
            let of_zone = |time: Timestamp| TimeZone::UTC.to_datetime(time);
            let date = set
                .created
                .parse()
                .or_else(|_| set.created.parse().map(of_zone));
            let date = date.map_err(|_| TrendError::NoDate {
                name: name.clone(),
                created: set.created.to_string(),
            });
            Ok((date?, blob))
        };
        let mut blobs = blobs.iter().map(dated).collect::<Result<Vec<_>, _>>()?;
        blobs.sort_by_key(|(date, _)| *date);
        let [(first, (_, first_set, _)), .., (_, last)] = blobs.as_slice() else {
            return Err(TrendError::NoLine);
        };
        if let Some((_, (name, set, _))) = blobs
            .iter()
            .find(|(_, blob)| blob.1.serial != first_set.serial)
        {
            return Err(TrendError::OtherStage {
                name: name.clone(),
                serial: set.serial.to_string(),
                first: first_set.serial.to_string(),
            });
        }
        let eta = |set: &ParameterSet| Parameters::from_set(set).eta();
        let first_eta = eta(first_set);
        let calibration = |(date, (_, set, known)): &(DateTime, &Blob)| {
            let eta = eta(set);
            let gain = |probe: usize| {
                let row = probe * PER_PROBE + ETA;
                let error = known
                    .as_ref()
                    .map(|known| known.covariance[(row, row)].sqrt());
                let part = |x: f64| x / first_eta[probe];
                (part(eta[probe]) - 1.0, error.map(part))
            };
            let budget = known.as_ref().and_then(|known| known.budget.as_ref());
            Calibration {
                date: *date,
                day: date.duration_since(*first).as_secs_f64() / DAY_S,
                gains: [0, 1, 2].map(gain),
                moved: [0.0; 3],
                errors: budget.map_or(set.fit.rms.map(f64::from), |of| of.in_service()),
            }
        };
        let mut calibrations: Vec<_> = blobs.iter().map(calibration).collect();
        let sets: Vec<_> = blobs.iter().map(|(_, blob)| &blob.1).collect();
        let lines = lines(&sets, &mut calibrations, stage).ok_or(TrendError::NoLine)?;
        let budget = last.2.as_ref().and_then(|known| known.budget.as_ref());
        let errors = calibrations[calibrations.len() - 1].errors;
        let drift = |axis: usize| {
            let usual = budget.map(|of| LIMITED_MAX * of.noise()[axis]);
            // The smaller, as a fit takes it.
            let limits = [stage.certificate.limits[axis], usual];
            let limit = limits.into_iter().flatten().reduce(f64::min);
            drift(lines[axis], sets.len() - 2, errors[axis], limit)
        };
        Ok(Self {
            drifts: [0, 1, 2].map(drift),
            calibrations,
        })
    }

    /// The date a number of days after the last calibration.
    pub fn date_after(&self, days: f64) -> Option<Date> {
        let time = SignedDuration::from_secs((days * DAY_S) as i64);
        Some(
            self.calibrations
                .last()?
                .date
                .checked_add(time)
                .ok()?
                .date(),
        )
    }
}

/// Mean square over the grid of the slopes of X, Y, Rz by day, and the variance of a slope, times its degrees of freedom, by the
/// scatter about the lines. Sets how far the poses have moved. `None` without a line.
fn lines(
    sets: &[&ParameterSet],
    calibrations: &mut [Calibration],
    stage: &Stage,
) -> Option<[[f64; 2]; 3]> {
    let count = sets.len() as f64;
    let mean_day = calibrations.iter().map(|of| of.day).sum::<f64>() / count;
    let days: Vec<f64> = calibrations.iter().map(|of| of.day - mean_day).collect();
    let spread: f64 = days.iter().map(|day| day * day).sum();
    let (mut poses, mut sums) = (0.0, [[0.0; 2]; 3]);
    // Levels with half the range as their rms, as in service.
    let range_si = stage.motion.axes.map(|axis| 0.5f64.sqrt() * axis.service);
    on_grid(sets, range_si, |read| {
        let Some(read) = read else { return };
        poses += 1.0;
        for (axis, [slopes, scatter]) in sums.iter_mut().enumerate() {
            let change = |k: usize| read[k][axis] - read[0][axis];
            let mean = (0..sets.len()).map(change).sum::<f64>() / count;
            let weighted = days.iter().enumerate().map(|(k, day)| day * change(k));
            let slope = weighted.sum::<f64>() / spread;
            *slopes += slope * slope;
            for (k, (day, of)) in days.iter().zip(calibrations.iter_mut()).enumerate() {
                of.moved[axis] += change(k).powi(2);
                *scatter += (change(k) - mean - slope * day).powi(2) / spread;
            }
        }
    })?;
    for moved in calibrations.iter_mut().flat_map(|of| &mut of.moved) {
        *moved = (*moved / poses).sqrt();
    }
    let sums = sums.map(|of_axis| of_axis.map(|sum| sum / poses));
    sums.as_flattened()
        .iter()
        .all(|sum| sum.is_finite())
        .then_some(sums)
}

/// The drift by the lines of an axis, and when an error in service reaches the limit.
fn drift([slope, scatter]: [f64; 2], freedom: usize, error: f64, limit: Option<f64>) -> Drift {
    let variance = scatter / freedom.max(1) as f64;
    // The scatter adds to the square of a slope.
    let per_day = (slope - variance).max(0.0).sqrt();
    let half = student(freedom) * variance.sqrt();
    let ends = [(per_day - half).max(0.0), per_day + half];
    let interval = (freedom > 0).then_some(ends);
    let days = |per_day: f64| {
        let limit = limit?;
        let room = (limit * limit - error * error).max(0.0).sqrt();
        // Beyond the limit no drift is needed.
        let days = if room > 0.0 { room / per_day } else { 0.0 };
        Some(days).filter(|days| *days < DAYS_MAX)
    };
    let [latest, earliest] = interval.unwrap_or([per_day; 2]);
    Drift {
        per_day,
        interval,
        limit,
        days: [per_day, earliest, latest].map(days),
    }
}

/// The two-sided 95 % quantile of Student's t.
fn student(freedom: usize) -> f64 {
    const FEW: [f64; 6] = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447];
    let few = freedom.checked_sub(1).and_then(|k| FEW.get(k));
    few.map_or(1.96 + 2.65 / freedom.max(1) as f64, |few| *few)
}

#[cfg(test)]
mod tests;

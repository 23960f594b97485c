//! The offset between the clocks and how much faster one runs, by the motion that both saw.
//!
//! A grid of one servo period finds the offset: at the right one each Hall signal is about what the
//! designed probe would read at the reference pose, times a sensitivity (`explained`). (A
//! fit by all three axes of the reference would also explain a run shifted by a whole movement:
//! each movement moves one axis only, and some matrix turns any axis into any other.)
//!
//! `refine` then finds offset and rate to a few microseconds. The offset is that in
//! the middle of the record, where the rate does not act.

use super::ImportError;
use super::agreement::agreement;
use super::explained::explain;
use super::reference::{ReferenceInput, Sample, collect};
use super::refine::{FIRST_STRETCH_US, RATE_MAX, refine};
use super::survey::{Point, Survey};
use crate::input::log::layout::Quantity;
use crate::input::stage::Stage;
use runtime::model::dot;

/// The offset between the clocks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offset {
    /// Time of the bus less time of the reference in the middle of the record, us.
    pub us: f64,
    /// How much faster the clock of the bus runs, as a part of one.
    pub rate: f64,
    /// The middle of the record, us on the clock of the bus.
    pub middle_us: f64,
    /// What the motion that both saw tells of it.
    pub seen: Seen,
}

/// What the motion that both records saw tells of an offset.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seen {
    /// Share of the Hall signals' motion that the reference explains.
    pub explained: f64,
    /// Over how many ticks.
    pub ticks: usize,
    /// Standard error of the offset that the motion tells, at the end of the record where it is
    /// larger, us.
    pub standard_error_us: f64,
    /// For an offset that was given: the one that the motion tells less the one given, at the
    /// end of the record where that is larger, us.
    pub apart_us: Option<f64>,
}

impl Offset {
    /// A time of the bus on the clock of the reference, us.
    pub fn on_reference_us(&self, bus_us: f64) -> f64 {
        bus_us - self.us - self.rate * (bus_us - self.middle_us)
    }

    /// The same, told by the offset at another time of the bus.
    fn in_the_middle(self, middle_us: f64) -> Self {
        Self {
            us: self.us + self.rate * (middle_us - self.middle_us),
            middle_us,
            ..self
        }
    }
}

/// Ticks of the coarse search, at most.
const COARSE_TICKS: usize = 4_000;

/// Samples of the reference that are held at a time, about.
const SAMPLES: f64 = 200_000.0;

/// Share that must be explained: signals of another run reach a third by chance.
const EXPLAINED_MIN: f64 = 0.6;

/// How far the rate that two minutes tell may be wrong, as a part of one.
const RATE_ERROR_MAX: f64 = 5e-6;

/// Servo periods of the reference that are read before and after the points: a coarse offset may be
/// wrong by some of them.
const MARGIN_PERIODS: f64 = 20.0;

/// Largest standard error of an offset, in servo periods.
const STANDARD_ERROR_PERIODS_MAX: f64 = 0.1;

/// How far a given offset may be from the one that the motion tells, in servo periods: the time
/// that frames take is part of the latter. And by how much that may change within the record.
const APART_PERIODS_MAX: f64 = 0.5;
const DRIFT_PERIODS_MAX: f64 = 0.1;

/// Finds the offset within `search_us` of where both records start together.
///
/// # Errors
/// `NoOffset`, `UnsteadyClocks`, `UncertainOffset`, `Astray`, and those of the reference.
pub(super) fn estimate(
    survey: &Survey,
    reference: &ReferenceInput<'_>,
    stage: &Stage,
    search_us: f64,
) -> Result<Offset, ImportError> {
    let start = coarse(survey, reference, stage, search_us)?;
    let found = follow(survey, reference, stage, start)?;
    let most_us = STANDARD_ERROR_PERIODS_MAX * stage.servo_period_s * 1e6;
    if found.seen.standard_error_us > most_us {
        return Err(ImportError::UncertainOffset {
            standard_error_us: found.seen.standard_error_us,
            most_us,
        });
    }
    Ok(found)
}

/// Checks an offset that was given against the motion, and tells how far it is from what that
/// shows.
///
/// # Errors
/// `WrongOffset`, `Astray`, and those of the reference.
pub(super) fn checked(
    survey: &Survey,
    reference: &ReferenceInput<'_>,
    stage: &Stage,
    given: Offset,
) -> Result<Offset, ImportError> {
    let given = given.in_the_middle(survey.middle_us());
    let [first_us, last_us] = ends_us(survey.liveliest());
    let start = given.in_the_middle((first_us + last_us) / 2.0);
    let found = match follow(survey, reference, stage, start) {
        Err(ImportError::NoOffset { percent, .. }) => Err(ImportError::UncheckedOffset { percent }),
        Err(ImportError::UnsteadyClocks { .. }) => {
            Err(ImportError::UncheckedOffset { percent: 0.0 })
        }
        found => found,
    }?;
    let step_us = stage.servo_period_s * 1e6;
    let drift_us = found.rate * (survey.middle_us() - survey.first_us());
    let middle_us = found.us - given.us;
    let error_us = 3.0 * found.seen.standard_error_us;
    if middle_us.abs() > APART_PERIODS_MAX * step_us + error_us
        || drift_us.abs() > DRIFT_PERIODS_MAX * step_us + error_us
    {
        return Err(ImportError::WrongOffset {
            middle_us,
            start_us: middle_us - drift_us,
            end_us: middle_us + drift_us,
        });
    }
    Ok(Offset {
        seen: Seen {
            apart_us: Some(middle_us + drift_us.abs().copysign(middle_us)),
            ..found.seen
        },
        ..given
    })
}

/// Follows an offset from the liveliest two minutes over the whole record.
///
/// A record that is longer than the liveliest two minutes of the [`Survey`] is followed from
/// there to its ends by the survey's blocks. The reference is read anew for each step, and held
/// only where and as densely as the step needs it.
///
/// # Errors
/// `NoOffset`, `UnsteadyClocks`, `Astray`, and those of the reference.
fn follow(
    survey: &Survey,
    reference: &ReferenceInput<'_>,
    stage: &Stage,
    found: Offset,
) -> Result<Offset, ImportError> {
    let step_us = stage.servo_period_s * 1e6;
    let window = survey.liveliest();
    let predicted = |points: &[Point], offset: &Offset| {
        let windows = windows(points, offset, step_us);
        reference.predicted(stage, &windows, step_us / 4.0)
    };
    let samples = predicted(window, &found)?;
    let refined = refine(window, &samples, found, step_us, FIRST_STRETCH_US);
    let check = |points: &[Point], samples: &[Sample], offset: &Offset| {
        let explained = explain(points, samples, offset, 2.0 * step_us);
        let share = explained.share();
        if share.is_nan() || share < EXPLAINED_MIN {
            return Err(ImportError::NoOffset {
                percent: 100.0 * share.max(0.0),
                least_percent: 100.0 * EXPLAINED_MIN,
            });
        }
        Ok((share, explained.ticks))
    };
    let unsteady = || ImportError::UnsteadyClocks {
        most_ppm: RATE_MAX * 1e6,
    };
    let judged = |points: &[Point], samples: &[Sample], offset: Offset| {
        let (explained, ticks) = check(points, samples, &offset)?;
        let agreement = agreement(points, samples, &offset, step_us).ok_or_else(unsteady)?;
        if let Some(movement) = agreement.astray {
            return Err(ImportError::Astray { movement });
        }
        let seen = Seen {
            explained,
            ticks,
            standard_error_us: agreement.standard_error_us,
            apart_us: None,
        };
        Ok(Offset { seen, ..offset })
    };
    check(window, &samples, &refined.unwrap_or(found))?;
    let mut best = judged(window, &samples, refined.ok_or_else(unsteady)?)?;
    if survey.is_longer() {
        let points = survey.blocks();
        let samples = predicted(&points, &best)?;
        let refined = refine(&points, &samples, best, step_us, 4.0 * FIRST_STRETCH_US);
        check(&points, &samples, &refined.unwrap_or(best))?;
        best = judged(&points, &samples, refined.ok_or_else(unsteady)?)?;
    }
    Ok(best.in_the_middle(survey.middle_us()))
}

/// The offset on a grid of one servo period.
fn coarse(
    survey: &Survey,
    reference: &ReferenceInput<'_>,
    stage: &Stage,
    search_us: f64,
) -> Result<Offset, ImportError> {
    let step_us = stage.servo_period_s * 1e6;
    let window = survey.liveliest();
    let every = window.len().div_ceil(COARSE_TICKS).max(1);
    let points: Vec<Point> = window.iter().step_by(every).copied().collect();
    let [first_us, last_us] = ends_us(&points);
    let centre_us = survey.first_us() - reference.first_us()?;
    let at = |us| Offset {
        us,
        rate: 0.0,
        middle_us: (first_us + last_us) / 2.0,
        seen: Seen::default(),
    };
    let span = [first_us, last_us].map(|t_us| t_us - centre_us);
    let span = [span[0] - search_us - step_us, span[1] + search_us + step_us];
    let spacing_us = step_us.max((span[1] - span[0]) / SAMPLES);
    let samples = reference.predicted(stage, &[span], spacing_us)?;
    let tolerance_us = 2.0 * step_us.max(spacing_us);
    let steps = (search_us / step_us).ceil().clamp(1.0, 1e6) as i64;
    let offsets = (-steps..=steps).map(|k| at(centre_us + k as f64 * step_us));
    let trial = |offset: &Offset| explain(&points, &samples, offset, tolerance_us).explained;
    Ok(most(offsets, trial).unwrap_or(at(centre_us)))
}

/// The times of the first and the last point, us.
fn ends_us(points: &[Point]) -> [f64; 2] {
    let ends = points.first().zip(points.last());
    ends.map_or([0.0; 2], |(first, last)| [first.t_us, last.t_us])
}

/// The times of the reference around these points, ascending.
fn windows(points: &[Point], offset: &Offset, step_us: f64) -> Vec<[f64; 2]> {
    let mut windows: Vec<[f64; 2]> = Vec::new();
    for point in points {
        let t_us = offset.on_reference_us(point.t_us);
        let since_us = (point.t_us - offset.middle_us).abs();
        let margin_us = MARGIN_PERIODS * step_us + RATE_ERROR_MAX * since_us;
        let window = [t_us - margin_us, t_us + margin_us];
        match windows.last_mut() {
            Some(last) if window[0] <= last[1] => last[1] = last[1].max(window[1]),
            _ => windows.push(window),
        }
    }
    windows
}

/// The one with the largest value, the first of equals.
fn most(offsets: impl Iterator<Item = Offset>, value: impl Fn(&Offset) -> f64) -> Option<Offset> {
    let mut best = None;
    for offset in offsets {
        let value = value(&offset);
        if best.is_none_or(|(most, _)| value > most) {
            best = Some((value, offset));
        }
    }
    best.map(|(_, offset)| offset)
}

impl ReferenceInput<'_> {
    /// The time of the first sample, us.
    fn first_us(&self) -> Result<f64, ImportError> {
        let mut reader = self.reader()?;
        Ok(reader.next_sample()?.map_or(0.0, |sample| sample.t_us))
    }

    /// The samples within these times, with what the designed probes would read, in m, in place
    /// of their values; at least `spacing_us` apart, and further where they would be too many.
    fn predicted(
        &self,
        stage: &Stage,
        windows: &[[f64; 2]],
        spacing_us: f64,
    ) -> Result<Vec<Sample>, ImportError> {
        let mut reader = self.reader()?;
        let whole_us: f64 = windows.iter().map(|[start, end]| end - start).sum();
        let spacing_us = spacing_us.max(whole_us / SAMPLES);
        let mut samples = collect(&mut reader, windows, spacing_us)?;
        let quantities = reader.quantities;
        let scale = quantities.map(|quantity| stage.log.column(quantity).scale);
        let plane = stage.designed.geometry([0.0; 3]).plane_rows();
        let beams = quantities == Quantity::BEAMS;
        for sample in &mut samples {
            let [a, b, c] = sample.values;
            let [x, second, third] = [a * scale[0], b * scale[1], c * scale[2]];
            let pose = if beams {
                let rz = ((second - third) / stage.y_baseline_m).atan();
                [x, 0.5 * (second + third), rz]
            } else {
                [x, second, third]
            };
            sample.values = plane.map(|row| dot(&row, pose));
        }
        Ok(samples)
    }
}

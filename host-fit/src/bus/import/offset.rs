//! The offset between the clocks and how much faster one runs, by the motion that both saw.
//!
//! A grid of one servo period finds the offset: at the right one each Hall signal is about what the
//! designed probe would read at the reference pose, times a sensitivity. For a trial the signal
//! of each probe is fitted by that prediction, with a factor and a constant for each movement. (A
//! fit by all three axes of the reference would also explain a run shifted by a whole movement:
//! each movement moves one axis only, and some matrix turns any axis into any other.)
//!
//! `refine` then finds offset and rate to a few microseconds. The offset is that in
//! the middle of the record, where the rate does not act.

use super::ImportError;
use super::bus_log::BusTick;
use super::join::{At, Cursor};
use super::reference::{Reference, Sample};
use super::refine::{RATE_MAX, refine};
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
    /// Share of the Hall signals' motion that the reference explains, if it was estimated.
    pub explained: Option<f64>,
}

impl Offset {
    /// A time of the bus on the clock of the reference, us.
    pub fn on_reference_us(&self, bus_us: f64) -> f64 {
        bus_us - self.us - self.rate * (bus_us - self.middle_us)
    }
}

/// Ticks of the coarse search, at most.
const COARSE_TICKS: usize = 4_000;

/// Share that must be explained: signals of another run reach a third by chance.
const EXPLAINED_MIN: f64 = 0.6;

/// Finds the offset within `search_us` of where both records start together.
///
/// # Errors
/// [`ImportError::NoOffset`], [`ImportError::UnsteadyClocks`].
pub fn estimate(
    ticks: &[BusTick],
    times_us: &[f64],
    reference: &Reference,
    stage: &Stage,
    search_us: f64,
) -> Result<Offset, ImportError> {
    let step_us = stage.servo_period_s * 1e6;
    let starts = times_us.first().zip(reference.samples.first());
    let centre_us = starts.map_or(0.0, |(bus, reference)| bus - reference.t_us);
    let predicted = predicted(reference, stage);
    let points: Vec<Point> = ticks
        .iter()
        .zip(times_us)
        .map(|(tick, t_us)| Point {
            t_us: *t_us,
            signal: tick.hall.map(f64::from),
            gaps: tick.capacitive.map(f64::from),
        })
        .collect();
    let every = points.len().div_ceil(COARSE_TICKS).max(1);
    let coarse: Vec<Point> = points.iter().step_by(every).copied().collect();
    let ends = times_us.first().zip(times_us.last());
    let middle_us = ends.map_or(0.0, |(first, last)| (first + last) / 2.0);
    let at = |us| Offset {
        us,
        rate: 0.0,
        middle_us,
        explained: None,
    };
    let trial =
        |points: &[Point], offset: &Offset| explain(points, &predicted, offset, 2.0 * step_us);
    let steps = (search_us / step_us).ceil().clamp(1.0, 1e6) as i64;
    let offsets = (-steps..=steps).map(|k| at(centre_us + k as f64 * step_us));
    let found = most(offsets, |offset| trial(&coarse, offset).explained).unwrap_or(at(centre_us));
    let refined = refine(&points, &predicted, found, step_us);
    let mut best = refined.unwrap_or(found);
    let explained = trial(&points, &best).share();
    if explained.is_nan() || explained < EXPLAINED_MIN {
        return Err(ImportError::NoOffset {
            percent: 100.0 * explained.max(0.0),
            least_percent: 100.0 * EXPLAINED_MIN,
        });
    }
    if refined.is_none() {
        let most_ppm = RATE_MAX * 1e6;
        return Err(ImportError::UnsteadyClocks { most_ppm });
    }
    best.explained = Some(explained);
    Ok(best)
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

/// The samples with what the designed probes would read, in m, in place of their values.
fn predicted(reference: &Reference, stage: &Stage) -> Vec<Sample> {
    let scale = reference
        .quantities
        .map(|quantity| stage.log.column(quantity).scale);
    let plane = stage.designed.geometry([0.0; 3]).plane_rows();
    let beams = reference.quantities == Quantity::BEAMS;
    let at = |sample: &Sample| -> [f64; 3] {
        let [a, b, c] = sample.values;
        let [x, second, third] = [a * scale[0], b * scale[1], c * scale[2]];
        let pose = if beams {
            let rz = ((second - third) / stage.y_baseline_m).atan();
            [x, 0.5 * (second + third), rz]
        } else {
            [x, second, third]
        };
        plane.map(|row| dot(&row, pose))
    };
    let samples = reference.samples.iter();
    samples
        .map(|sample| Sample {
            values: at(sample),
            ..*sample
        })
        .collect()
}

/// The codes of a tick, at its time by the clock of the bus.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    pub(super) t_us: f64,
    pub(super) signal: [f64; 3],
    pub(super) gaps: [f64; 3],
}

/// Sums of one probe over one movement.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    n: f64,
    s: f64,
    p: f64,
    ss: f64,
    sp: f64,
    pp: f64,
}

impl Sums {
    fn add(&mut self, s: f64, p: f64) {
        self.n += 1.0;
        self.s += s;
        self.p += p;
        self.ss += s * s;
        self.sp += s * p;
        self.pp += p * p;
    }

    /// Adds a movement to the whole, its means taken out.
    fn take_in(&mut self, movement: &Self) {
        if movement.n > 0.0 {
            self.n += movement.n;
            self.ss += movement.ss - movement.s * movement.s / movement.n;
            self.sp += movement.sp - movement.s * movement.p / movement.n;
            self.pp += movement.pp - movement.p * movement.p / movement.n;
        }
    }
}

/// What the prediction explains of the signals' motion, in codes squared.
#[derive(Clone, Copy, Debug, Default)]
struct Explained {
    explained: f64,
    motion: f64,
}

impl Explained {
    fn share(&self) -> f64 {
        if self.motion > 0.0 {
            self.explained / self.motion
        } else {
            0.0
        }
    }
}

/// Fits the points that have a reference at an offset.
fn explain(
    points: &[Point],
    predicted: &[Sample],
    offset: &Offset,
    tolerance_us: f64,
) -> Explained {
    let mut cursor = Cursor::new(predicted);
    let (mut whole, mut sums) = ([Sums::default(); 3], [Sums::default(); 3]);
    let mut current = None;
    let take_in = |whole: &mut [Sums; 3], sums: &[Sums; 3]| {
        for (whole, sums) in whole.iter_mut().zip(sums) {
            whole.take_in(sums);
        }
    };
    for point in points {
        let at = cursor.at(offset.on_reference_us(point.t_us), tolerance_us);
        let At::Found {
            movement, values, ..
        } = at
        else {
            continue;
        };
        if current != Some(movement) {
            take_in(&mut whole, &sums);
            sums = Default::default();
            current = Some(movement);
        }
        for ((sums, s), p) in sums.iter_mut().zip(point.signal).zip(values) {
            sums.add(s, p);
        }
    }
    take_in(&mut whole, &sums);
    let mut all = Explained::default();
    for probe in &whole {
        all.motion += probe.ss;
        // A probe that reads against its designed sense explains nothing.
        if probe.sp > 0.0 && probe.pp > 0.0 {
            all.explained += probe.sp * probe.sp / probe.pp;
        }
    }
    all
}

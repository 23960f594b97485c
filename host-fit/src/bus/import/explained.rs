//! How much of the Hall signals' motion the reference explains at an offset.
//!
//! The signal of each probe is fitted by what the designed probe would read at the reference pose,
//! with a factor for the whole record and a constant for each movement.

use super::join::{At, Cursor};
use super::offset::Offset;
use super::reference::Sample;
use super::survey::Point;

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
pub(super) struct Explained {
    pub(super) explained: f64,
    motion: f64,
    pub(super) ticks: usize,
}

impl Explained {
    /// Of the whole motion, from 0 to 1.
    pub(super) fn share(&self) -> f64 {
        if self.motion > 0.0 {
            self.explained / self.motion
        } else {
            0.0
        }
    }
}

/// Fits the points that have a reference within `tolerance_us` at an offset.
pub(super) fn explain(
    points: &[Point],
    predicted: &[Sample],
    offset: &Offset,
    tolerance_us: f64,
) -> Explained {
    let first_us = points
        .first()
        .map_or(0.0, |p| offset.on_reference_us(p.t_us));
    let mut cursor = Cursor::from(predicted, first_us);
    let mut ticks = 0;
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
        ticks += 1;
        for ((sums, s), p) in sums.iter_mut().zip(point.signal).zip(values) {
            sums.add(s, p);
        }
    }
    take_in(&mut whole, &sums);
    let mut all = Explained {
        ticks,
        ..Explained::default()
    };
    for probe in &whole {
        all.motion += probe.ss;
        // A probe that reads against its designed sense explains nothing.
        if probe.sp > 0.0 && probe.pp > 0.0 {
            all.explained += probe.sp * probe.sp / probe.pp;
        }
    }
    all
}

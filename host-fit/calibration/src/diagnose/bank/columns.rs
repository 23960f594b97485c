//! The bank: what a fault of each channel does to the signals.

use super::blocks::{Log, Mean};
use super::map::Estimate;
use crate::diagnose::slopes::Slopes;
use crate::finding::Code;
use crate::input::stage::Stage;
use crate::solve::field::probe::probes;
use nalgebra::Vector3;
use std::ops::Range;

/// What is wrong with the channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Its zero, by 1 um.
    Offset,
    /// Its gain, by 1 %.
    Gain,
}

/// How a fault goes over the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Course {
    /// From a mean on to the end of the log.
    From(usize),
    /// From a mean on to the end of its movement: a reset takes it off.
    ToReset(usize),
    /// Growing evenly over the log.
    Ramp,
    /// Growing evenly in each movement, by 1 in a second.
    RampInMovements,
}

/// A row of the bank.
#[derive(Clone, Copy, Debug)]
pub(super) struct Family {
    /// The channel or the group.
    pub(super) channel: &'static str,
    /// The first channel at fault and the one after the last: Hall A, B, C; beams X, Y1, Y2; gaps 1, 2, 3.
    channels: (usize, usize),
    pub(super) kind: Kind,
    /// Whether it may come from one row to the next and stay.
    pub(super) steps: bool,
    /// Whether a reset takes it off.
    pub(super) to_reset: bool,
}

const fn family(kind: Kind, channel: &'static str, from: usize, to: usize) -> Family {
    let is_offset = matches!(kind, Kind::Offset);
    Family {
        channel,
        channels: (from, to),
        kind,
        steps: !is_offset || from < 3 || from >= 6,
        to_reset: is_offset && from < 6,
    }
}

/// All faults that are looked for.
pub(super) const FAMILIES: [Family; 18] = [
    family(Kind::Gain, "hall_a", 0, 1),
    family(Kind::Gain, "hall_b", 1, 2),
    family(Kind::Gain, "hall_c", 2, 3),
    family(Kind::Gain, "hall", 0, 3),
    family(Kind::Gain, "ifm", 3, 6),
    family(Kind::Gain, "cap_1", 6, 7),
    family(Kind::Gain, "cap_2", 7, 8),
    family(Kind::Gain, "cap_3", 8, 9),
    family(Kind::Gain, "cap", 6, 9),
    family(Kind::Offset, "hall_a", 0, 1),
    family(Kind::Offset, "hall_b", 1, 2),
    family(Kind::Offset, "hall_c", 2, 3),
    family(Kind::Offset, "ifm_x", 3, 4),
    family(Kind::Offset, "ifm_y1", 4, 5),
    family(Kind::Offset, "ifm_y2", 5, 6),
    family(Kind::Offset, "cap_1", 6, 7),
    family(Kind::Offset, "cap_2", 7, 8),
    family(Kind::Offset, "cap_3", 8, 9),
];

impl Family {
    pub(super) const fn code(&self, course: Course) -> Code {
        match (self.kind, course) {
            (Kind::Gain, _) => Code::GainDrift,
            (Kind::Offset, Course::From(_) | Course::ToReset(_)) => Code::Step,
            (Kind::Offset, _) => Code::Drift,
        }
    }
}

/// Changes of the signals (mm) by a change of each of the nine channels by 1 mm, by mean.
pub(super) fn by_channel(log: &Log, stage: &Stage, estimate: &Estimate) -> Vec<[Vector3<f64>; 9]> {
    let slopes = Slopes::new(stage, probes(&estimate.parameters));
    let lags_s = estimate.lags_s();
    let rows = log.means.iter().map(|mean| &mean.row);
    rows.map(|row| slopes.at(log.planar_mm(row, lags_s, [0.0; 3]), row.vertical))
        .collect()
}

impl Family {
    /// What it adds to the residuals in the channels of the filter, without its course.
    pub(super) fn raw(
        &self,
        log: &Log,
        estimate: &Estimate,
        by_channel: &[[Vector3<f64>; 9]],
    ) -> Vec<[f64; 3]> {
        let at = |(place, mean): (usize, &Mean)| {
            let mut sum = Vector3::zeros();
            let (first, end) = self.channels;
            for (channel, by) in by_channel[place].iter().enumerate().take(end).skip(first) {
                let size = match (self.kind, channel) {
                    (Kind::Offset, _) => 1e-3,
                    (Kind::Gain, 0..3) => 1e-2 * mean.row.signal_mm[channel],
                    (Kind::Gain, 3..6) => 1e-2 * mean.beams_mm[channel - 3],
                    (Kind::Gain, _) => 1e-2 * mean.gaps_mm[channel - 6],
                };
                sum += by * size;
            }
            (estimate.channels[place] * sum).into()
        };
        log.means.iter().enumerate().map(at).collect()
    }
}

/// A raw column of a fault with its course. What becomes another stage is zero at the end of the log, so that
/// the parameters are those of the stage as it is then; the zero of a Hall probe is set anew.
pub(super) fn shaped(
    log: &Log,
    raw: &[[f64; 3]],
    family: &Family,
    course: Course,
) -> Vec<[f64; 3]> {
    let mut shares = shares(log, course);
    let stays = family.kind == Kind::Gain || family.channels.0 >= 6;
    if stays && matches!(course, Course::From(_) | Course::Ramp) {
        shares.iter_mut().for_each(|share| *share -= 1.0);
    }
    raw.iter()
        .zip(shares)
        .map(|(x, share)| x.map(|x| x * share))
        .collect()
}

/// How much of a fault each mean has.
fn shares(log: &Log, course: Course) -> Vec<f64> {
    let count = log.means.len();
    let mut shares = vec![0.0; count];
    match course {
        Course::From(from) => shares[from..].fill(1.0),
        Course::ToReset(from) => shares[to_reset(log, from)].fill(1.0),
        Course::Ramp => {
            for (at, share) in shares.iter_mut().enumerate() {
                *share = at as f64 / count as f64;
            }
        }
        Course::RampInMovements => {
            for movement in &log.movements {
                let start_s = log.means[movement.start].row.time_s;
                for at in movement.clone() {
                    shares[at] = log.means[at].row.time_s - start_s;
                }
            }
        }
    }
    shares
}

/// The means from one on to the end of its movement.
pub(super) fn to_reset(log: &Log, from: usize) -> Range<usize> {
    let movement = log
        .movements
        .iter()
        .find(|movement| movement.contains(&from));
    from..movement.map_or(from, |movement| movement.end)
}

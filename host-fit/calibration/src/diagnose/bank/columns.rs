//! The bank: what a fault of each channel does to the signals.

use super::means::Log;
use crate::diagnose::slopes::{CHANNELS, Slopes};
use crate::input::stage::Stage;
use crate::solve::field::blocks::FieldRow;
use crate::solve::field::parameters::FieldParameters;
use crate::solve::field::probe::probes;
use nalgebra::Vector3;
use runtime::VerticalPose;
use std::ops::Range;

/// What is wrong with the channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Its zero, by 1 um.
    Offset,
    /// Its gain, by 1 %.
    Gain,
    /// Its time: it is 1 ms later than the others of its kind.
    Lag,
}

/// How a fault goes over the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Course {
    /// From a mean on, up to another one: the end of the log, or of a movement, where a reset takes it off.
    On(usize, usize),
    /// Growing evenly over the log.
    Ramp,
    /// Growing evenly in each movement, by 1 in a second.
    RampInMovements,
}

impl Course {
    /// The mean that it begins with, where that is not the first.
    pub(super) fn onset(&self) -> Option<usize> {
        match self {
            Self::On(from @ 1.., _) => Some(*from),
            _ => None,
        }
    }
}

/// A row of the bank: what, the first of the [`CHANNELS`] at fault, and the one after the last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Family(pub(super) Kind, usize, usize);

/// All faults that are looked for: each alone, and the gains of all channels of a kind together; the beams have
/// one laser.
pub(super) fn families() -> impl Iterator<Item = Family> {
    let each = |kind, channels: Range<usize>| channels.map(move |k| Family(kind, k, k + 1));
    let all = [0, 3, 6].map(|k| Family(Kind::Gain, k, k + 3));
    let gains = each(Kind::Gain, 0..3).chain(each(Kind::Gain, 6..9));
    let others = each(Kind::Offset, 0..9).chain(each(Kind::Lag, 3..6));
    gains.chain(all).chain(others)
}

impl Family {
    /// Of the time of a beam: X, Y1, Y2.
    pub(super) fn late(beam: usize) -> Self {
        Self(Kind::Lag, 3 + beam, 4 + beam)
    }

    /// The channel or the group.
    pub(super) fn channel(&self) -> &'static str {
        let name = CHANNELS[self.1];
        match self.2 - self.1 {
            1 => name,
            _ => name.split('_').next().unwrap_or(name),
        }
    }

    pub(super) fn is_of_beams(&self) -> bool {
        (3..6).contains(&self.1)
    }

    /// Whether a reset takes it off.
    pub(super) fn ends_with_movement(&self) -> bool {
        self.0 == Kind::Offset && self.1 < 6
    }

    /// Whether it may come and stay.
    pub(super) fn stays(&self) -> bool {
        self.0 == Kind::Gain || self.0 == Kind::Offset && !self.is_of_beams()
    }
}

/// What each fault does to the signals of a log.
pub(super) struct Bank<'a> {
    pub(super) log: &'a Log,
    stage: &'a Stage,
    /// Changes of the signals (mm) by a change of each of the nine channels by 1 mm, by mean.
    by_channel: Vec<[Vector3<f64>; 9]>,
}

impl<'a> Bank<'a> {
    /// About these parameters and this lag of the reference, s.
    pub(super) fn new(
        log: &'a Log,
        stage: &'a Stage,
        parameters: &FieldParameters,
        lag_s: f64,
    ) -> Self {
        let slopes = Slopes::new(stage, probes(parameters));
        let at = |row: &FieldRow| slopes.at(row.planar_mm(lag_s, [0.0; 3]), row.vertical);
        Self {
            log,
            stage,
            by_channel: log.means.rows.iter().map(at).collect(),
        }
    }

    /// What a fault adds to the signals, mm, without its course.
    pub(super) fn raw(&self, family: Family) -> Vec<[f64; 3]> {
        let half_m = 0.5 * self.stage.y_baseline_m;
        let beams = |[x, y, rz]: [f64; 3]| [x, y + half_m * rz, y - half_m * rz];
        let at = |(row, by_channel): (&FieldRow, &[Vector3<f64>; 9])| {
            let vertical = VerticalPose::from_array(row.vertical);
            let gaps_m = runtime::capacitive::gaps_m(&self.stage.capacitive_probes_m, &vertical);
            let size = |channel: usize| match (family.0, channel) {
                (Kind::Offset, _) => 1e-3,
                (Kind::Gain, 0..3) => 1e-2 * row.signal_mm[channel],
                (Kind::Gain, 3..6) => 1e-2 * beams(row.reference_mm)[channel - 3],
                (Kind::Gain, _) => 1e-2 * (1e3 * gaps_m[channel - 6]),
                (Kind::Lag, _) => -1e-3 * beams(row.rate_mm_per_s)[channel - 3],
            };
            let channels = family.1..family.2;
            let sum: Vector3<f64> = channels.map(|k| by_channel[k] * size(k)).sum();
            sum.into()
        };
        (self.log.means.rows.iter().zip(&self.by_channel).map(at)).collect()
    }

    /// The same with its course. What becomes another stage is zero at the end of the log, so that the
    /// parameters are those of the stage as it is then; the zero of a Hall probe is set anew.
    pub(super) fn column(&self, family: Family, course: Course) -> Vec<[f64; 3]> {
        let mut column = self.raw(family);
        let count = column.len();
        let is = |condition: bool| f64::from(u8::from(condition));
        let at_end = is(family.stays() && !family.ends_with_movement());
        let time_s = |at: usize| self.log.means.rows[at].time_s;
        for movement in &self.log.means.movements {
            for at in movement.clone() {
                let share = match course {
                    Course::On(from, to) => is((from..to).contains(&at)),
                    Course::Ramp => at as f64 / count as f64,
                    Course::RampInMovements => time_s(at) - time_s(movement.start),
                };
                column[at] = column[at].map(|x| x * (share - at_end));
            }
        }
        column
    }
}

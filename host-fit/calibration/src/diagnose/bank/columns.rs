//! The bank: what a fault of each channel does to the signals.

use super::means::Log;
use crate::diagnose::slopes::Slopes;
use hallstage_input::channel::Channel;
use hallstage_input::finding::Quantity;
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::parameters::FieldParameters;
use hallstage_solver::estimator::probe::probes;
use hallstage_solver::estimator::rows::FieldRow;
use nalgebra::Vector3;
use runtime::VerticalPose;
use runtime::capacitive::gaps_m;
use std::ops::Range;

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

/// A row of the bank: what, the first of [`Channel::SINGLE`] at fault, and the one after the last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Family(pub(super) Quantity, usize, usize);

/// All faults that are looked for: each alone, and the gains and times of all channels of a kind together; the
/// beams have one laser. What they are all late by is an unknown of the fit, and so that of all Hall probes.
pub(super) fn families() -> impl Iterator<Item = Family> {
    let each = |kind, channels: Range<usize>| channels.map(move |k| Family(kind, k, k + 1));
    let all = |kind, first: &'static [usize]| first.iter().map(move |&k| Family(kind, k, k + 3));
    let gains = each(Quantity::Gain, 0..3).chain(each(Quantity::Gain, 6..9));
    let others = each(Quantity::Zero, 0..9).chain(each(Quantity::Time, 0..9));
    let groups = all(Quantity::Gain, &[0, 3, 6]).chain(all(Quantity::Time, &[3, 6]));
    gains.chain(groups).chain(others)
}

impl Family {
    /// Of the time of a beam: X, Y1, Y2.
    pub(super) fn late(beam: usize) -> Self {
        Self(Quantity::Time, 3 + beam, 4 + beam)
    }

    /// The channel or the group.
    pub(super) fn channel(&self) -> Channel {
        match self.is_single() {
            true => Channel::SINGLE[self.1],
            false => Channel::GROUPS[self.1 / 3],
        }
    }

    pub(super) fn is_single(&self) -> bool {
        self.2 - self.1 == 1
    }

    pub(super) fn is_of_beams(&self) -> bool {
        (3..6).contains(&self.1)
    }

    /// Whether a reset takes it off.
    pub(super) fn ends_with_movement(&self) -> bool {
        self.0 == Quantity::Zero && self.1 < 6
    }

    /// Whether it may come and stay.
    pub(super) fn stays(&self) -> bool {
        self.0 == Quantity::Gain || self.0 == Quantity::Zero && !self.is_of_beams()
    }
}

/// What each fault does to the signals of a log.
pub(super) struct Bank<'a> {
    pub(super) log: &'a Log,
    /// What each of the nine channels shows, mm, by mean.
    values: Vec<[f64; 9]>,
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
        let probes = probes(parameters);
        let planar_mm = |row: &FieldRow| row.planar_mm(lag_s, [0.0; 3]);
        let half_m = 0.5 * stage.y_baseline_m;
        let values = |row: &FieldRow| {
            // As fitted: at rest a signal is all noise, which explains itself.
            let [a, b, c] = probes.map(|probe| probe.signal_mm(planar_mm(row), row.vertical));
            let [x, y, rz] = row.reference_mm;
            let vertical = VerticalPose::from_array(row.vertical);
            let [one, two, three] = gaps_m(&stage.capacitive_probes_m, &vertical).map(|m| 1e3 * m);
            [
                a,
                b,
                c,
                x,
                y + half_m * rz,
                y - half_m * rz,
                one,
                two,
                three,
            ]
        };
        let slopes = Slopes::new(stage, probes);
        let at = |row: &FieldRow| slopes.at(planar_mm(row), row.vertical);
        Self {
            log,
            values: log.means.rows.iter().map(values).collect(),
            by_channel: log.means.rows.iter().map(at).collect(),
        }
    }

    /// What a fault adds to the signals, mm, without its course.
    pub(super) fn raw(&self, family: Family) -> Vec<[f64; 3]> {
        let time_s = |at: usize| self.log.means.rows[at].time_s;
        let at = |movement: &Range<usize>, at: usize| {
            let before = at.saturating_sub(1).max(movement.start);
            let after = (at + 1).min(movement.end - 1);
            let size = |channel: usize| match family.0 {
                Quantity::Zero => 1e-3,
                Quantity::Gain => 1e-2 * self.values[at][channel],
                Quantity::Time if before == after => 0.0,
                Quantity::Time => {
                    let [from, to] = [before, after].map(|at| self.values[at][channel]);
                    -1e-3 * (to - from) / (time_s(after) - time_s(before))
                }
            };
            let channels = family.1..family.2;
            let sum: Vector3<f64> = channels.map(|k| self.by_channel[at][k] * size(k)).sum();
            sum.into()
        };
        let movements = self.log.means.movements.iter();
        movements
            .flat_map(|movement| movement.clone().map(move |k| at(movement, k)))
            .collect()
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

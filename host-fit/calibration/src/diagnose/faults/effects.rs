//! The effect on the Hall signals of every fault that is looked for.

use super::means::Means;
use crate::diagnose::slopes::Slopes;
use hallstage_input::channel::Channel;
use hallstage_input::finding::Quantity;
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::parameters::FieldParameters;
use hallstage_solver::estimator::probe::{Probe, probes};
use hallstage_solver::estimator::rows::FieldRow;
use nalgebra::Vector3;
use runtime::VerticalPose;
use runtime::capacitive::gaps_m;
use std::ops::Range;

/// The shape of a fault over the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    /// From a mean on, up to another mean: the end of the log, or of a movement, where a reset takes it off.
    From(usize, usize),
    /// It grows evenly over the log.
    Ramp,
    /// It grows evenly in each movement, by 1 in a second.
    RampInMovements,
}

impl Shape {
    /// The mean where it begins, if that is not the first.
    pub(super) fn onset(&self) -> Option<usize> {
        match self {
            Self::From(from @ 1.., _) => Some(*from),
            _ => None,
        }
    }
}

/// Something that may be wrong: a quantity of a channel, or of all three channels of a kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Suspect {
    pub(super) quantity: Quantity,
    /// The first of the channels, as a number in [`Channel::SINGLE`].
    first: usize,
    count: usize,
}

/// Everything that is looked for: each channel by itself, and the gains and times of all channels of a kind, because
/// the beams share a laser. The common lag of the beams is an unknown of the fit. It equals minus the lag of all Hall
/// probes, so neither is listed.
pub(super) fn suspects() -> impl Iterator<Item = Suspect> {
    let some = |quantity, count| {
        move |first| Suspect {
            quantity,
            first,
            count,
        }
    };
    let gains = [0, 1, 2, 6, 7, 8].map(some(Quantity::Gain, 1));
    let gains_of_kinds = [0, 3, 6].map(some(Quantity::Gain, 3));
    let times_of_kinds = [3, 6].map(some(Quantity::Time, 3));
    let zeros = (0..9).map(some(Quantity::Zero, 1));
    let times = (0..9).map(some(Quantity::Time, 1));
    let kinds = gains_of_kinds.into_iter().chain(times_of_kinds);
    gains.into_iter().chain(kinds).chain(zeros).chain(times)
}

impl Suspect {
    /// The time of a beam: X, Y1, Y2.
    pub(super) const fn late(beam: usize) -> Self {
        Self {
            quantity: Quantity::Time,
            first: 3 + beam,
            count: 1,
        }
    }

    /// The Hall probe, 0 to 2, where its time is suspected.
    pub(super) fn late_probe(&self) -> Option<usize> {
        let is_late = self.quantity == Quantity::Time && self.is_single() && self.first < 3;
        is_late.then_some(self.first)
    }

    /// The channel or the group.
    pub(super) const fn channel(&self) -> Channel {
        match self.is_single() {
            true => Channel::SINGLE[self.first],
            false => Channel::GROUPS[self.first / 3],
        }
    }

    /// The gaps of a suspect, by their place among all channels.
    pub(super) fn gaps(&self) -> Range<usize> {
        self.first.max(6)..(self.first + self.count).max(6)
    }

    pub(super) const fn is_single(&self) -> bool {
        self.count == 1
    }

    pub(super) const fn is_beam(&self) -> bool {
        self.channel().is_beam()
    }

    /// Whether a reset of the zero takes it off.
    pub(super) fn ends_with_movement(&self) -> bool {
        self.quantity == Quantity::Zero && self.first < 6
    }

    /// Whether it can begin somewhere and stay.
    pub(super) fn can_stay(&self) -> bool {
        match self.quantity {
            Quantity::Gain => true,
            Quantity::Zero => !self.is_beam(),
            Quantity::Time => false,
        }
    }
}

/// What channels show in some rows, and how their errors change the signals.
pub(super) struct Sensed {
    /// What each of the nine channels shows, m, by row.
    pub(super) values: Vec<[f64; 9]>,
    /// Changes of the signals for a change of each of the nine channels, by row.
    pub(super) by_channel: Vec<[Vector3<f64>; 9]>,
}

impl Sensed {
    pub(super) fn new(rows: &[FieldRow], stage: &Stage, probes: &[Probe; 3], lag_s: f64) -> Self {
        let slopes = Slopes::new(stage, *probes);
        let at = |row: &FieldRow| slopes.at(row.planar(lag_s, [0.0; 3]), row.vertical);
        Self {
            values: Self::values(rows, stage, probes, lag_s),
            by_channel: rows.iter().map(at).collect(),
        }
    }

    /// The fitted signals, because at rest a measured signal is all noise, which explains itself.
    pub(super) fn values(
        rows: &[FieldRow],
        stage: &Stage,
        probes: &[Probe; 3],
        lag_s: f64,
    ) -> Vec<[f64; 9]> {
        let values = |row: &FieldRow| {
            let planar = row.planar(lag_s, [0.0; 3]);
            let [a, b, c] = probes.map(|probe| probe.signal_m(planar, row.vertical));
            let [x, y1, y2] = stage.interferometer.beams_m(row.reference, row.vertical);
            let vertical = VerticalPose::from_array(row.vertical);
            let [one, two, three] = gaps_m(&stage.capacitive_probes_m, &vertical);
            [a, b, c, x, y1, y2, one, two, three]
        };
        rows.iter().map(values).collect()
    }
}

/// The effects of faults on the signals of a log.
pub(super) struct Effects<'a> {
    pub(super) means: &'a Means,
    pub(super) sensed: Sensed,
}

impl<'a> Effects<'a> {
    /// At these parameters and this lag of the reference, s.
    pub(super) fn new(
        means: &'a Means,
        stage: &Stage,
        parameters: &FieldParameters,
        lag_s: f64,
    ) -> Self {
        let sensed = Sensed::new(&means.rows.rows, stage, &probes(parameters), lag_s);
        Self { means, sensed }
    }

    /// The signals of a fault that is the same in the whole log, m: of a gain of 1 %, of a zero of 1 um, of a time of
    /// 1 ms.
    pub(super) fn constant(&self, suspect: Suspect) -> Vec<[f64; 3]> {
        let time_s = |at: usize| self.means.rows.rows[at].time_s;
        let at = |movement: &Range<usize>, at: usize| {
            let before = at.saturating_sub(1).max(movement.start);
            let after = (at + 1).min(movement.end - 1);
            let size = |channel: usize| match suspect.quantity {
                Quantity::Zero => 1e-6,
                Quantity::Gain => 1e-2 * self.sensed.values[at][channel],
                Quantity::Time if before == after => 0.0,
                Quantity::Time => {
                    let [from, to] = [before, after].map(|at| self.sensed.values[at][channel]);
                    -1e-3 * (to - from) / (time_s(after) - time_s(before))
                }
            };
            let channels = suspect.first..suspect.first + suspect.count;
            let sum: Vector3<f64> = channels
                .map(|k| self.sensed.by_channel[at][k] * size(k))
                .sum();
            sum.into()
        };
        let movements = self.means.rows.movements.iter();
        movements
            .flat_map(|movement| movement.clone().map(move |k| at(movement, k)))
            .collect()
    }

    /// The same with a shape. A fault that stays is zero at the end of the log, so that the parameters are the stage
    /// as it ends; the zero of a Hall probe is set anew.
    pub(super) fn shaped(&self, suspect: Suspect, shape: Shape) -> Vec<[f64; 3]> {
        let mut column = self.constant(suspect);
        let count = column.len();
        let is = |condition: bool| f64::from(u8::from(condition));
        let at_end = is(suspect.can_stay() && !suspect.ends_with_movement());
        let time_s = |at: usize| self.means.rows.rows[at].time_s;
        for movement in &self.means.rows.movements {
            for at in movement.clone() {
                let share = match shape {
                    Shape::From(from, to) => is((from..to).contains(&at)),
                    Shape::Ramp => at as f64 / count as f64,
                    Shape::RampInMovements => time_s(at) - time_s(movement.start),
                };
                column[at] = column[at].map(|x| x * (share - at_end));
            }
        }
        column
    }
}

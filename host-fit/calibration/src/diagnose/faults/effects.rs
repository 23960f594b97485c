//! The effect on the Hall signals of every fault that is looked for.

use super::means::Means;
use super::motion::{Follows, Sensed};
use hallstage_input::channel::Channel;
use hallstage_input::finding::Quantity;
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::parameters::FieldParameters;
use hallstage_solver::estimator::rows::FieldRow;
use nalgebra::Vector3;
use std::ops::Range;

/// Accelerations are means over this time to both sides, s: a reference that vibrates is no motion.
const NEAR_S: f64 = 0.05;

/// The shape of a fault over the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    /// From a mean on, up to another mean: the end of the log, or of a movement, where a reset takes it off.
    From(usize, usize),
    /// It grows evenly over the log.
    Ramp,
    /// It grows to the middle of the log and falls.
    Arc,
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

/// Something that may be wrong: an error of a channel, or of all three channels of a kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Suspect {
    pub(super) follows: Follows,
    /// The first of the channels, as a number in [`Channel::SINGLE`].
    first: usize,
    count: usize,
}

/// Everything that is looked for: each channel by itself, and the gains and times of all channels of a kind, because
/// the beams share a laser and a filter. The common lag of the beams is an unknown of the fit. It equals minus the lag of all Hall
/// probes, so neither is listed. The suspects of a channel stand together.
pub(super) fn suspects(with_motion: bool) -> impl Iterator<Item = Suspect> {
    use Follows::{Gain, Heat, OwnAcceleration, OwnSpeed, Sag, Turning};
    let of_channel = |first: usize| {
        Follows::of_channel(first).map(move |follows| Suspect::single(follows, first))
    };
    let gains = [(Gain, 0), (Gain, 3), (Gain, 6)];
    let times = [(OwnSpeed, 3), (OwnSpeed, 6)];
    let motion = [(OwnAcceleration, 3), (Turning, 3), (Sag, 0), (Heat, 0)];
    let groups = gains.into_iter().chain(times).chain(motion);
    let groups = groups.map(|(follows, first)| Suspect {
        follows,
        first,
        count: 3,
    });
    let all = (0..9).flat_map(of_channel).chain(groups);
    all.filter(move |suspect| with_motion || suspect.quantity().is_some())
}

impl Suspect {
    /// An error of one channel.
    pub(super) const fn single(follows: Follows, first: usize) -> Self {
        Self {
            follows,
            first,
            count: 1,
        }
    }

    /// What changes, for an error that does not follow the motion.
    pub(super) const fn quantity(&self) -> Option<Quantity> {
        match self.follows {
            Follows::Zero => Some(Quantity::Zero),
            Follows::Gain => Some(Quantity::Gain),
            Follows::OwnSpeed => Some(Quantity::Time),
            _ => None,
        }
    }

    /// The channels, as numbers in [`Channel::SINGLE`].
    pub(super) const fn channels(&self) -> Range<usize> {
        self.first..self.first + self.count
    }

    /// The channel or the group.
    pub(super) const fn channel(&self) -> Channel {
        match self.is_single() {
            true => Channel::SINGLE[self.first],
            false => Channel::GROUPS[self.first / 3],
        }
    }

    pub(super) const fn is_single(&self) -> bool {
        self.count == 1
    }

    pub(super) const fn is_beam(&self) -> bool {
        self.channel().is_beam()
    }

    /// Whether a reset of the zero takes it off.
    pub(super) fn ends_with_movement(&self) -> bool {
        self.follows == Follows::Zero && self.first < 6
    }

    /// Whether it can begin somewhere and stay.
    pub(super) fn can_stay(&self) -> bool {
        match self.follows {
            Follows::Gain => true,
            Follows::Zero => !self.is_beam(),
            _ => false,
        }
    }
}

/// The effects of faults on the signals of a log.
pub(super) struct Effects<'a> {
    pub(super) means: &'a Means,
    sensed: Sensed,
}

impl<'a> Effects<'a> {
    /// At these parameters and this lag of the reference, s.
    pub(super) fn new(
        means: &'a Means,
        stage: &Stage,
        parameters: &FieldParameters,
        lag_s: f64,
    ) -> Self {
        let movements = &means.rows.movements;
        let rows = smooth(&means.rows.rows, movements);
        let sensed = Sensed::new(rows, stage, parameters, lag_s);
        Self { means, sensed }
    }

    /// Changes of the signals for a change of each of the nine channels at a mean.
    pub(super) fn by_channel(&self, at: usize) -> &[Vector3<f64>; 9] {
        &self.sensed.by_channel[at]
    }

    /// The direction of the signals at a mean by an error of a channel, which all its faults share; for several channels the
    /// signals by a unit of the fault, m.
    pub(super) fn direction(&self, suspect: Suspect, at: usize) -> Vector3<f64> {
        let by_channel = self.by_channel(at);
        let each = suspect.channels().map(|channel| match suspect.is_single() {
            true => by_channel[channel],
            false => by_channel[channel] * self.sensed.error(at, channel, suspect.follows),
        });
        each.sum()
    }

    /// A unit of a fault along its direction, at each mean.
    pub(super) fn units(&self, suspect: Suspect) -> Vec<f64> {
        let rows = &self.means.rows;
        let unit = |at: usize| match suspect.is_single() {
            true => self.sensed.error(at, suspect.first, suspect.follows),
            false => 1.0,
        };
        (0..rows.rows.len()).map(unit).collect()
    }

    /// What a fault with a shape changes of the signals, m: by a gain of 1 %, a zero of 1 um, a time of 1 ms.
    pub(super) fn shaped(&self, suspect: Suspect, shape: Shape) -> Vec<[f64; 3]> {
        let sizes = self
            .units(suspect)
            .into_iter()
            .zip(self.shares(suspect, shape));
        let signals = sizes
            .enumerate()
            .map(|(at, (unit, share))| (self.direction(suspect, at) * (unit * share)).into());
        signals.collect()
    }

    /// The size of a fault at each mean. A fault that stays is zero at the end of the log, so that the parameters are the
    /// stage as it ends; the zero of a Hall probe is set anew.
    pub(super) fn shares(&self, suspect: Suspect, shape: Shape) -> Vec<f64> {
        let rows = &self.means.rows;
        let is = |condition: bool| f64::from(u8::from(condition));
        let at_end = is(suspect.can_stay() && !suspect.ends_with_movement());
        let part = |at: usize| at as f64 / rows.rows.len() as f64;
        let time_s = |at: usize| rows.rows[at].time_s;
        let share = |movement: &Range<usize>, at: usize| match shape {
            Shape::From(from, to) => is((from..to).contains(&at)),
            Shape::Ramp => part(at),
            Shape::Arc => at_end + 4.0 * part(at) * (1.0 - part(at)),
            Shape::RampInMovements => time_s(at) - time_s(movement.start),
        };
        let movements = rows.movements.iter();
        let shares = movements
            .flat_map(|movement| movement.clone().map(move |at| share(movement, at) - at_end));
        shares.collect()
    }
}

/// Rows with means of the accelerations near them.
fn smooth(rows: &[FieldRow], movements: &[Range<usize>]) -> Vec<FieldRow> {
    let smooth = |movement: &Range<usize>, at: usize| {
        let is_near = |k: &usize| (rows[*k].time_s - rows[at].time_s).abs() < NEAR_S;
        let before = (movement.start..at).rev().take_while(is_near).count();
        let after = (at..movement.end).take_while(is_near).count();
        let near = &rows[at - before..at + after];
        let mean = |axis: usize| {
            let sum: f64 = near.iter().map(|row| row.acceleration_m_s2[axis]).sum();
            sum / near.len() as f64
        };
        FieldRow {
            acceleration_m_s2: std::array::from_fn(mean),
            ..rows[at]
        }
    };
    let rows = movements
        .iter()
        .flat_map(|movement| movement.clone().map(move |at| smooth(movement, at)));
    rows.collect()
}

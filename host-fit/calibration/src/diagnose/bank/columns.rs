//! The bank: what a fault of each channel does to the signals.

use super::means::Log;
use crate::diagnose::slopes::Slopes;
use crate::finding::Code;
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
    /// All the time.
    Whole,
    /// From a mean on to the end of the log.
    From(usize),
    /// From a mean on to the end of its movement: a reset takes it off.
    ToReset(usize),
    /// Growing evenly over the log.
    Ramp,
    /// Growing evenly in each movement, by 1 in a second.
    RampInMovements,
}

/// A row of the bank: what, the channel or the group, the first channel at fault and the one after the last
/// (Hall A, B, C; beams X, Y1, Y2; gaps 1, 2, 3).
#[derive(Clone, Copy, Debug)]
pub(super) struct Family(pub(super) Kind, pub(super) &'static str, usize, usize);

/// All faults that are looked for.
pub(super) const FAMILIES: [Family; 21] = [
    Family(Kind::Gain, "hall_a", 0, 1),
    Family(Kind::Gain, "hall_b", 1, 2),
    Family(Kind::Gain, "hall_c", 2, 3),
    Family(Kind::Gain, "hall", 0, 3),
    Family(Kind::Gain, "ifm", 3, 6),
    Family(Kind::Gain, "cap_1", 6, 7),
    Family(Kind::Gain, "cap_2", 7, 8),
    Family(Kind::Gain, "cap_3", 8, 9),
    Family(Kind::Gain, "cap", 6, 9),
    Family(Kind::Offset, "hall_a", 0, 1),
    Family(Kind::Offset, "hall_b", 1, 2),
    Family(Kind::Offset, "hall_c", 2, 3),
    Family(Kind::Offset, "ifm_x", 3, 4),
    Family(Kind::Offset, "ifm_y1", 4, 5),
    Family(Kind::Offset, "ifm_y2", 5, 6),
    Family(Kind::Offset, "cap_1", 6, 7),
    Family(Kind::Offset, "cap_2", 7, 8),
    Family(Kind::Offset, "cap_3", 8, 9),
    BEAMS_LATE[0],
    BEAMS_LATE[1],
    BEAMS_LATE[2],
];
/// The beams X, Y1, Y2 each late.
pub(super) const BEAMS_LATE: [Family; 3] = [
    Family(Kind::Lag, "ifm_x", 3, 4),
    Family(Kind::Lag, "ifm_y1", 4, 5),
    Family(Kind::Lag, "ifm_y2", 5, 6),
];

/// Changes of the signals (mm) by a change of each of the nine channels by 1 mm, by mean.
pub(super) fn by_channel(
    log: &Log,
    stage: &Stage,
    parameters: &FieldParameters,
    lag_s: f64,
) -> Vec<[Vector3<f64>; 9]> {
    let slopes = Slopes::new(stage, probes(parameters));
    let at = |row: &FieldRow| slopes.at(row.planar_mm(lag_s, [0.0; 3]), row.vertical);
    log.means().iter().map(at).collect()
}

impl Family {
    /// Whether it may come from one row to the next and stay.
    pub(super) fn steps(&self) -> bool {
        match self.0 {
            Kind::Gain => true,
            Kind::Offset => !(3..6).contains(&self.2),
            Kind::Lag => false,
        }
    }

    /// Whether a reset takes it off.
    pub(super) fn ends_with_movement(&self) -> bool {
        self.0 == Kind::Offset && self.2 < 6
    }

    pub(super) const fn code(&self, course: Course) -> Code {
        match (self.0, course) {
            (Kind::Gain, _) => Code::GainDrift,
            (Kind::Lag, _) => Code::ReferenceLag,
            (Kind::Offset, Course::From(_) | Course::ToReset(_)) => Code::Step,
            (Kind::Offset, _) => Code::Drift,
        }
    }

    /// What it adds to the signals, mm, without its course.
    pub(super) fn raw(
        &self,
        log: &Log,
        stage: &Stage,
        by_channel: &[[Vector3<f64>; 9]],
    ) -> Vec<[f64; 3]> {
        let half_m = 0.5 * stage.y_baseline_m;
        let beams = |[x, y, rz]: [f64; 3]| [x, y + half_m * rz, y - half_m * rz];
        let at = |(row, by_channel): (&FieldRow, &[Vector3<f64>; 9])| {
            let vertical = VerticalPose::from_array(row.vertical);
            let gaps_m = runtime::capacitive::gaps_m(&stage.capacitive_probes_m, &vertical);
            let size = |channel: usize| match (self.0, channel) {
                (Kind::Offset, _) => 1e-3,
                (Kind::Gain, 0..3) => 1e-2 * row.signal_mm[channel],
                (Kind::Gain, 3..6) => 1e-2 * beams(row.reference_mm)[channel - 3],
                (Kind::Gain, _) => 1e-2 * (1e3 * gaps_m[channel - 6]),
                (Kind::Lag, _) => -1e-3 * beams(row.rate_mm_per_s)[channel - 3],
            };
            let channels = self.2..self.3;
            let sum: Vector3<f64> = channels.map(|k| by_channel[k] * size(k)).sum();
            sum.into()
        };
        log.means().iter().zip(by_channel).map(at).collect()
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
    let stays = family.0 == Kind::Gain || family.2 >= 6;
    let is_state = stays && matches!(course, Course::From(_) | Course::Ramp);
    let range = range_of(log, course);
    let mut out = raw.to_vec();
    for (movement, at) in (log.movements().iter()).flat_map(|m| m.clone().map(move |at| (m, at))) {
        let time_s = |at: usize| log.means()[at].time_s;
        let share = match course {
            Course::Ramp => at as f64 / raw.len() as f64,
            Course::RampInMovements => time_s(at) - time_s(movement.start),
            _ => f64::from(u8::from(range.contains(&at))),
        };
        let share = share - f64::from(u8::from(is_state));
        out[at].iter_mut().for_each(|x| *x *= share);
    }
    out
}

/// The fault's column to its end.
pub(super) fn range_of(log: &Log, course: Course) -> Range<usize> {
    let all = 0..log.means().len();
    match course {
        Course::From(from) => from..all.end,
        Course::ToReset(from) => {
            let movement = log.movements().iter().find(|m| m.contains(&from));
            from..movement.map_or(from, |movement| movement.end)
        }
        _ => all,
    }
}

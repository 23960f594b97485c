//! Mistakes of labs with stage, wires, log and `stage.toml`, as linear changes of the rows that set them right.

use super::limits::UNDECIDED;
use hallstage_input::channel::Channel;
use hallstage_input::finding::{Cause, Code, Correction};
use hallstage_input::stage::Stage;
use nalgebra::Matrix3;
use runtime::capacitive::ProbePositions;
use std::ops::Range;

/// A linear transform of the rows: matrices for the three Hall signals, the reference and the vertical pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Transform(pub(super) [Matrix3<f64>; 3]);

impl Transform {
    pub(super) fn nothing() -> Self {
        Self([Matrix3::identity(); 3])
    }

    fn of(side: usize, matrix: Matrix3<f64>) -> Self {
        let mut change = Self::nothing();
        change.0[side] = matrix;
        change
    }
}

/// A mistake that may explain a log.
#[derive(Clone, Debug)]
pub(super) struct Mistake {
    pub(super) code: Code,
    /// What sets the log right, without its value.
    pub(super) correction: Correction,
    /// The factor of a scale, or how far something is turned, degrees.
    pub(super) value: Option<f64>,
    /// The cost of an unusual value: twice the logarithm of its odds.
    pub(super) penalty: f64,
    /// Whether other magnets than designed have the same effect.
    pub(super) may_be_magnets: bool,
    pub(super) change: Transform,
}

impl Mistake {
    /// Whether the beams are read in single pass for double pass, or the reverse.
    pub(super) fn is_other_pass(&self) -> bool {
        self.correction.is_scale_of_beams() && matches!(self.value, Some(0.5 | 2.0))
    }

    /// Whether X, Y, Rz are right in spite of it, as errors in service show.
    pub(super) fn leaves_pose(&self) -> bool {
        let is_gap = |channel: &Channel| {
            use Channel::{Gap1, Gap2, Gap3, Gaps};
            matches!(channel, Gap1 | Gap2 | Gap3 | Gaps)
        };
        self.code == Code::ScaleWrong
            && self.value.is_some_and(|by| GAP_FACTORS.contains(&by))
            && self.correction.channels().iter().all(is_gap)
    }
}

/// Gaps that are wrong by such a factor make no X, Y, Rz wrong: the sensitivity of the probes follows.
const GAP_FACTORS: Range<f64> = 0.5..2.0;
/// Factors per decade that are tried.
const FACTORS: i32 = 48;
/// Decades of factors: units may be um for m.
const POWERS: i32 = 6;
/// Step of the turns that are tried, degrees.
const TURN_DEG: i32 = 10;

/// The codes of an exchange and of a sign: of Hall probes, beams and gaps.
const SIDES: [[Code; 2]; 3] = [
    [Code::ChannelsSwapped, Code::ChannelInverted],
    [Code::BeamsSwapped, Code::BeamInverted],
    [Code::CapacitiveSwapped, Code::CapacitiveInverted],
];

/// All mistakes with order, sign, scale and place; mistakes with gaps only if the log has codes.
pub(super) fn mistakes(stage: &Stage, has_codes: bool) -> Vec<Mistake> {
    let beams = stage.interferometer.beams_per_pose();
    let gaps = pose_to_gaps(&stage.capacitive_probes_m);
    let sides = [Matrix3::identity(), beams, gaps].into_iter().enumerate();
    let mut out = Vec::new();
    for (side, to_channels) in sides.take(2 + usize::from(has_codes)) {
        let Some(to_pose) = to_channels.try_inverse() else {
            continue;
        };
        let change = |matrix: Matrix3<f64>| Transform::of(side, to_pose * matrix * to_channels);
        let [swapped, inverted] = SIDES[side];
        let (all, own) = (Channel::GROUPS[side], &Channel::SINGLE[3 * side..][..3]);
        for order in [[1, 0, 2], [2, 1, 0], [0, 2, 1], [1, 2, 0], [2, 0, 1]] {
            let moved: Vec<usize> = (0..3).filter(|&k| order[k] != k).collect();
            let correction = match moved[..] {
                [one, other] => Correction::Exchange([own[one], own[other]]),
                _ => Correction::Order(all, order.map(|k| own[k])),
            };
            let matrix = Matrix3::from_fn(|i, j| f64::from(u8::from(j == order[i])));
            out.push(mistake(swapped, correction, change(matrix)));
        }
        for bits in 1..8u32 {
            let some: Vec<usize> = (0..3).filter(|k| bits >> k & 1 == 1).collect();
            let times = |factor: f64| {
                let of = |k: usize| if some.contains(&k) { factor } else { 1.0 };
                change(Matrix3::from_diagonal(&[0, 1, 2].map(of).into()))
            };
            let named = match some.len() {
                3 => vec![all],
                _ => some.iter().map(|&k| own[k]).collect(),
            };
            let first = out.len();
            scales(&mut out, &Correction::Scale(named.clone()), times);
            for mistake in out[first..].iter_mut().filter(|_| named == [Channel::Gaps]) {
                // The field of such magnets falls with height half as fast, or less than twice.
                mistake.may_be_magnets = mistake.value.is_some_and(|by| GAP_FACTORS.contains(&by));
            }
            out.push(mistake(inverted, Correction::Sign(named), times(-1.0)));
        }
    }
    // Rz of the reference, and Rx and Ry, are multiplied.
    let turned = |rz: f64, tilts: f64| {
        let diagonals = [[1.0; 3], [1.0, 1.0, rz], [1.0, tilts, tilts]];
        Transform(diagonals.map(|by| Matrix3::from_diagonal(&by.into())))
    };
    scales(&mut out, &Correction::BaselineScale, |by| turned(by, 1.0));
    scales(&mut out, &Correction::HallPlaces, |by| {
        turned(1.0 / by, 1.0 / by)
    });
    if has_codes {
        scales(&mut out, &Correction::GapPlaces, |by| turned(1.0, 1.0 / by));
        places(&mut out, stage, &gaps);
    }
    out
}

const fn mistake(code: Code, correction: Correction, change: Transform) -> Mistake {
    Mistake {
        code,
        correction,
        value: None,
        penalty: 0.0,
        may_be_magnets: false,
        change,
    }
}

/// One mistake for each factor.
fn scales(out: &mut Vec<Mistake>, correction: &Correction, change: impl Fn(f64) -> Transform) {
    let powers = (-FACTORS * POWERS..=FACTORS * POWERS).filter(|power| *power != 0);
    let any = powers.map(|power| {
        let factor = 10f64.powf(f64::from(power) / f64::from(FACTORS));
        (factor, power % FACTORS == 0)
    });
    out.extend(
        any.chain([(2.0, true), (0.5, true)])
            .map(|(factor, is_usual)| Mistake {
                value: Some(factor),
                penalty: penalty(is_usual),
                ..mistake(Code::ScaleWrong, correction.clone(), change(factor))
            }),
    );
}

/// Factors of two, a half and powers of ten, and right angles, are more likely than others.
const fn penalty(is_usual: bool) -> f64 {
    if is_usual { 0.0 } else { UNDECIDED }
}

/// Sensors at other places than in `stage.toml`.
fn places(out: &mut Vec<Mistake>, stage: &Stage, gaps: &Matrix3<f64>) {
    let designed = stage.capacitive_probes_m;
    let mut add = |correction, value, penalty, places: ProbePositions<f64>| {
        out.extend(pose_to_gaps(&places).try_inverse().map(|to_pose| Mistake {
            value,
            penalty,
            ..mistake(
                Code::CapacitiveInverted,
                correction,
                Transform::of(2, to_pose * gaps),
            )
        }));
    };
    for (sensor, axis) in (0..3).flat_map(|sensor| [(sensor, 0), (sensor, 1)]) {
        let mut places = designed;
        let place = &mut places[sensor][axis];
        *place = -*place;
        let channel = Channel::SINGLE[6 + sensor];
        let correction = Correction::GapPlace(channel, ["x", "y"][axis], *place);
        if *place != 0.0 {
            add(correction, None, 0.0, places);
        }
    }
    for (correction, sign) in [
        (Correction::GapsTurned, 1.0),
        (Correction::GapsMirrored, -1.0),
    ] {
        for degrees in (-180 + TURN_DEG..=180)
            .step_by(TURN_DEG as usize)
            .filter(|turn| sign < 0.0 || *turn != 0)
        {
            let (sin, cos) = libm::sincos(f64::from(degrees).to_radians());
            let places =
                designed.map(|[x, y]| [cos * sign * x - sin * y, sin * sign * x + cos * y]);
            let penalty = penalty(degrees % 90 == 0);
            add(
                correction.clone(),
                Some(f64::from(degrees)),
                penalty,
                places,
            );
        }
    }
}

/// The cause from mistakes that differ only in their value, the best first.
pub(super) fn cause(alike: &[&Mistake]) -> Cause {
    let first = alike[0];
    let values = || alike.iter().filter_map(|mistake| mistake.value);
    Cause {
        correction: first.correction.clone(),
        values: first.value.map(|best| {
            [
                best,
                values().fold(best, f64::min),
                values().fold(best, f64::max),
            ]
        }),
    }
}

/// Gap changes 1, 2, 3 of a vertical pose Z, Rx, Ry: z + rx y - ry x.
fn pose_to_gaps(positions: &ProbePositions<f64>) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| {
        let [x, y] = positions[i];
        [1.0, y, -x][j]
    })
}

//! What labs mix up between stage, wires, log and `stage.toml`, as the linear change of the rows that sets it
//! right.

use super::bank::UNDECIDED;
use super::slopes::{CHANNELS, title};
use hallstage_input::finding::Code;
use hallstage_input::stage::Stage;
use nalgebra::Matrix3;
use runtime::capacitive::ProbePositions;

/// What is done to the rows: each matrix times its three numbers. Hall signals, reference, vertical pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Change(pub(super) [Matrix3<f64>; 3]);

impl Change {
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
    /// The channels, as in [`Finding::channel`](hallstage_input::finding::Finding::channel).
    pub(super) channel: String,
    /// What sets the log right, as the end of "it fits if ...", but for the value.
    pub(super) what: String,
    /// What follows: the factor of a scale, or how far something is turned, degrees.
    pub(super) value: Option<(f64, &'static str)>,
    /// What a value that may be any costs: twice the logarithm of the odds.
    pub(super) penalty: f64,
    /// Whether other magnets than designed show the same.
    pub(super) may_be_magnets: bool,
    pub(super) change: Change,
}

/// Factors to a power of ten that are tried, and the largest power: units of um and m.
const FACTORS: i32 = 24;
const POWERS: i32 = 6;
/// Turns that are tried, degrees.
const TURN_DEG: i32 = 10;

/// Of Hall probes, beams and gaps: all of them together, the codes of an exchange and of a sign.
const SIDES: [(&str, [Code; 2]); 3] = [
    ("hall", [Code::ChannelsSwapped, Code::ChannelInverted]),
    ("ifm", [Code::BeamsSwapped, Code::BeamInverted]),
    ("cap", [Code::CapacitiveSwapped, Code::CapacitiveInverted]),
];

/// All mistakes with order, sign, scale and place; of the gaps those that codes can have.
pub(super) fn mistakes(stage: &Stage, has_codes: bool) -> Vec<Mistake> {
    let half_m = 0.5 * stage.y_baseline_m;
    let beams = Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, half_m, 0.0, 1.0, -half_m);
    let gaps = of_gaps(&stage.capacitive_probes_m);
    let sides = [Matrix3::identity(), beams, gaps].into_iter().enumerate();
    let mut out = Vec::new();
    for (side, to_channels) in sides.take(2 + usize::from(has_codes)) {
        let Some(to_pose) = to_channels.try_inverse() else {
            continue;
        };
        let change = |matrix: Matrix3<f64>| Change::of(side, to_pose * matrix * to_channels);
        let (all, [swapped, inverted]) = SIDES[side];
        let own = &CHANNELS[3 * side..][..3];
        // The channels, and what they are called.
        let names = |some: &[usize]| {
            let named = match some.len() {
                3 => vec![all],
                _ => some.iter().map(|&k| own[k]).collect(),
            };
            (named.join(", "), titles(&named))
        };
        for order in [[1, 0, 2], [2, 1, 0], [0, 2, 1], [1, 2, 0], [2, 0, 1]] {
            let moved: Vec<usize> = (0..3).filter(|&k| order[k] != k).collect();
            let (channel, of) = names(&moved);
            let what = match moved[..] {
                [_, _] => format!("{of} are exchanged"),
                _ => format!("{of} are read as {}", titles(&order.map(|k| own[k]))),
            };
            let matrix = Matrix3::from_fn(|i, j| f64::from(u8::from(j == order[i])));
            out.push(mistake(swapped, channel, what, change(matrix)));
        }
        for bits in 1..8u32 {
            let some: Vec<usize> = (0..3).filter(|k| bits >> k & 1 == 1).collect();
            let times = |factor: f64| {
                let of = |k: usize| if some.contains(&k) { factor } else { 1.0 };
                change(Matrix3::from_diagonal(&[0, 1, 2].map(of).into()))
            };
            let (channel, of) = names(&some);
            let what = format!("the scale of {of} is multiplied by");
            let first = out.len();
            scales(&mut out, &channel, &what, times);
            for mistake in out[first..].iter_mut().filter(|_| channel == "cap") {
                // Their field falls with the height half as fast, or less than twice.
                let factors = 0.5..2.0;
                mistake.may_be_magnets = mistake.value.is_some_and(|(by, _)| factors.contains(&by));
            }
            let what = format!("the sign of {of} is turned");
            out.push(mistake(inverted, channel, what, times(-1.0)));
        }
    }
    // Rz of the reference, and Rx and Ry, are so many times larger.
    let turned = |rz: f64, tilts: f64| {
        let diagonals = [[1.0; 3], [1.0, 1.0, rz], [1.0, tilts, tilts]];
        Change(diagonals.map(|by| Matrix3::from_diagonal(&by.into())))
    };
    let what = "Rz of the reference (1 / interferometer.y_baseline_m) is multiplied by";
    scales(&mut out, "rz", what, |factor| turned(factor, 1.0));
    let what = "the places of the Hall probes are multiplied by";
    scales(&mut out, "hall", what, |factor| {
        turned(1.0 / factor, 1.0 / factor)
    });
    if has_codes {
        let what = "the places of the capacitive sensors are multiplied by";
        scales(&mut out, "cap", what, |factor| turned(1.0, 1.0 / factor));
        places(&mut out, stage, &gaps);
    }
    out
}

const fn mistake(code: Code, channel: String, what: String, change: Change) -> Mistake {
    Mistake {
        code,
        channel,
        what,
        value: None,
        penalty: 0.0,
        may_be_magnets: false,
        change,
    }
}

/// One mistake for each factor.
fn scales(out: &mut Vec<Mistake>, channel: &str, what: &str, change: impl Fn(f64) -> Change) {
    let powers = (-FACTORS * POWERS..=FACTORS * POWERS).filter(|power| *power != 0);
    let any = powers.map(|power| {
        let factor = 10f64.powf(f64::from(power) / f64::from(FACTORS));
        (factor, power % FACTORS == 0)
    });
    out.extend(
        any.chain([(2.0, true), (0.5, true)])
            .map(|(factor, is_usual)| Mistake {
                value: Some((factor, "")),
                penalty: penalty(is_usual),
                ..mistake(
                    Code::ScaleWrong,
                    channel.into(),
                    what.into(),
                    change(factor),
                )
            }),
    );
}

/// Any factor is less likely than two, a half or a power of ten, any turn less than a right angle.
const fn penalty(is_usual: bool) -> f64 {
    if is_usual { 0.0 } else { UNDECIDED }
}

/// Sensors that stand elsewhere than `stage.toml` says.
fn places(out: &mut Vec<Mistake>, stage: &Stage, gaps: &Matrix3<f64>) {
    let designed = stage.capacitive_probes_m;
    let mut add = |channel: &str, what: String, value, penalty, places: ProbePositions<f64>| {
        out.extend(of_gaps(&places).try_inverse().map(|to_pose| Mistake {
            value,
            penalty,
            ..mistake(
                Code::CapacitiveInverted,
                channel.into(),
                what,
                Change::of(2, to_pose * gaps),
            )
        }));
    };
    for (sensor, axis) in (0..3).flat_map(|sensor| [(sensor, 0), (sensor, 1)]) {
        let mut places = designed;
        let place = &mut places[sensor][axis];
        *place = -*place;
        let (name, number) = (["x", "y"][axis], sensor + 1);
        let what = format!("the {name} of capacitive sensor {number} in stage.toml is {place} m");
        if *place != 0.0 {
            add(CHANNELS[6 + sensor], what, None, 0.0, places);
        }
    }
    for (how, sign) in [("turned by", 1.0), ("mirrored along x and turned by", -1.0)] {
        for degrees in (-180 + TURN_DEG..=180)
            .step_by(TURN_DEG as usize)
            .filter(|turn| sign < 0.0 || *turn != 0)
        {
            let (sin, cos) = libm::sincos(f64::from(degrees).to_radians());
            let places =
                designed.map(|[x, y]| [cos * sign * x - sin * y, sin * sign * x + cos * y]);
            let what = format!("the places of the capacitive sensors are {how}");
            add(
                "cap",
                what,
                Some((f64::from(degrees), " degrees")),
                penalty(degrees % 90 == 0),
                places,
            );
        }
    }
}

/// What sets the log right: the first of mistakes that differ by a value, with all values that do.
pub(super) fn cure(alike: &[&Mistake]) -> String {
    let first = alike[0];
    let Some((value, unit)) = first.value else {
        return first.what.clone();
    };
    // Two digits of a factor.
    let shown = |value: f64| {
        let digits = match unit.is_empty() {
            true => 1 - value.log10().floor() as i32,
            false => 0,
        };
        let place = 10f64.powi(-digits);
        format!(
            "{:.*}",
            digits.max(0) as usize,
            (value / place).round() * place
        )
    };
    let values = alike.iter().filter_map(|mistake| Some(mistake.value?.0));
    let ends = values.fold([value; 2], |[low, high], value| {
        [low.min(value), high.max(value)]
    });
    let range = match ends.map(shown) {
        [low, high] if low != high => format!(" ({low} to {high})"),
        _ => String::new(),
    };
    format!("{} about {}{unit}{range}", first.what, shown(value))
}

fn titles(channels: &[&str]) -> String {
    let titles: Vec<String> = channels.iter().map(|channel| title(channel)).collect();
    titles.join(" and ")
}

/// Gap changes 1, 2, 3 of a vertical pose Z, Rx, Ry: z + rx y - ry x.
fn of_gaps(positions: &ProbePositions<f64>) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| {
        let [x, y] = positions[i];
        [1.0, y, -x][j]
    })
}

//! What labs mix up between stage, wires, log and `stage.toml`, as the linear change of the rows that sets it
//! right.

use crate::finding::Code;
use crate::input::stage::Stage;
use nalgebra::{Matrix3, Vector3};
use runtime::capacitive::ProbePositions;

/// What is done to the rows: each matrix times its three numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Change {
    pub(super) signal: Matrix3<f64>,
    pub(super) reference: Matrix3<f64>,
    pub(super) vertical: Matrix3<f64>,
}

impl Change {
    pub(super) const NOTHING: Self = {
        let one = Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
        Self {
            signal: one,
            reference: one,
            vertical: one,
        }
    };

    fn of(side: Side, matrix: Matrix3<f64>) -> Self {
        let mut change = Self::NOTHING;
        *match side {
            Side::Hall => &mut change.signal,
            Side::Beams => &mut change.reference,
            Side::Gaps => &mut change.vertical,
        } = matrix;
        change
    }
}

/// A mistake that may explain a log.
#[derive(Clone, Debug)]
pub(super) struct Mistake {
    pub(super) code: Code,
    /// The channels, as in [`Finding::channel`](crate::finding::Finding::channel).
    pub(super) channel: String,
    /// Mistakes of one group differ by a factor alone.
    pub(super) group: usize,
    /// What sets the log right, as the end of "it fits if ...".
    pub(super) cure: String,
    pub(super) remedy: &'static str,
    /// The factor of a scale.
    pub(super) factor: Option<f64>,
    /// What a factor that may be any costs: twice the logarithm of the odds.
    pub(super) penalty: f64,
    pub(super) change: Change,
}

#[derive(Clone, Copy)]
enum Side {
    Hall,
    Beams,
    Gaps,
}

/// Scales within this factor of the designed ones are no mistake but tolerances.
const FACTOR_MIN: f64 = 1.4;
/// Factors to a power of ten that are tried, and the largest power: units of um and m.
const FACTORS: i32 = 24;
const POWERS: i32 = 6;
/// Any factor is less likely than two, a half or a power of ten.
const ANY_FACTOR: f64 = 6.0;

const WIRES: &str =
    "check the wiring, the columns of the log and the tables [log] and [capacitive] of stage.toml";
const SCALES: &str = "check units, single or double pass, and the scales in stage.toml";
const PLACES: &str = "check probes_m in the table [capacitive] of stage.toml";

/// All mistakes with order, sign, scale and place; of the gaps those that codes can have.
pub(super) fn mistakes(stage: &Stage, has_codes: bool) -> Vec<Mistake> {
    let beams = of_beams(stage.y_baseline_m);
    let gaps = of_gaps(&stage.capacitive_probes_m);
    let sides = [
        (
            Side::Hall,
            "Hall",
            "hall_",
            ["A", "B", "C"],
            Matrix3::identity(),
        ),
        (Side::Beams, "beam", "ifm_", ["X", "Y1", "Y2"], beams),
        (Side::Gaps, "capacitive", "cap_", ["1", "2", "3"], gaps),
    ];
    let mut out = Vec::new();
    for (side, kind, prefix, names, to_channels) in sides {
        let Some(to_pose) = to_channels.try_inverse() else {
            continue;
        };
        if matches!(side, Side::Gaps) && !has_codes {
            continue;
        }
        let change = |matrix: Matrix3<f64>| Change::of(side, to_pose * matrix * to_channels);
        let channel = |moved: &[usize]| {
            let names: Vec<String> = moved
                .iter()
                .map(|&k| prefix.to_owned() + &names[k].to_lowercase())
                .collect();
            names.join(", ")
        };
        let (swapped, inverted) = match side {
            Side::Hall => (Code::ChannelsSwapped, Code::ChannelInverted),
            Side::Beams => (Code::BeamsSwapped, Code::BeamInverted),
            Side::Gaps => (Code::CapacitiveSwapped, Code::CapacitiveInverted),
        };
        for order in [[1, 0, 2], [2, 1, 0], [0, 2, 1], [1, 2, 0], [2, 0, 1]] {
            let moved: Vec<usize> = (0..3).filter(|&k| order[k] != k).collect();
            let cure = match moved[..] {
                [one, other] => format!("{kind} {} and {} are exchanged", names[one], names[other]),
                _ => format!(
                    "{kind} {} are read from {}",
                    names.join(", "),
                    order.map(|k| names[k]).join(", ")
                ),
            };
            let matrix = Matrix3::from_fn(|i, j| f64::from(u8::from(j == order[i])));
            out.push(plain(swapped, channel(&moved), cure, WIRES, change(matrix)));
        }
        for bits in 1..8u32 {
            let turned: Vec<usize> = (0..3).filter(|k| bits >> k & 1 == 1).collect();
            let cure = match turned[..] {
                [one] => format!("the sign of {kind} {} is turned", names[one]),
                [one, other] => format!(
                    "the signs of {kind} {} and {} are turned",
                    names[one], names[other]
                ),
                _ => format!("the signs of all {kind} channels are turned"),
            };
            let signs = Vector3::from_fn(|k, _| if bits >> k & 1 == 1 { -1.0 } else { 1.0 });
            let matrix = Matrix3::from_diagonal(&signs);
            out.push(plain(
                inverted,
                channel(&turned),
                cure,
                WIRES,
                change(matrix),
            ));
        }
        for k in 0..3 {
            let what = format!("{kind} {} is multiplied by", names[k]);
            scales(&mut out, &channel(&[k]), &what, |factor| {
                let mut diagonal = Vector3::repeat(1.0);
                diagonal[k] = factor;
                change(Matrix3::from_diagonal(&diagonal))
            });
        }
        let (all, what) = match side {
            Side::Hall => ("hall", "the Hall signals are multiplied by"),
            Side::Beams => ("ifm", "the reference is multiplied by"),
            Side::Gaps => ("cap", "the gaps are multiplied by"),
        };
        scales(&mut out, all, what, |factor| {
            change(Matrix3::from_diagonal_element(factor))
        });
    }
    scales(
        &mut out,
        "rz",
        "Rz of the reference is multiplied by",
        |factor| {
            Change::of(
                Side::Beams,
                Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, factor)),
            )
        },
    );
    if has_codes {
        scales(
            &mut out,
            "cap",
            "the places of the capacitive sensors are multiplied by",
            |factor| {
                let by = Vector3::new(1.0, 1.0 / factor, 1.0 / factor);
                Change::of(Side::Gaps, Matrix3::from_diagonal(&by))
            },
        );
        places(&mut out, stage, &gaps);
    }
    for (group, mistake) in out.iter_mut().enumerate() {
        if mistake.factor.is_none() {
            mistake.group = group;
        }
    }
    out
}

fn plain(
    code: Code,
    channel: String,
    cure: String,
    remedy: &'static str,
    change: Change,
) -> Mistake {
    Mistake {
        code,
        channel,
        group: 0,
        cure,
        remedy,
        factor: None,
        penalty: 0.0,
        change,
    }
}

/// One mistake for each factor.
fn scales(out: &mut Vec<Mistake>, channel: &str, what: &str, change: impl Fn(f64) -> Change) {
    let group = 1000 + out.len();
    let any = (-FACTORS * POWERS..=FACTORS * POWERS)
        .map(|k| (10f64.powf(f64::from(k) / f64::from(FACTORS)), ANY_FACTOR));
    let round = (-POWERS..=POWERS).map(|power| (10f64.powi(power), 0.0));
    for (factor, penalty) in any.chain(round).chain([(2.0, 0.0), (0.5, 0.0)]) {
        if (1.0 / FACTOR_MIN..FACTOR_MIN).contains(&factor) {
            continue;
        }
        let cure = format!("{what} {}", significant(factor));
        let mut mistake = plain(
            Code::ScaleWrong,
            channel.to_owned(),
            cure,
            SCALES,
            change(factor),
        );
        mistake.factor = Some(factor);
        mistake.penalty = penalty;
        mistake.group = group;
        out.push(mistake);
    }
}

/// Sensors that stand elsewhere than `stage.toml` says.
fn places(out: &mut Vec<Mistake>, stage: &Stage, gaps: &Matrix3<f64>) {
    let designed = stage.capacitive_probes_m;
    let mut add = |channel: String, cure: String, places: ProbePositions<f64>| {
        if let Some(to_pose) = of_gaps(&places).try_inverse() {
            let change = Change::of(Side::Gaps, to_pose * gaps);
            out.push(plain(
                Code::CapacitiveInverted,
                channel,
                cure,
                PLACES,
                change,
            ));
        }
    };
    for sensor in 0..3 {
        for (axis, name) in ["x", "y"].into_iter().enumerate() {
            let mut places = designed;
            if places[sensor][axis] == 0.0 {
                continue;
            }
            places[sensor][axis] = -places[sensor][axis];
            let cure = format!(
                "the {name} of capacitive sensor {} in stage.toml is {} m",
                sensor + 1,
                places[sensor][axis]
            );
            add(format!("cap_{}", sensor + 1), cure, places);
        }
    }
    type Turn = (&'static str, fn([f64; 2]) -> [f64; 2]);
    let turned: [Turn; 6] = [
        ("turned by 90 degrees", |[x, y]| [-y, x]),
        ("turned by 180 degrees", |[x, y]| [-x, -y]),
        ("turned by -90 degrees", |[x, y]| [y, -x]),
        ("mirrored along x", |[x, y]| [-x, y]),
        ("mirrored along y", |[x, y]| [x, -y]),
        ("given as y, x", |[x, y]| [y, x]),
    ];
    for (how, turn) in turned {
        let cure = format!("the places of the capacitive sensors are {how}");
        add("cap".to_owned(), cure, designed.map(turn));
    }
}

/// Two digits of a number.
fn significant(x: f64) -> String {
    let digits = 1 - x.abs().log10().floor() as i32;
    if digits > 0 {
        format!("{x:.*}", digits as usize)
    } else {
        let unit = 10f64.powi(-digits);
        format!("{}", (x / unit).round() * unit)
    }
}

/// Beams X, Y1, Y2 of a pose X, Y, Rz.
fn of_beams(baseline_m: f64) -> Matrix3<f64> {
    let half = 0.5 * baseline_m;
    Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, half, 0.0, 1.0, -half)
}

/// Gap changes 1, 2, 3 of a vertical pose Z, Rx, Ry: z + rx y - ry x.
fn of_gaps(positions: &ProbePositions<f64>) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| {
        let [x, y] = positions[i];
        [1.0, y, -x][j]
    })
}

//! What may be mixed up between stage, wires, log and `stage.toml`, as the linear change of the rows
//! that sets it right.

use super::finding::Code;
use crate::input::stage::Stage;
use crate::problem::{Problem, TrainRow};
use nalgebra::{Matrix3, Vector3};
use runtime::capacitive::ProbePositions;

/// A mistake that may explain a log.
#[derive(Clone, Debug, PartialEq)]
pub struct Hypothesis {
    /// What kind it is of.
    pub code: Code,
    /// The channel, as in [`Finding::channel`](super::finding::Finding::channel).
    pub channel: Option<String>,
    /// What sets the log right, as the end of "it fits if ...".
    pub cure: String,
    /// What to do.
    pub remedy: &'static str,
    /// The factor of a scale; `None` for the others.
    pub factor: Option<f64>,
    change: Change,
}

/// What is done to the rows: each matrix times its three numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Change {
    signal: Matrix3<f64>,
    reference: Matrix3<f64>,
    vertical: Matrix3<f64>,
}

/// The order and the signs of three channels.
#[derive(Clone, Copy)]
struct Wiring {
    order: [usize; 3],
    signs: [f64; 3],
}

const IN_ORDER: [usize; 3] = [0, 1, 2];
/// All other orders.
const ORDERS: [[usize; 3]; 5] = [[1, 0, 2], [2, 1, 0], [0, 2, 1], [1, 2, 0], [2, 0, 1]];
const WIRES: &str = "check the wiring, the columns of the log and the table [log] of stage.toml";
const SENSORS: &str =
    "check the wiring, the columns of the log, and the tables [log] and [capacitive] of stage.toml";

impl Wiring {
    const fn ordered(order: [usize; 3]) -> Self {
        Self {
            order,
            signs: [1.0; 3],
        }
    }

    const fn signed(signs: [f64; 3]) -> Self {
        Self {
            order: IN_ORDER,
            signs,
        }
    }

    fn matrix(self) -> Matrix3<f64> {
        Matrix3::from_fn(|i, j| {
            if j == self.order[i] {
                self.signs[i]
            } else {
                0.0
            }
        })
    }

    /// Which channels of `names` are not in their place.
    fn moved<'n>(&self, names: &[&'n str; 3]) -> Vec<&'n str> {
        let moved = (0..3).filter(|&k| self.order[k] != k || self.signs[k] < 0.0);
        moved.map(|k| names[k]).collect()
    }

    /// In words.
    fn words(&self, kind: &str, names: &[&str; 3]) -> String {
        let moved = self.moved(names);
        match (self.order == IN_ORDER, moved.as_slice()) {
            (true, [one]) => format!("the sign of {kind} {one} is turned"),
            (true, [one, other]) => format!("the signs of {kind} {one} and {other} are turned"),
            (true, _) => format!("the signs of all {kind} channels are turned"),
            (false, [one, other]) => format!("{kind} {one} and {other} are exchanged"),
            (false, _) => {
                let found = self.order.map(|k| names[k]).join(", ");
                format!("{kind} {} are read from {found}", names.join(", "))
            }
        }
    }
}

impl Hypothesis {
    /// Whether two undo the same.
    pub fn is_same_change(&self, other: &Self) -> bool {
        self.change == other.change
    }

    /// The rows as they would be without the mistake, for the solver.
    #[must_use]
    pub fn applied<'a>(&self, problem: &Problem<'a>) -> Problem<'a> {
        let times = |matrix: &Matrix3<f64>, x: [f64; 3]| (matrix * Vector3::from(x)).into();
        let change = &self.change;
        let row = |row: &TrainRow| {
            let mut out = *row;
            let [z, rx, ry, ..] = row.slopes;
            let vertical: [f64; 3] = times(&change.vertical, [z, rx, ry]);
            out.slopes[..3].copy_from_slice(&vertical);
            out.signal_um = times(&change.signal, row.signal_um);
            out.reference_um = times(&change.reference, row.reference_um);
            out
        };
        Problem {
            rows: problem.rows.iter().map(row).collect(),
            groups: problem.groups.clone(),
            ..*problem
        }
    }
}

const NOTHING: Change = {
    let one = Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    Change {
        signal: one,
        reference: one,
        vertical: one,
    }
};

/// Mistakes with the Hall channels, with the beams and with the scales: what the planar pose shows.
pub fn planar(stage: &Stage) -> Vec<Hypothesis> {
    let mut out = Vec::new();
    let halls = ["A", "B", "C"];
    let beams = ["X", "Y1", "Y2"];
    let to_beams = beams_of_pose(stage.y_baseline_m);
    let to_pose = to_beams.try_inverse().unwrap_or_else(Matrix3::identity);
    for wiring in wirings() {
        let swapped = wiring.order != IN_ORDER;
        out.push(Hypothesis {
            code: if swapped {
                Code::ChannelsSwapped
            } else {
                Code::ChannelInverted
            },
            channel: channel("hall_", &wiring.moved(&halls)),
            cure: wiring.words("Hall", &halls),
            remedy: WIRES,
            factor: None,
            change: Change {
                signal: wiring.matrix(),
                ..NOTHING
            },
        });
        // All signs of the Hall channels turned look the same as all beams turned.
        if wiring.signs.iter().all(|sign| *sign < 0.0) {
            continue;
        }
        out.push(Hypothesis {
            code: if swapped {
                Code::BeamsSwapped
            } else {
                Code::BeamInverted
            },
            channel: channel("ifm_", &wiring.moved(&beams)),
            cure: wiring.words("beam", &beams),
            remedy: WIRES,
            factor: None,
            change: Change {
                reference: to_pose * wiring.matrix() * to_beams,
                ..NOTHING
            },
        });
    }
    out
}

/// The factors that scales are wrong by, as far as three probes of about the same gain show them.
pub fn scale(kind: Scale, factor: f64) -> Hypothesis {
    let all = Matrix3::from_diagonal_element(factor);
    let (cure, remedy, channel, change) = match kind {
        Scale::Reference => (
            "the reference is multiplied by",
            "check the units of its columns in the log",
            "ifm",
            Change {
                reference: all,
                ..NOTHING
            },
        ),
        Scale::Hall => (
            "the Hall signals are multiplied by",
            "check hall.m_per_count in stage.toml",
            "hall",
            Change {
                signal: all,
                ..NOTHING
            },
        ),
        Scale::Baseline => (
            "Rz of the reference is multiplied by",
            "check interferometer.y_baseline_m in stage.toml, and the unit of Rz if the log holds it",
            "rz",
            Change {
                reference: Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, factor)),
                ..NOTHING
            },
        ),
    };
    Hypothesis {
        code: Code::ScaleWrong,
        channel: Some(channel.to_owned()),
        cure: format!("{cure} {}", significant(factor)),
        remedy,
        factor: Some(factor),
        change,
    }
}

/// A scale that may be wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Of the whole reference.
    Reference,
    /// Of the Hall codes.
    Hall,
    /// The baseline, which is that of Rz.
    Baseline,
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

/// Mistakes with the capacitive sensors: what only the change of the sensitivity shows.
pub fn vertical(stage: &Stage) -> Vec<Hypothesis> {
    let mut out = Vec::new();
    let Some(to_pose) = gaps_of_pose(&stage.capacitive_probes_m).try_inverse() else {
        return out;
    };
    let to_gaps = gaps_of_pose(&stage.capacitive_probes_m);
    let names = ["1", "2", "3"];
    for wiring in wirings() {
        let swapped = wiring.order != IN_ORDER;
        out.push(Hypothesis {
            code: if swapped {
                Code::CapacitiveSwapped
            } else {
                Code::CapacitiveInverted
            },
            channel: channel("cap_", &wiring.moved(&names)),
            cure: wiring.words("capacitive", &names),
            remedy: SENSORS,
            factor: None,
            change: Change {
                vertical: to_pose * wiring.matrix() * to_gaps,
                ..NOTHING
            },
        });
    }
    for sensor in 0..3 {
        for (axis, name) in ["x", "y"].into_iter().enumerate() {
            let mut positions = stage.capacitive_probes_m;
            if positions[sensor][axis] == 0.0 {
                continue;
            }
            positions[sensor][axis] = -positions[sensor][axis];
            let Some(to_pose) = gaps_of_pose(&positions).try_inverse() else {
                continue;
            };
            out.push(Hypothesis {
                code: Code::CapacitiveInverted,
                channel: channel("cap_", &[names[sensor]]),
                cure: format!(
                    "the {name} of capacitive sensor {} in stage.toml is {} m",
                    names[sensor], positions[sensor][axis]
                ),
                remedy: "check probes_m in the table [capacitive] of stage.toml",
                factor: None,
                change: Change {
                    vertical: to_pose * to_gaps,
                    ..NOTHING
                },
            });
        }
    }
    out
}

/// All other orders of three channels, and all turned signs with the order kept.
fn wirings() -> impl Iterator<Item = Wiring> {
    let orders = ORDERS.into_iter().map(Wiring::ordered);
    let signs = (1..8).map(|bits: u32| {
        Wiring::signed([0, 1, 2].map(|k| if bits >> k & 1 == 1 { -1.0 } else { 1.0 }))
    });
    orders.chain(signs)
}

fn channel(prefix: &str, names: &[&str]) -> Option<String> {
    let names: Vec<String> = (names.iter())
        .map(|name| format!("{prefix}{}", name.to_lowercase()))
        .collect();
    Some(names.join(", "))
}

/// Beams X, Y1, Y2 of a pose X, Y, Rz.
fn beams_of_pose(baseline_m: f64) -> Matrix3<f64> {
    let half = 0.5 * baseline_m;
    Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, half, 0.0, 1.0, -half)
}

/// Gap changes 1, 2, 3 of a vertical pose Z, Rx, Ry: z + rx y - ry x.
fn gaps_of_pose(positions: &ProbePositions<f64>) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| {
        let [x, y] = positions[i];
        [1.0, y, -x][j]
    })
}

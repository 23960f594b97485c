//! The motions of a run: movements, each a trajectory at the servo rate.

use super::pose::StagePose;
use super::random::{Purpose, Stream};
use super::thermal::Climate;
use std::f64::consts::TAU;

/// The 19 vertical settings of Table 6: Z in um, Rx and Ry in urad.
pub const TABLE_6: [[f64; 3]; 19] = [
    [0.0, 0.0, 0.0],
    [250.0, 0.0, 0.0],
    [-250.0, 0.0, 0.0],
    [150.0, 0.0, 0.0],
    [-150.0, 0.0, 0.0],
    [50.0, 0.0, 0.0],
    [-50.0, 0.0, 0.0],
    [0.0, 500.0, 0.0],
    [0.0, -500.0, 0.0],
    [0.0, 250.0, 0.0],
    [0.0, -250.0, 0.0],
    [0.0, 100.0, 0.0],
    [0.0, -100.0, 0.0],
    [0.0, 0.0, 500.0],
    [0.0, 0.0, -500.0],
    [0.0, 0.0, 250.0],
    [0.0, 0.0, -250.0],
    [0.0, 0.0, 100.0],
    [0.0, 0.0, -100.0],
];

/// A named motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Protocol {
    /// The paper's: at the 19 settings of its Table 6, a sine along Y, X and Rz in turn.
    Paper,
    /// All six axes at once, 8 movements of 8 s.
    Combined,
    /// The same motion on other trajectories, with an exact zero of the interferometers.
    Service,
    /// A working day in 37 pieces, one every quarter of an hour: 0.4 s at rest for a re-zero, then 1 s of
    /// the combined motion.
    Day,
    /// Moves of 60 ms between random poses, up to 1.4 m/s2 along Y, with an exact zero of the interferometers.
    Fast,
}

/// One movement: the pose of every servo period between two resets of the interferometers.
pub type Trajectory = Vec<StagePose>;

/// A run of the stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// The movements.
    pub movements: Vec<Trajectory>,
    /// Whether the zero of the interferometers is exact. If not, every reset has an error.
    pub is_zero_exact: bool,
    /// Time from one movement's begin to the next, s; `None` if the movements follow without a pause.
    pub spacing_s: Option<f64>,
    /// The number of the run: runs of one stage with other numbers have other noise.
    pub number: u64,
}

/// Amplitudes of the paper's sines along X, Y (m) and Rz (rad).
const PAPER_AMPLITUDES: [f64; 3] = [300e-6, 500e-6, 300e-6];
/// Frequency (Hz) and length (s) of the paper's sines.
const PAPER_SINE: (f64, f64) = (1.0, 2.0);
/// Amplitudes of the combined motion: X, Y, Rz and Z, Rx, Ry, m and rad.
const COMBINED_AMPLITUDES: [[f64; 3]; 2] = [[250e-6, 400e-6, 250e-6], [120e-6, 240e-6, 240e-6]];
/// Range of the frequencies of the combined motion, Hz, as in the given logs.
const COMBINED_HZ: [f64; 2] = [0.3, 2.0];
const COMBINED_MOVEMENTS: usize = 8;
const COMBINED_S: f64 = 8.0;
/// Time of a move of the fast motion and of the rest after it, s.
const FAST_S: [f64; 2] = [0.06, 0.02];
const DAY_MOVEMENTS: usize = 37;
const DAY_SPACING_S: f64 = 900.0;
/// Time at rest and of motion of a piece of the day, s.
const DAY_PIECE_S: [f64; 2] = [REST_S, 1.0];
/// Time at rest before each movement of the day, s.
pub const REST_S: f64 = 0.4;

/// Numbers of planned runs begin here.
const PLANNED_FROM: u64 = 256;

impl Protocol {
    /// The run of this protocol for a seed; the paper's protocol does not depend on the seed.
    pub fn run(self, servo_period_s: f64, seed: u64) -> Run {
        let number = self as u64;
        let movements = match self {
            Self::Paper => paper(servo_period_s),
            Self::Combined | Self::Service => {
                let mut random = Stream::new(seed, Purpose::Motion, number);
                let movement = |_| combined(servo_period_s, COMBINED_S, &mut random);
                (0..COMBINED_MOVEMENTS).map(movement).collect()
            }
            Self::Fast => {
                let mut random = Stream::new(seed, Purpose::Motion, number);
                let movement = |_| fast(servo_period_s, COMBINED_S, &mut random);
                (0..COMBINED_MOVEMENTS).map(movement).collect()
            }
            Self::Day => {
                let mut random = Stream::new(seed, Purpose::Motion, number);
                let [rest_s, motion_s] = DAY_PIECE_S;
                let rest = trajectory(servo_period_s, rest_s, |_| StagePose::default());
                let movement = |_| {
                    let motion = combined(servo_period_s, motion_s, &mut random);
                    [rest.as_slice(), &motion].concat()
                };
                (0..DAY_MOVEMENTS).map(movement).collect()
            }
        };
        Run {
            movements,
            is_zero_exact: matches!(self, Self::Service | Self::Fast),
            spacing_s: (self == Self::Day).then_some(DAY_SPACING_S),
            number,
        }
    }
}

impl Run {
    /// A planned run: one movement. Its number follows from its poses, so that other plans have other
    /// noise.
    pub fn planned(trajectory: Trajectory) -> Self {
        let numbers = trajectory.iter().flat_map(StagePose::to_array);
        let number = hashed(numbers.map(f64::to_bits));
        Self {
            movements: vec![trajectory],
            is_zero_exact: false,
            spacing_s: None,
            number,
        }
    }

    /// The run in a climate, with a number of its own.
    pub(super) fn in_climate(self, climate: &Climate) -> Self {
        let number = hashed([self.number, climate.number()].into_iter());
        Self { number, ..self }
    }
}

/// The number of a run from these words (FNV-1a).
fn hashed(words: impl Iterator<Item = u64>) -> u64 {
    let hash = words.fold(0xcbf2_9ce4_8422_2325, |hash: u64, word| {
        (hash ^ word).wrapping_mul(0x0100_0000_01b3)
    });
    // The stream of a run has room for 56 bits. The first numbers are the protocols'.
    PLANNED_FROM + (hash >> 16)
}

/// A movement of this length; `pose` gets the time in s.
fn trajectory(servo_period_s: f64, length_s: f64, pose: impl Fn(f64) -> StagePose) -> Trajectory {
    let rows = (length_s / servo_period_s).round() as usize;
    (0..rows).map(|k| pose(k as f64 * servo_period_s)).collect()
}

fn paper(servo_period_s: f64) -> Vec<Trajectory> {
    let (frequency_hz, length_s) = PAPER_SINE;
    let settings = TABLE_6.iter();
    settings
        .flat_map(|setting| [1, 0, 2].map(|axis| (setting.map(|x| x * 1e-6), axis)))
        .map(|(vertical, axis)| {
            trajectory(servo_period_s, length_s, |t| {
                let mut planar = [0.0; 3];
                planar[axis] = PAPER_AMPLITUDES[axis] * libm::sin(TAU * frequency_hz * t);
                StagePose { planar, vertical }
            })
        })
        .collect()
}

/// A sine along each axis, with a drawn frequency and phase, from the initial pose.
fn combined(servo_period_s: f64, length_s: f64, random: &mut Stream) -> Trajectory {
    let [low, high] = COMBINED_HZ;
    let waves = COMBINED_AMPLITUDES.map(|amplitudes| {
        amplitudes.map(|amplitude| (amplitude, random.between(low, high), TAU * random.uniform()))
    });
    trajectory(servo_period_s, length_s, |t| {
        let [planar, vertical] = waves.map(|axes| {
            axes.map(|(amplitude, frequency_hz, phase)| {
                amplitude * (libm::sin(TAU * frequency_hz * t + phase) - libm::sin(phase))
            })
        });
        StagePose { planar, vertical }
    })
}

/// Moves from pose to pose within the combined amplitudes, from the initial pose. The acceleration of a move
/// is one period of a sine.
fn fast(servo_period_s: f64, length_s: f64, random: &mut Stream) -> Trajectory {
    let [move_s, rest_s] = FAST_S;
    let each_s = move_s + rest_s;
    let amplitudes = COMBINED_AMPLITUDES.as_flattened();
    let mut pose = |k| {
        let to = |axis: usize| amplitudes[axis] * random.between(-1.0, 1.0);
        let drawn: [f64; 6] = std::array::from_fn(to);
        if k == 0 { [0.0; 6] } else { drawn }
    };
    let poses: Vec<[f64; 6]> = (0..=(length_s / each_s) as usize + 1)
        .map(&mut pose)
        .collect();
    trajectory(servo_period_s, length_s, |t| {
        let k = (t / each_s) as usize;
        let x = ((t - k as f64 * each_s) / move_s).min(1.0);
        let part = x - libm::sin(TAU * x) / TAU;
        let at = |axis: usize| poses[k][axis] + part * (poses[k + 1][axis] - poses[k][axis]);
        StagePose::from_array(std::array::from_fn(at))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_paper_s_run_is_57_movements_that_each_move_one_planar_axis() {
        let run = Protocol::Paper.run(0.002, 1);
        assert_eq!(run.movements.len(), 57);
        for (m, poses) in run.movements.iter().enumerate() {
            assert_eq!(poses.len(), 1000);
            let axis = [1, 0, 2][m % 3];
            for pose in poses {
                assert_eq!(pose.vertical, TABLE_6[m / 3].map(|x| x * 1e-6));
                assert!((0..3).all(|i| i == axis || pose.planar[i] == 0.0));
            }
            // A quarter of a period after the start.
            assert_eq!(poses[125].planar[axis], PAPER_AMPLITUDES[axis]);
        }
    }

    /// The longest move of Y: 0.8 mm in 60 ms, 2 pi d / T^2.
    #[test]
    fn fast_moves_reach_four_times_their_rms_acceleration() {
        const PERIOD_S: f64 = 0.002;
        for poses in Protocol::Fast.run(PERIOD_S, 1).movements {
            assert_eq!((poses.len(), poses[0]), (4000, StagePose::default()));
            let (mut peak, mut square) = (0.0f64, 0.0);
            for three in poses.windows(3) {
                let [a, b, c] = [0, 1, 2].map(|k| three[k].planar[1]);
                let acceleration = (c - 2.0 * b + a) / (PERIOD_S * PERIOD_S);
                peak = peak.max(acceleration.abs());
                square += acceleration * acceleration / (poses.len() - 2) as f64;
            }
            assert!((1.0..1.4).contains(&peak), "{peak}");
            let ratio = peak / square.sqrt();
            assert!((3.0..4.5).contains(&ratio), "{ratio}");
        }
    }
}

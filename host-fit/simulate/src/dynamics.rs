//! What motion does to the probes: lag, the stray field of motor coils, arms that bend.
//!
//! | effect | physics |
//! |---|---|
//! | lag tau | a reading at t belongs to the pose at t - tau |
//! | coil | a motor near each probe, along X, Y or Z, pushes `MASS_KG` with the acceleration there; the moment of its coil follows its force, the field is a dipole's |
//! | arm | the probe is a mass on three springs: x'' + 2 zeta w x' + w^2 x = -a, w = 2 pi f |
//!
//! Places and polarities of the coils and resonances of the arms are drawn for a stage. One motor is along
//! X, one along Y, one along Z. All directions are the framework's: the stage turns by less than 1 mrad.

use super::pose::StagePose;
use super::probe::REMANENCE_T;
use super::random::{Purpose, Stream};
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::TAU;

/// Mass that each motor moves, kg: a signal follows by 7 um per m/s2 at 5 cm.
const MASS_KG: f64 = 7.0;
/// Moment of a coil over its force, A m2/N: 200 turns of 2 cm radius, 20 N/A.
const MOMENT_A_M2_PER_N: f64 = 0.0126;
/// mu0 / (4 pi), T m/A.
const MU0_OVER_4_PI: f64 = 1e-7;
/// Direction from a probe to a coil along X, Y, Z, and how far each component is drawn from it.
const TO_COIL: [[f64; 3]; 3] = [[0.7, 0.0, 0.7], [0.0, 0.7, 0.7], [0.7, 0.7, 0.0]];
const TO_COIL_WITHIN: f64 = 0.3;
/// Resonances of the arms over the given one, and their damping.
const RESONANCES: [f64; 2] = [0.85, 1.15];
const DAMPING: f64 = 0.02;

/// The effects of motion on the probes A, B, C of a stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionEffects {
    /// Lag of each probe, s; positive for a late probe.
    pub lag_s: [f64; 3],
    /// Field of the coil at each probe over the acceleration there, designed remanences per m/s2.
    pub coil_per_m_s2: [Matrix3<f64>; 3],
    /// Resonances of each arm along X, Y, Z, Hz; infinite for a rigid arm.
    pub arm_hz: [[f64; 3]; 3],
}

/// A probe at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moving {
    /// The pose of the stage at the instant of the reading.
    pub pose: StagePose,
    /// Displacement of the probe from its place on the stage, m.
    pub bend_m: Vector3<f64>,
    /// Stray field, designed remanences.
    pub stray: Vector3<f64>,
}

impl Moving {
    /// A probe that only the pose moves.
    pub fn at(pose: &StagePose) -> Self {
        Self {
            pose: *pose,
            bend_m: Vector3::zeros(),
            stray: Vector3::zeros(),
        }
    }
}

impl MotionEffects {
    /// No effects.
    pub const NONE: Self = Self {
        lag_s: [0.0; 3],
        coil_per_m_s2: [Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0); 3],
        arm_hz: [[f64::INFINITY; 3]; 3],
    };

    /// The effects for the stage of a seed: a coil at this distance from each probe (m), arms with
    /// resonances about this one (Hz); none where it is `None`.
    pub fn draw(lag_s: [f64; 3], coil_m: Option<f64>, arm_hz: Option<f64>, seed: u64) -> Self {
        let mut random = Stream::new(seed, Purpose::Dynamics, 0);
        let mut effects = Self {
            lag_s,
            ..Self::NONE
        };
        let first = (3.0 * random.uniform()) as usize;
        for probe in 0..3 {
            let axis = (first + probe) % 3;
            let to = TO_COIL[axis].map(|x| x + random.between(-TO_COIL_WITHIN, TO_COIL_WITHIN));
            let polarity = if random.uniform() < 0.5 { -1.0 } else { 1.0 };
            if let Some(distance_m) = coil_m {
                let from_coil_m = Vector3::from(to).normalize() * -distance_m;
                let mut moment = Vector3::zeros();
                moment[axis] = polarity * MASS_KG * MOMENT_A_M2_PER_N;
                let field = dipole_t(moment, from_coil_m) / REMANENCE_T;
                effects.coil_per_m_s2[probe].set_column(axis, &field);
            }
            let mut resonance_hz = |hz: f64| hz * random.between(RESONANCES[0], RESONANCES[1]);
            effects.arm_hz[probe] = [arm_hz.unwrap_or(f64::INFINITY); 3].map(&mut resonance_hz);
        }
        effects
    }
}

/// Flux density of a magnetic moment (A m2) at a place from it, T.
fn dipole_t(moment: Vector3<f64>, at_m: Vector3<f64>) -> Vector3<f64> {
    let (distance_m, to) = (at_m.norm(), at_m.normalize());
    (to * (3.0 * to.dot(&moment)) - moment) * (MU0_OVER_4_PI / libm::pow(distance_m, 3.0))
}

/// A probe through a movement, row by row.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    lag_rows: f64,
    period_s: f64,
    coil_per_m_s2: Matrix3<f64>,
    arms: [Arm; 3],
    last: Option<Vector3<f64>>,
}

impl Motion {
    /// Probe 0, 1 or 2 at the begin of a movement with rows every `period_s`.
    pub fn new(dynamics: &MotionEffects, probe: usize, period_s: f64) -> Self {
        Self {
            lag_rows: dynamics.lag_s[probe] / period_s,
            period_s,
            coil_per_m_s2: dynamics.coil_per_m_s2[probe],
            arms: dynamics.arm_hz[probe].map(|hz| Arm {
                rate: TAU * hz,
                at: [0.0; 2],
            }),
            last: None,
        }
    }

    /// The probe at `place_m` of the stage in row `k` of the movement; the rows come one by one.
    pub fn next(&mut self, poses: &[StagePose], k: usize, place_m: Vector3<f64>) -> Moving {
        let at = |k: usize| pose_between(poses, k as f64 - self.lag_rows);
        let place = |k: usize| {
            let pose = at(k);
            pose.rotation() * place_m + pose.position_m()
        };
        let mut now = Vector3::zeros();
        if let Some(last) = poses.len().checked_sub(2).filter(|last| *last > 0) {
            // The first and the last row have the acceleration of their neighbours.
            let k = k.clamp(1, last);
            let change_m = (place(k + 1) - place(k)) - (place(k) - place(k - 1));
            now = change_m / (self.period_s * self.period_s);
        }
        let pose = at(k);
        let before = self.last.replace(now);
        let mut bend_m = Vector3::zeros();
        for (axis, arm) in self.arms.iter_mut().enumerate() {
            let before = before.map(|acceleration| acceleration[axis]);
            bend_m[axis] = arm.next(before, now[axis], self.period_s);
        }
        Moving {
            pose,
            bend_m,
            stray: self.coil_per_m_s2 * now,
        }
    }
}

/// The end of an arm along one axis.
#[derive(Clone, Copy, Debug)]
struct Arm {
    /// 2 pi times its resonance, 1/s; infinite for a rigid arm.
    rate: f64,
    /// Displacement (m) and speed (m/s).
    at: [f64; 2],
}

impl Arm {
    /// The displacement (m) a period after the acceleration of the stage was `before`, m/s2, which changes
    /// steadily to `now`: exact. Without `before` the arm is at rest under `now`.
    fn next(&mut self, before: Option<f64>, now: f64, period_s: f64) -> f64 {
        let w = self.rate;
        if w.is_infinite() {
            return 0.0;
        }
        let Some(before) = before else {
            self.at = [-now / (w * w), 0.0];
            return self.at[0];
        };
        // A particular solution, linear in time, and the free oscillation about it.
        let slope = (before - now) / (w * w * period_s);
        let begin = -before / (w * w) - 2.0 * DAMPING / w * slope;
        let free = [self.at[0] - begin, self.at[1] - slope];
        let (decay, ringing) = (DAMPING * w, w * libm::sqrt(1.0 - DAMPING * DAMPING));
        let (sin, cos) = libm::sincos(ringing * period_s);
        let left = libm::exp(-decay * period_s);
        self.at = [
            begin
                + slope * period_s
                + left * (free[0] * cos + (free[1] + decay * free[0]) / ringing * sin),
            slope + left * (free[1] * cos - (w * w * free[0] + decay * free[1]) / ringing * sin),
        ];
        self.at[0]
    }
}

/// The pose at a row that need not be whole, by a cubic through four rows (0.2 nm at 9 Hz and 40 um, rows of
/// 2 ms). Before the first and after the last row the motion goes on.
fn pose_between(poses: &[StagePose], row: f64) -> StagePose {
    let count = poses.len().min(4);
    // The cast saturates at 0.
    let first = ((row.floor() - 1.0) as usize).min(poses.len() - count);
    let mut sum = [0.0; 6];
    for (j, pose) in (first..).zip(&poses[first..first + count]) {
        let others = (first..first + count).filter(|&i| i != j);
        let weight: f64 = others
            .map(|i| (row - i as f64) / (j as f64 - i as f64))
            .product();
        for (sum, x) in sum.iter_mut().zip(pose.to_array()) {
            *sum += weight * x;
        }
    }
    StagePose::from_array(sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assembly::Assembly;
    use crate::protocol::{Protocol, Run, Trajectory};
    use crate::recording::{Recording, record};
    use crate::sensors::SensorErrors;
    use hallstage_input::shipped::stage;

    const PERIOD_S: f64 = 0.002;

    /// Signals of the stage of seed 3 without noise, in codes, with these effects.
    fn recorded(trajectory: Trajectory, dynamics: MotionEffects) -> Recording {
        let errors = SensorErrors {
            dynamics,
            ..SensorErrors::NONE
        };
        let run = Run::planned(trajectory);
        record(&stage(), &Assembly::draw(&stage(), 3), run, &errors, 3).expect("clear")
    }

    fn sine(axis: usize, amplitude: f64, hz: f64) -> Trajectory {
        let pose = |k: i32| {
            let mut pose = [0.0; 6];
            pose[axis] = amplitude * libm::sin(TAU * hz * f64::from(k) * PERIOD_S);
            StagePose::from_array(pose)
        };
        (0..1000).map(pose).collect()
    }

    #[test]
    fn a_late_probe_reads_now_what_it_would_have_read_before() {
        let trajectory = Protocol::Service.run(PERIOD_S, 3).movements.swap_remove(0);
        let dynamics = MotionEffects::draw([PERIOD_S, -PERIOD_S, 0.4 * PERIOD_S], None, None, 3);
        let [late, sound] = [dynamics, MotionEffects::NONE]
            .map(|d| recorded(trajectory.clone(), d).movements.concat());
        for k in 2..late.len() - 2 {
            let [before, now, after] = [k - 1, k, k + 1].map(|k| sound[k].hall);
            assert_eq!(late[k].hall[..2], [before[0], after[1]]);
            let between = 0.6 * f64::from(now[2]) + 0.4 * f64::from(before[2]);
            assert!((f64::from(late[k].hall[2]) - between).abs() < 1.5, "{k}");
            assert_eq!(late[k].capacitive, sound[k].capacitive);
        }
    }

    /// A driven oscillator: -a / (w^2 - r^2) at the rate r; far below the resonance -a / w^2.
    #[test]
    fn an_arm_follows_the_acceleration_as_an_oscillator() {
        for (hz, resonance_hz) in [(1.0, 120.0), (8.0, 120.0), (8.0, 40.0)] {
            let [w, r] = [resonance_hz, hz].map(|f| TAU * f);
            let mut arm = Arm {
                rate: w,
                at: [0.0; 2],
            };
            let acceleration = |k: i32| libm::cos(r * f64::from(k) * PERIOD_S);
            let mut bend = arm.next(None, 1.0, PERIOD_S);
            // Past 20 time constants of the damping only the driven motion is left.
            for k in 1..4000 {
                bend = arm.next(Some(acceleration(k - 1)), acceleration(k), PERIOD_S);
                let driven = -acceleration(k) / (w * w - r * r);
                let tolerance = 0.01 / (w * w);
                assert!(
                    k < 2500 || (bend - driven).abs() < tolerance,
                    "{hz}: {bend} {driven}"
                );
            }
            assert!(bend.abs() < 1.1 / (w * w - r * r));
        }
    }

    #[test]
    fn a_released_arm_rings_at_its_resonance_and_decays() {
        let mut arm = Arm {
            rate: TAU * 25.0,
            at: [1e-6, 0.0],
        };
        let rings: Vec<f64> = (0..200)
            .map(|_| arm.next(Some(0.0), 0.0, PERIOD_S))
            .collect();
        // A period is 20 rows.
        let expected = libm::exp(-DAMPING * TAU);
        for k in [19, 39, 59] {
            let ratio = rings[k + 20] / rings[k];
            assert!((ratio / expected - 1.0).abs() < 1e-2, "{ratio}");
        }
    }

    #[test]
    fn the_field_of_a_coil_is_that_of_a_current_loop_seen_from_afar() {
        let (moment, z) = (Vector3::new(0.0, 0.0, 0.14), 0.3);
        let on_axis = dipole_t(moment, Vector3::new(0.0, 0.0, z));
        // mu0 I R^2 / (2 (R^2 + z^2)^(3/2)), with the moment pi R^2 I.
        let radius: f64 = 0.02;
        let squares = radius * radius + z * z;
        let in_loop = 2.0 * MU0_OVER_4_PI * moment.z / squares.powf(1.5);
        assert!((on_axis.z / in_loop - 1.0).abs() < 0.01);
        let beside = dipole_t(moment, Vector3::new(z, 0.0, 0.0));
        assert!((beside.z / on_axis.z + 0.5).abs() < 1e-12);
    }

    #[test]
    fn a_coil_at_5_cm_shifts_a_signal_by_7_um_per_m_s2_and_at_10_cm_by_an_eighth() {
        let (amplitude, hz) = (300e-6, 8.0);
        let (rate_squared, m_per_count) = ((TAU * hz) * (TAU * hz), stage().hall.m_per_count);
        let [near, far] = [0.05, 0.1].map(|coil_m| {
            let dynamics = MotionEffects::draw([0.0; 3], Some(coil_m), None, 3);
            let mut largest = [0.0f64; 3];
            for axis in [0, 1, 3] {
                let trajectory = sine(axis, amplitude, hz);
                let [moved, sound] = [dynamics, MotionEffects::NONE]
                    .map(|d| recorded(trajectory.clone(), d).movements.concat());
                for (probe, largest) in largest.iter_mut().enumerate() {
                    let (mut product, mut square) = (0.0, 0.0);
                    for (k, pose) in trajectory.iter().enumerate() {
                        let acceleration = -rate_squared * pose.to_array()[axis];
                        let codes = moved[k].hall[probe] - sound[k].hall[probe];
                        product += acceleration * f64::from(codes) * m_per_count;
                        square += acceleration * acceleration;
                    }
                    *largest = largest.max((product / square).abs());
                }
            }
            largest
        });
        for (near, far) in near.into_iter().zip(far) {
            assert!((4e-6..10e-6).contains(&near), "{near}");
            assert!((near / far - 8.0).abs() < 0.3, "{near} {far}");
        }
    }
}

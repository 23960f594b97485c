//! The tick beside plain comparisons, over any words as parameters.

use super::tests::{changed, frame, words};
use super::*;
use crate::model::{Sensitivity, apply_gain, planar_pose, sensitivity_at};

/// What the table of [`Status`] says, by plain comparisons.
fn expected(
    decoder: &Decoder<LinearModel>,
    hall: [i32; 3],
    capacitive: [i32; 3],
    zero: &PlanarPose<f32>,
) -> Reading {
    let c = decoder.constants();
    let v = vertical_pose(&c.vertical_per_code, capacitive.map(|code| code as f32));
    let phi = decoder
        .probes()
        .map(|s| apply_gain(sensitivity_at(&s, &v), 0.0));
    let q = planar_pose(&c.planar_per_code, hall.map(|code| code as f32), phi, zero);
    let not_finite = |x: &f32| !x.is_finite();
    let beyond = |x: [f32; 3], limits: [f32; 3]| {
        let over = |(x, limit): (f32, f32)| {
            // A limit of NaN lets everything pass but what is no number.
            let within = x.abs() <= limit.abs() || limit.is_nan() && !x.is_nan();
            !within
        };
        x.into_iter().zip(limits).any(over)
    };
    let least = if c.sensitivity_min.is_finite() {
        c.sensitivity_min.abs()
    } else {
        f32::MAX
    };
    let mut status = 0;
    for k in 0..3 {
        status |= u32::from(!c.hall_window.contains(hall[k])) << k;
        status |= u32::from(!c.capacitive_window.contains(capacitive[k])) << (3 + k);
        status |= u32::from(!(phi[k].abs() >= least && phi[k].is_finite())) << (6 + k);
    }
    status |= u32::from(q.to_array().iter().any(not_finite)) << 9;
    status |= u32::from(v.to_array().iter().any(not_finite)) << 10;
    status |= u32::from(beyond(v.to_array(), c.calibrated_vertical)) << 11;
    status |= u32::from(beyond(q.to_array(), c.calibrated_planar)) << 12;
    let planar_bad = status & 0b111_1111_1111 != 0;
    let vertical_bad = status & 0b100_0011_1000 != 0;
    status |= u32::from(planar_bad) << 13 | u32::from(vertical_bad) << 14;
    Reading {
        pose: Pose {
            planar: if planar_bad { PlanarPose::ZERO } else { q },
            vertical: if vertical_bad { VerticalPose::ZERO } else { v },
        },
        status: Status::from_bits(status),
    }
}

/// A plain pseudo-random sequence (xorshift).
struct Words(u32);

impl Words {
    fn next(&mut self) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        self.0
    }

    /// Any word, or one of a kind that arithmetic handles apart.
    fn odd(&mut self) -> f32 {
        let fraction = self.next() & 0x7f_ffff;
        let sign = self.next() & (1 << 31);
        f32::from_bits(match self.next() % 6 {
            0 => self.next(),
            1 => sign | fraction,
            2 => sign | f32::INFINITY.to_bits(),
            3 => sign | f32::INFINITY.to_bits() | fraction.max(1),
            4 => sign | (f32::MAX.to_bits() - fraction),
            _ => sign | (1f32.to_bits() + fraction),
        })
    }

    fn odd3(&mut self) -> [f32; 3] {
        [self.odd(), self.odd(), self.odd()]
    }
}

/// With random words as parameters no pose is NaN, invalid fields are zero, and every status bit
/// equals the plain comparison.
#[test]
fn any_words_as_parameters_give_defined_poses() {
    let mut w = Words(0x2545_f491);
    for round in 0..20_000 {
        let decoder = changed(|c, probes| {
            for _ in 0..1 + round % 5 {
                match w.next() % 6 {
                    0 => c.vertical_per_code[round % 3] = w.odd3(),
                    1 => c.planar_per_code[round % 3] = w.odd3(),
                    2 => c.calibrated_planar = w.odd3(),
                    3 => c.calibrated_vertical = w.odd3(),
                    4 => c.sensitivity_min = w.odd(),
                    _ => {
                        let [eta, per_z_m, per_rx_rad] = w.odd3();
                        let s = Sensitivity {
                            eta,
                            per_z_m,
                            per_rx_rad,
                            per_ry_rad: w.odd(),
                        };
                        probes[round % 3] = s;
                    }
                }
            }
            if round % 7 == 0 {
                c.hall_window = CodeWindow {
                    low: w.next() as i32,
                    high: w.next() as i32,
                };
            }
        });
        let zero = if round % 3 == 0 {
            PlanarPose::from_array(w.odd3())
        } else {
            PlanarPose::ZERO
        };
        let codes = |w: &mut Words| match w.next() % 8 {
            0 => w.next() as i32,
            _ => w.next() as i32 >> 16,
        };
        let hall = [codes(&mut w), codes(&mut w), codes(&mut w)];
        let capacitive = [codes(&mut w), codes(&mut w), codes(&mut w)];
        let reading = decoder.decode(&frame(hall, capacitive), &zero);
        let want = expected(&decoder, hall, capacitive, &zero);
        assert_eq!(
            words(&reading),
            words(&want),
            "round {round}: {:?}",
            decoder.constants()
        );
        let q = reading.pose.planar.to_array();
        let v = reading.pose.vertical.to_array();
        assert!(q.iter().chain(&v).all(|x| x.is_finite()));
    }
}

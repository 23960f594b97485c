//! A Hall probe on the stage over its magnet on the framework.
//!
//! The long edge of the magnet lies along the sensing axis u, and the magnet is magnetised along it.
//! The probe is `gap` above the upper face and senses the vertical flux. This flux is zero over the
//! middle of the magnet and proportional to u. (A magnet that is magnetised upwards under a probe
//! that senses along u gives the same signal, since the matrix N of [`super::magnet`] is symmetric.)
//! When the stage tilts, the probe also senses some of the flux along u, as if the probe were
//! [`TILT_LEVER_M`] lower.

use super::dynamics::Moving;
use super::magnet::Cuboid;
use super::pose::StagePose;
use nalgebra::{Matrix3, Vector3};

/// Half the edges of the designed magnet, 12.7 x 6.4 x 6.4 mm (section 2 of the paper), m.
pub const MAGNET_HALF_M: Vector3<f64> = Vector3::new(6.35e-3, 3.2e-3, 3.2e-3);

/// Remanence of the designed magnet, T.
pub const REMANENCE_T: f64 = 1.3;

/// Distance of the designed probe from the magnet's upper face, m. The paper does not state it. With
/// 4.0 mm the slope falls with height as in the given logs, by 215 to 237 per m at sensitivities of 0.93
/// to 0.67.
pub const DESIGNED_GAP_M: f64 = 4.0e-3;

/// Flux along u over slope of the vertical flux, m: 4.5 to 4.6 mm at any gap from 4 to 6 mm.
pub const TILT_LEVER_M: f64 = 4.54e-3;

/// Range of gaps, m. The slope falls steadily with the gap there.
const GAPS_M: [f64; 2] = [2.0e-3, 12.0e-3];

/// One probe with its magnet, as assembled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HallProbe {
    /// The probe in the coordinates of the stage, m; Z from the plane of the centroid.
    pub position_m: Vector3<f64>,
    /// The sensing direction in the coordinates of the stage; (0, 0, 1) as designed.
    pub axis: Vector3<f64>,
    /// The probe at rest in the coordinates u (sensed), w (across), v (up) of the magnet's mount, from
    /// the middle of the designed magnet, m.
    pub at_rest_m: Vector3<f64>,
    /// Turns u, w, v into the framework.
    pub mount: Matrix3<f64>,
    /// Turns directions of the magnet's edges into u, w, v.
    pub seat: Matrix3<f64>,
    /// The magnet; its remanence in units of the designed remanence.
    pub magnet: Cuboid,
    /// Curvature of the element: a reading s becomes s (1 + k2 s + k3 s^2), 1/m and 1/m^2.
    pub curvature: [f64; 2],
}

/// The effect of temperature on a probe and its magnet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThermalChange {
    /// Remanence over the remanence before.
    pub remanence: f64,
    /// Relative expansion of the stage.
    pub body: f64,
    /// Relative expansion of the framework.
    pub frame: f64,
    /// Growth of the gap by the mounts of probe and magnet, m.
    pub gap_m: f64,
    /// Gain of the Hall element.
    pub gain: f64,
    /// Signal of the Hall element without a field, in units of the designed remanence.
    pub offset: f64,
}

/// A probe with a trimmed amplifier: its signal is zero at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrimmedProbe {
    probe: HallProbe,
    rest_flux: f64,
    flux_per_m: f64,
    /// Gain of the Hall element, and its signal without a field in units of the flux.
    element: [f64; 2],
}

impl HallProbe {
    /// Moves the probe along u to zero flux at rest.
    pub fn centre(&mut self) {
        let slope_per_m = slope_per_m(self.at_rest_m.z - MAGNET_HALF_M.z);
        // Newton's steps with a slope that is right to a few per cent.
        for _ in 0..8 {
            self.at_rest_m.x -= self.flux_at_rest() / slope_per_m;
        }
    }

    /// Trims the amplifier at rest, with the gain for the slope of the designed magnet.
    pub fn trimmed(self) -> TrimmedProbe {
        TrimmedProbe {
            probe: self,
            rest_flux: self.flux_at_rest(),
            flux_per_m: slope_per_m(DESIGNED_GAP_M),
            element: [1.0, 0.0],
        }
    }

    fn in_mount_m(&self, Moving { pose, bend_m, .. }: &Moving) -> Vector3<f64> {
        let moved = pose.rotation() * self.position_m - self.position_m + pose.position_m();
        self.at_rest_m + self.mount.tr_mul(&(moved + bend_m))
    }

    /// Flux density that the probe senses, in units of the designed magnet's remanence.
    fn flux(&self, moving: &Moving) -> f64 {
        let field = self
            .magnet
            .field(self.seat.tr_mul(&self.in_mount_m(moving)));
        let axis = moving.pose.rotation() * self.axis;
        axis.dot(&(self.mount * (self.seat * field) + moving.stray))
    }

    fn flux_at_rest(&self) -> f64 {
        self.flux(&Moving::at(&StagePose::default()))
    }
}

impl TrimmedProbe {
    /// The signal at a pose, at the designed scale, m.
    pub fn signal_m(&self, pose: &StagePose) -> f64 {
        self.moving_signal_m(&Moving::at(pose))
    }

    /// The signal of the moving probe, at the designed scale, m.
    pub fn moving_signal_m(&self, moving: &Moving) -> f64 {
        let [gain, offset] = self.element;
        let flux = gain * self.probe.flux(moving) + offset;
        let s = (flux - self.rest_flux) / self.flux_per_m;
        let [k2, k3] = self.probe.curvature;
        s * (1.0 + s * (k2 + s * k3))
    }

    /// The probe after its signal changed by the factor `gain`, by age of magnet or amplifier.
    #[must_use]
    pub fn with_gain(mut self, gain: f64) -> Self {
        self.flux_per_m /= gain;
        self
    }

    /// The probe at another temperature, with the amplifier as trimmed.
    #[must_use]
    pub fn warmed(mut self, change: &ThermalChange) -> Self {
        self.probe.magnet.remanence *= change.remanence;
        // Stage and framework grow about the origin, the middle of the interferometers.
        let moved = self.probe.position_m * (change.body - change.frame);
        self.probe.position_m *= 1.0 + change.body;
        self.probe.at_rest_m += self.probe.mount.tr_mul(&moved);
        self.probe.at_rest_m.z += change.gap_m;
        self.element = [change.gain, change.offset];
        self
    }

    /// The probe after it was taken off and put back `moved_m` farther along u, w, v, with its
    /// amplifier trimmed to zero again.
    #[must_use]
    pub fn reseated(mut self, moved_m: Vector3<f64>) -> Self {
        self.probe.at_rest_m += moved_m;
        self.probe.position_m += self.probe.mount * moved_m;
        self.rest_flux = self.probe.flux_at_rest();
        self
    }

    /// Place of the probe on the stage, m.
    pub const fn place_m(&self) -> Vector3<f64> {
        self.probe.position_m
    }

    /// Whether the probe is free of its magnet at a pose.
    pub fn is_clear(&self, pose: &StagePose) -> bool {
        self.probe.in_mount_m(&Moving::at(pose)).z > self.probe.magnet.half_m.z
    }
}

/// The magnet as designed.
pub const fn designed_magnet() -> Cuboid {
    Cuboid {
        half_m: MAGNET_HALF_M,
        remanence: Vector3::new(1.0, 0.0, 0.0),
    }
}

/// Slope of the vertical flux along u over the middle of the designed magnet, 1/m.
fn slope_per_m(gap_m: f64) -> f64 {
    const STEP_M: f64 = 1e-6;
    let at = Vector3::new(STEP_M, 0.0, MAGNET_HALF_M.z + gap_m);
    // The field is odd in u.
    designed_magnet().field(at).z / STEP_M
}

/// The gap for a share of the designed sensitivity, over the designed magnet, m; within 2 to 12 mm.
pub fn gap_m(sensitivity: f64) -> f64 {
    let [mut near, mut far] = GAPS_M;
    let wanted = sensitivity * slope_per_m(DESIGNED_GAP_M);
    // 10 mm halved 40 times is far below any tolerance.
    for _ in 0..40 {
        let middle = 0.5 * (near + far);
        if slope_per_m(middle) > wanted {
            near = middle;
        } else {
            far = middle;
        }
    }
    near
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Probe A of the paper, which senses Y, with a gap for this sensitivity.
    fn probe(sensitivity: f64) -> TrimmedProbe {
        HallProbe {
            position_m: Vector3::new(0.1975, 0.4, TILT_LEVER_M),
            axis: Vector3::z(),
            at_rest_m: Vector3::new(0.0, 0.0, MAGNET_HALF_M.z + gap_m(sensitivity)),
            mount: Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0),
            seat: Matrix3::identity(),
            magnet: designed_magnet(),
            curvature: [0.0; 2],
        }
        .trimmed()
    }

    fn at(planar: [f64; 3], vertical: [f64; 3]) -> StagePose {
        StagePose { planar, vertical }
    }

    #[test]
    fn the_signal_is_the_displacement_times_the_sensitivity() {
        for sensitivity in [0.67, 0.84, 1.0] {
            let probe = probe(sensitivity);
            for step in [-50e-6, 50e-6] {
                let along = probe.signal_m(&at([0.0, step, 0.0], [0.0; 3]));
                assert!(
                    (along / step - sensitivity).abs() < 1e-4,
                    "{}",
                    along / step
                );
                let by_turning = probe.signal_m(&at([0.0, 0.0, step], [0.0; 3]));
                assert!((by_turning / step - 0.1975 * sensitivity).abs() < 1e-4);
                let across = probe.signal_m(&at([step, 0.0, 0.0], [0.0; 3]));
                assert!(across.abs() < 1e-12, "{across}");
            }
        }
    }

    /// The pairs of eta and a / eta that Model (31) finds on the given logs.
    #[test]
    fn the_slope_falls_with_height_as_in_the_given_logs() {
        for (sensitivity, per_m) in [(0.895, -215.4), (0.837, -222.4), (0.674, -237.0)] {
            let probe = probe(sensitivity);
            let slope = |z| probe.signal_m(&at([0.0, 1e-4, 0.0], [z, 0.0, 0.0])) / 1e-4;
            let rate = (slope(2e-4) - slope(-2e-4)) / 4e-4 / sensitivity;
            assert!((rate / per_m - 1.0).abs() < 0.015, "{rate}, not {per_m}");
        }
    }
}

//! One frame to one reading: the flat tick path.
//!
//! [`Decoder::decode`] does the whole arithmetic of a servo period: six codes checked
//! against their windows and scaled, vertical pose, three sensitivities, planar pose, checks
//! for finite results and for the calibrated range, status. It has no branch that depends on
//! data, no loop, no call and no panic, so its time is the same for every input.
//!
//! The scale of the codes is folded into the constants on the host, in `f64`: a code is
//! converted to `f32` exactly (up to 24 bits) and never scaled by itself.

use crate::capacitive::vertical_pose;
use crate::frame::{CodeFault, CodeWindow, RawFrame};
use crate::model::{Sensitivity, planar_pose, sensitivity_at};
use crate::pose::{PlanarPose, Pose, VerticalPose};
use crate::real::Real;
use crate::status::Status;
use serde::{Deserialize, Serialize};

/// Everything that a tick reads: about 170 bytes, borrowed read-only.
///
/// Made by [`crate::Calibration::prepare`] in `f64` and rounded once to `f32`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[repr(C)]
pub struct DecoderConstants<T> {
    /// Rows Z, Rx, Ry: m, rad, rad per capacitive code.
    pub vertical_per_code: [[T; 3]; 3],
    /// Sensitivity of the probes A, B, C (equation 33).
    pub sensitivity: [Sensitivity<T>; 3],
    /// Rows X, Y, Rz of PM^-1 times m per Hall code: m, m, rad per code of sensitivity one.
    pub planar_per_code: [[T; 3]; 3],
    /// Largest magnitude of Z, Rx, Ry in the calibration, m, rad, rad.
    pub calibrated_vertical: [T; 3],
    /// Largest magnitude of X, Y, Rz in the calibration, m, m, rad.
    pub calibrated_planar: [T; 3],
    /// Smallest magnitude of phi that is decoded; above zero.
    pub sensitivity_min: T,
    /// Hall codes that are decoded.
    pub hall_window: CodeWindow,
    /// Capacitive codes that are decoded.
    pub capacitive_window: CodeWindow,
}

/// A pose and what is wrong with it. Invalid fields are zero unless held.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Reading {
    /// The pose; fields that `status` calls invalid are 0, or the last valid ones if held.
    pub pose: Pose,
    /// What is wrong: 0 when all is good.
    pub status: Status,
}

/// Runs one calibration. Borrow it, call [`Decoder::decode`] every servo period.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(transparent)]
pub struct Decoder {
    constants: DecoderConstants<f32>,
}

/// Why a code of a frame is not decoded, with the channel it belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChannelFault {
    /// A Hall probe, 0 to 2 for A to C.
    Hall {
        /// Which probe.
        probe: u8,
        /// What is wrong.
        fault: CodeFault,
    },
    /// A capacitive sensor, 0 to 2 for gaps 1 to 3.
    Capacitive {
        /// Which gap.
        gap: u8,
        /// What is wrong.
        fault: CodeFault,
    },
}

const INFINITY_BITS: u32 = f32::INFINITY.to_bits();

/// The bits of |x|: ordered like the magnitudes, with every NaN above infinity.
#[inline(always)]
const fn magnitude_bits(x: f32) -> u32 {
    x.to_bits() & 0x7fff_ffff
}

/// Whether any of the three is infinite or NaN.
#[inline(always)]
const fn any_not_finite(v: [f32; 3]) -> bool {
    (magnitude_bits(v[0]) >= INFINITY_BITS)
        | (magnitude_bits(v[1]) >= INFINITY_BITS)
        | (magnitude_bits(v[2]) >= INFINITY_BITS)
}

/// Whether any of the three is larger in magnitude than its limit.
#[inline(always)]
fn any_beyond(v: [f32; 3], limits: &[f32; 3]) -> bool {
    (magnitude_bits(v[0]) > magnitude_bits(limits[0]))
        | (magnitude_bits(v[1]) > magnitude_bits(limits[1]))
        | (magnitude_bits(v[2]) > magnitude_bits(limits[2]))
}

/// `bit` if `condition`, without a branch.
#[inline(always)]
const fn bit_if(condition: bool, bit: Status) -> u32 {
    (condition as u32) * bit.bits()
}

/// The three bits from `first` up, for three conditions.
#[inline(always)]
const fn bits_if(conditions: [bool; 3], first: Status) -> u32 {
    (conditions[0] as u32 | (conditions[1] as u32) << 1 | (conditions[2] as u32) << 2)
        * first.bits()
}

/// `x` if `keep` is all ones, +0 if it is all zeros.
#[inline(always)]
const fn masked(x: f32, keep: u32) -> f32 {
    f32::from_bits(x.to_bits() & keep)
}

impl Decoder {
    /// A decoder with constants that were checked: see [`crate::ParameterSet::decoder`].
    /// Unchecked ones give no panic and no NaN either, only a status.
    pub const fn new(constants: DecoderConstants<f32>) -> Self {
        Self { constants }
    }

    /// The constants.
    pub const fn constants(&self) -> &DecoderConstants<f32> {
        &self.constants
    }

    /// The vertical pose of three capacitive codes, with the bits that concern it.
    #[inline(always)]
    fn vertical(&self, codes: [i32; 3]) -> (VerticalPose<f32>, u32) {
        let c = &self.constants;
        let bad = codes.map(|code| !c.capacitive_window.contains(code));
        let v = vertical_pose(&c.vertical_per_code, codes.map(f32::from_code));
        let status = bits_if(bad, Status::CAPACITIVE_1)
            | bit_if(any_not_finite(v.to_array()), Status::VERTICAL_NOT_FINITE);
        (v, status)
    }

    /// The planar pose of three Hall codes at a vertical pose, with the bits that concern it.
    #[inline(always)]
    fn planar(
        &self,
        codes: [i32; 3],
        vertical: &VerticalPose<f32>,
        zero: &PlanarPose<f32>,
    ) -> (PlanarPose<f32>, u32) {
        let c = &self.constants;
        let bad = codes.map(|code| !c.hall_window.contains(code));
        let phi = [
            sensitivity_at(&c.sensitivity[0], vertical),
            sensitivity_at(&c.sensitivity[1], vertical),
            sensitivity_at(&c.sensitivity[2], vertical),
        ];
        let low = magnitude_bits(c.sensitivity_min);
        // One comparison for "too near zero" and "not finite".
        let usable =
            phi.map(|phi| magnitude_bits(phi).wrapping_sub(low) < INFINITY_BITS.wrapping_sub(low));
        let q = planar_pose(&c.planar_per_code, codes.map(f32::from_code), phi, zero);
        let status = bits_if(bad, Status::HALL_A)
            | bits_if(usable.map(|u| !u), Status::SENSITIVITY_A)
            | bit_if(any_not_finite(q.to_array()), Status::PLANAR_NOT_FINITE);
        (q, status)
    }

    /// The vertical pose of three capacitive codes and the planar pose of three Hall codes,
    /// less `zero`; invalid fields are 0 and the status says why. Never NaN.
    #[inline(always)]
    pub fn decode(&self, hall: [i32; 3], capacitive: [i32; 3], zero: &PlanarPose<f32>) -> Reading {
        let (vertical, vertical_status) = self.vertical(capacitive);
        self.finish(hall, vertical, vertical_status, zero)
    }

    /// As [`Decoder::decode`], with a vertical pose that is known by other means (a log
    /// in SI columns).
    pub fn decode_at(
        &self,
        hall: [i32; 3],
        vertical: VerticalPose<f32>,
        zero: &PlanarPose<f32>,
    ) -> Reading {
        let not_finite = bit_if(
            any_not_finite(vertical.to_array()),
            Status::VERTICAL_NOT_FINITE,
        );
        self.finish(hall, vertical, not_finite, zero)
    }

    #[inline(always)]
    fn finish(
        &self,
        hall: [i32; 3],
        v: VerticalPose<f32>,
        vertical_status: u32,
        zero: &PlanarPose<f32>,
    ) -> Reading {
        let c = &self.constants;
        let (q, planar_status) = self.planar(hall, &v, zero);
        let faults = vertical_status | planar_status;
        let keep_vertical = ((vertical_status == 0) as u32).wrapping_neg();
        let keep_planar = ((faults == 0) as u32).wrapping_neg();
        let status = faults
            | bit_if(
                any_beyond(v.to_array(), &c.calibrated_vertical),
                Status::VERTICAL_EXTRAPOLATED,
            )
            | bit_if(
                any_beyond(q.to_array(), &c.calibrated_planar),
                Status::PLANAR_EXTRAPOLATED,
            )
            | (!keep_planar & Status::PLANAR_INVALID.bits())
            | (!keep_vertical & Status::VERTICAL_INVALID.bits());
        Reading {
            pose: Pose {
                planar: PlanarPose {
                    x_m: masked(q.x_m, keep_planar),
                    y_m: masked(q.y_m, keep_planar),
                    rz_rad: masked(q.rz_rad, keep_planar),
                },
                vertical: VerticalPose {
                    z_m: masked(v.z_m, keep_vertical),
                    rx_rad: masked(v.rx_rad, keep_vertical),
                    ry_rad: masked(v.ry_rad, keep_vertical),
                },
            },
            status: Status::from_bits(status),
        }
    }

    /// Every bad code of a frame with its reason, for diagnosis off the tick path.
    pub fn channel_faults(&self, frame: &RawFrame) -> impl Iterator<Item = ChannelFault> + use<> {
        let hall_window = self.constants.hall_window;
        let capacitive_window = self.constants.capacitive_window;
        let hall = (0u8..).zip(frame.hall).filter_map(move |(probe, code)| {
            let fault = hall_window.check(code).err()?;
            Some(ChannelFault::Hall { probe, fault })
        });
        let gaps = (0u8..).zip(frame.capacitive);
        hall.chain(gaps.filter_map(move |(gap, code)| {
            let fault = capacitive_window.check(code).err()?;
            Some(ChannelFault::Capacitive { gap, fault })
        }))
    }
}

impl Reading {
    /// X, Y, Rz if they were measured in this period.
    pub fn planar(&self) -> Option<PlanarPose<f32>> {
        (!self.status.any(Status::PLANAR_INVALID)).then_some(self.pose.planar)
    }

    /// Z, Rx, Ry if they were measured in this period.
    pub fn vertical(&self) -> Option<VerticalPose<f32>> {
        (!self.status.any(Status::VERTICAL_INVALID)).then_some(self.pose.vertical)
    }

    /// X, Y, Rz if they were measured in this period or are held from one before.
    pub fn planar_or_held(&self) -> Option<PlanarPose<f32>> {
        let usable = self.planar().is_some() || self.status.any(Status::PLANAR_HELD);
        usable.then_some(self.pose.planar)
    }
}

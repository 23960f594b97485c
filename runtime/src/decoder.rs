//! One frame to one reading: the flat tick path.
//!
//! [`Decoder::decode`] does the whole arithmetic of a servo period: six codes checked
//! against their windows and scaled, vertical pose, three sensitivities, planar pose, checks
//! for finite results and for the calibrated range, status. It has no branch, no loop, no
//! call and no panic, so the number of its instructions is the same for every input.
//!
//! The scale of the codes is folded into the constants on the host, in `f64`: a code is
//! converted to `f32` exactly (up to 24 bits) and never scaled by itself.

use crate::capacitive::vertical_pose;
use crate::checks::{
    keep_without, shift_in_any_beyond, shift_in_faulty, shift_in_outside, shift_in_outside_doubled,
    with_bit_if_any_beyond,
};
use crate::frame::{CodeFault, CodeWindow, RawFrame};
use crate::model::{Sensitivity, planar_pose, sensitivity_at};
use crate::pose::{PlanarPose, Pose, VerticalPose};
use crate::real::Real;
use crate::status::Status;

/// Everything that a tick reads: about 170 bytes, borrowed read-only.
///
/// Made by [`crate::Calibration::prepare`] in `f64` and rounded once to `f32`.
#[derive(Clone, Copy, Debug, PartialEq)]
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
#[repr(C)]
pub struct Decoder {
    constants: DecoderConstants<f32>,
    limits: Limits,
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

/// The limits of a tick as the words that it compares with, made once from the constants.
///
/// Magnitudes are compared as the integers that their bits are, doubled to leave out the
/// sign: these are ordered like the magnitudes, with every NaN above infinity, so no
/// comparison needs a flag of the FPU. A `room` is what fits above the largest accepted
/// word: see [`crate::checks`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
struct Limits {
    capacitive_low: u32,
    capacitive_room: u32,
    vertical_room: [u32; 3],
    sensitivity_low: u32,
    sensitivity_room: u32,
    hall_low: u32,
    hall_room: u32,
    planar_room: [u32; 3],
}

/// The bits of |x|, those of `largest` at most.
#[inline(always)]
const fn magnitude_up_to(x: f32, largest: f32) -> u32 {
    let (bits, largest) = (x.to_bits() & 0x7fff_ffff, largest.to_bits());
    if bits > largest { largest } else { bits }
}

/// What fits above twice the bits of each magnitude. A limit of NaN becomes infinity: NaNs
/// differ from machine to machine, so none may be compared with another.
const fn room(v: &[f32; 3]) -> [u32; 3] {
    [
        !(magnitude_up_to(v[0], f32::INFINITY) << 1),
        !(magnitude_up_to(v[1], f32::INFINITY) << 1),
        !(magnitude_up_to(v[2], f32::INFINITY) << 1),
    ]
}

/// What fits above twice the bits of every finite magnitude: a carry from twice those of an
/// infinity or a NaN.
const FINITE_ROOM: u32 = (f32::INFINITY.to_bits() << 1).wrapping_neg();

/// All bits that make X, Y, Rz invalid lie below that of the vertical range.
const FAULTS_FROM_THE_TOP: u32 = Status::VERTICAL_EXTRAPOLATED.bits().leading_zeros() + 1;
const PLANAR_EXTRAPOLATED_AT: u32 = Status::PLANAR_EXTRAPOLATED.bits().trailing_zeros();

impl Limits {
    const fn of(c: &DecoderConstants<f32>) -> Self {
        let low = magnitude_up_to(c.sensitivity_min, f32::MAX);
        Self {
            capacitive_low: c.capacitive_window.low as u32,
            capacitive_room: !c.capacitive_window.span(),
            vertical_room: room(&c.calibrated_vertical),
            sensitivity_low: low << 1,
            sensitivity_room: !((f32::MAX.to_bits() - low) << 1),
            hall_low: c.hall_window.low as u32,
            hall_room: !c.hall_window.span(),
            planar_room: room(&c.calibrated_planar),
        }
    }
}

/// The bits of three numbers.
#[inline(always)]
const fn bits(v: [f32; 3]) -> [u32; 3] {
    [v[0].to_bits(), v[1].to_bits(), v[2].to_bits()]
}

/// Codes as numbers, exactly.
#[inline(always)]
fn numbers(codes: &[i32; 3]) -> [f32; 3] {
    [
        f32::from_code(codes[0]),
        f32::from_code(codes[1]),
        f32::from_code(codes[2]),
    ]
}

/// Codes as words.
#[inline(always)]
const fn words(codes: &[i32; 3]) -> [u32; 3] {
    [codes[0] as u32, codes[1] as u32, codes[2] as u32]
}

impl Decoder {
    /// A decoder with constants that were checked: see [`crate::ParameterSet::decoder`].
    /// Unchecked ones give no panic and no NaN either, only a status.
    pub const fn new(constants: DecoderConstants<f32>) -> Self {
        Self {
            constants,
            limits: Limits::of(&constants),
        }
    }

    /// The constants.
    pub const fn constants(&self) -> &DecoderConstants<f32> {
        &self.constants
    }

    /// The vertical pose of three capacitive codes and the planar pose of three Hall codes,
    /// less `zero`; invalid fields are 0 and the status says why. Never NaN.
    #[inline(always)]
    pub fn decode(&self, hall: [i32; 3], capacitive: [i32; 3], zero: &PlanarPose<f32>) -> Reading {
        let mut reading = Reading::default();
        self.decode_into(&hall, &capacitive, zero, &mut reading);
        reading
    }

    /// [`Decoder::decode`] with the codes read, and the reading written, where they lie: on a
    /// core with few registers this saves copies.
    #[inline(always)]
    pub fn decode_into(
        &self,
        hall: &[i32; 3],
        capacitive: &[i32; 3],
        zero: &PlanarPose<f32>,
        reading: &mut Reading,
    ) {
        let limits = &self.limits;
        let bad = shift_in_outside(
            0,
            words(capacitive),
            limits.capacitive_low,
            limits.capacitive_room,
        );
        let v = vertical_pose(&self.constants.vertical_per_code, numbers(capacitive));
        self.finish(hall, v, bad, zero, reading);
    }

    /// As [`Decoder::decode`], with a vertical pose that is known by other means (a log
    /// in SI columns).
    pub fn decode_at(
        &self,
        hall: [i32; 3],
        vertical: VerticalPose<f32>,
        zero: &PlanarPose<f32>,
    ) -> Reading {
        let mut reading = Reading::default();
        self.finish(&hall, vertical, 0, zero, &mut reading);
        reading
    }

    /// The checks of a vertical pose, the planar pose at it, and the checks of that.
    ///
    /// The bits are shifted in from the highest down, so that those of the single channels
    /// end where [`Status`] has them without being moved.
    #[inline(always)]
    fn finish(
        &self,
        hall: &[i32; 3],
        vertical: VerticalPose<f32>,
        capacitive_bad: u32,
        zero: &PlanarPose<f32>,
        reading: &mut Reading,
    ) {
        let (c, limits) = (&self.constants, &self.limits);

        let found = bits([vertical.z_m, vertical.rx_rad, vertical.ry_rad]);
        let seen = shift_in_any_beyond(capacitive_bad, found, limits.vertical_room);
        let finite = [FINITE_ROOM, FINITE_ROOM, FINITE_ROOM];
        let seen = shift_in_any_beyond(seen, found, finite);
        // Beyond the calibrated range, the second bit, is no fault.
        let keep = keep_without(seen & !0b10);
        let invalid = keep.wrapping_add(1);
        reading.pose.vertical = VerticalPose {
            z_m: f32::from_bits(found[0] & keep),
            rx_rad: f32::from_bits(found[1] & keep),
            ry_rad: f32::from_bits(found[2] & keep),
        };

        let phi = [
            sensitivity_at(&c.sensitivity[0], &vertical),
            sensitivity_at(&c.sensitivity[1], &vertical),
            sensitivity_at(&c.sensitivity[2], &vertical),
        ];
        let (low, room) = (limits.sensitivity_low, limits.sensitivity_room);
        // Beyond, vertical not finite, and room for planar not finite; then the channels.
        let status = shift_in_outside_doubled((seen & 0b11) << 1, bits(phi), low, room);
        let status = (status << 3) | (seen >> 2);
        let status = shift_in_outside(status, words(hall), limits.hall_low, limits.hall_room);
        let planar = planar_pose(&c.planar_per_code, numbers(hall), phi, zero);

        let found = bits([planar.x_m, planar.y_m, planar.rz_rad]);
        let status = with_bit_if_any_beyond::<{ Status::PLANAR_NOT_FINITE.bits() }>(
            status,
            found,
            FINITE_ROOM,
        );
        let (top, keep) = shift_in_faulty(invalid, status << FAULTS_FROM_THE_TOP);
        let top = shift_in_any_beyond(top, found, limits.planar_room);
        reading.pose.planar = PlanarPose {
            x_m: f32::from_bits(found[0] & keep),
            y_m: f32::from_bits(found[1] & keep),
            rz_rad: f32::from_bits(found[2] & keep),
        };
        reading.status = Status::from_bits(status | (top << PLANAR_EXTRAPOLATED_AT));
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

#[cfg(test)]
#[path = "decoder_tests.rs"]
mod tests;
#[cfg(test)]
#[path = "decoder_word_tests.rs"]
mod word_tests;

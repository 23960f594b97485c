//! One frame to one reading: the flat tick path.
//!
//! [`Decode::decode`] does the whole arithmetic of a servo period: six codes checked
//! against their windows and scaled, vertical pose, the model's sensitivities and planar
//! pose, checks for finite results and for the calibrated range, status. It has no branch, no
//! loop, no call and no panic, so the number of its instructions is the same for every input.
//!
//! The scale of the codes is folded into the constants on the host, in `f64`: a code is
//! converted to `f32` exactly (up to 24 bits) and never scaled by itself.
//!
//! Numbers are compared by the bits of their magnitudes. As integers these are ordered like
//! the magnitudes, with every NaN above infinity: one comparison finds what is too large and
//! what is NaN.

use crate::capacitive::vertical_pose;
use crate::frame::{CodeWindow, RawFrame};
use crate::model::{FieldModel, LinearModel, Model};
use crate::pose::{PlanarPose, Pose, VerticalPose};
use crate::real::Real;
use crate::status::Status;
use crate::temperature::Temperature;

/// What a tick reads in addition to the coefficients of the probes.
///
/// Made by [`crate::Calibration::constants`] in `f64` and rounded once to `f32`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct DecoderConstants<T> {
    /// Rows Z, Rx, Ry: m, rad, rad per capacitive code.
    pub vertical_per_code: [[T; 3]; 3],
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
    /// How the sensitivities follow temperature.
    pub temperature: Temperature<T>,
}

/// A pose and what is wrong with it. Invalid fields are zero unless held.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(C)]
pub struct Reading {
    /// The pose; fields that `status` calls invalid are 0, or the last valid ones if held.
    pub pose: Pose,
    /// What is wrong: 0 when all is good.
    pub status: Status,
}

/// Decodes frames by one calibration, whatever its model.
///
/// A [`Decoder`] does this for its own model, an [`AnyDecoder`] for the model of a parameter set, and
/// a reference for its decoder.
pub trait Decode: Sync {
    /// The vertical pose of a frame's capacitive codes and the planar pose of its Hall codes,
    /// less `zero`; invalid fields are 0 and the status says why. Never NaN.
    fn decode(&self, frame: &RawFrame, zero: &PlanarPose<f32>) -> Reading;

    /// The constants that do not depend on the model.
    fn constants(&self) -> &DecoderConstants<f32>;
}

impl<D: Decode + ?Sized> Decode for &D {
    #[inline(always)]
    fn decode(&self, frame: &RawFrame, zero: &PlanarPose<f32>) -> Reading {
        (**self).decode(frame, zero)
    }

    fn constants(&self) -> &DecoderConstants<f32> {
        (**self).constants()
    }
}

/// Decodes frames by one calibration of the model `M`.
///
/// ```
/// use runtime::{AnyDecoder, Decode, PlanarPose, RawFrame, VerticalPose};
/// # use runtime::ParameterSet;
/// # const BLOB: &[u8] = include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/examples/stage.bin"));
/// # fn main() -> Result<(), runtime::BlobError> {
/// # let set = ParameterSet::from_bytes(BLOB)?;
/// let AnyDecoder::Linear(decoder) = set.decoder() else {
///     panic!("the blob holds Model (31)");
/// };
/// assert_eq!(decoder.probes()[0].eta, 0.87);
///
/// // Z by the capacitive codes, or known by other means: the same planar pose.
/// let frame = RawFrame::new([1200, 900, 700], [300, -200, 100], 0, 0);
/// let by_codes = decoder.decode(&frame, &PlanarPose::ZERO);
/// let by_pose = decoder.decode_at(frame.hall, frame.temperature_mc, by_codes.pose.vertical, &PlanarPose::ZERO);
/// assert_eq!(by_codes, by_pose);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Decoder<M: Model> {
    constants: DecoderConstants<f32>,
    probes: [M::Probe<f32>; 3],
    /// The status of every reading: [`Status::FORCED`], or none.
    status: Status,
}

/// The decoder of a parameter set, whatever its model. A tick takes the same branch each time.
#[expect(
    clippy::large_enum_variant,
    reason = "there is one, in a static, and no heap"
)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(not(feature = "host"), non_exhaustive)]
pub enum AnyDecoder {
    /// Of Models (12), (15), (30), (31).
    Linear(Decoder<LinearModel>),
    /// Of the field model.
    Field(Decoder<FieldModel>),
}

impl AnyDecoder {
    /// [`Decoder::decode_at`] of the model in use. The trait [`Decode`] leaves it out: it would take
    /// flash of every controller, which has codes.
    pub fn decode_at(
        &self,
        hall: [i32; 3],
        temperature_mc: [i32; 2],
        vertical: VerticalPose<f32>,
        zero: &PlanarPose<f32>,
    ) -> Reading {
        match self {
            Self::Linear(decoder) => decoder.decode_at(hall, temperature_mc, vertical, zero),
            Self::Field(decoder) => decoder.decode_at(hall, temperature_mc, vertical, zero),
        }
    }
}

impl Decode for AnyDecoder {
    fn decode(&self, frame: &RawFrame, zero: &PlanarPose<f32>) -> Reading {
        match self {
            Self::Linear(decoder) => decoder.decode(frame, zero),
            Self::Field(decoder) => decoder.decode(frame, zero),
        }
    }

    fn constants(&self) -> &DecoderConstants<f32> {
        match self {
            Self::Linear(decoder) => decoder.constants(),
            Self::Field(decoder) => decoder.constants(),
        }
    }
}

/// The bits of |x|.
#[inline(always)]
const fn magnitude(x: f32) -> u32 {
    x.to_bits() & 0x7fff_ffff
}

/// The largest finite magnitude.
const FINITE: u32 = f32::MAX.to_bits();

/// Whether any of three magnitudes is not finite: its exponent is then full, and one more carries
/// into the sign.
#[inline(always)]
const fn any_not_finite([a, b, c]: [u32; 3]) -> bool {
    const ONE_MORE: u32 = 1 << 23;
    ((a + ONE_MORE) | (b + ONE_MORE) | (c + ONE_MORE)) >> 31 != 0
}

/// Which of three words lie outside `low..=high`, as three bits with the first lowest. One
/// subtraction and one comparison a word, as in [`CodeWindow::contains`].
#[inline(always)]
fn outside([a, b, c]: [u32; 3], low: u32, high: u32) -> u32 {
    let span = high.wrapping_sub(low);
    let outside = |word: u32| u32::from(word.wrapping_sub(low) > span);
    outside(c) << 2 | outside(b) << 1 | outside(a)
}

/// [`outside`] for codes.
#[inline(always)]
fn outside_window(codes: [i32; 3], window: &CodeWindow) -> u32 {
    let words = each(codes, i32::cast_unsigned);
    outside(
        words,
        window.low.cast_unsigned(),
        window.high.cast_unsigned(),
    )
}

/// Whether any magnitude is larger than its limit.
#[inline(always)]
const fn beyond(v: [u32; 3], limits: [u32; 3]) -> bool {
    (v[0] > limits[0]) | (v[1] > limits[1]) | (v[2] > limits[2])
}

/// `f` of each of three, written out: `array::map` becomes a loop at opt-level "s".
#[inline(always)]
fn each<A, B>([a, b, c]: [A; 3], f: impl Fn(A) -> B) -> [B; 3] {
    [f(a), f(b), f(c)]
}

/// The numbers, or zeros if they are not valid.
#[inline(always)]
fn zero_unless(valid: bool, v: [f32; 3]) -> [f32; 3] {
    let keep = u32::from(valid).wrapping_neg();
    each(v, |x| f32::from_bits(x.to_bits() & keep))
}

/// A limit of a range without its sign. Of unchecked constants a NaN becomes infinity: NaNs
/// differ from machine to machine, so none may be compared with another.
const fn limit(x: f32) -> f32 {
    if x.is_nan() { f32::INFINITY } else { x.abs() }
}

const fn limits([a, b, c]: [f32; 3]) -> [f32; 3] {
    [limit(a), limit(b), limit(c)]
}

impl<M: Model> Decoder<M> {
    /// A decoder with these constants. Checked ones come from
    /// [`ParameterSet::decoder`](crate::ParameterSet::decoder); unchecked ones give no panic
    /// and no NaN either, only a status.
    pub const fn new(mut constants: DecoderConstants<f32>, probes: [M::Probe<f32>; 3]) -> Self {
        constants.calibrated_vertical = limits(constants.calibrated_vertical);
        constants.calibrated_planar = limits(constants.calibrated_planar);
        if constants.sensitivity_min.is_finite() {
            constants.sensitivity_min = constants.sensitivity_min.abs();
        } else {
            constants.sensitivity_min = f32::MAX;
        }
        Self {
            constants,
            probes,
            status: Status::GOOD,
        }
    }

    /// Marks every reading by [`Status::FORCED`] if the parameters were written by `--force`.
    #[must_use]
    pub const fn with_forced(mut self, is_forced: bool) -> Self {
        self.status = Status::FORCED.when(is_forced);
        self
    }

    /// The coefficients of the probes A, B, C.
    pub const fn probes(&self) -> &[M::Probe<f32>; 3] {
        &self.probes
    }

    /// As [`Decode::decode`], with a vertical pose that is known by other means (a log in SI
    /// columns).
    pub fn decode_at(
        &self,
        hall: [i32; 3],
        temperature_mc: [i32; 2],
        vertical: VerticalPose<f32>,
        zero: &PlanarPose<f32>,
    ) -> Reading {
        self.finish(hall, temperature_mc, vertical, 0, zero)
    }

    /// The checks of a vertical pose, the planar pose at it, and the checks of that.
    #[inline(always)]
    fn finish(
        &self,
        hall: [i32; 3],
        temperature_mc: [i32; 2],
        vertical: VerticalPose<f32>,
        capacitive_bad: u32,
        zero: &PlanarPose<f32>,
    ) -> Reading {
        let c = &self.constants;
        let ([mount, body], temperature_bad) = c.temperature.changes_mk(temperature_mc);
        let change = (c.temperature).gain_change([f32::from_code(mount), f32::from_code(body)]);
        let signal = each(hall, f32::from_code);
        let rows = &c.planar_per_code;
        let (phi, planar) = M::planar_pose(&self.probes, rows, signal, change, &vertical, zero);
        let (v, q) = (vertical.to_array(), planar.to_array());
        let (size_v, size_q) = (each(v, magnitude), each(q, magnitude));

        let phi_bad = outside(each(phi, magnitude), c.sensitivity_min.to_bits(), FINITE);
        // Finite or not is asked in two ways: so a tick keeps the fewest values on the stack.
        let faults = (Status::HALL_A.with_next(outside_window(hall, &c.hall_window)))
            .with(Status::CAPACITIVE_1.with_next(capacitive_bad))
            .with(Status::SENSITIVITY_A.with_next(phi_bad))
            .with(Status::PLANAR_NOT_FINITE.when(beyond(size_q, [FINITE, FINITE, FINITE])))
            .with(Status::VERTICAL_NOT_FINITE.when(any_not_finite(size_v)));
        let vertical_valid = !faults.any(VERTICAL_FAULTS);
        let planar_valid = faults.bits() == 0;
        let range_v = each(c.calibrated_vertical, f32::to_bits);
        let range_q = each(c.calibrated_planar, f32::to_bits);
        let status = faults
            .with(Status::VERTICAL_EXTRAPOLATED.when(beyond(size_v, range_v)))
            .with(Status::PLANAR_EXTRAPOLATED.when(beyond(size_q, range_q)))
            .with(Status::TEMPERATURE_MISSING.with_next(temperature_bad & 1))
            .with(Status::PLANAR_INVALID.when(!planar_valid))
            .with(Status::VERTICAL_INVALID.when(!vertical_valid))
            .with(self.status);
        Reading {
            pose: Pose {
                planar: PlanarPose::from_array(zero_unless(planar_valid, q)),
                vertical: VerticalPose::from_array(zero_unless(vertical_valid, v)),
            },
            status,
        }
    }
}

/// What makes Z, Rx, Ry invalid. Any fault makes X, Y, Rz invalid.
const VERTICAL_FAULTS: Status = Status::CAPACITIVE.with(Status::VERTICAL_NOT_FINITE);

impl<M: Model> Decode for Decoder<M> {
    #[inline(always)]
    fn decode(&self, frame: &RawFrame, zero: &PlanarPose<f32>) -> Reading {
        let c = &self.constants;
        let bad = outside_window(frame.capacitive, &c.capacitive_window);
        let gaps = each(frame.capacitive, f32::from_code);
        let vertical = vertical_pose(&c.vertical_per_code, gaps);
        self.finish(frame.hall, frame.temperature_mc, vertical, bad, zero)
    }

    fn constants(&self) -> &DecoderConstants<f32> {
        &self.constants
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

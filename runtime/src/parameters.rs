//! The parameter set of one stage, as it lies in the blob, and the checks that it must pass.

use crate::decoder::{AnyDecoder, Decoder, DecoderConstants};
use crate::geometry::ProbeGeometry;
use crate::model::{ModelKind, Probes};
use crate::motion::MotionCorrection;
use heapless::String;
use nalgebra::Matrix3;

/// A short text of a parameter set: at most 32 bytes of UTF-8.
pub type Text = String<32>;

/// Everything that the decoder needs, and what `inspect` and a later refit need.
///
/// The fields have the order of the blob (see [`crate::blob`]), where the code windows
/// come last and the counts before the numbers. The blob of a field model leaves out PM, PM^-1
/// and the capacitive plane matrix: they follow from the constants.
///
/// ```
/// use runtime::{Decode, ParameterSet, PlanarPose, RawFrame};
/// # const BLOB: &[u8] = include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/examples/stage.bin"));
/// # fn main() -> Result<(), runtime::BlobError> {
/// let set = ParameterSet::from_bytes(BLOB)?; // or `from_flash`, where padding follows
/// set.expect_serial("HS-0007")?;
/// let frame = RawFrame::new([1200, 900, 700], [300, -200, 100], 0, 0);
/// let reading = set.decoder().decode(&frame, &PlanarPose::ZERO);
/// assert!(reading.status.is_good());
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterSet {
    /// Which model was fitted.
    pub model: ModelKind,
    /// Serial number of the stage; empty if none was given.
    pub serial: Text,
    /// When the set was made, as given by the user; empty if not given.
    pub created: Text,
    /// SHA-256 of the decompressed input logs, one after the other.
    pub logs_sha256: [u8; 32],
    /// How good the fit was.
    pub fit: FitRecord,
    /// Lever arms and misalignments.
    pub geometry: ProbeGeometry<f32>,
    /// PM (equation 32).
    pub plane: Matrix3<f32>,
    /// PM^-1.
    pub plane_inverse: Matrix3<f32>,
    /// Scale of the Hall codes.
    pub hall: HallInput,
    /// Scale and geometry of the capacitive codes.
    pub capacitive: CapacitiveInput,
    /// The model's coefficients of the probes A, B, C.
    pub probes: Probes<f32>,
    /// The other numbers that the tick reads: the terms above, combined.
    pub constants: DecoderConstants<f32>,
    /// Corrects poses by commanded velocity and acceleration; `None` where the calibration has no such
    /// correction.
    pub motion_correction: Option<MotionCorrection>,
}

/// How Hall codes become displacements at the designed sensitivity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HallInput {
    /// Displacement per code, m.
    pub m_per_code: f32,
}

/// How capacitive codes become the vertical pose.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CapacitiveInput {
    /// Z, Rx, Ry in m, rad, rad per m of gap change: the inverse of the plane matrix.
    pub vertical_per_m: Matrix3<f32>,
    /// Gap change per code, m.
    pub m_per_code: f32,
}

/// Errors of the fit over all rows of its logs, zero deviations refitted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FitRecord {
    /// Rows of the logs.
    pub rows: u32,
    /// Rows that the fit used.
    pub train_rows: u32,
    /// rms error of X, Y, Rz: m, m, rad.
    pub rms: [f32; 3],
    /// Peak error of X, Y, Rz: m, m, rad.
    pub peak: [f32; 3],
    /// Whether the log was refused, or the fit beyond the limits asked for, and written all the same.
    pub forced: bool,
}

/// The largest range that a calibration may cover, m or rad. Every model takes rotations for small,
/// and a pose without a status lies within the range: it never has a larger rotation.
pub const RANGE_MAX: f32 = 1.0;

/// What is wrong with a parameter set.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ParameterError {
    /// A number of this group is NaN or infinite.
    #[error("{group} holds a NaN or an infinity")]
    NotFinite {
        /// Which group of numbers.
        group: &'static str,
    },
    /// PM has no inverse: two probes sense the same motion.
    #[error("the plane matrix PM has no inverse: two probes sense the same motion")]
    SingularPlane,
    /// The three capacitive sensors stand in one line, or so near each other that their largest
    /// codes stand for more than a whole turn: they define no plane.
    #[error(
        "the three capacitive sensors stand in one line, or nearer to each other than their gaps, and define no plane"
    )]
    CapacitiveProbesInLine,
    /// The stored PM^-1 is not the inverse of the stored PM.
    #[error("the stored PM^-1 is not the inverse of PM (PM PM^-1 differs from I by {largest:e})")]
    NotTheInverse {
        /// Largest element of PM PM^-1 - I, in magnitude.
        largest: f32,
    },
    /// A precomputed term does not follow from the terms that it was made of.
    #[error("{term} does not follow from the values that it was made of")]
    Inconsistent {
        /// Which term.
        term: &'static str,
    },
    /// A value that must be above zero is not.
    #[error("{value} must be above zero")]
    NotPositive {
        /// Which value.
        value: &'static str,
    },
    /// The calibrated range reaches beyond [`RANGE_MAX`].
    #[error("the calibrated range reaches {reach:e} m or rad, more than {RANGE_MAX}")]
    LargeRange {
        /// How far, m or rad.
        reach: f32,
    },
    /// phi comes nearer to zero than `sensitivity_min` within the calibrated vertical range.
    #[error("the sensitivity of probe {} comes too near zero within the calibrated range", letter(*.probe))]
    PoleInRange {
        /// Which probe, 0 to 2 for A to C.
        probe: u8,
    },
    /// A slope of p of the field model may reach 1 within the calibrated range: one reading could
    /// then stand for two displacements.
    #[error("the field terms of probe {} are too large for the calibrated range", letter(*.probe))]
    SteepInRange {
        /// Which probe, 0 to 2 for A to C.
        probe: u8,
    },
    /// The gain of a probe changes by half or more within the reach of the temperatures, or the
    /// reach is beyond 24 bits.
    #[error("the temperature coefficients of probe {} are too large", letter(*.probe))]
    LargeTemperatureChange {
        /// Which probe, 0 to 2 for A to C.
        probe: u8,
    },
    /// A motion correction is larger than any stage has, so its unit is wrong.
    #[error("the motion correction is too large")]
    LargeMotionCorrection,
    /// A window of accepted codes is empty or reaches beyond 24 bits.
    #[error("the window of accepted {sensors} codes is empty or reaches beyond 24 bits")]
    UnsoundWindow {
        /// Which sensors' window.
        sensors: &'static str,
    },
}

/// The name of a probe.
fn letter(probe: u8) -> char {
    char::from(b'A'.saturating_add(probe))
}

impl ParameterSet {
    /// The decoder of this set, of its model.
    pub const fn decoder(&self) -> AnyDecoder {
        let (constants, is_forced) = (self.constants, self.fit.forced);
        match self.probes {
            Probes::Linear(probes) => {
                AnyDecoder::Linear(Decoder::new(constants, probes).with_forced(is_forced))
            }
            Probes::Field(probes) => {
                AnyDecoder::Field(Decoder::new(constants, probes).with_forced(is_forced))
            }
        }
    }
}

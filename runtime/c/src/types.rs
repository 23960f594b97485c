//! What C hands in and gets back.

use runtime::{PlanarPose, Pose, Reading, Status, VerticalPose};

/// Major version of the library that this header belongs to.
pub const HALL_RUNTIME_VERSION_MAJOR: u32 = 0;
/// Minor version.
pub const HALL_RUNTIME_VERSION_MINOR: u32 = 2;
/// Patch version.
pub const HALL_RUNTIME_VERSION_PATCH: u32 = 0;
/// Version of the sizes and fields of the structs in this header.
pub const HALL_LAYOUT_VERSION: u32 = 1;
/// The version as one number that can be compared: layout << 24, major << 16, minor << 8, patch.
pub const HALL_RUNTIME_VERSION: u32 = (HALL_LAYOUT_VERSION << 24)
    | (HALL_RUNTIME_VERSION_MAJOR << 16)
    | (HALL_RUNTIME_VERSION_MINOR << 8)
    | HALL_RUNTIME_VERSION_PATCH;

/// What became of a call. 32 bits wide, whatever a compiler makes of enums.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HallResult {
    /// Done.
    Ok = 0,
    /// A pointer that is needed is NULL.
    NullPointer = 1,
    /// The memory is shorter than a blob, or than the blob's header says.
    Truncated = 2,
    /// The memory is erased: no blob was written.
    Erased = 3,
    /// Something else than a blob.
    BadMagic = 4,
    /// A layout that this version does not read.
    UnknownVersion = 5,
    /// A length that no blob has.
    BadHeader = 6,
    /// A bit is wrong.
    BadCrc = 7,
    /// The check holds, yet the payload is not a parameter set.
    BadPayload = 8,
    /// A parameter is NaN or infinite, a matrix singular, or the like.
    UnusableParameters = 9,
    /// The blob belongs to another stage than expected.
    OtherStage = 10,
    /// The decoder was never loaded.
    NotLoaded = 11,
    /// The servo or the predictor was never started.
    NotStarted = 12,
}

/// Where a re-zero stands.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HallRezero {
    /// No re-zero was asked for.
    Idle = 0,
    /// It runs.
    Running = 1,
    /// It ended, and the zero deviation is in use.
    Done = 2,
    /// Refused: fewer than 250 ticks were asked for.
    TooShort = 3,
    /// Refused: a tick gave no planar pose.
    NoPose = 4,
    /// Refused: the stage moved.
    Moved = 5,
    /// Refused: the pose drifted.
    Drifted = 6,
    /// Refused: the stage stands too far from its zero, or is lifted or tilted.
    OutOfBounds = 7,
    /// Refused: a pose lies outside the calibrated range.
    Extrapolated = 8,
}

/// Motion in the plane.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct HallPlanarPose {
    /// Displacement along X, m.
    pub x_m: f32,
    /// Displacement along Y, m.
    pub y_m: f32,
    /// Rotation about Z, rad.
    pub rz_rad: f32,
}

/// A pose and what is wrong with it: all is good when the status is 0, or HALL_STATUS_ZERO_SET
/// alone. Invalid fields are 0 unless held.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct HallReading {
    /// Displacement along X, m.
    pub x_m: f32,
    /// Displacement along Y, m.
    pub y_m: f32,
    /// Rotation about Z, rad.
    pub rz_rad: f32,
    /// Displacement along Z, m.
    pub z_m: f32,
    /// Rotation about X, rad.
    pub rx_rad: f32,
    /// Rotation about Y, rad.
    pub ry_rad: f32,
    /// The bits that HALL_STATUS_ names.
    pub status: u32,
}

/// Hall code A is at a rail, implausible or missing.
pub const HALL_STATUS_HALL_A: u32 = 1 << 0;
/// Hall code B likewise.
pub const HALL_STATUS_HALL_B: u32 = 1 << 1;
/// Hall code C likewise.
pub const HALL_STATUS_HALL_C: u32 = 1 << 2;
/// Capacitive code 1 is at a rail, implausible or missing.
pub const HALL_STATUS_CAPACITIVE_1: u32 = 1 << 3;
/// Capacitive code 2 likewise.
pub const HALL_STATUS_CAPACITIVE_2: u32 = 1 << 4;
/// Capacitive code 3 likewise.
pub const HALL_STATUS_CAPACITIVE_3: u32 = 1 << 5;
/// The sensitivity of probe A is too near zero, or not finite.
pub const HALL_STATUS_SENSITIVITY_A: u32 = 1 << 6;
/// That of probe B likewise.
pub const HALL_STATUS_SENSITIVITY_B: u32 = 1 << 7;
/// That of probe C likewise.
pub const HALL_STATUS_SENSITIVITY_C: u32 = 1 << 8;
/// A planar result is not finite.
pub const HALL_STATUS_PLANAR_NOT_FINITE: u32 = 1 << 9;
/// A vertical result is not finite.
pub const HALL_STATUS_VERTICAL_NOT_FINITE: u32 = 1 << 10;
/// Z, Rx or Ry lies outside the calibrated range.
pub const HALL_STATUS_VERTICAL_EXTRAPOLATED: u32 = 1 << 11;
/// X, Y or Rz lies outside the calibrated range.
pub const HALL_STATUS_PLANAR_EXTRAPOLATED: u32 = 1 << 12;
/// X, Y, Rz are invalid.
pub const HALL_STATUS_PLANAR_INVALID: u32 = 1 << 13;
/// Z, Rx, Ry are invalid.
pub const HALL_STATUS_VERTICAL_INVALID: u32 = 1 << 14;
/// A temperature is missing or implausible: decoded as if at T0 of the calibration.
pub const HALL_STATUS_TEMPERATURE_MISSING: u32 = 1 << 15;
/// The parameters were written by `host-fit fit --force`: their log was refused.
pub const HALL_STATUS_FORCED: u32 = 1 << 16;
/// One or more servo periods before this frame had no frame.
pub const HALL_STATUS_FRAMES_MISSED: u32 = 1 << 17;
/// The frame repeats an earlier sequence number.
pub const HALL_STATUS_FRAME_REPEATED: u32 = 1 << 18;
/// A zero deviation is subtracted from X, Y, Rz. No fault.
pub const HALL_STATUS_ZERO_SET: u32 = 1 << 19;
/// X, Y, Rz are the last valid ones, repeated.
pub const HALL_STATUS_PLANAR_HELD: u32 = 1 << 20;
/// Z, Rx, Ry are the last valid ones, repeated.
pub const HALL_STATUS_VERTICAL_HELD: u32 = 1 << 21;

impl HallPlanarPose {
    pub(crate) const ZERO: Self = Self {
        x_m: 0.0,
        y_m: 0.0,
        rz_rad: 0.0,
    };
}

impl HallReading {
    /// There is no new measurement.
    pub(crate) const INVALID: Self = Self {
        x_m: 0.0,
        y_m: 0.0,
        rz_rad: 0.0,
        z_m: 0.0,
        rx_rad: 0.0,
        ry_rad: 0.0,
        status: HALL_STATUS_PLANAR_INVALID | HALL_STATUS_VERTICAL_INVALID,
    };
}

impl From<PlanarPose<f32>> for HallPlanarPose {
    fn from(pose: PlanarPose<f32>) -> Self {
        let PlanarPose { x_m, y_m, rz_rad } = pose;
        Self { x_m, y_m, rz_rad }
    }
}

impl From<HallPlanarPose> for PlanarPose<f32> {
    fn from(pose: HallPlanarPose) -> Self {
        let HallPlanarPose { x_m, y_m, rz_rad } = pose;
        Self { x_m, y_m, rz_rad }
    }
}

impl From<Reading> for HallReading {
    fn from(reading: Reading) -> Self {
        let (planar, vertical) = (reading.pose.planar, reading.pose.vertical);
        Self {
            x_m: planar.x_m,
            y_m: planar.y_m,
            rz_rad: planar.rz_rad,
            z_m: vertical.z_m,
            rx_rad: vertical.rx_rad,
            ry_rad: vertical.ry_rad,
            status: reading.status.bits(),
        }
    }
}

impl From<&HallReading> for Reading {
    fn from(reading: &HallReading) -> Self {
        Self {
            pose: Pose {
                planar: PlanarPose {
                    x_m: reading.x_m,
                    y_m: reading.y_m,
                    rz_rad: reading.rz_rad,
                },
                vertical: VerticalPose {
                    z_m: reading.z_m,
                    rx_rad: reading.rx_rad,
                    ry_rad: reading.ry_rad,
                },
            },
            status: Status::from_bits(reading.status),
        }
    }
}

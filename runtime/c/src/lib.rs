//! The runtime for a controller written in C: load a blob, tick, read pose and status.
//!
//! The header `hall_runtime.h` is made from this file by cbindgen. There is no allocation: the
//! caller keeps a [`HallDecoder`] and a [`HallServo`], usually in static memory. No function
//! can panic, only [`hall_servo_start`] keeps a pointer. A null pointer is refused, and so is a
//! decoder that was never loaded or a servo that was never started: keep both in static memory,
//! which is zero until they are filled. Call the functions of one servo from one context only.
//!
//! It also builds for a computer, for the unit tests of the program that uses it.
#![cfg_attr(target_os = "none", no_std)]

mod storage;
pub mod types;

use core::ffi::{CStr, c_char};
use core::mem::MaybeUninit;
use runtime::tracker::Health;
use runtime::zero_offset::{ZeroOffsetRefusal, ZeroOffsetSettings, ZeroOffsetState};
use runtime::{
    AnyDecoder, BlobError, CommandedMotion, MotionCorrection, OnInvalid, ParameterSet, PoseTracker,
    Predictor, RawFrame, Reading,
};
pub use storage::{HallDecoder, HallPredictor, HallServo};
pub use types::{
    HALL_LAYOUT_VERSION, HALL_RUNTIME_VERSION, HallPlanarPose, HallReading, HallResult, HallRezero,
};

/// A panic cannot be reached: the tests link every function of the runtime against a panic
/// handler that does not exist. The language requires one.
#[cfg(target_os = "none")]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {}
}

/// HALL_RUNTIME_VERSION of the library. A header of another layout has structs of other sizes: compare it with the
/// header's once, before any other call.
#[must_use]
#[unsafe(no_mangle)]
pub extern "C" fn hall_version() -> u32 {
    HALL_RUNTIME_VERSION
}

/// Whether floating-point arithmetic is set as after a reset, so that poses are, bit for bit,
/// those that the host computed. Check it once, before the first tick.
#[must_use]
#[unsafe(no_mangle)]
pub extern "C" fn hall_arithmetic_is_sound() -> bool {
    runtime::arithmetic::check().is_ok()
}

/// Loads the parameter blob at the start of `memory` (flash, padding may follow), checks it,
/// and makes a decoder of it. `serial` is the serial number of the stage that is expected, or
/// NULL to take any stage. Unless the result is HALL_RESULT_OK, the decoder is unchanged.
///
/// # Safety
/// `memory` points to `length` readable bytes; `serial` is NULL or ends in a zero byte;
/// `decoder` is NULL or points to a HallDecoder that no servo uses.
#[must_use]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hall_load(
    memory: *const u8,
    length: usize,
    serial: *const c_char,
    decoder: Option<&mut MaybeUninit<HallDecoder>>,
) -> HallResult {
    let Some(decoder) = decoder.filter(|_| !memory.is_null()) else {
        return HallResult::NullPointer;
    };
    // SAFETY: not null, and `length` bytes long as the caller promises.
    let memory = unsafe { core::slice::from_raw_parts(memory, length) };
    let set = match ParameterSet::from_flash(memory) {
        Ok(set) => set,
        Err(error) => return error.into(),
    };
    if !serial.is_null() {
        // SAFETY: not null, and ended by a zero byte as the caller promises.
        let serial = unsafe { CStr::from_ptr(serial) };
        if serial.to_bytes() != set.serial.as_bytes() {
            return HallResult::OtherStage;
        }
    }
    decoder.write(HallDecoder::new(set.decoder()));
    HallResult::Ok
}

/// Starts a servo: no zero deviation, nothing to hold, all counters zero. What is invalid is
/// held for `hold_ticks` ticks in a row, and zero after that. Unless the result is
/// HALL_RESULT_OK, the servo is unchanged.
///
/// # Safety
/// `decoder` is NULL, or memory that was zero before hall_load filled it or failed to; once it is
/// filled, it is neither changed nor moved while the servo is used.
#[must_use]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hall_servo_start(
    servo: Option<&mut MaybeUninit<HallServo>>,
    decoder: Option<&'static HallDecoder>,
    hold_ticks: u16,
) -> HallResult {
    let (Some(servo), Some(decoder)) = (servo, decoder) else {
        return HallResult::NullPointer;
    };
    let Some(decoder) = decoder.get() else {
        return HallResult::NotLoaded;
    };
    let on_invalid = match hold_ticks {
        0 => OnInvalid::Zero,
        ticks => OnInvalid::Hold { ticks },
    };
    servo.write(HallServo::new(PoseTracker::new(decoder, on_invalid)));
    HallResult::Ok
}

/// One servo period: decodes the frame into `reading`. Unless the result is HALL_RESULT_OK, all
/// six fields of the reading are 0 and marked invalid.
#[unsafe(no_mangle)]
pub extern "C" fn hall_tick(
    servo: Option<&mut HallServo>,
    frame: Option<&RawFrame>,
    reading: Option<&mut MaybeUninit<HallReading>>,
) -> HallResult {
    tick(servo, reading, |servo| {
        Ok(servo.tick(frame.ok_or(HallResult::NullPointer)?))
    })
}

/// One servo period without a frame: values are held or zero. Unless the result is
/// HALL_RESULT_OK, all six fields of the reading are 0 and marked invalid.
#[unsafe(no_mangle)]
pub extern "C" fn hall_tick_without_frame(
    servo: Option<&mut HallServo>,
    reading: Option<&mut MaybeUninit<HallReading>>,
) -> HallResult {
    tick(servo, reading, |servo| Ok(servo.tick_without_frame()))
}

/// Forgets the pose to hold and the sequence; zero deviation and counters stay.
#[unsafe(no_mangle)]
pub extern "C" fn hall_forget(servo: Option<&mut HallServo>) -> HallResult {
    result(started(servo).map(PoseTracker::forget))
}

/// Starts to average at rest, over `ticks` ticks (250 or more) with the default limits of
/// movement and of the zero deviation; hall_rezero_state reports the progress.
#[unsafe(no_mangle)]
pub extern "C" fn hall_rezero_start(servo: Option<&mut HallServo>, ticks: u16) -> HallResult {
    result(started(servo).map(|servo| {
        servo.start_zero_offset(ZeroOffsetSettings {
            ticks,
            ..ZeroOffsetSettings::default()
        });
    }))
}

/// Where the re-zero stands; idle for a null pointer or a servo that was never started.
#[unsafe(no_mangle)]
pub extern "C" fn hall_rezero_state(servo: Option<&HallServo>) -> HallRezero {
    match running(servo).map(PoseTracker::zero_offset_state) {
        None | Some(ZeroOffsetState::Idle) => HallRezero::Idle,
        Some(ZeroOffsetState::Running { .. }) => HallRezero::Running,
        Some(ZeroOffsetState::Done { .. }) => HallRezero::Done,
        Some(ZeroOffsetState::Refused(refusal)) => match refusal {
            ZeroOffsetRefusal::TooShort { .. } => HallRezero::TooShort,
            ZeroOffsetRefusal::NoPose { .. } => HallRezero::NoPose,
            ZeroOffsetRefusal::Moved { .. } => HallRezero::Moved,
            ZeroOffsetRefusal::Drifted { .. } => HallRezero::Drifted,
            ZeroOffsetRefusal::OutOfBounds { .. } => HallRezero::OutOfBounds,
            ZeroOffsetRefusal::Extrapolated { .. } => HallRezero::Extrapolated,
        },
    }
}

/// The zero deviation that is subtracted, as a pose; zeros for a null pointer or a servo that was
/// never started.
#[unsafe(no_mangle)]
pub extern "C" fn hall_zero(servo: Option<&HallServo>) -> HallPlanarPose {
    running(servo).map_or(HallPlanarPose::ZERO, |servo| servo.zero().into())
}

/// Subtracts a zero deviation that is known, for instance from before a restart. One that is
/// not finite, a null pointer and a servo that was never started are ignored and `false` returned.
#[must_use]
#[unsafe(no_mangle)]
pub extern "C" fn hall_set_zero(servo: Option<&mut HallServo>, zero: HallPlanarPose) -> bool {
    started(servo).is_ok_and(|servo| servo.set_zero(zero.into()))
}

/// The counters; zeros for a null pointer or a servo that was never started.
#[unsafe(no_mangle)]
pub extern "C" fn hall_health(servo: Option<&HallServo>) -> Health {
    running(servo).map(PoseTracker::health).unwrap_or_default()
}

/// Starts a predictor without poses. `age_max_us` is the largest age of a pose that is carried
/// on, and the longest time between two poses in a row: one or two servo periods.
#[must_use]
#[unsafe(no_mangle)]
pub extern "C" fn hall_predictor_start(
    predictor: Option<&mut MaybeUninit<HallPredictor>>,
    age_max_us: u16,
) -> HallResult {
    let Some(predictor) = predictor else {
        return HallResult::NullPointer;
    };
    predictor.write(HallPredictor::new(Predictor::new(age_max_us)));
    HallResult::Ok
}

/// Takes the reading that `servo` has just made of `frame`; an invalid one is passed over. Call
/// it after each hall_tick.
#[unsafe(no_mangle)]
pub extern "C" fn hall_predictor_take(
    predictor: Option<&mut HallPredictor>,
    servo: Option<&HallServo>,
    frame: Option<&RawFrame>,
    reading: Option<&HallReading>,
) -> HallResult {
    let (Some(predictor), Some(servo), Some(frame), Some(reading)) =
        (predictor, servo, frame, reading)
    else {
        return HallResult::NullPointer;
    };
    let (Some(predictor), Some(servo)) = (predictor.get_mut(), servo.get()) else {
        return HallResult::NotStarted;
    };
    predictor.take(servo, frame, &reading.into());
    HallResult::Ok
}

/// X, Y, Rz at a time of the frames' clock (us, wrapping), by the slope of the last eight valid
/// poses. `false`, and zeros, before there are eight in a row, for a time before the last one or
/// further after it than the largest age, and for a predictor that was never started.
#[must_use]
#[unsafe(no_mangle)]
pub extern "C" fn hall_predict(
    predictor: Option<&HallPredictor>,
    time_us: u32,
    pose: Option<&mut MaybeUninit<HallPlanarPose>>,
) -> bool {
    let Some(pose) = pose else {
        return false;
    };
    let predicted = predictor.and_then(HallPredictor::get);
    let predicted = predicted.and_then(|predictor| predictor.pose_at(time_us));
    pose.write(predicted.map_or(HallPlanarPose::ZERO, HallPlanarPose::from));
    predicted.is_some()
}

/// Reads the motion correction of the parameter blob at the start of `memory`, which is checked as by
/// hall_load; zeros where the blob has none. Unless the result is HALL_RESULT_OK, the correction is
/// unchanged.
///
/// # Safety
/// `memory` points to `length` readable bytes; `correction` is NULL or points to memory for one.
#[must_use]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hall_load_motion_correction(
    memory: *const u8,
    length: usize,
    correction: Option<&mut MaybeUninit<MotionCorrection>>,
) -> HallResult {
    let Some(correction) = correction.filter(|_| !memory.is_null()) else {
        return HallResult::NullPointer;
    };
    // SAFETY: not null, and `length` bytes long as the caller promises.
    let memory = unsafe { core::slice::from_raw_parts(memory, length) };
    match ParameterSet::from_flash(memory) {
        Ok(set) => {
            correction.write(set.motion_correction.unwrap_or_default());
            HallResult::Ok
        }
        Err(error) => error.into(),
    }
}

/// The pose without the errors that follow the commanded motion. The trajectory generator gives
/// velocity and acceleration, for the sample of the pose. `false`, and zeros, for a null pointer and
/// where the pose or the command is NaN or infinite.
#[must_use]
#[unsafe(no_mangle)]
pub extern "C" fn hall_correct_motion(
    correction: Option<&MotionCorrection>,
    pose: HallPlanarPose,
    commanded: Option<&CommandedMotion>,
    corrected: Option<&mut MaybeUninit<HallPlanarPose>>,
) -> bool {
    let Some(corrected) = corrected else {
        return false;
    };
    let found = correction.zip(commanded);
    let found = found.and_then(|(correction, motion)| correction.correct(pose.into(), motion));
    corrected.write(found.map_or(HallPlanarPose::ZERO, HallPlanarPose::from));
    found.is_some()
}

/// The servo that C points to, if it was started.
fn running(servo: Option<&HallServo>) -> Option<&PoseTracker<&'static AnyDecoder>> {
    servo?.get()
}

/// The servo that C points to, or why there is none.
fn started(
    servo: Option<&mut HallServo>,
) -> Result<&mut PoseTracker<&'static AnyDecoder>, HallResult> {
    let servo = servo.ok_or(HallResult::NullPointer)?;
    servo.get_mut().ok_or(HallResult::NotStarted)
}

fn result(done: Result<(), HallResult>) -> HallResult {
    done.err().unwrap_or(HallResult::Ok)
}

/// Ticks into the room that C has for the reading, which is written in any case.
#[inline(always)]
fn tick(
    servo: Option<&mut HallServo>,
    reading: Option<&mut MaybeUninit<HallReading>>,
    tick: impl FnOnce(&mut PoseTracker<&'static AnyDecoder>) -> Result<Reading, HallResult>,
) -> HallResult {
    let Some(reading) = reading else {
        return HallResult::NullPointer;
    };
    match started(servo).and_then(tick) {
        Ok(ticked) => {
            reading.write(ticked.into());
            HallResult::Ok
        }
        Err(refused) => {
            reading.write(HallReading::INVALID);
            refused
        }
    }
}

impl From<BlobError> for HallResult {
    fn from(error: BlobError) -> Self {
        match error {
            BlobError::Truncated { .. } => Self::Truncated,
            BlobError::Erased => Self::Erased,
            BlobError::BadMagic { .. } => Self::BadMagic,
            BlobError::UnknownVersion { .. } => Self::UnknownVersion,
            BlobError::BadHeader { .. } => Self::BadHeader,
            BlobError::TrailingBytes { .. } => Self::BadHeader,
            BlobError::BadCrc { .. } => Self::BadCrc,
            BlobError::BadPayload => Self::BadPayload,
            BlobError::Parameters(_) => Self::UnusableParameters,
            BlobError::OtherStage => Self::OtherStage,
            BlobError::BufferTooSmall { .. } => Self::Truncated,
            _ => Self::UnusableParameters,
        }
    }
}

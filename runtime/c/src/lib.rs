//! The runtime for a controller written in C: load a blob, tick, read pose and status.
//!
//! The header `hall_runtime.h` is made from this file by cbindgen. Nothing allocates: the
//! caller keeps a [`HallDecoder`] and a [`HallServo`], usually in static memory. No function
//! can panic, only [`hall_servo_start`] keeps a pointer, and a null pointer is refused or
//! ignored. Call the functions of one servo from one context only.
#![no_std]

mod storage;
mod types;

use core::ffi::{CStr, c_char};
use core::mem::MaybeUninit;
use runtime::rezero::{RezeroRefusal, RezeroSettings, RezeroState};
use runtime::{BlobError, OnInvalid, ParameterSet, Servo};
pub use storage::{HallDecoder, HallServo};
pub use types::{HallFrame, HallHealth, HallPlanarPose, HallReading, HallResult, HallRezero};

/// A panic cannot be reached: the tests link every function of the runtime against a panic
/// handler that does not exist. The language requires one.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {}
}

/// Whether floating-point arithmetic is set as after a reset, so that poses are, bit for bit,
/// those that the host computed. Check it once, before the first tick.
#[unsafe(no_mangle)]
pub extern "C" fn hall_arithmetic_is_sound() -> bool {
    runtime::arithmetic::check().is_ok()
}

/// Loads the parameter blob at the start of `memory` (flash, padding may follow), checks it,
/// and makes a decoder of it. `serial` is the serial number of the stage that is expected, or
/// NULL to take that of any. Unless the result is HALL_RESULT_OK, the decoder stays as it was.
///
/// # Safety
/// `memory` points to `length` readable bytes; `serial` is NULL or ends in a zero byte;
/// `decoder` is NULL or points to a HallDecoder that no servo uses.
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
/// held for `hold_ticks` ticks in a row, and zero after that.
///
/// # Safety
/// `decoder` was filled by hall_load and stays as it is, and where it is, for as long as the
/// servo is used.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hall_servo_start(
    servo: Option<&mut MaybeUninit<HallServo>>,
    decoder: Option<&'static HallDecoder>,
    hold_ticks: u16,
) -> HallResult {
    let (Some(servo), Some(decoder)) = (servo, decoder) else {
        return HallResult::NullPointer;
    };
    let on_invalid = match hold_ticks {
        0 => OnInvalid::Zero,
        ticks => OnInvalid::Hold { ticks },
    };
    servo.write(HallServo::new(Servo::new(&**decoder.get(), on_invalid)));
    HallResult::Ok
}

/// One servo period: decodes the frame into `reading`.
#[unsafe(no_mangle)]
pub extern "C" fn hall_tick(
    servo: Option<&mut HallServo>,
    frame: Option<&HallFrame>,
    reading: Option<&mut MaybeUninit<HallReading>>,
) {
    if let (Some(servo), Some(frame), Some(reading)) = (servo, frame, reading) {
        reading.write(servo.get_mut().tick(&frame.raw()).into());
    }
}

/// One servo period in which no frame came: values are held or zero.
#[unsafe(no_mangle)]
pub extern "C" fn hall_tick_without_frame(
    servo: Option<&mut HallServo>,
    reading: Option<&mut MaybeUninit<HallReading>>,
) {
    if let (Some(servo), Some(reading)) = (servo, reading) {
        reading.write(servo.get_mut().tick_without_frame().into());
    }
}

/// Forgets the pose to hold and the sequence; zero deviation and counters stay.
#[unsafe(no_mangle)]
pub extern "C" fn hall_forget(servo: Option<&mut HallServo>) {
    if let Some(servo) = servo {
        servo.get_mut().forget();
    }
}

/// Starts to average at rest, over `ticks` ticks (250 or more) with the default limits of
/// movement and of the zero deviation.
#[unsafe(no_mangle)]
pub extern "C" fn hall_rezero_start(servo: Option<&mut HallServo>, ticks: u16) {
    if let Some(servo) = servo {
        servo.get_mut().start_rezero(RezeroSettings {
            ticks,
            ..RezeroSettings::default()
        });
    }
}

/// Where the re-zero stands.
#[unsafe(no_mangle)]
pub extern "C" fn hall_rezero_state(servo: Option<&HallServo>) -> HallRezero {
    match servo.map(|servo| servo.get().rezero_state()) {
        None | Some(RezeroState::Idle) => HallRezero::Idle,
        Some(RezeroState::Running { .. }) => HallRezero::Running,
        Some(RezeroState::Done { .. }) => HallRezero::Done,
        Some(RezeroState::Refused(refusal)) => match refusal {
            RezeroRefusal::TooShort { .. } => HallRezero::TooShort,
            RezeroRefusal::NoPose { .. } => HallRezero::NoPose,
            RezeroRefusal::Moved { .. } => HallRezero::Moved,
            RezeroRefusal::Drifted { .. } => HallRezero::Drifted,
            RezeroRefusal::OutOfBounds { .. } => HallRezero::OutOfBounds,
            RezeroRefusal::Extrapolated { .. } => HallRezero::Extrapolated,
        },
    }
}

/// The zero deviation that is subtracted, as a pose; zeros for a null pointer.
#[unsafe(no_mangle)]
pub extern "C" fn hall_zero(servo: Option<&HallServo>) -> HallPlanarPose {
    servo.map_or(HallPlanarPose::ZERO, |servo| servo.get().zero().into())
}

/// Subtracts a zero deviation that is known, for instance from before a restart. One that is
/// not finite is ignored and `false` returned.
#[unsafe(no_mangle)]
pub extern "C" fn hall_set_zero(servo: Option<&mut HallServo>, zero: HallPlanarPose) -> bool {
    servo.is_some_and(|servo| servo.get_mut().set_zero(zero.into()))
}

/// The counters; zeros for a null pointer.
#[unsafe(no_mangle)]
pub extern "C" fn hall_health(servo: Option<&HallServo>) -> HallHealth {
    servo
        .map(|servo| servo.get().health())
        .unwrap_or_default()
        .into()
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
        }
    }
}

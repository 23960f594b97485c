//! The runtime in someone else's control loop: no HAL, no allocator, the map of `memory.x`.
//!
//! At start the parameters are loaded from slot 0, or from slot 1 if those are refused; with
//! neither there is no pose and no control, only the reasons. Then a period is: codes from
//! the converters, [`PoseTracker::tick`], a controller that looks at the status first.
//!
//! The stage that the firmware belongs to is compiled in (`HALL_STAGE_SERIAL`, any if unset).
//! Replace [`converters`] and [`coils`] by your own and wait for your timer in the loop.
#![no_std]
#![no_main]

use core::fmt::Write;
use cortex_m_rt::entry;
use image::semihost::{CONSOLE, File, exit};
use runtime::frame::MISSING_CODE;
use runtime::{BlobError, OnInvalid, ParameterSet, PlanarPose, PoseTracker, Predictor, RawFrame};

unsafe extern "C" {
    // Their addresses are what memory.x says; there is nothing to read at them but bytes.
    static _parameter_slot_0: u8;
    static _parameter_slot_1: u8;
    static _parameter_slot_bytes: u8;
}

/// Serial number of this firmware's stage.
const SERIAL: Option<&str> = option_env!("HALL_STAGE_SERIAL");

/// Periods that this example runs.
const PERIODS: u32 = 12;

/// From the sample to the change of the forces, us.
const FORCES_US: u32 = 300;

/// The bytes of a parameter slot.
fn slot(number: usize) -> &'static [u8] {
    // SAFETY: memory.x keeps the slots free of anything else, and flash is always readable.
    unsafe {
        let start = match number {
            0 => &raw const _parameter_slot_0,
            _ => &raw const _parameter_slot_1,
        };
        core::slice::from_raw_parts(start, (&raw const _parameter_slot_bytes).addr())
    }
}

/// The parameters of a slot, if they are sound and this stage's.
fn load(number: usize) -> Result<ParameterSet, BlobError> {
    let set = ParameterSet::from_flash(slot(number))?;
    if let Some(serial) = SERIAL {
        set.expect_serial(serial)?;
    }
    Ok(set)
}

/// Stands for the converters. Period 4 has no code of probe B; period 8 no frame at all.
fn converters(period: u32) -> Option<RawFrame> {
    let step = 25 * period as i32;
    let b = if period == 4 {
        MISSING_CODE
    } else {
        900 - step
    };
    (period != 8).then_some(RawFrame::new(
        [1200 - step, b, 700 - step],
        [300, -200, 100],
        period,
        2000 * period,
    ))
}

/// Stands for the voice coils: takes forces in N and N m.
fn coils(console: &mut File, period: u32, force: [f32; 3]) {
    let thousandths = force.map(|newton| (newton * 1e3) as i32);
    let _ = writeln!(console, "{period}: forces {thousandths:?} mN");
}

/// A proportional controller towards zero: N per m, N per m, N m per rad.
fn control(pose: &PlanarPose<f32>) -> [f32; 3] {
    [-2e4 * pose.x_m, -2e4 * pose.y_m, -5e2 * pose.rz_rad]
}

#[entry]
fn main() -> ! {
    let Ok(mut console) = File::write_to(CONSOLE) else {
        exit(false)
    };
    if let Err(fault) = runtime::arithmetic::check() {
        let _ = writeln!(console, "{fault}");
        exit(false);
    }
    let mut loaded = None;
    for number in 0..2 {
        match load(number) {
            Ok(set) => {
                let _ = writeln!(console, "slot {number}: loaded");
                loaded = Some(set);
                break;
            }
            Err(error) => {
                let _ = writeln!(console, "slot {number}: refused: {}", error.number());
            }
        }
    }
    let Some(set) = loaded else {
        let _ = writeln!(console, "no pose: no usable parameters");
        exit(false)
    };
    let decoder = set.decoder();
    let mut tracker = PoseTracker::new(decoder, OnInvalid::Hold { ticks: 2 });
    let mut predictor = Predictor::new(4_000);
    for period in 0..PERIODS {
        let reading = match converters(period) {
            Some(frame) => {
                let reading = tracker.tick(&frame);
                predictor.take(&tracker, &frame, &reading);
                reading
            }
            None => tracker.tick_without_frame(),
        };
        // Where the stage is when the forces change, if eight poses in a row tell.
        let predicted = predictor.pose_at(2000 * period + FORCES_US);
        match predicted.or(reading.planar_or_held()) {
            Some(pose) => coils(&mut console, period, control(&pose)),
            // No measurement for too long: let the stage down rather than guess.
            None => coils(&mut console, period, [0.0; 3]),
        }
    }
    let health = tracker.health();
    let _ = writeln!(
        console,
        "{} ticks, {} held, {} frames missed",
        health.ticks, health.held, health.frames_missed
    );
    exit(health.ticks == PERIODS && health.held == 2)
}

//! The runtime in an RTIC task, which owns tracker and predictor: a frame every 2 ms, X, Y, Rz at
//! the time of the new forces.
//!
//! SysTick stands for the timer that starts the converters, [`converters`] for them.
#![no_std]
#![no_main]

use cortex_m_rt as _;
use image::example::{FORCES_US, PERIOD_US, converters, parameters};
use runtime::{OnInvalid, PoseTracker, Predictor};

/// Stands for the device crate of your chip.
mod device {
    /// Bits of a priority.
    pub const NVIC_PRIO_BITS: u8 = 3;
}

#[rtic::app(device = crate::device, peripherals = false)]
mod app {
    use super::*;

    #[shared]
    struct Shared {}

    #[local]
    struct Local {
        tracker: PoseTracker,
        predictor: Predictor,
        period: u32,
    }

    #[init]
    fn init(mut context: init::Context) -> (Shared, Local) {
        let Ok(set) = parameters() else {
            image::semihost::exit(false)
        };
        image::example::start(&mut context.core.SYST);
        let local = Local {
            tracker: PoseTracker::new(set.decoder(), OnInvalid::Hold { ticks: 2 }),
            predictor: Predictor::new(2 * PERIOD_US as u16),
            period: 0,
        };
        (Shared {}, local)
    }

    #[task(binds = SysTick, priority = 1, local = [tracker, predictor, period])]
    fn tick(context: tick::Context) {
        let local = context.local;
        let frame = converters(*local.period);
        let reading = local.tracker.tick(&frame);
        local.predictor.take(local.tracker, &frame, &reading);
        let predicted = local
            .predictor
            .pose_at(frame.time_us.wrapping_add(FORCES_US));
        image::example::coils(*local.period, predicted.or(reading.planar_or_held()));
        *local.period = local.period.wrapping_add(1);
    }
}

//! The runtime in an Embassy task, which owns tracker and predictor: a frame every 2 ms, X, Y, Rz
//! at the time of the new forces.
//!
//! SysTick stands for the timer that starts the converters, [`converters`] for them.
#![no_std]
#![no_main]

use cortex_m_rt::exception;
use embassy_executor::Spawner;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use image::example::{FORCES_US, PERIOD_US, coils, converters, parameters, start};
use image::semihost::exit;
use runtime::{OnInvalid, PoseTracker, Predictor};

static PERIOD: Signal<CriticalSectionRawMutex, ()> = Signal::new();

#[exception]
fn SysTick() {
    PERIOD.signal(());
}

#[embassy_executor::task]
async fn control(mut tracker: PoseTracker, mut predictor: Predictor) {
    for period in 0.. {
        PERIOD.wait().await;
        let frame = converters(period);
        let reading = tracker.tick(&frame);
        predictor.take(&tracker, &frame, &reading);
        let predicted = predictor.pose_at(frame.time_us.wrapping_add(FORCES_US));
        coils(period, predicted.or(reading.planar_or_held()));
    }
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let (Ok(set), Some(mut core)) = (parameters(), cortex_m::Peripherals::take()) else {
        exit(false)
    };
    let tracker = PoseTracker::new(set.decoder(), OnInvalid::Hold { ticks: 2 });
    let predictor = Predictor::new(2 * PERIOD_US as u16);
    let Ok(task) = control(tracker, predictor) else {
        exit(false)
    };
    spawner.spawn(task);
    start(&mut core.SYST);
}

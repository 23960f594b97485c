//! A controller's loop: one frame every servo period, the pose held when a code is bad, and the
//! zero measured at rest.
//!
//! `cargo run -p runtime --example tracker -- runtime/examples/stage.bin`

use runtime::frame::MISSING_CODE;
use runtime::zero_offset::ZeroOffsetSettings;
use runtime::{OnInvalid, ParameterSet, PoseTracker, RawFrame};
use std::error::Error;

/// Stands for the converters: a stage at rest near its zero, and one Hall code lost in period 255.
fn converters(period: u32) -> RawFrame {
    let hall_b = if period == 255 { MISSING_CODE } else { 90 };
    RawFrame::new([120, hall_b, 70], [300, -200, 100], period, 2000 * period)
}

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("use: tracker params.bin")?;
    // Once, at start: this machine rounds as the host does, and the parameters are sound.
    runtime::arithmetic::check()?;
    let decoder = ParameterSet::from_bytes(&std::fs::read(path)?)?.decoder();
    let mut tracker = PoseTracker::new(decoder, OnInvalid::Hold { ticks: 3 });

    // Every period.
    for period in 0..260 {
        if period == 2 {
            tracker.start_zero_offset(ZeroOffsetSettings {
                ticks: ZeroOffsetSettings::TICKS_MIN,
                ..ZeroOffsetSettings::default()
            });
        }
        let reading = tracker.tick(&converters(period));
        if (3..250).contains(&period) {
            continue;
        }
        match reading.planar_or_held() {
            Some(q) => println!(
                "{period:2}: X {:8.3} um, status {}",
                q.x_m * 1e6,
                reading.status.bits()
            ),
            None => println!("{period:2}: no pose, status {}", reading.status.bits()),
        }
    }
    println!("{:?}", tracker.zero_offset_state());
    println!("{:?}", tracker.health());
    Ok(())
}

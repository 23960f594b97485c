//! A controller's loop: one frame every servo period, the pose held when a code is bad, and the
//! zero measured at rest.
//!
//! `cargo run -p runtime --example servo -- runtime/examples/stage.bin`

use runtime::frame::MISSING_CODE;
use runtime::rezero::RezeroSettings;
use runtime::{OnInvalid, ParameterSet, RawFrame, Servo};
use std::error::Error;

/// Stands for the converters: a stage at rest near its zero, and one Hall code lost in period 255.
fn converters(period: u32) -> RawFrame {
    let hall_b = if period == 255 { MISSING_CODE } else { 90 };
    RawFrame {
        hall: [120, hall_b, 70],
        capacitive: [300, -200, 100],
        sequence: period,
        time_us: 2000 * period,
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("use: servo params.bin")?;
    // Once, at start: the arithmetic is that of the host, and the parameters are sound.
    runtime::arithmetic::check()?;
    let decoder = ParameterSet::from_bytes(&std::fs::read(path)?)?.decoder();
    let mut servo = Servo::new(&*decoder, OnInvalid::Hold { ticks: 3 });

    // Every period.
    for period in 0..260 {
        if period == 2 {
            servo.start_rezero(RezeroSettings {
                ticks: RezeroSettings::TICKS_MIN,
                ..RezeroSettings::default()
            });
        }
        let reading = servo.tick(&converters(period));
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
    println!("{:?}", servo.rezero_state());
    println!("{:?}", servo.health());
    Ok(())
}

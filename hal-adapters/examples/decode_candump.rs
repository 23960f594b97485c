//! Poses from a recorded bus: reads a parameter blob and a `candump -L` log with 16-bit codes, and prints one
//! line per tick.
//!
//! ```sh
//! cargo run -p hal-adapters --example decode_candump -- hal-adapters/examples/data/params.bin hal-adapters/examples/data/bus.log
//! ```

use hal_adapters::can::{Layout, SensorReceiver, Timing};
use hal_adapters::candump::LogLine;
use runtime::{OnInvalid, ParameterSet, PoseTracker, RawFrame, Reading};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().collect();
    let [_, blob, log] = args.as_slice() else {
        return Err("use: decode_candump BLOB LOG".into());
    };
    let (blob, log) = (std::fs::read(blob)?, std::fs::read_to_string(log)?);
    println!("tick, x_um, y_um, rz_urad, status");
    decode(&blob, &log, |frame, reading| {
        let [x, y, rz] = reading.pose.planar.to_array().map(|v| 1e6 * f64::from(v));
        let status = reading.status.bits();
        println!("{}, {x:.3}, {y:.3}, {rz:.3}, {status}", frame.sequence);
    })
}

/// Decodes every tick of `log` with the parameters of `blob`.
fn decode(
    blob: &[u8],
    log: &str,
    mut show: impl FnMut(&RawFrame, &Reading),
) -> Result<(), Box<dyn Error>> {
    let decoder = ParameterSet::from_bytes(blob)?.decoder();
    let mut tracker = PoseTracker::new(decoder, OnInvalid::Zero);
    let mut receiver = SensorReceiver::new(Layout::Bits16, Timing::default());
    for (number, text) in (1..).zip(log.lines()) {
        let line = LogLine::parse(text).map_err(|e| format!("line {number}: {e}"))?;
        let now_us = line.time_us as u32;
        // Time has passed since the last frame: a tick may be over, the source silent.
        for taken in [receiver.poll(now_us), receiver.take(&line.frame, now_us)] {
            if let Some(fault) = taken.fault {
                eprintln!("line {number}: {fault}");
            }
            if let Some(frame) = taken.tick {
                show(&frame, &tracker.tick(&frame));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `poses.csv` is what `host-fit decode` makes of the codes in `bus.log`.
    #[test]
    fn the_poses_of_a_recorded_bus_are_those_of_the_host() {
        let mut words = Vec::new();
        let blob = include_bytes!("data/params.bin");
        decode(blob, include_str!("data/bus.log"), |_, reading| {
            words.push(reading.pose.planar.to_array().map(f32::to_bits));
        })
        .expect("a sound log");
        let word = |cell: &str| (1e-6 * cell.parse::<f64>().expect("a number")) as f32;
        let poses = include_str!("data/poses.csv").lines().skip(1);
        let want: Vec<[u32; 3]> = poses
            .map(|line| {
                let cells: Vec<&str> = line.split(',').collect();
                [2, 3, 4].map(|k: usize| word(cells[k]).to_bits())
            })
            .collect();
        assert_eq!(want.len(), 25);
        assert_eq!(words, want);
    }
}

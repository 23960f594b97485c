//! How fast the host decodes a log from memory, with the target's code and bits: ticks a second on
//! one core, of Model (31) and of the field model.
//!
//! Prints `RESULT key=value` lines, medians of several runs.

use host_fit::input::log;
use host_fit::input::stage::Stage;
use runtime::{Decode, ParameterSet, PlanarPose, RawFrame};
use std::hint::black_box;
use std::time::Instant;

const RUNS: usize = 21;

/// Millions of ticks a second, median. Each reading is looked at: its words go into a sum.
fn million_ticks_per_s(decoder: &dyn Decode, frames: &[RawFrame]) -> f64 {
    let mut rates: Vec<f64> = (0..RUNS)
        .map(|_| {
            let started = Instant::now();
            let mut sum = 0u32;
            for frame in black_box(frames) {
                let reading = decoder.decode(frame, &PlanarPose::ZERO);
                let pose = reading.pose.planar;
                for word in [pose.x_m, pose.y_m, pose.rz_rad].map(f32::to_bits) {
                    sum = sum.wrapping_add(word);
                }
                sum = sum.wrapping_add(reading.status.bits());
            }
            black_box(sum);
            frames.len() as f64 * 1e-6 / started.elapsed().as_secs_f64()
        })
        .collect();
    rates.sort_by(f64::total_cmp);
    rates[RUNS / 2]
}

fn main() {
    let stage = Stage::from_toml(host_fit::input::shipped::STAGE_TOML, "stage.toml".as_ref())
        .expect("the shipped stage");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("log.csv.gz");
    std::fs::write(&path, host_fit::input::shipped::LOG_GZ).expect("written");
    let read = log::read(&[path], &stage, &log::ReadOptions::default()).expect("read");
    let frames: Vec<RawFrame> = (read.dataset.rows.iter())
        .filter_map(|row| row.frame.all_codes())
        .collect();
    let blobs: [(&str, &[u8]); 2] = [
        ("31", include_bytes!("../../runtime/examples/stage.bin")),
        ("field", include_bytes!("../../runtime/examples/field.bin")),
    ];
    for (model, blob) in blobs {
        let decoder = ParameterSet::from_bytes(blob).expect("sound").decoder();
        let rate = million_ticks_per_s(&decoder, &frames);
        println!("RESULT decode_{model}_million_ticks_per_s={rate:.1}");
    }
}

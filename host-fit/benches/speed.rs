//! The time of a fit with its judgement, and the rate of the target's decoder on the host, from memory and
//! on one core.
//!
//! Prints `RESULT key=value` lines, medians of several runs.

mod common;

use common::{Fallible, Twin, fitted, median_s, read};
use host_fit::input::dataset::Dataset;
use host_fit::input::shipped::{self, LOG_GZ, RUN_GZ};
use host_fit::simulate::protocol::Protocol;
use host_fit::simulate::recording::Recording;
use runtime::{Decode, ModelKind, ParameterSet, PlanarPose, RawFrame};
use std::hint::black_box;

fn main() -> Fallible<()> {
    let stage = shipped::stage();
    let (log, run) = (read(LOG_GZ, &stage)?, read(RUN_GZ, &stage)?);
    // The paper's protocol and the combined one of a simulated stage together.
    let twin = Twin::new(&stage, 1);
    let both = [Protocol::Paper, Protocol::Combined]
        .map(|protocol| twin.record(protocol.run(stage.servo_period_s, 1)));
    let both = Recording::joined(&both.each_ref(), &stage).ok_or("no plane")?;
    for (kind, name, dataset) in [
        (ModelKind::M31, "fit_and_judge", &log),
        (ModelKind::Field, "fit_field_model", &run),
        (ModelKind::Field, "fit_field_model", &both),
    ] {
        let ms = 1e3 * median_s(9, || drop(fitted(dataset, &stage, kind).expect("a fit")));
        println!("RESULT {name}_{}_rows_ms={ms:.1}", dataset.rows.len());
    }
    decode(&log);
    Ok(())
}

/// The words of each reading go into a sum, so that none is optimised away.
fn decode(log: &Dataset) {
    let frames: Vec<RawFrame> = (log.rows.iter())
        .filter_map(|row| row.frame.all_codes())
        .collect();
    let blobs: [(&str, &[u8]); 2] = [
        ("31", include_bytes!("../../runtime/examples/stage.bin")),
        ("field", include_bytes!("../../runtime/examples/field.bin")),
    ];
    for (model, blob) in blobs {
        let decoder = ParameterSet::from_bytes(blob).expect("sound").decoder();
        let seconds = median_s(21, || {
            let mut sum = 0u32;
            for frame in black_box(&frames) {
                let reading = decoder.decode(frame, &PlanarPose::ZERO);
                for number in reading.pose.planar.to_array() {
                    sum = sum.wrapping_add(number.to_bits());
                }
                sum = sum.wrapping_add(reading.status.bits());
            }
            black_box(sum);
        });
        let rate = frames.len() as f64 * 1e-6 / seconds;
        println!("RESULT decode_{model}_million_ticks_per_s={rate:.1}");
    }
}

//! Faults of the signals without a cost of their own, by size: the number of logs with the fault named by its
//! channel, and the other warnings.

use crate::common::dataset;
use crate::{FAULTY, recording};
use host_fit::input::channel::Channel;
use host_fit::input::finding::Code;
use host_fit::input::stage::Stage;
use host_fit::simulate::protocol::Trajectory;
use host_fit::simulate::recording::{Recording, Sample};
use std::f64::consts::TAU;

/// Hall A, Hall C, X, Y1, Y2 as places in [`Channel::SINGLE`].
const CHANNELS: [usize; 5] = [0, 2, 3, 4, 5];
const FAULTS: [(&str, Code, &[f64]); 3] = [
    ("ten jumps, um", Code::Outliers, &[3.0, 5.0]),
    ("hum of 50 Hz, um", Code::Hum, &[0.1, 0.2]),
    ("channel stuck, s", Code::Stuck, &[0.2, 0.5, 1.0]),
];

/// Adds an error in um to a channel.
fn add(sample: &mut Sample, stage: &Stage, channel: usize, um: f64) {
    match channel {
        0..3 => sample.hall[channel] += (um * 1e-6 / stage.hall.m_per_count).round() as i32,
        _ => sample.beams_nm[channel - 3] += (um * 1e3).round() as i64,
    }
}

/// Puts a fault into a recording; `place` picks the rows of a stuck channel.
fn spoil(log: &mut Recording, stage: &Stage, code: Code, channel: usize, size: f64, place: usize) {
    let (count, period_s) = (log.rows(), stage.servo_period_s);
    if code == Code::Stuck {
        let movement = place * 7 % log.movements.len();
        let rows = &mut log.movements[movement];
        let first = rows.len() / 4 + place * 131 % (rows.len() / 2);
        let end = rows.len().min(first + (size / period_s) as usize);
        let held = rows[first];
        for sample in &mut rows[first..end] {
            match channel {
                0..3 => sample.hall[channel] = held.hall[channel],
                _ => sample.beams_nm[channel - 3] = held.beams_nm[channel - 3],
            }
        }
        return;
    }
    let apart = count / 10;
    for (row, sample) in log.movements.iter_mut().flatten().enumerate() {
        let um = match code {
            Code::Hum => size * (TAU * 50.0 * row as f64 * period_s).sin(),
            _ if row % apart != apart / 2 => 0.0,
            _ if row / apart % 3 == 0 => -size,
            _ => size,
        };
        add(sample, stage, channel, um);
    }
}

/// Prints a line for each fault and size.
pub(crate) fn table(stage: &Stage, planned: &Trajectory) {
    println!("{:<36}{:>9}{:>9}{:>9}", "fault", "size", "named", "others");
    for (name, code, sizes) in FAULTS {
        for &size in sizes {
            let (mut named, mut others) = (0, 0);
            for seed in 1..=FAULTY {
                let channel = CHANNELS[seed as usize % CHANNELS.len()];
                let mut log = recording(stage, planned, 1000 + seed);
                spoil(&mut log, stage, code, channel, size, seed as usize);
                let (found, _) = crate::grave(&dataset(&log, stage), stage);
                let (right, wrong): (Vec<_>, Vec<_>) = (found.into_iter()).partition(|finding| {
                    finding.code() == code && finding.channels() == [Channel::SINGLE[channel]]
                });
                named += usize::from(!right.is_empty());
                others += wrong.len();
            }
            println!("{name:<36}{size:>9}{named:>6}/{FAULTY}{others:>9}");
        }
    }
}

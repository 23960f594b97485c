//! Faults of the signals that have no cost of their own, by size: how many of the logs have the fault named
//! with its channel, and how many other warnings come beside.

use crate::{FAULTY, recording};
use host_fit::input::channel::Channel;
use host_fit::input::finding::Code;
use host_fit::input::stage::Stage;
use host_fit::simulate::protocol::Trajectory;
use host_fit::simulate::recording::{Recording, Sample};
use std::f64::consts::TAU;

/// Puts a fault of this size into a recording.
type Fault = fn(&mut Faulty, f64);

/// A recording, the channel that is at fault, and a number that picks the place.
struct Faulty<'a> {
    stage: &'a Stage,
    recording: Recording,
    channel: usize,
    place: u64,
}

impl Faulty<'_> {
    /// Adds an error (m) to the channel in a sample.
    fn add(stage: &Stage, channel: usize, sample: &mut Sample, error_m: f64) {
        let codes = |m_per_count: f64| (error_m / m_per_count).round() as i32;
        match channel {
            0..3 => sample.hall[channel] += codes(stage.hall.m_per_count),
            3..6 => sample.beams_nm[channel - 3] += (error_m * 1e9).round() as i64,
            _ => sample.capacitive[channel - 6] += codes(stage.capacitive.m_per_count),
        }
    }

    /// Adds an error (m) that depends on the time since the start of the log, s.
    fn add_over_time(&mut self, error_m: impl Fn(f64) -> f64) {
        for (row, sample) in self.recording.movements.iter_mut().flatten().enumerate() {
            let t_s = row as f64 * self.stage.servo_period_s;
            Self::add(self.stage, self.channel, sample, error_m(t_s));
        }
    }

    /// A movement, and a row in its middle half.
    fn middle(&self) -> (usize, usize) {
        let movement = self.place as usize * 7 % self.recording.movements.len();
        let rows = self.recording.movements[movement].len();
        (movement, rows / 4 + self.place as usize * 131 % (rows / 2))
    }

    fn jumps(&mut self, count: usize, error_m: f64) {
        let rows = self.recording.rows();
        let apart = rows / count;
        let samples = self.recording.movements.iter_mut().flatten();
        for (k, sample) in samples.skip(apart / 2).step_by(apart).enumerate() {
            let sign = if k % 3 == 0 { -1.0 } else { 1.0 };
            Self::add(self.stage, self.channel, sample, sign * error_m);
        }
    }
}

/// Name, code, channels, sizes.
type Row = (&'static str, Code, &'static [usize], &'static [f64], Fault);

const FAULTS: [Row; 3] = [
    (
        "ten jumps, um",
        Code::Outliers,
        &[0, 2, 3, 4, 5],
        &[3.0, 5.0],
        |f, um| {
            f.jumps(10, um * 1e-6);
        },
    ),
    (
        "hum of 50 Hz, um",
        Code::Hum,
        &[0, 2, 3, 4, 5],
        &[0.1, 0.2],
        |f, um| {
            f.add_over_time(|t| um * 1e-6 * (TAU * 50.0 * t).sin());
        },
    ),
    (
        "channel stuck, s",
        Code::Stuck,
        &[0, 2, 3, 4, 5],
        &[0.2, 0.5, 1.0],
        |f, seconds| {
            let (movement, row) = f.middle();
            let rows = &mut f.recording.movements[movement];
            let end = rows
                .len()
                .min(row + (seconds / f.stage.servo_period_s) as usize);
            let held = rows[row];
            for sample in &mut rows[row..end] {
                match f.channel {
                    0..3 => sample.hall[f.channel] = held.hall[f.channel],
                    _ => sample.beams_nm[f.channel - 3] = held.beams_nm[f.channel - 3],
                }
            }
        },
    ),
];

/// Prints a line for each fault and size, and `RESULT` lines.
pub(crate) fn table(stage: &Stage, planned: &Trajectory) {
    println!("{:<36}{:>9}{:>9}{:>9}", "fault", "size", "named", "others");
    for (name, code, channels, sizes, fault) in FAULTS {
        for &size in sizes {
            let (mut named, mut others) = (0, 0);
            for seed in 1..=FAULTY {
                let channel = channels[seed as usize % channels.len()];
                let recording = recording(stage, planned, 1000 + seed);
                let mut faulty = Faulty {
                    stage,
                    recording,
                    channel,
                    place: seed,
                };
                fault(&mut faulty, size);
                let dataset = faulty.recording.dataset(stage).expect("a plane");
                let (found, _) = crate::grave(&dataset, stage);
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

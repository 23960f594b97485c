//! Inputs that move: poses are those of the instant that the program stamps.

use super::{Outcome, expect};
use crate::adc_model::{Input, Part};
use crate::bench::{Bench, Seen};

const PERIOD_US: f64 = 2000.0;
const TICKS: u64 = 10_000;
/// From the trigger to the middle of what the driver of the ADS131M08 reads: its 150 us stand for 144
/// and 155 us, and the modelled part is one of 155 us. (An ADS8688 is 12 us late: too little of a step of the log
/// to show in codes of 16 bits.)
const SAMPLE_US: f64 = 155.0;

/// The inputs move from row to row of the log: the lag behind the row of the tick that fits the
/// poses X, Y and Rz best is what the driver says.
pub fn a_pose_is_of_its_instant(bench: &Bench) -> Outcome {
    let mut machine = bench.machine(Part::Ads131m08, [&bench.blob, &[]])?;
    machine.chip.adc.input = Input::moving(bench.rows.clone(), PERIOD_US as u64, 0);
    machine.run_ticks(TICKS)?;
    let seen = Seen::since_last(&mut machine);
    let value = |word: u32| f64::from(f32::from_bits(word));
    let (mut products, mut squares) = (0.0, 0.0);
    for axis in seen.axes.iter().filter(|axis| axis.axis < 3) {
        let word = |tick: u64| value(bench.poses[tick as usize].words[axis.axis]);
        let (row, next) = (word(axis.tick), word(axis.tick + 1));
        products += (value(axis.word) - row) * (next - row);
        squares += (next - row).powi(2);
    }
    let lag_us = PERIOD_US * products / squares;
    println!("RESULT firmware_ads131m08_sample_us={lag_us:.1}");
    expect((lag_us - SAMPLE_US).abs() < 2.0, || {
        format!("the poses are {lag_us:.1} us behind the trigger, not {SAMPLE_US}")
    })
}

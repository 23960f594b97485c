//! Inputs that move: a pose belongs to the instant that the program stamps.

use crate::adc_model::Input;
use crate::adc_model::ads131m08::Variant;
use crate::bench::{Bench, Seen};

const PERIOD_US: f64 = 2000.0;
const TICKS: u64 = 60;
/// From the trigger to the middle of the sample, by the driver: it stands for 160 and 171 us.
const SAMPLE_US: f64 = 166.0;
/// The interrupt that reads the codes may come this much early or late, ns.
const JITTER_NS: i64 = 3000;

/// The instant of a pose, in variants of the converter and with the program's own gaps between its frames:
/// every instruction takes its time. (The driver's test takes every variant.)
pub fn a_pose_has_its_instant(bench: &Bench) {
    let mut lags = Vec::new();
    for variant in Variant::all().step_by(11) {
        for jitter_ns in [-JITTER_NS, 0, JITTER_NS] {
            let lag_us = lag_us(bench, variant, jitter_ns);
            assert!(
                (lag_us - SAMPLE_US).abs() < 7.0,
                "poses {lag_us:.1} us behind the trigger: {variant:?}, {jitter_ns} ns"
            );
            lags.push(lag_us);
        }
    }
    lags.sort_by(f64::total_cmp);
    let (least, most) = (lags[0], lags[lags.len() - 1]);
    println!("RESULT firmware_sample_us={least:.1}..{most:.1}");
}

/// Lag of X, Y and Rz behind the row of their tick, us, by least squares. The inputs move from row to row of
/// the log.
fn lag_us(bench: &Bench, variant: Variant, jitter_ns: i64) -> f64 {
    let mut machine = bench.machine([&bench.blob, &[]]);
    machine.count_instructions();
    machine.chip.adc.part.variant = variant;
    machine.chip.settled_jitter_ns = jitter_ns;
    machine.chip.adc.input = Input::moving(bench.rows.clone(), PERIOD_US as u64, 0);
    let seen = Seen::after(&mut machine, TICKS);
    assert!(seen.axes.len() >= 3 * TICKS as usize, "{variant:?}");
    let value = |word: u32| f64::from(f32::from_bits(word));
    let (mut products, mut squares) = (0.0, 0.0);
    for axis in seen.axes.iter().filter(|axis| axis.axis < 3) {
        let word = |tick: u64| value(bench.pose(tick).words[axis.axis]);
        let (row, next) = (word(axis.tick), word(axis.tick + 1));
        products += (value(axis.word) - row) * (next - row);
        squares += (next - row).powi(2);
    }
    PERIOD_US * products / squares
}

//! Inputs that move: a pose belongs to the instant that the program stamps.

use crate::adc_model::Input;
use crate::adc_model::ads131m08::Variant;
use crate::bench::{Bench, Seen};

const PERIOD_US: f64 = 2000.0;
const TICKS: u64 = 60;
/// The interrupt that reads the codes may come this much early or late, ns.
const LATE_NS: [i64; 4] = [-3000, 0, 3000, 40_000];

/// The time of a pose on the bus is its instant, in every variant of the converter and with the program's own gaps between
/// its frames: every instruction takes its time.
pub fn a_pose_has_its_instant(bench: &Bench) {
    let mut errors: Vec<f64> = Vec::new();
    for variant in Variant::all() {
        for late_ns in LATE_NS {
            let (lag_us, stamped_us) = lags_us(bench, variant, late_ns);
            let error_us = stamped_us - lag_us;
            assert!(
                error_us.abs() < 10.0,
                "{stamped_us:.1} us stamped, {lag_us:.1} us true: {variant:?}, {late_ns} ns"
            );
            errors.push(error_us);
        }
    }
    errors.sort_by(f64::total_cmp);
    let (least, most) = (errors[0], errors[errors.len() - 1]);
    println!("RESULT firmware_error_of_time_us={least:.1}..{most:.1}");
}

/// Lag of X, Y and Rz behind the row of their tick, us, by least squares, and by their times. The inputs move from row to
/// row of the log.
fn lags_us(bench: &Bench, variant: Variant, jitter_ns: i64) -> (f64, f64) {
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
    let first_us = machine
        .chip
        .timer_us_at(machine.chip.first_tick_ns.expect("a tick"));
    let lags = seen.times.iter().map(|(number, time_us)| {
        let tick_us = first_us.wrapping_add(number * PERIOD_US as u32);
        f64::from(time_us.wrapping_sub(tick_us))
    });
    let stamped_us = lags.sum::<f64>() / seen.times.len() as f64;
    (PERIOD_US * products / squares, stamped_us)
}

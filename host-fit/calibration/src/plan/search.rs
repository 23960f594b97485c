//! The choice of the six frequencies, by the service error that each set leads to.
//!
//! Axes that move together can't be separated, and products of two axes that fall on the frequency
//! of a third, or near zero where the reference drifts, are badly determined. No rule sees all of that:
//! sets are drawn, judged by their forecast, and the best is improved axis by axis.

use super::forecast::forecast;
use super::run::Run;
use hallstage_input::stage::{AxisMotion, Stage};
use hallstage_simulate::random::{Purpose, Stream};
use hallstage_solver::solve::field::forecast::Forecaster;
use rayon::prelude::*;

/// Highest frequency, Hz: faster motion shakes the stage and gains nothing, since the reference
/// hardly drifts within a second.
const FREQUENCY_MAX_HZ: f64 = 2.0;
/// Frequencies are multiples of half a cycle in the length of a run: that far apart, sines differ.
const CYCLE_STEP: f64 = 0.5;
/// Fewest cycles.
const CYCLES_MIN: f64 = 1.0;
/// How closely a run is looked at while the choice is made, s.
const STEP_S: f64 = 0.04;
/// Sets that are judged before the best of them goes on.
const BATCH: usize = 16;
/// Batches times seconds: a long run takes longer to judge and less choosing.
const BATCH_SECONDS: f64 = 200.0;
/// Fewest and most batches; the first third are drawn anew.
const BATCHES: (usize, usize) = (3, 10);
/// Cycles of a set that is good on a stage of the usual limits, in parts of the highest: where the
/// choice starts.
const START: [f64; 6] = [0.7, 0.85, 0.75, 1.0, 0.9, 0.55];

/// Numbers of cycles that an axis can do within its limits, in ascending order.
pub fn allowed_cycles(motion: &AxisMotion, axis: usize, seconds: f64, taper_s: f64) -> Vec<f64> {
    let most = (FREQUENCY_MAX_HZ * seconds / CYCLE_STEP).floor() as u32;
    let least = (CYCLES_MIN / CYCLE_STEP) as u32;
    let within = |cycles: &f64| {
        let run = Run {
            seconds,
            taper_s,
            amplitudes: [motion.amplitude; 6],
            cycles: [*cycles; 6],
        };
        let [speed, acceleration] = run.peaks(axis);
        speed <= motion.speed && acceleration <= motion.acceleration
    };
    let steps = (least..=most).map(|k| f64::from(k) * CYCLE_STEP);
    steps.filter(within).collect()
}

/// The best run found with these cycles allowed to each axis; `None` where six can't be distinct.
pub fn best(
    stage: &Stage,
    forecaster: &Forecaster,
    seconds: f64,
    taper_s: f64,
    allowed: &[Vec<f64>; 6],
) -> Option<Run> {
    let run = |cycles: [f64; 6]| Run {
        seconds,
        taper_s,
        amplitudes: stage.motion.axes.map(|axis| axis.amplitude),
        cycles,
    };
    let step_s = STEP_S.max(stage.servo_period_s);
    // Variance by the parameters over that by noise, of the worst axis.
    let cost = |cycles: &[f64; 6]| {
        let forecast = forecast(forecaster, &run(*cycles), stage.servo_period_s, step_s);
        forecast.map_or(f64::INFINITY, |forecast| forecast.service.worst())
    };
    let mut random = Stream::new(0, Purpose::Motion, 0);
    let mut sets = vec![start(allowed)?];
    let batches = ((BATCH_SECONDS / seconds) as usize).clamp(BATCHES.0, BATCHES.1);
    let mut best = (f64::INFINITY, sets[0]);
    for batch in 0..batches {
        while sets.len() < BATCH {
            let mut set = best.1;
            // Anew: all six in turn; later one or two.
            let changes = if batch * 3 < batches {
                6
            } else {
                1 + sets.len() % 2
            };
            let first = (6.0 * random.uniform()) as usize;
            for k in 0..changes {
                let axis = (first + k * (1 + sets.len() / 2 % 5)) % 6;
                redraw(
                    &mut set,
                    if changes == 6 { k } else { axis },
                    allowed,
                    &mut random,
                );
            }
            sets.push(set);
        }
        let costs: Vec<f64> = sets.par_iter().map(cost).collect();
        for (set, cost) in sets.drain(..).zip(costs) {
            if cost < best.0 {
                best = (cost, set);
            }
        }
    }
    Some(run(best.1))
}

/// Other cycles for one axis: any that it can do and no other axis has.
fn redraw(set: &mut [f64; 6], axis: usize, allowed: &[Vec<f64>; 6], random: &mut Stream) {
    let others = *set;
    let free = |cycles: &&f64| (0..6).all(|k| k == axis || others[k] != **cycles);
    let free: Vec<&f64> = allowed[axis].iter().filter(free).collect();
    // The upper part: slow sines are lost in the drift.
    let place = random.between(0.25, 1.0) * free.len() as f64;
    if let Some(cycles) = free.get(place as usize) {
        set[axis] = **cycles;
    }
}

/// A first set: for each axis what is nearest to [`START`] and not taken; the axis with the
/// fewest to choose from chooses first.
fn start(allowed: &[Vec<f64>; 6]) -> Option<[f64; 6]> {
    let mut order = [0, 1, 2, 3, 4, 5];
    order.sort_by_key(|&axis| allowed[axis].len());
    let mut set = [0.0; 6];
    for axis in order {
        let wanted = START[axis] * allowed[axis].last()?;
        let free = allowed[axis].iter().filter(|cycles| !set.contains(cycles));
        let distance = |cycles: &f64| (cycles - wanted).abs();
        set[axis] = *free.min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    }
    Some(set)
}

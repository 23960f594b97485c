//! The choice of the six frequencies, by the predicted error in service.
//!
//! Axes that move together cannot be separated. A product of two axes is badly determined on the
//! frequency of a third axis, and near zero, where the reference drifts. No simple rule covers this: sets
//! are drawn, judged by their forecast, and the best set is improved axis by axis.

use super::forecast::forecast;
use super::run::PlannedRun;
use hallstage_input::stage::{AxisMotion, Stage};
use hallstage_simulate::random::{Purpose, Stream};
use hallstage_solver::estimator::forecast::Forecaster;
use rayon::prelude::*;

/// Highest frequency of the slow sines, Hz. Faster motion shakes the stage and gains nothing, since the reference hardly
/// drifts within a second.
const FREQUENCY_MAX_HZ: f64 = 1.0;
/// Cycles are multiples of one half: sines half a cycle apart differ enough.
const CYCLE_STEP: f64 = 0.5;
/// Fewest cycles.
const CYCLES_MIN: f64 = 1.0;
/// Sampling interval of a run during the choice, s.
const STEP_S: f64 = 0.04;
/// Sets in a batch. The best set goes on to the next batch.
const BATCH: usize = 16;
/// Batches times the length of the run in s: a long run is slow to judge and easy to choose.
const BATCH_SECONDS: f64 = 200.0;
/// Fewest and most batches. The first third draw all six axes anew.
const BATCHES: (usize, usize) = (3, 10);
/// The first set, cycles over the highest allowed ones: good for a stage with usual limits.
const START: [f64; 6] = [0.7, 0.85, 0.75, 1.0, 0.9, 0.55];

/// The numbers of cycles within the limits of an axis, in ascending order.
pub fn allowed_cycles(motion: &AxisMotion, axis: usize, seconds: f64, taper_s: f64) -> Vec<f64> {
    let most = (FREQUENCY_MAX_HZ * seconds / CYCLE_STEP).floor() as u32;
    let least = (CYCLES_MIN / CYCLE_STEP) as u32;
    let within = |cycles: &f64| {
        let run = PlannedRun {
            seconds,
            taper_s,
            amplitudes: [motion.amplitude; 6],
            cycles: [*cycles; 6],
            tones: [0.0; 6],
        };
        let [speed, acceleration] = run.peaks(axis);
        speed <= motion.speed && acceleration <= motion.acceleration
    };
    let steps = (least..=most).map(|k| f64::from(k) * CYCLE_STEP);
    steps.filter(within).collect()
}

/// The best run found with the allowed cycles of each axis; `None` where six cannot be distinct.
pub fn best(
    stage: &Stage,
    forecaster: &Forecaster,
    seconds: f64,
    taper_s: f64,
    allowed: &[Vec<f64>; 6],
) -> Option<PlannedRun> {
    let run = |cycles: [f64; 6]| {
        PlannedRun {
            seconds,
            taper_s,
            amplitudes: stage.motion.axes.map(|axis| axis.amplitude),
            cycles,
            tones: [0.0; 6],
        }
        .with_tones(&stage.motion)
    };
    let step_s = STEP_S.max(stage.servo_period_s);
    // The variance due to the parameters over the variance due to noise, for the worst axis.
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
            // At first all six axes change, later one or two.
            let first = (6.0 * random.uniform()) as usize;
            let second = first + 1 + sets.len() / 2 % 5;
            let changed = match (batch * 3 < batches, sets.len() % 2) {
                (true, _) => &[0, 1, 2, 3, 4, 5][..],
                (false, 0) => &[first],
                (false, _) => &[first, second % 6],
            };
            for &axis in changed {
                redraw(&mut set, axis, allowed, &mut random);
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

/// Draws new cycles for one axis, different from the other axes.
fn redraw(set: &mut [f64; 6], axis: usize, allowed: &[Vec<f64>; 6], random: &mut Stream) {
    let others = *set;
    let free = |cycles: &&f64| (0..6).all(|k| k == axis || others[k] != **cycles);
    let free: Vec<&f64> = allowed[axis].iter().filter(free).collect();
    // The upper three quarters: slow sines are lost in the drift.
    let place = random.between(0.25, 1.0) * free.len() as f64;
    if let Some(cycles) = free.get(place as usize) {
        set[axis] = **cycles;
    }
}

/// The first set: for each axis the free cycles nearest to [`START`]. The axis with the fewest allowed
/// cycles chooses first.
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

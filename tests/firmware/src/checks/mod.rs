//! Every property that is checked. A check that does not hold panics.

mod asking;
pub mod authority;
pub mod bus;
pub mod commands;
pub mod figures;
pub mod log;
pub mod motion;
pub mod neighbour;
pub mod parameters;
pub mod power_cuts;
pub mod sensors;
pub mod start;
pub mod stopped;
pub mod temperature;
pub mod timing;
pub mod update;
pub mod zero;

use crate::bench::{Axis, Comparison, Words};
use crate::machine::Machine;

/// The program neither panicked nor was bitten by the watchdog.
pub fn no_resets(machine: &Machine) {
    assert_eq!((machine.panics, machine.watchdog_resets), (0, 0));
}

/// Every word from this tick on is the host's, and so many poses are there at least.
pub fn same_words(axes: &[Axis], poses: &[Words], from: u64, least: u64) -> Comparison {
    let mut comparison = Comparison::default();
    comparison.add(axes, poses, from);
    assert_eq!(comparison.differing, 0, "words that differ");
    assert!(
        comparison.planar >= least,
        "only {} poses",
        comparison.planar
    );
    comparison
}

/// Ticks with valid words that are not the host's: of their tick or, where a reset may have come
/// between, of so many before it.
pub fn wrong_valid(axes: &[Axis], poses: &[Words], before: u64) -> usize {
    let is_right = |axis: &Axis| {
        let mut ticks = axis.tick.saturating_sub(before)..=axis.tick;
        ticks.any(|tick| poses[tick as usize % poses.len()].words[axis.axis] == axis.word)
    };
    let wrong = axes
        .iter()
        .filter(|axis| axis.is_valid() && !is_right(axis));
    let mut ticks: Vec<_> = wrong.map(|axis| axis.tick).collect();
    ticks.dedup();
    ticks.len()
}

//! The checks: one property each. A check panics if its property does not hold.

mod asking;
pub mod authority;
pub mod bus;
pub mod commands;
pub mod figures;
pub mod log;
pub mod motion;
pub mod neighbour;
pub mod parameters;
pub mod seal;
pub mod sensors;
pub mod start;
pub mod stopped;
pub mod temperature;
pub mod timing;
pub mod update;
pub mod zero;

use crate::bench::{Axis, Words};
use crate::machine::Machine;

/// The program neither panicked nor was reset by the watchdog.
pub fn no_resets(machine: &Machine) {
    assert_eq!((machine.panics, machine.watchdog_resets), (0, 0));
}

/// Every word from tick `from` on equals the host's word, and there are at least `least` poses. Returns
/// the number of words.
pub fn same_words(axes: &[Axis], poses: &[Words], from: u64, least: u64) -> u64 {
    let (mut words, mut planar) = (0, 0);
    for axis in axes.iter().filter(|axis| axis.tick >= from) {
        let host = poses[axis.tick as usize % poses.len()];
        assert!(axis.equals(&host), "{axis:x?}, not {host:x?}");
        words += 1;
        planar += u64::from(axis.axis == 0);
    }
    assert!(planar >= least, "only {planar} poses");
    words
}

/// Ticks with valid words that differ from the host's words of this tick and of the `before` ticks before
/// it: a reset may shift the log.
pub fn wrong_valid(axes: &[Axis], poses: &[Words], before: u64) -> usize {
    let is_right = |axis: &Axis| {
        let mut ticks = axis.tick.saturating_sub(before)..=axis.tick;
        ticks.any(|tick| poses[tick as usize % poses.len()].words[axis.axis] == axis.word)
    };
    let wrong = (axes.iter()).filter(|axis| axis.is_valid() && !is_right(axis));
    let mut ticks: Vec<_> = wrong.map(|axis| axis.tick).collect();
    ticks.dedup();
    ticks.len()
}

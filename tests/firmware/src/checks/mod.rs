//! Every property that is checked, and how results are reported.

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

/// Why a check failed.
pub type Failure = Box<dyn std::error::Error>;
/// How a check ended.
pub type Outcome = Result<(), Failure>;

/// Counts what passed.
#[derive(Default)]
pub struct Report {
    /// Checks that passed.
    pub passed: u32,
    /// Checks that failed.
    pub failed: u32,
}

impl Report {
    /// Prints how a check ended.
    pub fn note(&mut self, name: &str, outcome: Outcome) {
        match outcome {
            Ok(()) => {
                self.passed += 1;
                println!("ok      {name}");
            }
            Err(failure) => {
                self.failed += 1;
                println!("FAILED  {name}: {failure}");
            }
        }
    }
}

/// Fails with `text` unless `holds`.
pub fn expect(holds: bool, text: impl FnOnce() -> String) -> Outcome {
    if holds { Ok(()) } else { Err(text().into()) }
}

/// Fails unless both are equal.
pub fn equal<T: PartialEq + core::fmt::Debug>(what: &str, found: T, wanted: T) -> Outcome {
    expect(found == wanted, || {
        format!("{what} is {found:?}, not {wanted:?}")
    })
}

/// Fails if the program panicked or the watchdog bit.
pub fn no_resets(machine: &Machine) -> Outcome {
    let resets = (machine.panics, machine.watchdog_resets);
    equal("panics and watchdog resets", resets, (0, 0))
}

/// Fails unless every word from this tick on is the host's, and so many poses are there at least.
pub fn same_words(axes: &[Axis], poses: &[Words], from: u64, least: u64) -> Outcome {
    let mut comparison = Comparison::default();
    comparison.add(axes, poses, from);
    equal("words that differ", comparison.differing, 0)?;
    let planar = comparison.planar;
    expect(planar >= least, || format!("only {planar} poses"))
}

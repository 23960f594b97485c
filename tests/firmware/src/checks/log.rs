//! The whole log through converter, decoder and bus.

use super::{no_resets, same_words};
use crate::bench::{Bench, Seen};
use crate::machine::Machine;
use hal_adapters::can::status::NodeState;

/// Ticks between two looks at the bus.
const STEP: usize = 1000;

/// The words of `ticks` ticks equal the words of `host-fit decode`, and there are no other frames.
pub fn whole_log(bench: &Bench, ticks: u64) {
    let mut machine = bench.machine([&bench.blob, &[]]);
    machine.run_ns(0); // The start-up feeds the watchdog, too.
    let fed_before = machine.chip.watchdog.fed;
    let (mut words, mut seen) = (0, Seen::default());
    for from in (0..ticks).step_by(STEP) {
        let step = (ticks - from).min(STEP as u64);
        seen = Seen::after(&mut machine, step);
        words += same_words(&seen.axes, &bench.poses, 0, step - 2);
        assert_eq!(seen.damaged, 0);
        // Every sixteenth tick has a state.
        let states = || seen.statuses.iter().map(|(tick, _)| tick);
        assert!(states().all(|tick| tick % 16 == 0));
        assert!(
            (STEP / 16..STEP / 16 + 2).contains(&states().count()) || ticks - from < STEP as u64
        );
    }
    println!("RESULT firmware_ticks={ticks}");
    println!("RESULT firmware_words={words}");
    println!("RESULT firmware_differing=0");
    let stack_bytes = machine.stack_bytes();
    println!("RESULT firmware_stack_bytes={stack_bytes}");
    let stage = Stage::read(&machine);
    for (counter, value) in COUNTERS.iter().zip(stage.counters) {
        println!("RESULT firmware_{counter}={value}");
    }
    // The first tick joins the bus, the last one is still on its way.
    assert!(words >= (ticks - 2) * 15 / 4 - 8, "{words} words");
    no_resets(&machine);
    let status = seen.last_status().expect("a state");
    let found = (status.state, status.missed_ticks, status.bus_off);
    assert_eq!(found, (Some(NodeState::Running), 0, 0));
    assert_eq!(stage.count("adc_faults"), 0);
    assert!(stage.count("frames_dropped") <= 8);
    let fed = machine.chip.watchdog.fed - fed_before;
    assert_eq!(fed, u64::from(stage.sequence) + 1);
    let ticks_reported = seen.page(0).expect("page 0");
    assert!(
        u64::from(ticks_reported) + 200 > ticks,
        "health reports {ticks_reported} ticks"
    );
    // Ticks without a planar pose, without a vertical one, held, without codes, repeated.
    for page in (seen.health.iter()).filter(|page| (1..6).contains(&page.page)) {
        assert_eq!(page.value, 0, "{page:?}");
    }
}

/// The counters of `STAGE`, in their order.
const COUNTERS: [&str; 7] = [
    "overrun_ticks",
    "adc_faults",
    "adc_starts",
    "frames_sent",
    "frames_dropped",
    "receive_overruns",
    "fpu_restored",
];

/// The static `STAGE` as a debugger reads it.
pub struct Stage {
    /// Number of the last tick.
    pub sequence: u32,
    /// Bits of the pose.
    pub pose: [u32; 6],
    counters: [u32; COUNTERS.len()],
}

impl Stage {
    /// Reads it by its symbol.
    pub fn read(machine: &Machine) -> Self {
        let word = |k: usize| machine.word(machine.stage_at + 4 * k as u32);
        assert_eq!(word(0) % 2, 0, "STAGE is torn");
        Self {
            sequence: word(1),
            pose: core::array::from_fn(|k| word(4 + k)),
            counters: core::array::from_fn(|k| word(10 + k)),
        }
    }

    /// One of [`COUNTERS`].
    pub fn count(&self, name: &str) -> u32 {
        let at = COUNTERS.iter().position(|counter| *counter == name);
        self.counters[at.expect(name)]
    }

    /// It shows the host's pose, of this tick or of a later one.
    pub fn has_the_pose(&self, bench: &Bench, least: u32) {
        assert!(self.sequence >= least, "only tick {}", self.sequence);
        assert_eq!(self.pose, bench.pose(self.sequence.into()).words);
    }
}

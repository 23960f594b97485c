//! The whole log through converter, decoder and bus.

use super::sensors::ticks_to_settle;
use super::{Outcome, equal, expect, no_resets};
use crate::adc_model::Part;
use crate::bench::{Bench, Comparison, Seen};
use crate::machine::Machine;
use hal_adapters::can::status::NodeState;

/// Ticks between two looks at the bus.
const STEP: u64 = 1000;

/// Runs `ticks` ticks and compares every word on the bus with the host's.
pub fn compare(
    bench: &Bench,
    machine: &mut Machine,
    part: Part,
    ticks: u64,
) -> Result<(Comparison, Seen), super::Failure> {
    let mut comparison = Comparison::default();
    let mut all = Seen::default();
    let mut left = ticks;
    while left > 0 {
        let now = left.min(STEP);
        machine.run_ticks(now)?;
        left -= now;
        let seen = Seen::since_last(machine);
        comparison.add(&seen.axes, &bench.poses, ticks_to_settle(part));
        all.damaged += seen.damaged;
        all.statuses = seen.statuses;
        all.health = seen.health;
    }
    Ok((comparison, all))
}

/// The words of `ticks` ticks are those of `host-fit decode`, and there are no other frames.
pub fn same_words(bench: &Bench, part: Part, ticks: u64, name: &str) -> Outcome {
    let mut machine = bench.machine(part, [&bench.blob, &[]])?;
    machine.run_ns(0)?; // The start-up feeds the watchdog, too.
    let fed_before = machine.chip.watchdog.fed;
    let (comparison, seen) = compare(bench, &mut machine, part, ticks)?;
    println!("RESULT firmware_{name}_ticks={ticks}");
    println!("RESULT firmware_{name}_words={}", comparison.words);
    println!("RESULT firmware_{name}_differing={}", comparison.differing);
    println!(
        "RESULT firmware_{name}_stack_bytes={}",
        machine.stack_bytes()
    );
    let stage = Stage::read(&machine, bench, part)?;
    for (counter, value) in stage.counters() {
        println!("RESULT firmware_{name}_{counter}={value}");
    }
    equal("words that differ", comparison.differing, 0)?;
    // The first tick joins the bus, the last one is still on its way.
    let settling = ticks_to_settle(part);
    let ticks_with_codes = ticks - settling;
    expect(comparison.planar >= ticks_with_codes - 2, || {
        format!("only {} poses", comparison.planar)
    })?;
    expect(
        comparison.words >= (ticks_with_codes - 2) * 15 / 4 - 8,
        || format!("only {} words", comparison.words),
    )?;
    equal("damaged frames", seen.damaged, 0)?;
    no_resets(&machine)?;
    let state = seen
        .last_status()
        .map(|s| (s.state, s.missed_ticks, s.bus_off));
    let running = Some((Some(NodeState::Running), 0, 0));
    equal("state, missed ticks, times the bus was off", state, running)?;
    equal("ticks without codes", stage.adc_faults.into(), settling)?;
    expect(stage.frames_dropped <= 8, || {
        format!("{} frames dropped", stage.frames_dropped)
    })?;
    let fed = machine.chip.watchdog.fed - fed_before;
    equal("feeds of the watchdog", fed, u64::from(stage.sequence) + 1)?;
    let ticks_reported = seen
        .health
        .iter()
        .rev()
        .find(|page| page.page == 0)
        .map_or(0, |page| page.value);
    expect(u64::from(ticks_reported) + 200 > ticks, || {
        format!("health reports {ticks_reported} ticks")
    })?;
    let wrong = seen
        .health
        .iter()
        .filter(|page| page.page != 0 && page.page < 6)
        // Up to page 5, counters. Pages 1, 2 and 4: ticks without a planar pose, without a vertical one, without codes.
        .find(|page| {
            u64::from(page.value)
                != if page.page == 3 || page.page == 5 {
                    0
                } else {
                    settling
                }
        });
    equal(
        "a counter of the health frames",
        wrong.map(|page| page.page),
        None,
    )
}

/// The static `STAGE` as a debugger reads it.
pub struct Stage {
    /// Number of the last tick.
    pub sequence: u32,
    /// Bits of the pose.
    pub pose: [u32; 6],
    /// Ticks not done in time.
    pub overrun_ticks: u32,
    /// Ticks without codes.
    pub adc_faults: u32,
    /// Starts of the converter.
    pub adc_starts: u32,
    /// Frames sent.
    pub frames_sent: u32,
    /// Frames dropped.
    pub frames_dropped: u32,
    /// Times that a received frame found no room.
    pub receive_overruns: u32,
    /// Ticks in which the FPU's settings were restored.
    pub fpu_restored: u32,
}

impl Stage {
    /// Reads it by its symbol.
    pub fn read(machine: &Machine, bench: &Bench, part: Part) -> Result<Self, String> {
        let at = bench.image(part).address("STAGE")?;
        let word = |k: u32| machine.word(at + 4 * k);
        expect(word(0) % 2 == 0, || "STAGE is torn".to_owned()).map_err(|e| e.to_string())?;
        Ok(Self {
            sequence: word(1),
            pose: [4, 5, 6, 7, 8, 9].map(word),
            overrun_ticks: word(10),
            adc_faults: word(11),
            adc_starts: word(12),
            frames_sent: word(13),
            frames_dropped: word(14),
            receive_overruns: word(15),
            fpu_restored: word(16),
        })
    }

    fn counters(&self) -> [(&'static str, u32); 7] {
        [
            ("overrun_ticks", self.overrun_ticks),
            ("adc_faults", self.adc_faults),
            ("adc_starts", self.adc_starts),
            ("frames_sent", self.frames_sent),
            ("frames_dropped", self.frames_dropped),
            ("receive_overruns", self.receive_overruns),
            ("fpu_restored", self.fpu_restored),
        ]
    }
}

/// What a debugger reads is the pose of the last tick.
pub fn a_debugger_reads_the_last_pose(bench: &Bench) -> Outcome {
    let part = Part::Ads131m08;
    let mut machine = bench.machine(part, [&bench.blob, &[]])?;
    machine.run_ticks(321)?;
    let stage = Stage::read(&machine, bench, part)?;
    equal(
        "pose",
        stage.pose,
        bench.poses[stage.sequence as usize].words,
    )?;
    expect(stage.sequence >= 319, || format!("tick {}", stage.sequence))
}

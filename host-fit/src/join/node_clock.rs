//! The time of each tick's sample, by the clock of the sensor node.
//!
//! One tick in 16 has a time frame with its number and time; all ticks have the last four bits of their number.
//! Between two successive time frames each recorded tick has one place. Ticks beside a time frame that is missing
//! or out of order are skipped: 16 ticks may be lost there unseen, and receive times do not show it.

use crate::bus::bus_log::BusTick;
use hal_adapters::can::sensor::TickTime;
use hallstage_input::dataset::LoggedFrame;

/// Range of the numbers in time frames.
const NUMBERS: u32 = 1 << 20;

/// Ticks from one time frame to the next.
const TICKS: u32 = 16;

/// Longest time of ticks that a node misses, us. It does not number them.
const MISSED_MAX_US: f64 = 1e6;

/// How far the node's clock and the designed servo period may differ, as a part of one.
const CLOCK_SHARE: f64 = 1e-3;

/// Ticks of a block, half a second at 500 Hz. The earliest arrival of a block shows the distance between the
/// recorder's clock and the node's.
const BLOCK_TICKS: usize = 250;

/// What the sensors read at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tick {
    /// By the clock of the record, us; on the bus since the first time frame of the run.
    pub(super) t_us: f64,
    pub(super) frame: LoggedFrame,
}

/// Ticks since the node started.
#[derive(Clone, Debug, Default)]
pub(super) struct NodeRun {
    pub(super) ticks: Vec<Tick>,
    /// From the record's first time frame to the run's, us by the recorder's clock.
    pub(super) since_start_us: f64,
    /// Receive times less sample times, us: the smallest of each block of ticks.
    delays_us: Vec<f64>,
}

impl NodeRun {
    fn push(&mut self, tick: &BusTick, t_us: f64) {
        let delay_us = tick.received_us as f64 - t_us;
        if self.ticks.len().is_multiple_of(BLOCK_TICKS) {
            self.delays_us.push(delay_us);
        }
        if let Some(least) = self.delays_us.last_mut() {
            *least = least.min(delay_us);
        }
        self.ticks.push(Tick {
            t_us,
            frame: tick.codes.into(),
        });
    }

    /// Time by the recorder's clock less time by the node's, us: the median over the record. With clocks of
    /// different speed it is the value in the middle; if a clock was set, the value of the longer part.
    pub(super) fn recorder_less_node_us(&self) -> f64 {
        let mut delays_us = self.delays_us.clone();
        let middle = delays_us.len() / 2;
        match delays_us.is_empty() {
            true => 0.0,
            false => *delays_us.select_nth_unstable_by(middle, f64::total_cmp).1,
        }
    }
}

/// A time frame.
#[derive(Clone, Copy, Debug)]
struct Mark {
    frame: TickTime,
    t_us: f64,
    received_us: u64,
}

/// Gives each tick its time.
#[derive(Debug, Default)]
pub(super) struct NodeClock {
    period_us: f64,
    mark: Option<Mark>,
    /// When the first time frame was received, us.
    first_us: u64,
    /// Ticks since the mark.
    waiting: Vec<BusTick>,
    run: NodeRun,
    longest: NodeRun,
    /// How often the node started again.
    pub(super) restarts: usize,
    /// Ticks between two time frames, without a certain place.
    pub(super) untimed: usize,
}

impl NodeClock {
    /// For a stage with this servo period, us.
    pub(super) fn new(period_us: f64) -> Self {
        Self {
            period_us,
            ..Self::default()
        }
    }

    /// Takes a whole tick.
    pub(super) fn take(&mut self, tick: BusTick) {
        // The counters distinguish no more ticks.
        if self.waiting.len() <= TICKS as usize {
            self.waiting.push(tick);
        } else {
            self.untimed += 1;
        }
    }

    /// Takes a time frame.
    ///
    /// # Errors
    /// Another record begins: the node started again and the recorder's clock went back by this time, us.
    pub(super) fn take_time(&mut self, frame: TickTime, received_us: u64) -> Result<(), u64> {
        let waiting = std::mem::take(&mut self.waiting);
        let mut mark = Mark {
            frame,
            t_us: 0.0,
            received_us,
        };
        let Some(before) = self.mark else {
            self.untimed += waiting.len();
            self.mark = Some(mark);
            self.first_us = received_us;
            return Ok(());
        };
        let ticks = frame.sequence.wrapping_sub(before.frame.sequence) % NUMBERS;
        let passed_us = f64::from(frame.time_us.wrapping_sub(before.frame.time_us));
        let expected_us = f64::from(ticks) * self.period_us;
        let more_us = passed_us - expected_us;
        let apart_us = self.period_us / 2.0 + CLOCK_SHARE * expected_us;
        let follows = (-apart_us..apart_us + MISSED_MAX_US).contains(&more_us) && ticks > 0;
        if follows {
            mark.t_us = before.t_us + passed_us;
        } else if received_us < before.received_us {
            return Err(before.received_us - received_us);
        } else {
            self.restarts += 1;
            self.end_run();
            self.run.since_start_us = received_us.saturating_sub(self.first_us) as f64;
        }
        self.mark = Some(mark);
        let in_order = waiting.is_sorted_by(|a, b| a.counter() < b.counter());
        if follows && ticks == TICKS && more_us < apart_us && in_order {
            let step_us = passed_us / f64::from(TICKS);
            for tick in &waiting {
                let t_us = before.t_us + f64::from(tick.counter()) * step_us;
                if !tick.is_saturated {
                    self.run.push(tick, t_us);
                }
            }
        } else {
            self.untimed += waiting.len();
        }
        Ok(())
    }

    /// Number of ticks with a time.
    pub(super) fn timed(&self) -> usize {
        self.run.ticks.len() + self.longest.ticks.len()
    }

    /// The longest run, and the number of untimed ticks, after the last frame.
    pub(super) fn into_longest(mut self) -> (NodeRun, usize) {
        self.untimed += self.waiting.len();
        self.end_run();
        (self.longest, self.untimed)
    }

    /// Keeps the longer run.
    fn end_run(&mut self) {
        let mut run = std::mem::take(&mut self.run);
        if run.ticks.len() > self.longest.ticks.len() {
            std::mem::swap(&mut run, &mut self.longest);
        }
        self.untimed += run.ticks.len();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use runtime::RawFrame;

    /// Ticks carry their own number, from 1, by their code.
    fn tick(n: u32) -> BusTick {
        BusTick {
            received_us: u64::from(n) * 2_000 + 5_000,
            codes: RawFrame::new([n as i32; 3], [0; 3], n, 0),
            is_saturated: false,
        }
    }

    fn take(clock: &mut NodeClock, n: u32, is_refused: bool) {
        if n.is_multiple_of(TICKS) {
            let frame = TickTime {
                sequence: n % NUMBERS,
                time_us: n.wrapping_mul(2_000),
            };
            clock
                .take_time(frame, u64::from(n) * 2_000 + 5_000)
                .expect("one record");
        }
        if !is_refused {
            clock.take(tick(n));
        }
    }

    #[test]
    fn no_loss_of_ticks_gives_a_tick_another_time() {
        // The node's numbers and times wrap on the way.
        for first in [NUMBERS - 100 - NUMBERS % TICKS, 2_147_400] {
            for count in 0..130 {
                for start in 190..222 {
                    for refused in [0, 1, 2] {
                        let mut clock = NodeClock::new(2_000.0);
                        let lost = first + start..first + start + count;
                        for n in (first..first + 700).filter(|n| !lost.contains(n)) {
                            take(&mut clock, n, (lost.end..lost.end + refused).contains(&n));
                        }
                        let (run, untimed) = clock.into_longest();
                        let what = format!("{count} from {start} on, {refused} refused");
                        let ticks = run.ticks.len() + untimed;
                        assert!(ticks as u32 + count + refused == 700, "{what}: {ticks}");
                        assert!(run.ticks.len() as u32 + count > 630, "{what}: {untimed}");
                        let zero_us = run.ticks[0].t_us
                            - 2_000.0 * f64::from(run.ticks[0].frame.codes.hall[0]);
                        for tick in &run.ticks {
                            let n_us = 2_000.0 * f64::from(tick.frame.codes.hall[0]);
                            assert_eq!(tick.t_us - n_us, zero_us, "{what}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn of_a_node_that_starts_again_the_longest_run_is_kept() {
        let mut clock = NodeClock::new(2_000.0);
        for n in (600_000..600_100).chain(0..200) {
            let received = u64::from(n) + if n < 600_000 { 700_000 } else { 0 };
            if n % TICKS == 0 {
                let frame = TickTime {
                    sequence: n,
                    time_us: n * 2_000,
                };
                clock.take_time(frame, received).expect("one record");
            }
            clock.take(tick(n));
        }
        assert_eq!(clock.restarts, 1);
        let (run, untimed) = clock.into_longest();
        assert_eq!((run.ticks.len(), untimed), (192, 108));
        assert_eq!(
            (run.ticks[20].t_us, run.ticks[20].frame.codes.hall[0]),
            (40_000.0, 20)
        );
    }
}

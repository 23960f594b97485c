//! Numbers of ticks, by the sensor node's own count. The counters of frames count modulo 16, so
//! a loss of 16 ticks does not show in them, and receive times cannot tell it from frames that
//! came late. One tick in 16 has a time frame with its number. Between two time frames that are
//! as many ticks apart as the counters say, none was lost unseen, and each tick has its number.
//! All other ticks are left out.

use super::bus_log::BusTick;
use hal_adapters::can::sensor::TickTime;
use std::collections::VecDeque;

/// Numbers that a time frame tells: it has 20 bits for them.
const NUMBERS: u64 = 1 << 20;

/// Values of a frame's counter.
const COUNTERS: u64 = 16;

/// Ticks that wait for the next time frame, at most.
const WAITING_MAX: usize = 1024;

/// How far two clocks of one node may differ over the time between two time frames: as a share,
/// and besides, us.
const SAME_CLOCK: (f64, f64) = (1e-3, 20_000.0);

/// The tick of a time frame.
#[derive(Clone, Copy, Debug)]
struct Mark {
    frame: TickTime,
    /// Its number, by the counters alone.
    counted: u64,
    /// Its number in the run, with every lost tick counted.
    sequence: u64,
    /// Whether the node counted on since the mark before.
    follows: bool,
}

/// Gives ticks their numbers.
#[derive(Debug)]
pub(super) struct Numbering {
    servo_period_us: f64,
    /// The tick before, by the counters alone.
    counted: Option<u64>,
    mark: Option<Mark>,
    /// A time frame whose tick is not known yet.
    told: Option<TickTime>,
    /// Ticks since the mark.
    waiting: Vec<BusTick>,
    numbered: VecDeque<BusTick>,
    /// The last one that was numbered.
    last: Option<u64>,
    /// Whether the node counted on since then.
    follows: bool,
    counts: NumberingCounts,
    /// Of those without a number, how many since the last one that has one.
    unnumbered_since: u64,
}

/// What was numbered.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct NumberingCounts {
    /// Whole ticks without a number.
    pub(super) unnumbered: u64,
    /// Ticks missing between those with a number, not counting the ones without.
    pub(super) missing: u64,
    /// Places where ticks are missing.
    pub(super) gaps: usize,
}

impl Numbering {
    /// Of a stage whose ticks are this far apart, us.
    pub(super) const fn new(servo_period_us: f64) -> Self {
        Self {
            servo_period_us,
            counted: None,
            mark: None,
            told: None,
            waiting: Vec::new(),
            numbered: VecDeque::new(),
            last: None,
            follows: true,
            counts: NumberingCounts {
                unnumbered: 0,
                missing: 0,
                gaps: 0,
            },
            unnumbered_since: 0,
        }
    }

    /// Takes a time frame.
    pub(super) fn take_time(&mut self, frame: TickTime) {
        if let Some(before) = self.told.replace(frame) {
            self.settle(before, None);
        }
    }

    /// Takes a whole tick, of whose sequence only the counter is used.
    pub(super) fn take(&mut self, tick: BusTick) {
        let counter = tick.sequence % COUNTERS;
        // The counters allow for this number and for 16, 32, ... more.
        let counted = self
            .counted
            .map_or(COUNTERS + counter, |before| first_after(before, counter));
        if let Some(frame) = self.told.take() {
            self.settle(frame, Some(counted));
        }
        self.counted = Some(counted);
        if self.mark.is_some() && self.waiting.len() < WAITING_MAX {
            self.waiting.push(BusTick {
                sequence: counted,
                ..tick
            });
        } else {
            self.leave_out(1);
        }
    }

    /// No frame follows.
    pub(super) fn end(&mut self) {
        if let Some(frame) = self.told.take() {
            self.settle(frame, None);
        }
        self.leave_out(self.waiting.len() as u64);
        self.waiting.clear();
    }

    /// The next tick that has its number.
    pub(super) fn next(&mut self) -> Option<BusTick> {
        self.numbered.pop_front()
    }

    pub(super) const fn counts(&self) -> NumberingCounts {
        self.counts
    }

    /// Finds the tick of a time frame that came before tick `next`, and numbers those before it.
    fn settle(&mut self, frame: TickTime, next: Option<u64>) {
        let counter = u64::from(frame.sequence) % COUNTERS;
        let counted = self.counted.map_or_else(
            // No tick came before: that after it, or one of the 15 before that.
            || next.map_or(counter, |next| first_after(next, counter) - COUNTERS),
            |before| {
                let after = first_after(before, counter);
                // A bus may deliver a time frame after the codes of its tick.
                match next {
                    Some(next) if after > next => after - COUNTERS,
                    _ => after,
                }
            },
        );
        let mark = self.mark.map_or(
            Mark {
                frame,
                counted,
                sequence: counted,
                follows: false,
            },
            |before| before.next(frame, counted, self.servo_period_us),
        );
        self.number_until(&mark);
        self.mark = Some(mark);
    }

    /// Numbers the ticks before a mark.
    fn number_until(&mut self, mark: &Mark) {
        let agrees = |start: &Mark| {
            mark.follows
                && mark.counted.checked_sub(start.counted) == Some(mark.sequence - start.sequence)
        };
        let Some(start) = self.mark.filter(agrees) else {
            // Ticks were lost unseen before or after any of these, the last one included.
            self.leave_out(self.waiting.len() as u64);
            self.waiting.clear();
            self.follows &= mark.follows;
            return;
        };
        let split = self
            .waiting
            .partition_point(|tick| tick.sequence < mark.counted);
        let rest = self.waiting.split_off(split);
        let before = std::mem::replace(&mut self.waiting, rest);
        for tick in before {
            let sequence = start.sequence + (tick.sequence - start.counted);
            let follows = std::mem::replace(&mut self.follows, true);
            if let Some(last) = self.last.replace(sequence).filter(|_| follows) {
                let missing = sequence - last - 1;
                self.counts.gaps += usize::from(missing > 0);
                self.counts.missing += missing.saturating_sub(self.unnumbered_since);
            }
            self.unnumbered_since = 0;
            self.numbered.push_back(BusTick {
                sequence,
                follows,
                ..tick
            });
        }
    }

    const fn leave_out(&mut self, ticks: u64) {
        self.counts.unnumbered += ticks;
        self.unnumbered_since += ticks;
    }
}

impl Mark {
    /// The mark of the time frame that comes next.
    fn next(&self, frame: TickTime, counted: u64, servo_period_us: f64) -> Self {
        let ticks = u64::from(frame.sequence.wrapping_sub(self.frame.sequence)) % NUMBERS;
        let agrees = counted.checked_sub(self.counted) == Some(ticks);
        // A node that starts again loses count and time; one whose frames were lost keeps both.
        let passed_us = frame.time_us.wrapping_sub(self.frame.time_us);
        let expected_us = ticks as f64 * servo_period_us;
        let apart_us = f64::from(passed_us) - expected_us;
        let (share, most_us) = SAME_CLOCK;
        let same_run = apart_us.abs() <= most_us + share * expected_us;
        Self {
            frame,
            counted,
            sequence: self.sequence + ticks,
            follows: agrees || (same_run && ticks > 0),
        }
    }
}

/// The first number after `before` with this counter.
const fn first_after(before: u64, counter: u64) -> u64 {
    let ahead = (counter + COUNTERS - before % COUNTERS) % COUNTERS;
    before + if ahead == 0 { COUNTERS } else { ahead }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tick(sequence: u64) -> BusTick {
        BusTick {
            sequence,
            follows: true,
            received_us: 0,
            hall: [sequence as i32; 3],
            capacitive: [0; 3],
            is_saturated: false,
        }
    }

    fn time_frame(number: u64) -> TickTime {
        TickTime {
            sequence: number as u32 & 0xf_ffff,
            time_us: (2_000 * number) as u32,
        }
    }

    /// The ticks of a record in which those of `lost` are missing; the receiver may refuse as many
    /// after them.
    fn numbered(lost: std::ops::Range<u64>, refused: u64, late: bool) -> (Vec<BusTick>, u64) {
        let mut numbering = Numbering::new(2_000.0);
        let first = NUMBERS - 100;
        for n in (first..first + 700).filter(|n| !lost.contains(&(n - first))) {
            let is_refused = (lost.end..lost.end + refused).contains(&(n - first));
            let is_time = n.is_multiple_of(16);
            if is_time && !late {
                numbering.take_time(time_frame(n));
            }
            if !is_refused {
                numbering.take(tick(n));
            }
            if is_time && late {
                numbering.take_time(time_frame(n));
            }
        }
        numbering.end();
        let ticks = std::iter::from_fn(|| numbering.next()).collect();
        (ticks, numbering.counts().missing)
    }

    #[test]
    fn no_loss_of_ticks_gives_a_tick_another_number() {
        for count in 0..130 {
            for start in 190..222 {
                for (refused, late) in [(0, false), (1, false), (2, true)] {
                    let (ticks, missing) = numbered(start..start + count, refused, late);
                    let offset = ticks[0].hall[0] - ticks[0].sequence as i32;
                    let what = format!("{count} from {start} on, {refused} refused");
                    assert!(ticks.len() as u64 + count > 630, "{what}: {}", ticks.len());
                    for tick in &ticks {
                        assert_eq!(tick.hall[0] - tick.sequence as i32, offset, "{what}");
                    }
                    assert!(ticks.iter().skip(1).all(|tick| tick.follows), "{what}");
                    assert!(missing <= count + refused, "{what}: {missing}");
                }
            }
        }
    }

    #[test]
    fn a_node_that_starts_again_counts_anew() {
        let mut numbering = Numbering::new(2_000.0);
        for n in (600_000..600_100).chain(0..100) {
            if n % 16 == 0 {
                numbering.take_time(time_frame(n));
            }
            numbering.take(tick(n));
        }
        numbering.end();
        let ticks: Vec<_> = std::iter::from_fn(|| numbering.next()).collect();
        let breaks = ticks.iter().filter(|tick| !tick.follows).count();
        // The first tick of each run.
        assert_eq!((breaks, ticks.len()), (2, 192));
    }
}

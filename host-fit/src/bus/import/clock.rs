//! Receive times to sample times. The sensor node samples evenly by its own clock; the bus and
//! the receiving computer deliver with jitter. A straight line through the receive times over
//! the numbers of the ticks takes the jitter out and keeps the clocks' difference in speed.

use super::bus_log::{BusCounts, BusTick};
use super::bus_reader::BusReader;
use super::{ImportError, ImportSettings};
use crate::input::stage::Stage;
use std::collections::VecDeque;

/// Ticks of one stretch of line, at most: over a minute at 500 Hz, in which two crystals drift
/// apart by no more than they differ in speed.
const STRETCH_TICKS: usize = 30_000;

/// Ticks of one stretch of line, at least: few may all have come late.
const STRETCH_TICKS_MIN: usize = 125;

/// Ticks of which one, at least, must have been received on time: half a second at 500 Hz.
const LATE_TICKS_MAX: usize = 250;

/// How far these may be off their line, as a part of a servo period: an adapter that fetches frames
/// every millisecond drifts by that against the ticks.
const OFF_PERIODS_MAX: f64 = 0.75;

/// Weight of a time above the line, against 1 of one below.
const LATE_WEIGHT: f64 = 0.01;

/// Times further above the line pull it no harder, us: a stall must not bend it.
const LATE_PULL_US: f64 = 2_000.0;

/// How much the clocks' difference in speed may change from one line to the next, as a part of one.
const RATE_CHANGE_MAX: f64 = 1e-4;

/// Rounds of the weighted fit: it settles within a dozen.
const ROUNDS: usize = 20;

/// How even the receive times were.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Smoothing {
    /// Stretches of line.
    pub stretches: usize,
    /// Time from tick to tick by the first line, us.
    pub period_us: f64,
    /// Standard deviation of receive times about the lines, us.
    pub rms_us: f64,
    /// Largest distance of a receive time from its line, us.
    pub max_us: f64,
    /// Largest distance of the earliest of 250 successive ticks from their line, of those of the next
    /// 250 from them, and of two successive lines from each other, us: how well the lines tell the
    /// times.
    pub off_us: f64,
    /// Where that is, s after the first tick with a time.
    pub off_at_s: f64,
    /// Ticks left out because the sensor node started again before there were 125.
    pub untimed: usize,
}

/// A tick and its sample time on the clock of the receive times, us since 1970 or whatever the
/// record counts from. It lies later than the true one by about the shortest time that a frame
/// takes.
pub(super) type TimedTick = (BusTick, f64);

/// Turns receive times to sample times, a stretch of line at a time.
#[derive(Debug, Default)]
pub(super) struct Smoother {
    /// The ticks of the stretch that has no line yet.
    stretch: Vec<BusTick>,
    /// The line before, and the last tick on it, if those of the stretch follow.
    before: Option<(Line, BusTick)>,
    first_us: Option<u64>,
    timed: VecDeque<TimedTick>,
    ticks: usize,
    squares: f64,
    smoothing: Smoothing,
}

impl Smoother {
    /// Takes the next tick of the record.
    pub(super) fn take(&mut self, tick: BusTick) {
        if !tick.follows {
            self.end();
            self.before = None;
        }
        self.stretch.push(tick);
        if self.stretch.len() >= 2 * STRETCH_TICKS {
            let rest = self.stretch.split_off(STRETCH_TICKS);
            let full = std::mem::replace(&mut self.stretch, rest);
            self.part(&full);
        }
    }

    /// No tick follows on those that were taken.
    pub(super) fn end(&mut self) {
        let stretch = std::mem::take(&mut self.stretch);
        if stretch.len() < STRETCH_TICKS_MIN {
            self.smoothing.untimed += stretch.len();
            return;
        }
        // Equal parts, so that none is too short for a line.
        let parts = stretch.len().div_ceil(STRETCH_TICKS).max(1);
        for part in stretch.chunks(stretch.len().div_ceil(parts).max(1)) {
            self.part(part);
        }
    }

    /// The next tick whose time is known.
    pub(super) fn next(&mut self) -> Option<TimedTick> {
        self.timed.pop_front()
    }

    /// How even the receive times were so far.
    pub(super) fn smoothing(&self) -> Smoothing {
        Smoothing {
            rms_us: (self.squares / self.ticks.max(1) as f64).sqrt(),
            ..self.smoothing
        }
    }

    fn part(&mut self, part: &[BusTick]) {
        let (Some(first), Some(last)) = (part.first(), part.last()) else {
            return;
        };
        let line = Line::through(part);
        if self.smoothing.stretches == 0 {
            self.smoothing.period_us = line.slope;
        }
        self.smoothing.stretches += 1;
        self.ticks += part.len();
        if let Some((before, end)) = self.before.replace((line, *last)) {
            let lost_us = (first.sequence - end.sequence) as f64 * line.slope;
            let apart_us = (line.at(first) - before.at(first)).abs();
            self.note((apart_us - RATE_CHANGE_MAX * lost_us).max(0.0), first);
        }
        let blocks = part.len().div_ceil(LATE_TICKS_MAX);
        let mut before_us = None;
        for block in part.chunks(part.len().div_ceil(blocks)) {
            let mut earliest_us = f64::INFINITY;
            for tick in block {
                let time = line.at(tick);
                let distance = tick.received_us as f64 - time;
                self.squares += distance * distance;
                self.smoothing.max_us = self.smoothing.max_us.max(distance.abs());
                earliest_us = earliest_us.min(distance);
                self.timed.push_back((*tick, time));
            }
            // A line may lie across a step of the clock.
            let step_us = earliest_us - before_us.replace(earliest_us).unwrap_or(earliest_us);
            let off_us = earliest_us.abs().max(step_us.abs());
            self.note(off_us, block.first().unwrap_or(first));
        }
    }

    /// Notes how far off its line a tick is.
    fn note(&mut self, off_us: f64, tick: &BusTick) {
        let first_us = *self.first_us.get_or_insert(tick.received_us);
        if off_us > self.smoothing.off_us {
            self.smoothing.off_us = off_us;
            self.smoothing.off_at_s = tick.received_us.saturating_sub(first_us) as f64 * 1e-6;
        }
    }
}

/// A record of the bus, tick by tick, with the times of the samples.
pub(super) struct EvenTicks<'s> {
    reader: BusReader<'s>,
    smoother: Smoother,
    is_read: bool,
}

impl<'s> EvenTicks<'s> {
    pub(super) fn new(reader: BusReader<'s>) -> Self {
        Self {
            reader,
            smoother: Smoother::default(),
            is_read: false,
        }
    }

    /// The next tick; `None` at the end.
    ///
    /// # Errors
    /// Those of [`BusReader::next_tick`].
    pub(super) fn next_tick(&mut self) -> Result<Option<TimedTick>, ImportError> {
        loop {
            if let Some(timed) = self.smoother.next() {
                return Ok(Some(timed));
            }
            if self.is_read {
                return Ok(None);
            }
            match self.reader.next_tick()? {
                Some(tick) => self.smoother.take(tick),
                None => {
                    self.is_read = true;
                    self.smoother.end();
                }
            }
        }
    }

    /// How even the receive times were so far.
    pub(super) fn smoothing(&self) -> Smoothing {
        self.smoother.smoothing()
    }

    /// What the record held, and how even its times were.
    ///
    /// # Errors
    /// `NoTicks`, and `UnevenTimes` if those of half a second are all off their line.
    pub(super) fn finish(
        &self,
        settings: &ImportSettings,
        stage: &Stage,
    ) -> Result<(BusCounts, Smoothing), ImportError> {
        let (counts, smoothing) = (self.reader.counts(), self.smoothing());
        if smoothing.stretches == 0 {
            return Err(ImportError::NoTicks {
                path: settings.bus.clone(),
                frames: counts.frames,
                saturated: counts.saturated,
                ticks: counts.ticks,
            });
        }
        if smoothing.off_us > OFF_PERIODS_MAX * stage.servo_period_s * 1e6 {
            return Err(ImportError::UnevenTimes {
                off_us: smoothing.off_us,
                at_s: smoothing.off_at_s,
            });
        }
        Ok((counts, smoothing))
    }
}

#[derive(Clone, Copy, Debug)]
struct Line {
    start: u64,
    start_us: u64,
    constant: f64,
    slope: f64,
}

impl Line {
    /// Weighted least squares, in which a time above the line counts little: a frame may wait
    /// for the bus or for the receiver, but it never comes early. Times and numbers are taken
    /// from the first tick, so that `f64` keeps their digits.
    fn through(ticks: &[BusTick]) -> Self {
        let (start, start_us) = ticks
            .first()
            .map_or((0, 0), |t| (t.sequence, t.received_us));
        let mut line = Self {
            start,
            start_us,
            constant: f64::INFINITY,
            slope: 0.0,
        };
        for _ in 0..ROUNDS {
            line.refit(ticks);
        }
        line
    }

    fn refit(&mut self, ticks: &[BusTick]) {
        let points = ticks.iter().map(|t| {
            let x = (t.sequence - self.start) as f64;
            let y = t.received_us as f64 - self.start_us as f64;
            let late_us = y - (self.constant + self.slope * x);
            let late_weight = LATE_WEIGHT * (LATE_PULL_US / late_us).min(1.0);
            (x, y, if late_us > 0.0 { late_weight } else { 1.0 })
        });
        let sums = points.clone().fold([0.0; 3], |[n, sx, sy], (x, y, w)| {
            [n + w, sx + w * x, sy + w * y]
        });
        let [n, sum_x, sum_y] = sums;
        if n == 0.0 {
            return;
        }
        let (mean_x, mean_y) = (sum_x / n, sum_y / n);
        let (xx, xy) = points.fold((0.0, 0.0), |(xx, xy), (x, y, w)| {
            let dx = x - mean_x;
            (xx + w * dx * dx, xy + w * dx * (y - mean_y))
        });
        self.slope = if xx > 0.0 { xy / xx } else { 0.0 };
        self.constant = mean_y - self.slope * mean_x;
    }

    fn at(&self, tick: &BusTick) -> f64 {
        let x = (tick.sequence - self.start) as f64;
        self.start_us as f64 + (self.constant + self.slope * x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample_times_us(ticks: &[BusTick]) -> (Vec<f64>, Smoothing) {
        let mut smoother = Smoother::default();
        ticks.iter().for_each(|tick| smoother.take(*tick));
        smoother.end();
        let times = std::iter::from_fn(|| smoother.next()).map(|(_, time)| time);
        (times.collect(), smoother.smoothing())
    }

    fn tick(sequence: u64, received_us: u64) -> BusTick {
        BusTick {
            sequence,
            follows: true,
            received_us,
            hall: [0; 3],
            capacitive: [0; 3],
            is_saturated: false,
        }
    }

    #[test]
    fn jitter_is_taken_out_and_a_clock_that_runs_fast_is_kept() {
        // 2000.1 us a tick, jitter of +-150 us in turn, a gap of three ticks.
        let even = |k: u64| 5e11 + 2_000.1 * k as f64;
        let numbers = (0..400u64).filter(|k| !(100..103).contains(k));
        let ticks: Vec<_> = numbers
            .clone()
            .map(|k| {
                tick(
                    k,
                    (even(k) + if k % 2 == 0 { 150.0 } else { -150.0 }) as u64,
                )
            })
            .collect();
        let (times, smoothing) = sample_times_us(&ticks);
        let early = times[0] - even(0);
        assert!((-150.0..-100.0).contains(&early), "{early}");
        for (time, k) in times.iter().zip(numbers) {
            assert!((time - even(k) - early).abs() < 3.0, "{k}");
        }
        assert!((smoothing.period_us - 2_000.1).abs() < 0.01);
        assert_eq!(smoothing.stretches, 1);
    }

    #[test]
    fn a_receiver_that_stalls_now_and_then_does_not_bend_the_line() {
        // In the second half every fifth frame waits 20 ms, and those behind it less.
        let late = |k: u64| {
            if k >= 500 {
                20_000 - 4_000 * (k % 5)
            } else {
                0
            }
        };
        let ticks: Vec<_> = (0..1_000)
            .map(|k| tick(k, 2_000 * k + late(k) / 2 * (k / 10 % 2)))
            .collect();
        let (times, _) = sample_times_us(&ticks);
        for (time, k) in times.iter().zip(0u64..) {
            assert!((time - 2_000.0 * k as f64).abs() < 150.0, "{k}: {time}");
        }
    }

    #[test]
    fn a_sender_that_starts_again_gets_a_line_of_its_own() {
        let mut ticks: Vec<_> = (0..500).map(|k| tick(k, 2_000 * k)).collect();
        ticks.extend((500..1_000).map(|k| tick(k, 2_000 * k + 777_000)));
        ticks[500].follows = false;
        // It starts again soon: a few ticks may all be late.
        ticks.extend((1_000..1_100).map(|k| tick(k, 2_000 * k + 888_000)));
        ticks[1_000].follows = false;
        let (times, smoothing) = sample_times_us(&ticks);
        assert_eq!((smoothing.stretches, smoothing.untimed), (2, 100));
        assert_eq!(times.len(), 1_000);
        assert!(smoothing.max_us < 1e-6);
        assert!((times[500] - 1_777_000.0).abs() < 1e-6);
    }
}

//! Receive times to sample times. The sensor node samples evenly by its own clock; the bus and
//! the receiving computer deliver with jitter. A straight line through the receive times over
//! the numbers of the ticks takes the jitter out and keeps the clocks' difference in speed.

use super::bus_log::BusTick;

/// Ticks of one stretch of line, at most: over a minute at 500 Hz, in which two crystals drift
/// apart by no more than they differ in speed.
const STRETCH_TICKS: usize = 30_000;

/// Weight of a time above the line, against 1 of one below.
const LATE_WEIGHT: f64 = 0.01;

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
}

/// The sample time of every tick on the clock of the receive times, us since 1970 or whatever
/// the record counts from, and how far the receive times were from it. They lie later than
/// the true ones by about the shortest time that a frame takes.
pub fn sample_times_us(ticks: &[BusTick]) -> (Vec<f64>, Smoothing) {
    let mut times = Vec::with_capacity(ticks.len());
    let mut smoothing = Smoothing::default();
    let mut squares = 0.0;
    for stretch in ticks.chunk_by(|_, next| next.follows) {
        // Equal parts, so that none is too short for a line.
        let parts = stretch.len().div_ceil(STRETCH_TICKS).max(1);
        for part in stretch.chunks(stretch.len().div_ceil(parts).max(1)) {
            let line = Line::through(part);
            if smoothing.stretches == 0 {
                smoothing.period_us = line.slope;
            }
            smoothing.stretches += 1;
            for tick in part {
                let time = line.at(tick);
                let distance = tick.received_us as f64 - time;
                squares += distance * distance;
                smoothing.max_us = smoothing.max_us.max(distance.abs());
                times.push(time);
            }
        }
    }
    smoothing.rms_us = (squares / ticks.len().max(1) as f64).sqrt();
    (times, smoothing)
}

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
            let is_late = y > self.constant + self.slope * x;
            (x, y, if is_late { LATE_WEIGHT } else { 1.0 })
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

    fn tick(sequence: u64, received_us: u64) -> BusTick {
        BusTick {
            sequence,
            follows: true,
            received_us,
            hall: [0; 3],
            capacitive: [0; 3],
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
        let mut ticks: Vec<_> = (0..50).map(|k| tick(k, 2_000 * k)).collect();
        ticks.extend((50..100).map(|k| tick(k, 2_000 * k + 777_000)));
        ticks[50].follows = false;
        let (times, smoothing) = sample_times_us(&ticks);
        assert_eq!(smoothing.stretches, 2);
        assert!(smoothing.max_us < 1e-6);
        assert!((times[50] - 877_000.0).abs() < 1e-6);
    }
}

//! Rate and jitter of what comes, by receive times.

/// Collects receive times.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rhythm {
    last: Option<(u32, u64)>,
    ticks: u64,
    span_us: u64,
    steps: u32,
    sum_us: f64,
    sum_squares: f64,
    low_us: f64,
    high_us: f64,
}

/// What the receive times say.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pace {
    /// Ticks per second, lost ones included.
    pub rate_hz: f64,
    /// Standard deviation of the time from tick to tick, us.
    pub jitter_rms_us: f64,
    /// Largest less smallest time from tick to tick, us.
    pub jitter_span_us: f64,
}

impl Rhythm {
    /// Takes the number of a tick and when it came, us.
    pub fn take(&mut self, sequence: u32, time_us: u64) {
        if let Some((last, last_us)) = self.last.replace((sequence, time_us)) {
            let ticks = sequence.wrapping_sub(last);
            let passed_us = time_us.saturating_sub(last_us);
            if ticks == 0 || ticks > u32::MAX / 2 {
                return;
            }
            self.ticks += u64::from(ticks);
            self.span_us += passed_us;
            let step_us = passed_us as f64 / f64::from(ticks);
            if self.steps == 0 {
                (self.low_us, self.high_us) = (step_us, step_us);
            }
            self.steps += 1;
            self.sum_us += step_us;
            self.sum_squares += step_us * step_us;
            self.low_us = self.low_us.min(step_us);
            self.high_us = self.high_us.max(step_us);
        }
    }

    /// The pace since the last call, and a new start from the last tick on; `None` if fewer
    /// than two ticks came.
    pub fn pace(&mut self) -> Option<Pace> {
        let old = core::mem::take(self);
        self.last = old.last;
        if old.steps == 0 || old.span_us == 0 {
            return None;
        }
        let n = f64::from(old.steps);
        let mean = old.sum_us / n;
        let variance = (old.sum_squares / n - mean * mean).max(0.0);
        Some(Pace {
            rate_hz: old.ticks as f64 * 1e6 / old.span_us as f64,
            jitter_rms_us: variance.sqrt(),
            jitter_span_us: old.high_us - old.low_us,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pace_worked_by_hand() {
        let mut rhythm = Rhythm::default();
        assert_eq!(rhythm.pace(), None);
        // 2000, 1900, 2100 us from tick to tick; then one tick lost, 4000 us for two.
        for (sequence, time_us) in [(7, 0), (8, 2_000), (9, 3_900), (10, 6_000), (12, 10_000)] {
            rhythm.take(sequence, time_us);
        }
        let pace = rhythm.pace().expect("five ticks");
        assert!((pace.rate_hz - 500.0).abs() < 1e-9);
        assert!((pace.jitter_rms_us - 5_000f64.sqrt()).abs() < 1e-6);
        assert!((pace.jitter_span_us - 200.0).abs() < 1e-9);
        assert_eq!(rhythm.pace(), None);
        rhythm.take(13, 12_000);
        assert_eq!(rhythm.pace().map(|p| p.jitter_span_us), Some(0.0));
    }
}

//! The first estimate of the offset: the best correlation of a minute of the sensors with the reference, on a grid.

use super::{Clocks, Records, STRETCH_US, middle_us, thinned};
use crate::join::node_clock::Tick;
use crate::join::reference::Sample;
use rayon::iter::{IntoParallelIterator, ParallelIterator};

/// Most ticks of the first correlation, and the periods of its grid; most ticks of the second correlation, on a grid of
/// one period.
pub(super) const SEARCH_TICKS: usize = 500;
pub(super) const SEARCH_PERIODS: f64 = 5.0;
const COARSE_TICKS: usize = 2_000;

/// Offsets with this part of the largest explained motion explain as much.
const ALIKE: f64 = 0.98;

/// How far from a given start the offset is searched, us, if nothing else is asked.
const SEARCH_US: f64 = 2e6;

impl<'r> Records<'r> {
    /// The offsets to try, us, without the time of the recorder.
    pub(super) fn range_us(&self, offset_us: Option<f64>, search_us: Option<f64>) -> [f64; 2] {
        let [ticks, samples] = self.ends_us();
        let start_us = match offset_us {
            Some(us) => us - self.recorder_us,
            None => self.start_us - samples[0],
        };
        let search_us = search_us.or(offset_us.map(|_| SEARCH_US));
        match search_us {
            Some(search_us) => [start_us - search_us, start_us + search_us],
            None => {
                let half_us = 0.5 * (ticks[1] - ticks[0]).min(samples[1] - samples[0]);
                [
                    ticks[0] - samples[1] + half_us,
                    ticks[1] - samples[0] - half_us,
                ]
            }
        }
    }

    /// The minutes of the record, the liveliest first.
    pub(super) fn liveliest(&self) -> Vec<&'r [Tick]> {
        let ticks = (STRETCH_US / self.period_us).max(1.0);
        let parts = (self.ticks.len() as f64 / ticks).ceil().max(1.0) as usize;
        let minutes = self.ticks.chunks(self.ticks.len().div_ceil(parts).max(1));
        let variance = |ticks: &[Tick], k: usize| {
            let codes = || ticks.iter().map(|tick| f64::from(tick.frame.codes.hall[k]));
            let mean = codes().sum::<f64>() / ticks.len() as f64;
            codes().map(|code| (code - mean).powi(2)).sum::<f64>()
        };
        let motion = |ticks: &&[Tick]| [0, 1, 2].map(|k| variance(ticks, k)).iter().sum::<f64>();
        let mut minutes: Vec<&[Tick]> = minutes.collect();
        minutes.sort_by(|a, b| motion(b).total_cmp(&motion(a)));
        minutes
    }

    /// The best offset of the range on a grid of one period.
    pub(super) fn coarse(&self, minute: &[Tick]) -> Clocks {
        let wide_us = SEARCH_PERIODS * self.period_us;
        let [first_us, last_us] = self.range_us;
        let near = match last_us - first_us > COARSE_TICKS as f64 * self.period_us {
            false => self.range_us,
            true => {
                let found = self.best(minute, SEARCH_TICKS, self.range_us, wide_us);
                [found.us - wide_us, found.us + wide_us]
            }
        };
        self.best(minute, COARSE_TICKS, near, self.period_us)
    }

    /// The best offset of a range on a grid, by a number of ticks.
    pub(super) fn best(
        &self,
        minute: &[Tick],
        ticks: usize,
        [first_us, last_us]: [f64; 2],
        step_us: f64,
    ) -> Clocks {
        let points: Vec<Tick> = thinned(minute, ticks).collect();
        let steps = ((last_us - first_us) / step_us).ceil().clamp(0.0, 1e7) as u32;
        let clocks = |step: u32| Clocks {
            us: first_us + f64::from(step) * step_us,
            rate: 0.0,
            middle_us: middle_us(minute),
        };
        let trial = |step: u32| (self.explained(&self.rows(&points, &clocks(step)))[0], step);
        let trials: Vec<(f64, u32)> = (0..steps + 1).into_par_iter().map(trial).collect();
        let most = trials.iter().map(|trial| trial.0).fold(0.0, f64::max);
        // A run that repeats explains as much at several offsets: the records overlap most at the right one.
        let explained = |at: Option<&(f64, u32)>| at.map_or(0.0, |trial| trial.0);
        let peaks = (0..trials.len()).filter(|&at| {
            let own = trials[at].0;
            let before = explained(at.checked_sub(1).and_then(|at| trials.get(at)));
            own >= ALIKE * most && own >= before && own > explained(trials.get(at + 1))
        });
        let overlap_us = |at: &usize| self.overlap_us(clocks(trials[*at].1).us);
        let best = peaks.max_by(|a, b| {
            let by_overlap = overlap_us(a).total_cmp(&overlap_us(b));
            by_overlap.then(trials[*a].0.total_cmp(&trials[*b].0))
        });
        clocks(best.map_or(0, |at| trials[at].1))
    }

    /// How long both records last together at an offset, us.
    fn overlap_us(&self, offset_us: f64) -> f64 {
        let [[tick, last_tick], [sample, last_sample]] = self.ends_us();
        (last_tick - offset_us).min(last_sample) - (tick - offset_us).max(sample)
    }

    /// The first and the last time of both records, us.
    fn ends_us(&self) -> [[f64; 2]; 2] {
        let ends = |first: Option<f64>, last: Option<f64>| [first, last].map(|t| t.unwrap_or(0.0));
        let tick = |tick: &Tick| tick.t_us;
        let sample = |sample: &Sample| sample.t_us;
        [
            ends(self.ticks.first().map(tick), self.ticks.last().map(tick)),
            ends(
                self.samples.first().map(sample),
                self.samples.last().map(sample),
            ),
        ]
    }
}

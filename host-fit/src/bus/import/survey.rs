//! What is kept of a record of the bus to find the clocks' offset and rate by: its liveliest
//! stretch whole, and blocks from all over it. Both are bounded, however long the record is.

use super::clock::TimedTick;

/// Ticks of a stretch: two minutes at 500 Hz. The tests' records are longer than a stretch.
const STRETCH_TICKS: usize = if cfg!(test) { 20_000 } else { 60_000 };

/// Ticks of a block: half a second.
const BLOCK_TICKS: usize = 250;

/// Blocks, at least, of a record that has more; half of them go when they are twice as many.
const BLOCKS: usize = 120;

/// The codes of a tick, at its time by the clock of the bus.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    pub(super) t_us: f64,
    pub(super) signal: [f64; 3],
    pub(super) gaps: [f64; 3],
}

/// What is kept.
#[derive(Debug, Default)]
pub(super) struct Survey {
    ticks: usize,
    first_us: f64,
    last_us: f64,
    /// The stretch with most motion so far, and how much, in codes squared.
    liveliest: Vec<Point>,
    motion: f64,
    /// The stretch in hand.
    stretch: Vec<Point>,
    /// Every so many blocks, from the first.
    blocks: Vec<Vec<Point>>,
    every: usize,
    /// The block in hand, and how many were before it.
    block: Vec<Point>,
    before: usize,
}

impl Survey {
    /// Takes the next tick.
    pub(super) fn take(&mut self, (tick, t_us): &TimedTick) {
        let point = Point {
            t_us: *t_us,
            signal: tick.hall.map(f64::from),
            gaps: tick.capacitive.map(f64::from),
        };
        if self.ticks == 0 {
            self.first_us = *t_us;
        }
        self.last_us = *t_us;
        self.ticks += 1;
        self.stretch.push(point);
        if self.stretch.len() == STRETCH_TICKS {
            self.end_stretch();
        }
        self.block.push(point);
        if self.block.len() == BLOCK_TICKS {
            self.end_block();
        }
    }

    /// No tick follows.
    pub(super) fn end(&mut self) {
        self.end_stretch();
        self.end_block();
    }

    fn end_stretch(&mut self) {
        let stretch = std::mem::take(&mut self.stretch);
        let motion = motion(&stretch);
        if self.liveliest.is_empty() || motion > self.motion {
            (self.liveliest, self.motion) = (stretch, motion);
        }
    }

    fn end_block(&mut self) {
        let block = std::mem::take(&mut self.block);
        self.every = self.every.max(1);
        if self.before.is_multiple_of(self.every) {
            self.blocks.push(block);
        }
        self.before += 1;
        if self.blocks.len() == 2 * BLOCKS {
            let mut is_kept = false;
            self.blocks.retain(|_| {
                is_kept = !is_kept;
                is_kept
            });
            self.every *= 2;
        }
    }

    /// The time of the first tick, us.
    pub(super) const fn first_us(&self) -> f64 {
        self.first_us
    }

    /// The time in the middle of the record, us.
    pub(super) const fn middle_us(&self) -> f64 {
        (self.first_us + self.last_us) / 2.0
    }

    /// The stretch with most motion.
    pub(super) fn liveliest(&self) -> &[Point] {
        &self.liveliest
    }

    /// Whether the record goes on beyond that stretch.
    pub(super) const fn is_longer(&self) -> bool {
        self.ticks > self.liveliest.len()
    }

    /// Ticks from all over the record.
    pub(super) fn blocks(&self) -> Vec<Point> {
        self.blocks.iter().flatten().copied().collect()
    }
}

/// The squares of the signals about their means, in codes squared.
fn motion(points: &[Point]) -> f64 {
    let n = points.len().max(1) as f64;
    let of_probe = |probe: usize| {
        let mean = points.iter().map(|p| p.signal[probe]).sum::<f64>() / n;
        let from_mean = points.iter().map(|p| p.signal[probe] - mean);
        from_mean.map(|distance| distance * distance).sum::<f64>()
    };
    (0..3).map(of_probe).sum()
}

#[cfg(test)]
mod tests {
    use super::super::bus_log::BusTick;
    use super::*;

    /// A record with motion from tick `from` on.
    fn survey(ticks: u32, from: u32) -> Survey {
        let mut survey = Survey::default();
        for n in 0..ticks {
            let hall = if n >= from { n as i32 % 100 } else { 0 };
            let tick = BusTick {
                sequence: n.into(),
                follows: true,
                received_us: u64::from(n) * 2_000,
                hall: [hall; 3],
                capacitive: [0; 3],
                is_saturated: false,
            };
            survey.take(&(tick, f64::from(n) * 2_000.0));
        }
        survey.end();
        survey
    }

    #[test]
    fn a_short_record_is_kept_whole_and_a_long_one_by_blocks_from_end_to_end() {
        let short = survey(1_000, 0);
        assert_eq!((short.liveliest().len(), short.is_longer()), (1_000, false));
        let long = survey(1_800_000, 1_760_000);
        assert!(long.is_longer());
        let blocks = long.blocks();
        assert!((BLOCKS..=2 * BLOCKS).contains(&(blocks.len() / BLOCK_TICKS)));
        assert!(blocks[0].t_us == 0.0 && blocks[blocks.len() - 1].t_us > 3_500e6);
        // The motion is in the last stretch only.
        assert_eq!(long.liveliest()[0].t_us, 1_760_000.0 * 2_000.0);
    }
}

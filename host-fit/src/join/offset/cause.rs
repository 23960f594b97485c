//! What may be wrong before a clock is blamed: units, signs and the order of columns.

use super::search::{SEARCH_PERIODS, SEARCH_TICKS};
use super::{EXPLAINED_MIN, Records};
use crate::join::JoinError;
use crate::join::bus_reader::TICKS_MIN;
use crate::join::node_clock::Tick;
use crate::join::offset::Clocks;
use crate::join::reference::Sample;
use hallstage_input::log::layout::Quantity;

/// Factors of the size of the motion that no stage has.
const FACTOR_MAX: f64 = 5.0;

/// By how much a change of the columns must raise the share that is explained.
const BETTER_MIN: f64 = 0.1;

/// A slip with three columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Slip {
    Exchanged(usize, usize),
    Turned(usize),
}

const SLIPS: [Slip; 6] = [
    Slip::Exchanged(0, 1),
    Slip::Exchanged(0, 2),
    Slip::Exchanged(1, 2),
    Slip::Turned(0),
    Slip::Turned(1),
    Slip::Turned(2),
];

impl Slip {
    /// The values without it.
    fn undo<T>(self, mut values: [T; 3], turned: impl Fn(&T) -> T) -> [T; 3] {
        match self {
            Self::Exchanged(one, other) => values.swap(one, other),
            Self::Turned(one) => values[one] = turned(&values[one]),
        }
        values
    }

    fn text(self, columns: [Quantity; 3]) -> String {
        let name = |at: usize| columns[at].key();
        match self {
            Self::Exchanged(one, other) => format!("{} and {} exchanged", name(one), name(other)),
            Self::Turned(one) => format!("the sign of {} turned", name(one)),
        }
    }
}

impl Records<'_> {
    /// No offset explains enough.
    pub(super) fn no_offset(&self, share: f64) -> JoinError {
        JoinError::NoOffset {
            range_s: self.range_us.map(|us| 1e-6 * (us + self.recorder_us)),
            percent: 100.0 * share,
            least_percent: 100.0 * EXPLAINED_MIN,
        }
    }

    /// Checks the size of the motion.
    ///
    /// # Errors
    /// `Unit`.
    pub(super) fn check_unit(&self, minute: &[Tick], clocks: &Clocks) -> Result<(), JoinError> {
        let rows = self.rows(minute, clocks);
        let [explained, motion] = self.explained(&rows);
        let mut factors = self
            .sums(&rows)
            .map(|[_, sp, pp]| self.stage.hall.m_per_count * sp / pp);
        factors.sort_by(f64::total_cmp);
        let factor = factors[1];
        // A few rows have any size. Without common rows it is no number.
        let is_size =
            rows.len() >= TICKS_MIN && factor > 0.0 && explained >= EXPLAINED_MIN * motion;
        match is_size && !(FACTOR_MAX.recip()..FACTOR_MAX).contains(&factor) {
            true => Err(JoinError::Unit { factor }),
            false => Ok(()),
        }
    }

    /// The cause of an error: a change of the columns that explains the motion, or the error itself.
    pub(super) fn cause(&self, error: JoinError) -> JoinError {
        // Where few rows have a partner, another movement with a slip may look like this movement.
        let share = |records: &Records<'_>| {
            let minute = records.liveliest().first().copied().unwrap_or_default();
            let step_us = SEARCH_PERIODS * records.period_us;
            let near = records.best(minute, SEARCH_TICKS, records.range_us, step_us);
            let rows = records.rows(minute, &near);
            let [explained, motion] = records.explained(&rows);
            let has_partners = rows.len() >= TICKS_MIN && 2 * rows.len() >= minute.len();
            if has_partners {
                explained / motion
            } else {
                0.0
            }
        };
        let without = share(self);
        let mut best = (without + BETTER_MIN, None);
        for slip in SLIPS {
            let sample = |sample: &Sample| Sample {
                values: slip.undo(sample.values, |value| -value),
                ..*sample
            };
            let samples: Vec<Sample> = self.samples.iter().map(sample).collect();
            let tick = |tick: &Tick| {
                let mut tick = *tick;
                let codes = &mut tick.frame.codes.hall;
                *codes = slip.undo(*codes, |code| code.saturating_neg());
                tick
            };
            let ticks: Vec<Tick> = self.ticks.iter().map(tick).collect();
            let samples = Records {
                samples: &samples,
                ..*self
            };
            let ticks = Records {
                ticks: &ticks,
                ..*self
            };
            for (records, columns) in [(samples, self.quantities), (ticks, Quantity::HALL)] {
                let share = share(&records);
                if share > best.0 {
                    best = (share, Some(slip.text(columns)));
                }
            }
        }
        match best {
            (share, Some(change)) if share >= EXPLAINED_MIN => JoinError::Columns {
                change,
                percent: 100.0 * share,
                without_percent: 100.0 * without.max(0.0),
            },
            _ => error,
        }
    }
}

//! What rows tell by themselves, of all rows of a log: of a long one piece by piece.

use super::channels::LogSignals;
use super::converters::FlatTops;
use super::places::{Run, Told};
use super::still::{Rests, frozen, most_repeats, of_frozen};
use super::timing::{Timing, usual_periods};
use crate::diagnose::finding::Finding;
use crate::input::dataset::Dataset;
use crate::input::stage::Stage;
use crate::input::whole::Whole;
use crate::input::whole::pieces::Piece;
use rayon::prelude::*;

/// What is known of a log before its rows are looked at.
struct Usual {
    /// Periods from most rows to the next.
    periods: u32,
    period_s: f64,
    most_repeats: Vec<Option<f64>>,
    has_reference: bool,
}

/// What some of its rows tell.
struct Seen {
    timing: Timing,
    tops: FlatTops,
    rests: Rests,
    frozen: Vec<Run>,
}

impl Seen {
    /// Looks at the rows, and leaves those out that are named.
    fn of(log: &mut LogSignals, usual: &Usual) -> Self {
        Self {
            timing: Timing::of(log, usual.periods),
            tops: FlatTops::of(log),
            rests: match usual.has_reference {
                true => Rests::of(log),
                false => Rests::default(),
            },
            frozen: frozen(log, &usual.most_repeats),
        }
    }

    /// With those of rows that follow.
    fn and(mut self, more: Self) -> Self {
        self.frozen.extend(more.frozen);
        Self {
            timing: self.timing.and(more.timing),
            tops: self.tops.and(more.tops),
            rests: self.rests.and(more.rests),
            frozen: self.frozen,
        }
    }
}

/// Missing and uneven rows, flat tops, movements and channels that stand still, in a log of a
/// dataset; in all rows of a log of which the dataset holds an excerpt. Rows of the dataset that
/// are named are left out of what follows.
pub(super) fn findings(
    log: &mut LogSignals,
    dataset: &Dataset,
    number: usize,
    stage: &Stage,
) -> Vec<Finding> {
    let has_reference = dataset.logs[number].has_reference;
    let usual = Usual {
        periods: usual_periods(log),
        period_s: log.period_s,
        most_repeats: most_repeats(log, has_reference),
        has_reference,
    };
    let held = Seen::of(log, &usual);
    let all = dataset.whole.as_ref();
    let seen = all.and_then(|whole| of_whole(whole, number, stage, &usual));
    let Seen {
        timing,
        tops,
        rests,
        frozen,
    } = seen.unwrap_or(held);
    let told = Told::new(dataset, number);
    let mut findings = timing.findings(&told, stage, usual.period_s, usual.periods);
    findings.extend(tops.findings(&told, &log.channels));
    findings.extend(rests.findings(&told, usual.period_s));
    findings.extend(of_frozen(&told, &log.channels, frozen, usual.period_s));
    findings
}

fn of_whole(whole: &Whole, log: usize, stage: &Stage, usual: &Usual) -> Option<Seen> {
    let look = |piece: &Piece| {
        let dataset = whole.piece(piece, usual.period_s * 1e6);
        let mut signals = LogSignals::new(&dataset, stage, 0);
        signals.period_s = usual.period_s;
        signals.from.row = piece.rows.start;
        signals.from.movement = piece.movements.start;
        signals.is_part = piece.is_part;
        Seen::of(&mut signals, usual)
    };
    let pieces = whole.pieces(log);
    let seen: Vec<Seen> = pieces.par_iter().map(look).collect();
    seen.into_iter().reduce(Seen::and)
}

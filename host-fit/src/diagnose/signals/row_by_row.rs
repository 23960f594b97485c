//! What rows tell by themselves, of all rows of a log: of a long one piece by piece.

use super::channels::LogSignals;
use super::converters::{flat_tops, of_flat_tops, range};
use super::frozen::{frozen, most_repeats, of_frozen};
use super::places::{Run, Told};
use super::still::Rests;
use super::timing::Timing;
use crate::diagnose::finding::Finding;
use crate::input::dataset::Dataset;
use crate::input::stage::Stage;
use crate::input::whole::Whole;
use crate::input::whole::chunk::{Sample, SampledVertical};
use crate::input::whole::pieces::Piece;
use rayon::prelude::*;

/// What is known of a log before its rows are looked at.
struct Usual {
    period_s: f64,
    most_repeats: Vec<Option<f64>>,
    /// Lowest and highest value of each channel of codes, m.
    ranges: Vec<[f64; 2]>,
    has_reference: bool,
}

/// What some of its rows tell.
struct Seen {
    timing: Timing,
    tops: Vec<Run>,
    rests: Rests,
    frozen: Vec<Run>,
}

impl Seen {
    /// Looks at the rows, and leaves those out that are named.
    fn of(log: &mut LogSignals, usual: &Usual) -> Self {
        Self {
            timing: Timing::of(log),
            tops: flat_tops(log, &usual.ranges),
            rests: match usual.has_reference {
                true => Rests::of(log),
                false => Rests::default(),
            },
            frozen: frozen(log, &usual.most_repeats),
        }
    }

    /// With those of rows that follow.
    fn and(mut self, more: Self) -> Self {
        self.tops.extend(more.tops);
        self.frozen.extend(more.frozen);
        Self {
            timing: self.timing.and(more.timing),
            rests: self.rests.and(more.rests),
            ..self
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
        period_s: log.period_s,
        most_repeats: most_repeats(log, has_reference),
        ranges: ranges(log, dataset.whole.as_deref(), number),
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
    let mut findings = timing.findings(&told, stage, usual.period_s);
    findings.extend(of_flat_tops(&told, &log.channels, tops));
    findings.extend(rests.findings(&told, usual.period_s));
    findings.extend(of_frozen(&told, &log.channels, frozen, usual.period_s));
    findings
}

/// Lowest and highest value of each channel of codes, m: of all rows of the log.
fn ranges(log: &LogSignals, whole: Option<&Whole>, number: usize) -> Vec<[f64; 2]> {
    let Some(whole) = whole else {
        return (log.channels.iter())
            .map(|channel| range(&channel.values))
            .collect();
    };
    let pieces = whole.pieces(number);
    let of = |piece: &Piece| CodeRanges::of(whole.samples().of(piece.rows.clone()));
    let CodeRanges([a, b, c, gap_1, gap_2, gap_3]) =
        (pieces.par_iter().map(of)).reduce(CodeRanges::default, CodeRanges::and);
    let beam = [0; 2];
    let of_channels = [a, b, c, beam, beam, beam, gap_1, gap_2, gap_3];
    (log.channels.iter().zip(of_channels))
        .map(|(channel, codes)| codes.map(|code| f64::from(code) * channel.m_per_code))
        .collect()
}

/// Lowest and highest code of the probes A, B, C and of the gaps.
struct CodeRanges([[i32; 2]; 6]);

impl Default for CodeRanges {
    fn default() -> Self {
        Self([[i32::MAX, i32::MIN]; 6])
    }
}

impl CodeRanges {
    fn of(samples: impl Iterator<Item = Sample>) -> Self {
        let mut ranges = Self::default();
        samples.for_each(|sample| {
            let gaps = match sample.vertical {
                SampledVertical::Codes(codes) => codes,
                SampledVertical::Pose(_) => [0; 3],
            };
            let codes = sample.hall.into_iter().chain(gaps);
            for ([low, high], code) in ranges.0.iter_mut().zip(codes) {
                (*low, *high) = ((*low).min(code), (*high).max(code));
            }
        });
        ranges
    }

    fn and(mut self, more: Self) -> Self {
        for ([low, high], more) in self.0.iter_mut().zip(more.0) {
            (*low, *high) = ((*low).min(more[0]), (*high).max(more[1]));
        }
        self
    }
}

fn of_whole(whole: &Whole, log: usize, stage: &Stage, usual: &Usual) -> Option<Seen> {
    let look = |piece: &Piece| {
        let dataset = whole.piece(piece, usual.period_s * 1e6);
        let mut signals = LogSignals::with_period(&dataset, stage, 0, Some(usual.period_s));
        signals.from.row = piece.rows.start;
        signals.from.movement = piece.movements.start;
        signals.is_part = piece.is_part;
        Seen::of(&mut signals, usual)
    };
    let pieces = whole.pieces(log);
    let seen: Vec<Seen> = pieces.par_iter().map(look).collect();
    seen.into_iter().reduce(Seen::and)
}

#[cfg(test)]
mod tests {
    use super::super::sample::{dataset, recording, stage};
    use super::*;
    use crate::diagnose::finding::Code;
    use crate::input::dataset::{LoggedFrame, Movement, Row, Scales};
    use crate::input::whole::Samples;
    use crate::input::whole::pieces::ROWS;
    use std::sync::Arc;

    /// A log several times, so that there are several pieces; as one movement if `is_one`.
    fn repeated(log: &Dataset, times: usize, is_one: bool) -> Dataset {
        let mut all = Dataset {
            logs: log.logs.clone(),
            ..Dataset::default()
        };
        let mut periods = 0;
        for _ in 0..times {
            for movement in &log.movements {
                let start = match is_one {
                    true => 0,
                    false => all.rows.len(),
                };
                let number = if is_one { 0 } else { all.movements.len() };
                let first = periods;
                for row in &log.rows[movement.rows.clone()] {
                    periods = first + row.frame.sequence();
                    let in_movement = if is_one { periods } else { periods - first };
                    all.rows.push(Row {
                        movement: number,
                        t_us: 2000 * i64::from(periods),
                        frame: row.frame.with_sequence(in_movement),
                        ..*row
                    });
                }
                periods += 1;
                all.movements.truncate(number);
                all.movements.push(Movement {
                    log: 0,
                    index: number as i64,
                    rows: start..all.rows.len(),
                });
            }
        }
        all.logs[0].rows = 0..all.rows.len();
        all
    }

    fn found(dataset: &Dataset) -> Vec<Finding> {
        let mut log = LogSignals::new(dataset, &stage(), 0);
        findings(&mut log, dataset, 0, &stage())
    }

    /// What is found in a log that is held, and if only an excerpt of it is.
    fn both(log: &Dataset) -> [Vec<Finding>; 2] {
        let mut samples = Samples::default();
        log.rows
            .iter()
            .for_each(|row| samples.push(&Sample::of(row)));
        let (movements, logs) = (log.movements.clone(), log.logs.clone());
        let whole = Arc::new(Whole::new(Scales::of(&stage()), samples, movements, logs));
        let excerpt = whole.excerpt(4_000, [0; 32]);
        assert!(excerpt.rows.len() < log.rows.len() / 4);
        [found(log), found(&excerpt)]
    }

    /// Has a probe read a code.
    fn read_by_hall(row: &mut Row, probe: usize, code: i32) {
        if let LoggedFrame::Codes(frame) = &mut row.frame {
            frame.hall[probe] = code;
        }
        row.signal_m[probe] = f64::from(code) * stage().hall.m_per_count;
    }

    fn codes(found: &[Finding]) -> Vec<Code> {
        found.iter().map(|found| found.code).collect()
    }

    #[test]
    fn all_rows_of_a_long_log_are_counted_as_those_of_a_short_one() {
        let mut recording = recording();
        let highest = |channel: usize| {
            let all = recording.movements.iter().flatten();
            all.map(|sample| sample.hall[channel]).max().unwrap_or(0)
        };
        let top = highest(1) * 9 / 10;
        let held = recording.movements[1][700].hall[2];
        let rest = recording.movements[2][0];
        for (movement, samples) in recording.movements.iter_mut().enumerate() {
            for (k, sample) in samples.iter_mut().enumerate() {
                sample.hall[1] = sample.hall[1].min(top);
                if movement == 1 && (700..1400).contains(&k) {
                    sample.hall[2] = held;
                }
                if movement == 2 {
                    let noise = (k * 7 % 5) as i32;
                    sample.hall = rest.hall.map(|code| code + noise);
                    sample.capacitive = rest.capacitive.map(|code| code + noise);
                    sample.beams_nm = rest.beams_nm.map(|nm| nm + i64::from(noise));
                }
            }
        }
        let mut gappy = dataset(&recording);
        gappy.rows.remove(500);
        for (k, movement) in gappy.movements.iter_mut().enumerate() {
            movement.rows = movement.rows.start - usize::from(k > 0)..movement.rows.end - 1;
        }
        let [held, excerpt] = both(&repeated(&gappy, 12, false));
        assert_eq!(excerpt, held);
        assert_eq!(
            codes(&held),
            [
                Code::RowsMissing,
                Code::Saturated,
                Code::IdleMovement,
                Code::Stuck
            ]
        );
        assert_eq!(held[0].value, Some(12.0));
    }

    /// There it is no flat top: elsewhere the channel goes farther.
    #[test]
    fn a_channel_that_stands_still_farther_than_it_goes_in_its_piece_is_stuck() {
        let mut long = repeated(&dataset(&recording()), 12, false);
        let farthest = long.rows.iter().map(|row| row.frame.hall()[2]).max();
        let held = farthest.expect("rows") + 20;
        for row in &mut long.rows[2700..3400] {
            read_by_hall(row, 2, held);
        }
        let last = long.rows.len() - 1;
        read_by_hall(&mut long.rows[last], 2, held + 100);
        let [held, excerpt] = both(&long);
        assert_eq!(excerpt, held);
        assert_eq!(codes(&held), [Code::Stuck]);
    }

    #[test]
    fn faults_across_the_pieces_of_a_long_movement_are_found_once() {
        let mut long = repeated(&dataset(&recording()), 12, true);
        let count = long.rows.len();
        let boundary = count - ROWS;
        for row in &mut long.rows[boundary..] {
            row.t_us += 10_000;
            row.frame = row.frame.with_sequence(row.frame.sequence() + 5);
        }
        let held = long.rows[boundary].frame.hall()[0];
        for row in &mut long.rows[boundary - 300..boundary + 300] {
            read_by_hall(row, 0, held);
        }
        let [held, excerpt] = both(&long);
        assert_eq!(excerpt, held);
        assert_eq!(codes(&held), [Code::RowsMissing, Code::Stuck]);
        assert_eq!((held[0].value, held[1].value), (Some(5.0), Some(1.2)));
    }
}

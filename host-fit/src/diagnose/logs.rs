//! Whether the logs of one fit are of one stage in one state: how much better parameters of its own
//! would describe each.

use super::finding::{Code, Finding, Severity};
use super::trials::{Trials, unlimited, zeros_free};
use super::warning;
use crate::input::dataset::Dataset;
use crate::input::stage::Stage;
use crate::judge::identify::check_motion;
use crate::judge::uncertainty::OwnFit;
use crate::problem::model::Model;
use crate::problem::{Group, Problem};
use runtime::ModelKind;
use std::fmt::Write;

/// Logs with parameters of their own may have errors smaller by this factor than together: runs with
/// other motion ask for others, because Model (31) is not all that there is.
pub(super) const BETTER_MAX: f64 = 1.15;
/// Beyond this they are of different stages, or something has changed.
pub(super) const BETTER_REFUSED: f64 = 1.5;
/// They are told too where the sensitivities that they ask for, all else being the same, all differ by
/// this part of one, as a supply or a temperature changes them, ...
const GAIN_MAX: f64 = 0.006;
/// ... and refused where one differs by this: between parts of a log of a simulated stage, of which one
/// hardly moves C, the largest difference is 0.013.
const GAIN_REFUSED: f64 = 0.016;
/// A difference of sensitivities counts if it makes errors larger by this factor: logs that hardly move
/// a probe do not show its sensitivity.
const GAIN_TELLS: f64 = 1.015;

/// How far the logs contradict each other: by the errors that parameters of its own would leave in
/// each, whether or not it determines them.
pub fn disagreement(dataset: &Dataset, stage: &Stage) -> Option<Finding> {
    if dataset.logs.len() < 2 {
        return None;
    }
    let logs = fits_of_logs(dataset, stage)?;
    let better = better_alone(&logs);
    let gains = gain_difference(&logs);
    let tells = gains.as_ref().filter(|_| better > GAIN_TELLS);
    let has_changed = tells.is_some_and(|gains| gains.worst() > GAIN_REFUSED);
    let may_have = tells.is_some_and(|gains| gains.least() > GAIN_MAX);
    if better <= BETTER_MAX && !has_changed && !may_have {
        return None;
    }
    let mut message = "the logs do not agree".to_owned();
    for log in &logs {
        let _ = write!(
            message,
            ", {} fits to {:.2} um rms together with the others and to {:.2} um alone",
            dataset.logs[log.log].path.display(),
            log.together_um,
            log.alone_um
        );
    }
    if let Some(Gains { log, first, parts }) = &gains {
        let path = |log: usize| dataset.logs[log].path.display();
        let told = |part: &Option<f64>| {
            part.map_or("?".to_owned(), |part| format!("{:+.1}", part * 100.0))
        };
        let _ = write!(
            message,
            "; the sensitivity of the probes A, B, C in {} differs by {} % from that in {}",
            path(*log),
            parts.each_ref().map(told).join(", "),
            path(*first)
        );
    }
    message.push_str(
        ": fit logs of one stage in one state only, and fit the other ones by themselves",
    );
    Some(Finding {
        severity: match better > BETTER_REFUSED || has_changed {
            true => Severity::Refuse,
            false => Severity::Warn,
        },
        message,
        value: Some(better),
        unit: Some("times"),
        ..warning(Code::LogsDisagree)
    })
}

/// By what factor the errors over all logs are larger than with parameters for each.
fn better_alone(logs: &[LogFit]) -> f64 {
    let sum =
        |of: fn(&LogFit) -> f64| -> f64 { logs.iter().map(|log| log.rows * of(log).powi(2)).sum() };
    (sum(|log| log.together_um) / sum(|log| log.alone_um)).sqrt()
}

/// Sensitivities that differ most between two logs.
struct Gains {
    log: usize,
    /// The log that they are compared with.
    first: usize,
    /// Those of A, B, C over those in the first log, less 1; `None` for a probe that one of the logs hardly
    /// moves.
    parts: [Option<f64>; 3],
}

impl Gains {
    fn worst(&self) -> f64 {
        self.parts
            .iter()
            .flatten()
            .fold(0.0, |worst, part| part.abs().max(worst))
    }

    /// The smallest difference; none where a probe does not tell one.
    fn least(&self) -> f64 {
        self.parts.iter().fold(f64::INFINITY, |least, part| {
            part.map_or(0.0, f64::abs).min(least)
        })
    }
}

/// How the sensitivities differ that the logs ask for, all else being the same.
fn gain_difference(logs: &[LogFit]) -> Option<Gains> {
    let mut own = logs.iter().filter_map(|log| Some((log.log, log.gain?)));
    let (first, theirs) = own.next()?;
    let differences = own.map(|(log, gain)| Gains {
        log,
        first,
        // A gain is one over a sensitivity.
        parts: [0, 1, 2].map(|k| Some(theirs[k]? - gain[k]?)),
    });
    differences.max_by(|a, b| a.worst().total_cmp(&b.worst()))
}

/// The sensitivities of A, B, C that rows show which can be fitted alone.
pub(super) fn sensitivities(dataset: &Dataset, stage: &Stage) -> Option<[f64; 3]> {
    let model = Model::of(ModelKind::M31);
    check_motion(dataset, stage, dataset.rows.len(), model).ok()?;
    let (zeros_free, unlimited) = (zeros_free(stage), unlimited(stage));
    let trial = Trials::new(dataset, stage, &zeros_free, &unlimited).of(None)?;
    Some(trial.free.eta())
}

/// How well Model (31) describes one log: rms over X, Y, Rz (um, um, urad).
struct LogFit {
    log: usize,
    rows: f64,
    /// With the parameters of the fit to all logs.
    together_um: f64,
    /// With parameters of its own, by one step from those.
    alone_um: f64,
    /// By what part it would change the gain of each probe that it moves, if nothing else.
    gain: Option<[Option<f64>; 3]>,
}

fn fits_of_logs(dataset: &Dataset, stage: &Stage) -> Option<Vec<LogFit>> {
    let model = Model::of(ModelKind::M31);
    check_motion(dataset, stage, dataset.rows.len(), model).ok()?;
    let (zeros_free, unlimited) = (zeros_free(stage), unlimited(stage));
    let trials = Trials::new(dataset, stage, &zeros_free, &unlimited);
    let together = trials.of(None)?.free;
    let fit = |log: usize| {
        let problem = part(trials.problem(), |movement| {
            dataset.movements[movement].log == log
        });
        let own = OwnFit::new(&problem, &together)?;
        Some(LogFit {
            log,
            rows: problem.rows.len() as f64,
            together_um: problem.fitness(own.cost),
            alone_um: problem.fitness(own.cost_alone()),
            gain: own.gain_step(),
        })
    };
    // Of a log in which nothing moves an excerpt has no rows.
    let has_rows = |log: &usize| !dataset.logs[*log].rows.is_empty();
    (0..dataset.logs.len()).filter(has_rows).map(fit).collect()
}

/// The groups of some movements.
pub(super) fn part<'a>(problem: &Problem<'a>, is_in: impl Fn(usize) -> bool) -> Problem<'a> {
    let mut part = Problem {
        rows: Vec::new(),
        groups: Vec::new(),
        ..*problem
    };
    for group in problem.groups.iter().filter(|group| is_in(group.movement)) {
        let from = part.rows.len();
        part.rows.extend(&problem.rows[group.rows.clone()]);
        part.groups.push(Group {
            movement: group.movement,
            rows: from..part.rows.len(),
        });
    }
    part
}

/// The rows of one log.
pub(super) fn of_log(dataset: &Dataset, log: usize) -> Dataset {
    dataset.only(|rows| {
        let movement = rows.first().map(|row| row.movement);
        movement.is_some_and(|movement| dataset.movements[movement].log == log)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::dataset::LogSource;
    use crate::input::shipped::STAGE_TOML;
    use crate::simulate::assembly::Assembly;
    use crate::simulate::protocol::Protocol;
    use crate::simulate::recording::record;
    use crate::simulate::sensors::SensorErrors;

    fn log(stage: &Stage, protocol: Protocol, seed: u64) -> Dataset {
        let run = protocol.run(stage.servo_period_s, seed);
        let assembly = Assembly::draw(stage, seed);
        let recording = record(stage, &assembly, run, &SensorErrors::USUAL, seed);
        let recording = recording.expect("no probe hits its magnet");
        recording.dataset(stage).expect("a plane")
    }

    /// Some movements of one log and some of another.
    fn joined(logs: [&Dataset; 2], takes: [fn(usize, usize) -> bool; 2]) -> Dataset {
        let mut joined = Dataset::default();
        for (number, (log, takes)) in logs.into_iter().zip(takes).enumerate() {
            let count = log.movements.len();
            let from = joined.rows.len();
            for movement in (0..count).filter(|movement| takes(*movement, count)) {
                let start = joined.rows.len();
                let slot = joined.movements.len();
                let movement = &log.movements[movement];
                joined
                    .rows
                    .extend(log.rows[movement.rows.clone()].iter().map(|row| {
                        crate::input::dataset::Row {
                            movement: slot,
                            ..*row
                        }
                    }));
                joined.movements.push(crate::input::dataset::Movement {
                    log: number,
                    rows: start..joined.rows.len(),
                    ..movement.clone()
                });
            }
            joined.logs.push(LogSource {
                path: format!("{number}.csv").into(),
                rows: from..joined.rows.len(),
                has_reference: true,
            });
        }
        joined
    }

    #[test]
    fn parts_of_logs_of_two_stages_disagree_and_those_of_one_stage_do_not() {
        let stage = Stage::from_toml(STAGE_TOML, "stage.toml".as_ref()).expect("sound");
        let all = |_, _| true;
        let first = |movement, count| movement < count / 3;
        let rest = |movement, count| movement >= count / 3;
        let even = |movement, _| movement % 2 == 0;
        let odd = |movement, _| movement % 2 == 1;
        // Of 12 stages, 60 pairs of either kind, those of one have at most 1.089 times the errors and
        // those of two at least 1.918 times.
        let stages = 1..=3;
        let logs = |protocol| -> Vec<Dataset> {
            stages
                .clone()
                .map(|seed| log(&stage, protocol, 70 + seed))
                .collect()
        };
        let (paper, combined) = (logs(Protocol::Paper), logs(Protocol::Combined));
        for k in 0..paper.len() {
            let other = (k + 1) % paper.len();
            for (one, two, takes) in [
                (&paper, &paper, [first, rest]),
                (&paper, &paper, [even, odd]),
                (&paper, &combined, [all, all]),
                (&paper, &combined, [first, all]),
                (&combined, &combined, [even, odd]),
            ] {
                for (second, is_mixed) in [(k, false), (other, true)] {
                    let dataset = joined([&one[k], &two[second]], takes);
                    let found = disagreement(&dataset, &stage);
                    let better = fits_of_logs(&dataset, &stage).map(|logs| better_alone(&logs));
                    let want = is_mixed.then_some(Severity::Refuse);
                    assert_eq!(found.map(|found| found.severity), want, "{better:?}");
                }
            }
        }
    }

    /// It shows nothing of the sensitivity of a probe that it does not move.
    #[test]
    fn a_short_log_along_one_axis_agrees_with_a_long_one_of_the_same_stage() {
        let stage = Stage::from_toml(STAGE_TOML, "stage.toml".as_ref()).expect("sound");
        let along: [fn(usize, usize) -> bool; 3] = [|k, _| k == 0, |k, _| k == 1, |k, _| k == 2];
        for seed in 71..=73 {
            let paper = log(&stage, Protocol::Paper, seed);
            let combined = log(&stage, Protocol::Combined, seed);
            for (axis, along) in along.into_iter().enumerate() {
                let dataset = joined([&combined, &paper], [|_, _| true, along]);
                assert_eq!(disagreement(&dataset, &stage), None, "{seed}, {axis}");
            }
        }
    }

    #[test]
    fn a_gain_that_differs_between_logs_is_told_from_one_percent_and_refused_from_two() {
        let stage = Stage::from_toml(STAGE_TOML, "stage.toml".as_ref()).expect("sound");
        let all = |_, _| true;
        for seed in 71..=73 {
            let paper = log(&stage, Protocol::Paper, seed);
            let combined = log(&stage, Protocol::Combined, seed);
            for (one, two) in [
                (&paper, &combined),
                (&combined, &combined),
                (&combined, &paper),
            ] {
                for (percent, want) in [
                    (0.0, None),
                    (1.0, Some(Severity::Warn)),
                    (2.0, Some(Severity::Refuse)),
                ] {
                    let mut dataset = joined([one, two], [all, all]);
                    let second = dataset.logs[1].rows.start;
                    for row in &mut dataset.rows[second..] {
                        row.signal_m = row.signal_m.map(|s| s * (1.0 + percent / 100.0));
                    }
                    let found = disagreement(&dataset, &stage);
                    let told = found.as_ref().map(|found| found.severity);
                    assert_eq!(told, want, "{seed}, {percent} %: {found:?}");
                }
            }
        }
    }
}

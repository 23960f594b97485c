//! Whether the logs of one fit are of one stage in one state: each is fitted alone, and where one
//! cannot be, it is asked how much better parameters of its own would describe it.

use super::finding::{Code, Finding, Severity};
use super::trials::{Trial, Trials, unlimited, zeros_free};
use super::warning;
use crate::input::dataset::Dataset;
use crate::input::stage::Stage;
use crate::judge::identify::check_motion;
use crate::judge::uncertainty::own_fit;
use crate::problem::model::Model;
use crate::problem::{Group, Problem};
use runtime::ModelKind;
use std::fmt::Write;

/// Sensitivities of two logs may differ by this part: runs with other motion give others, because
/// Model (31) is not all that there is.
const GAIN_MAX: f64 = 0.01;
/// Beyond this they are of different stages, or a gain has changed.
const GAIN_REFUSED: f64 = 0.02;

/// Logs with parameters of their own may have errors smaller by this factor than together: runs with
/// other motion ask for others, as above.
const BETTER_MAX: f64 = 1.5;

/// How far the logs contradict each other.
pub fn disagreement(dataset: &Dataset, stage: &Stage) -> Option<Finding> {
    if dataset.logs.len() < 2 {
        return None;
    }
    gains(dataset, stage).or_else(|| own_parameters(dataset, stage))
}

/// By the sensitivities that the logs show, each by itself.
fn gains(dataset: &Dataset, stage: &Stage) -> Option<Finding> {
    let (zeros_free, unlimited) = (zeros_free(stage), unlimited(stage));
    let trial = |dataset: &Dataset| {
        let model = Model::of(ModelKind::M31);
        check_motion(dataset, stage, dataset.rows.len(), model).ok()?;
        Trials::new(dataset, stage, &zeros_free, &unlimited).of(None)
    };
    let together = trial(dataset)?;
    let alone: Vec<(usize, Trial)> = (0..dataset.logs.len())
        .filter_map(|log| Some((log, trial(&of_log(dataset, log))?)))
        .collect();
    let (_, first) = alone.first()?;
    let differences = alone.iter().map(|(_, trial)| {
        let (eta, theirs) = (trial.free.eta(), first.free.eta());
        [0, 1, 2].map(|k| eta[k] / theirs[k] - 1.0)
    });
    let differences: Vec<[f64; 3]> = differences.collect();
    let (which, worst) = (differences.iter().enumerate())
        .map(|(k, d)| (k, d.iter().fold(0.0, |a: f64, x| a.max(x.abs()))))
        .max_by(|(_, a), (_, b)| a.total_cmp(b))?;
    if worst <= GAIN_MAX {
        return None;
    }
    let mut message = format!(
        "the logs do not agree: together they fit to {:.2} um rms",
        together.within_um
    );
    for (log, trial) in &alone {
        let path = dataset.logs[*log].path.display();
        let _ = write!(message, ", {path} alone to {:.2} um", trial.within_um);
    }
    let [a, b, c] = differences[which].map(|d| d * 100.0);
    let log = dataset.logs[alone[which].0].path.display().to_string();
    let _ = write!(
        message,
        "; the sensitivity of the probes A, B, C in {log} differs by {a:+.1}, {b:+.1}, {c:+.1} % from that in {}: fit logs of \
         one stage in one state only, and fit the other one by itself",
        dataset.logs[alone[0].0].path.display()
    );
    Some(Finding {
        severity: if worst > GAIN_REFUSED {
            Severity::Refuse
        } else {
            Severity::Warn
        },
        message,
        value: Some(worst * 100.0),
        unit: Some("%"),
        ..warning(Code::LogsDisagree)
    })
}

/// By the errors that parameters of its own would leave in each log, whether or not it determines
/// them.
fn own_parameters(dataset: &Dataset, stage: &Stage) -> Option<Finding> {
    let logs = fits_of_logs(dataset, stage)?;
    let rms = |of: fn(&LogFit) -> f64| {
        let sum: f64 = logs.iter().map(|log| log.rows * of(log).powi(2)).sum();
        (sum / logs.iter().map(|log| log.rows).sum::<f64>()).sqrt()
    };
    let (together, alone) = (rms(|log| log.together_um), rms(|log| log.alone_um));
    if together <= BETTER_MAX * alone {
        return None;
    }
    let mut message = "the logs do not agree".to_owned();
    for (source, log) in dataset.logs.iter().zip(&logs) {
        let _ = write!(
            message,
            ", {} fits to {:.2} um rms together with the others and to {:.2} um alone",
            source.path.display(),
            log.together_um,
            log.alone_um
        );
    }
    message.push_str(
        ": fit logs of one stage in one state only, and those of another one by themselves",
    );
    Some(Finding {
        severity: Severity::Refuse,
        message,
        value: Some(together / alone),
        unit: Some("times"),
        ..warning(Code::LogsDisagree)
    })
}

/// How well Model (31) describes one log: rms over X, Y, Rz (um, um, urad).
struct LogFit {
    rows: f64,
    /// With the parameters of the fit to all logs.
    together_um: f64,
    /// With parameters of its own, by one step from those.
    alone_um: f64,
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
        let (cost, fall) = own_fit(&problem, &together)?;
        Some(LogFit {
            rows: problem.rows.len() as f64,
            together_um: problem.fitness(cost),
            alone_um: problem.fitness(cost - fall),
        })
    };
    (0..dataset.logs.len()).map(fit).collect()
}

/// The groups of some movements.
fn part<'a>(problem: &Problem<'a>, is_in: impl Fn(usize) -> bool) -> Problem<'a> {
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
fn of_log(dataset: &Dataset, log: usize) -> Dataset {
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
        let stages = 1..=STAGES;
        let logs = |protocol| -> Vec<Dataset> {
            stages
                .clone()
                .map(|seed| log(&stage, protocol, 70 + seed))
                .collect()
        };
        let (paper, combined) = (logs(Protocol::Paper), logs(Protocol::Combined));
        let told = |logs, takes| {
            let dataset = joined(logs, takes);
            for log in fits_of_logs(&dataset, &stage).into_iter().flatten() {
                eprint!(" {:.2}/{:.2}", log.together_um, log.alone_um);
            }
            let found = disagreement(&dataset, &stage);
            eprintln!(
                " {:?}",
                found
                    .as_ref()
                    .map(|found| (found.severity, found.value, found.unit))
            );
            found.map(|found| found.severity)
        };
        for k in 0..paper.len() {
            let other = (k + 1) % paper.len();
            for (one, two, takes) in [
                (&paper, &paper, [first, rest]),
                (&paper, &paper, [even, odd]),
                (&paper, &combined, [all, all]),
                (&paper, &combined, [first, all]),
                (&combined, &combined, [even, odd]),
            ] {
                assert_eq!(told([&one[k], &two[k]], takes), None);
                assert_eq!(told([&one[k], &two[other]], takes), Some(Severity::Refuse));
            }
        }
    }
    const STAGES: u64 = 12;
}

//! Whether a log is of one stage in one state throughout: two logs that were joined in one file, or a
//! part that was changed between two movements.
//!
//! As with several logs, what tells is by how much parameters of its own would lower the errors of
//! each of two groups of movements, those before and those from one movement on: in the errors to second
//! order about the fit to the whole log, which add up over movements. The boundary that lowers them
//! most is told, unless the field model describes the whole log. Stages that take turns from movement to
//! movement, and a log of one movement, have no such boundary.

use super::finding::{Code, Finding, Severity};
use super::logs::{BETTER_MAX, BETTER_REFUSED, of_log, sensitivities};
use super::signals::residual_to_noise;
use super::trials::{Trials, unlimited, zeros_free};
use super::warning;
use crate::input::dataset::Dataset;
use crate::input::stage::Stage;
use crate::judge::identify::check_motion;
use crate::judge::uncertainty::OwnFit;
use crate::problem::model::Model;
use crate::problem::parameters::Parameters;
use crate::problem::{Group, Problem};
use rayon::prelude::*;
use runtime::ModelKind;
use std::fmt::Write;

/// Units of movements at most.
const UNITS_MAX: usize = 512;
/// Two states leave little that further groups would better: less than this part of what the first
/// two did. A drift leaves a quarter, and what the model lacks a third and more.
const SECOND_MAX: f64 = 0.1;
/// Errors larger by this factor than in two groups are no drift.
const BETTER_SURE: f64 = 2.0;
/// One unit of a group has at most this part of what the group is better by: more is a fault of
/// that movement.
const SHARE_MAX: f64 = 0.8;
/// Sensitivities that differ by this part of one are a change, whatever the errors.
const GAIN_REFUSED: f64 = 0.02;
/// The field model does not describe a log of which it leaves this, in terms of the noise.
const RESIDUAL_MIN: f64 = 1.2;

/// Where the movements of a log contradict each other, for each log; `sound` holds the rows that are no
/// outliers.
pub fn changes(dataset: &Dataset, sound: &Dataset, stage: &Stage) -> Vec<Finding> {
    // What Model (31) lacks may make groups of movements at other heights and tilts.
    let is_described = |log: usize| {
        let ratio = residual_to_noise(dataset, stage, log);
        ratio.is_none_or(|ratio| ratio < RESIDUAL_MIN)
    };
    let of = |log: usize| {
        let found = match dataset.logs.len() {
            1 => change(sound, stage)?,
            _ => change(&of_log(sound, log), stage)?,
        };
        (!is_described(log)).then_some(found)
    };
    (0..dataset.logs.len()).filter_map(of).collect()
}

fn change(dataset: &Dataset, stage: &Stage) -> Option<Finding> {
    let model = Model::of(ModelKind::M31);
    check_motion(dataset, stage, dataset.rows.len(), model).ok()?;
    let (zeros_free, unlimited) = (zeros_free(stage), unlimited(stage));
    let trials = Trials::new(dataset, stage, &zeros_free, &unlimited);
    let all = trials.of(None)?.free;
    let units = units(dataset, trials.problem(), &all);
    let fits: Vec<&OwnFit> = units.iter().map(|unit| &unit.fit).collect();
    let two = TwoGroups::best(&fits)?;
    let better = (two.together / two.alone()).sqrt();
    if better <= BETTER_MAX || two.largest_share(&fits) > SHARE_MAX {
        return None;
    }
    if better <= BETTER_SURE && two.second(&fits) > SECOND_MAX {
        return None;
    }
    Some(finding(dataset, stage, units[two.start].movement, better))
}

fn finding(dataset: &Dataset, stage: &Stage, start: usize, better: f64) -> Finding {
    let movement = &dataset.movements[start];
    let name = dataset.movement_name(movement);
    let mut message = format!(
        "the movements from {name} on do not agree with those before: with parameters of their own for each of the two \
         groups the errors would be {better:.1} times smaller"
    );
    let eta = |in_second: bool| {
        let is_in = |movement: usize| (movement >= start) == in_second;
        let group = dataset.only(|rows| rows.first().is_some_and(|row| is_in(row.movement)));
        sensitivities(&group, stage)
    };
    let mut differs = false;
    if let (Some(first), Some(second)) = (eta(false), eta(true)) {
        let parts = [0, 1, 2].map(|k| second[k] / first[k] - 1.0);
        let [a, b, c] = parts.map(|part| part * 100.0);
        let _ = write!(
            message,
            ", and the sensitivity of the probes A, B, C differs by {a:+.1}, {b:+.1}, {c:+.1} %"
        );
        differs = parts.iter().any(|part| part.abs() > GAIN_REFUSED);
    }
    message.push_str(
        ". Either the logs of two stages were joined, or something was changed in between: fit each group by itself",
    );
    Finding {
        severity: match better > BETTER_REFUSED || differs {
            true => Severity::Refuse,
            false => Severity::Warn,
        },
        message,
        movement: Some(name),
        t_us: dataset.rows.get(movement.rows.start).map(|row| row.t_us),
        value: Some(better),
        unit: Some("times"),
        ..warning(Code::LogsDisagree)
    }
}

/// A movement, or several that follow each other where there are very many.
struct Unit {
    /// The first of them: several also where an excerpt has several runs of one movement.
    movement: usize,
    fit: OwnFit,
}

fn units(dataset: &Dataset, problem: &Problem, parameters: &Parameters) -> Vec<Unit> {
    let all = &dataset.movements;
    let begins = |&k: &usize| k == 0 || all[k].index != all[k - 1].index;
    let begins: Vec<usize> = (0..all.len()).filter(begins).collect();
    let together = begins.len().div_ceil(UNITS_MAX).max(1);
    let starts: Vec<usize> = begins.into_iter().step_by(together).collect();
    let ends = starts.iter().skip(1).copied().chain([all.len()]);
    let of = |(start, end): (usize, usize)| {
        let mut fit = OwnFit::none();
        let first = problem
            .groups
            .partition_point(|group| group.movement < start);
        let groups = problem.groups[first..].iter();
        for group in groups.take_while(|group| group.movement < end) {
            fit.add(&OwnFit::new(&of_group(problem, group), parameters)?);
        }
        let movement = start;
        Some(Unit { movement, fit })
    };
    let ranges: Vec<(usize, usize)> = starts.iter().copied().zip(ends).collect();
    let units: Option<Vec<Unit>> = ranges.into_par_iter().map(of).collect();
    units.unwrap_or_default()
}

fn of_group<'a>(problem: &Problem<'a>, group: &Group) -> Problem<'a> {
    Problem {
        rows: problem.rows[group.rows.clone()].to_vec(),
        groups: vec![Group {
            movement: group.movement,
            rows: 0..group.rows.len(),
        }],
        ..*problem
    }
}

/// The units before and from one on, with parameters of their own.
struct TwoGroups {
    /// The first unit of the second group.
    start: usize,
    /// Cost with the parameters of the fit to all.
    together: f64,
    groups: [OwnFit; 2],
}

impl TwoGroups {
    fn new(fits: &[&OwnFit], start: usize) -> Self {
        let mut groups = [OwnFit::none(); 2];
        for (k, fit) in fits.iter().enumerate() {
            groups[usize::from(k >= start)].add(fit);
        }
        Self {
            start,
            together: groups[0].cost + groups[1].cost,
            groups,
        }
    }

    /// Cost with parameters of its own for each group.
    fn alone(&self) -> f64 {
        self.groups.iter().map(OwnFit::cost_alone).sum()
    }

    /// Those before and from one unit on, with the least cost; of one unit there are none.
    fn best(fits: &[&OwnFit]) -> Option<Self> {
        let from = |start: usize| {
            let two = Self::new(fits, start);
            (two.alone(), two)
        };
        let all: Vec<(f64, Self)> = (1..fits.len()).into_par_iter().map(from).collect();
        let best = all.into_iter().min_by(|(a, _), (b, _)| a.total_cmp(b));
        best.map(|(_, two)| two)
    }

    /// The largest part that one unit has in what the smaller group is better by.
    fn largest_share(&self, fits: &[&OwnFit]) -> f64 {
        let (first, second) = fits.split_at(self.start);
        let (members, group) = match first.len() < second.len() {
            true => (first, &self.groups[0]),
            false => (second, &self.groups[1]),
        };
        let step = group.step();
        let better = members.iter().map(|fit| fit.cost - fit.cost_after(&step));
        let (most, all) = better.fold((0.0, 0.0), |(most, all): (f64, f64), better| {
            (most.max(better), all + better)
        });
        most / all.max(f64::MIN_POSITIVE)
    }

    /// What two groups in each of the two are better by, in parts of what these two are.
    fn second(&self, fits: &[&OwnFit]) -> f64 {
        let (first, second) = fits.split_at(self.start);
        let better = |fits: &[&OwnFit], group: &OwnFit| {
            Self::best(fits).map_or(0.0, |again| group.cost_alone() - again.alone())
        };
        let again = better(first, &self.groups[0]) + better(second, &self.groups[1]);
        again / (self.together - self.alone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::of_log;
    use crate::fit::{FitSettings, FitWarning, ModelChoice, fit};
    use crate::input::shipped::STAGE_TOML;
    use crate::simulate::assembly::Assembly;
    use crate::simulate::protocol::Protocol;
    use crate::simulate::recording::{Recording, record};
    use crate::simulate::sensors::SensorErrors;

    fn stage() -> Stage {
        Stage::from_toml(STAGE_TOML, "stage.toml".as_ref()).expect("sound")
    }

    fn recording(protocol: Protocol, seed: u64) -> Recording {
        let stage = stage();
        let run = protocol.run(stage.servo_period_s, seed);
        let assembly = Assembly::draw(&stage, seed);
        record(&stage, &assembly, run, &SensorErrors::USUAL, seed).expect("clear")
    }

    fn found(recording: &Recording) -> Vec<Finding> {
        let stage = stage();
        let dataset = recording.dataset(&stage).expect("a plane");
        changes(&dataset, &dataset, &stage)
    }

    /// The movements of one log, and of another where `is_other` says so by movement and count.
    fn mixed(logs: [&Recording; 2], is_other: fn(usize, usize) -> bool) -> Recording {
        let mut mixed = logs[0].clone();
        let count = mixed.movements.len();
        for movement in (0..count).filter(|movement| is_other(*movement, count)) {
            mixed.movements[movement] = logs[1].movements[movement].clone();
        }
        mixed
    }

    #[test]
    fn two_stages_in_one_log_are_refused_with_the_movement_where_the_second_begins() {
        for protocol in [Protocol::Paper, Protocol::Combined] {
            let logs = [1, 2].map(|seed| recording(protocol, 80 + seed));
            let logs = logs.each_ref();
            assert_eq!(found(logs[0]), [], "{protocol:?}");
            let half = mixed(logs, |movement, count| movement >= count / 2);
            let first = (half.movements.len() / 2).to_string();
            let found = found(&half);
            let [found] = &found[..] else {
                panic!("{protocol:?}: {found:?}");
            };
            assert_eq!(
                (found.code, found.severity),
                (Code::LogsDisagree, Severity::Refuse)
            );
            assert_eq!(found.movement.as_deref(), Some(first.as_str()));
        }
    }

    /// Which has no boundary to tell.
    #[test]
    fn stages_that_take_turns_are_refused_for_what_the_field_model_leaves() {
        let stage = stage();
        let logs = [1, 2].map(|seed| recording(Protocol::Combined, 80 + seed));
        let turns = mixed(logs.each_ref(), |movement, _| movement % 2 == 1);
        let dataset = turns.dataset(&stage).expect("a plane");
        let fitted = fit(&dataset, &stage, &FitSettings::new(ModelChoice::Auto));
        let fitted = fitted.expect("Model (31) takes it");
        assert!(fitted.warnings.contains(&FitWarning::FieldUnsettled));
        let found = of_log(&dataset, &stage, Ok(&fitted));
        assert_eq!(found[0].severity, Severity::Refuse);
        let message = &found[0].message;
        assert!(message.contains("times the noise of"), "{message}");
    }

    /// The paper's protocol has three tilts in turn; driven one after the other they are three groups that
    /// Model (31) describes less well together.
    #[test]
    fn what_model_31_lacks_is_no_other_stage() {
        let mut recording = recording(Protocol::Paper, 81);
        let in_turn = std::mem::take(&mut recording.movements);
        for tilt in 0..3 {
            let of_tilt = in_turn.iter().skip(tilt).step_by(3).cloned();
            recording.movements.extend(of_tilt);
        }
        assert_eq!(found(&recording), []);
    }

    /// A drift and a fault have findings of their own.
    #[test]
    fn neither_a_drift_nor_a_fault_of_one_movement_is_another_stage() {
        let sound = recording(Protocol::Paper, 83);
        let rows = sound.rows() as f64;
        let mut drift = sound.clone();
        for (row, sample) in drift.movements.iter_mut().flatten().enumerate() {
            let gain = 1.0 - 0.02 * row as f64 / rows;
            sample.hall[1] = (f64::from(sample.hall[1]) * gain).round() as i32;
        }
        let mut stuck = sound;
        let held = stuck.movements[56][300];
        for sample in &mut stuck.movements[56][300..] {
            sample.beams_nm[1] = held.beams_nm[1];
        }
        for log in [drift, stuck] {
            assert_eq!(found(&log), []);
        }
    }
}

//! Faults of a long log that the excerpt of it may have missed: the stretches whose errors are far
//! above the rest, and what the signals tell once these are among the rows looked at.

use super::finding::{Code, Finding};
use super::{signals, warning};
use crate::fit::Fit;
use crate::input::dataset::Dataset;
use crate::input::stage::Stage;
use crate::input::whole::Whole;
use crate::judge::Decoded;
use crate::judge::stretches::Stretch;
use std::collections::BTreeSet;
use std::sync::Arc;

/// Stretches whose rows are added to the excerpt, ...
const ADDED: usize = 12;
/// ... with so many seconds before and behind each.
const BESIDE: usize = 3;

/// What the signals tell of an excerpt with the worst stretches of the whole, and these; `None` if
/// no stretch is far worse than the rest.
pub(super) fn findings(
    dataset: &Dataset,
    whole: &Arc<Whole>,
    stage: &Stage,
    fit: &Fit,
) -> Option<Vec<Finding>> {
    let far = &fit.stretches;
    let told = told(dataset, whole, far)?;
    let beside = |stretch: &Stretch| stretch.run.saturating_sub(BESIDE)..=stretch.run + BESIDE;
    let more: BTreeSet<usize> = far.iter().take(ADDED).flat_map(beside).collect();
    let wider = whole.with_more(dataset, &more, stage.servo_period_s);
    let decoded = Decoded::new(&fit.set, &wider);
    let mut findings = signals::signal_findings(&wider, stage, Some(&decoded.errors));
    findings.push(told);
    Some(findings)
}

fn told(dataset: &Dataset, whole: &Whole, far: &[Stretch]) -> Option<Finding> {
    const AXES: [(&str, &str, &str); 3] =
        [("x", "X", "um"), ("y", "Y", "um"), ("rz", "Rz", "urad")];
    let worst = far.first()?;
    let run = whole.runs().into_iter().nth(worst.run)?;
    let movement = dataset.movement_name(whole.movements().get(run.movement)?);
    let t_us = whole.looked_at(&run).next()?.t_us;
    let (channel, axis, unit) = AXES[worst.axis];
    let error = worst.error * 1e6;
    let stretches = match far.len() {
        1 => "a stretch of a second".to_owned(),
        several => format!("{several} stretches of a second"),
    };
    Some(Finding {
        message: format!(
            "the errors of {stretches} are far above those of the rest, the worst in {axis} by {error:.2} {unit}, {:.0} times \
             the usual (movement {movement} from t_us = {t_us}): look for a fault there, or for motion that the model does \
             not describe",
            worst.ratio
        ),
        channel: Some(channel.to_owned()),
        movement: Some(movement),
        t_us: Some(t_us),
        value: Some(error),
        unit: Some(unit),
        ..warning(Code::Outliers)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::finding::Severity;
    use crate::fit::{FitSettings, ModelChoice, fit};
    use crate::input::dataset::Scales;
    use crate::input::log::{ReadOptions, read_bytes};
    use crate::input::shipped::{LOG_GZ, STAGE_TOML};
    use crate::input::whole::Samples;
    use crate::input::whole::chunk::Sample;
    use crate::problem::model::Model;
    use runtime::ModelKind;

    const MOVEMENT: usize = 30;

    fn excerpt_of(all: &Dataset, stage: &Stage) -> Dataset {
        let mut samples = Samples::default();
        all.rows
            .iter()
            .for_each(|row| samples.push(&Sample::of(row)));
        let (movements, logs) = (all.movements.clone(), all.logs.clone());
        Arc::new(Whole::new(Scales::of(stage), samples, movements, logs)).excerpt(12_500, [0; 32])
    }

    #[test]
    fn a_step_that_the_excerpt_misses_is_found_and_a_sound_log_raises_nothing() {
        let stage = Stage::from_toml(STAGE_TOML, "stage.toml".as_ref()).expect("sound");
        let options = ReadOptions {
            rows_max: None,
            ..ReadOptions::FIT
        };
        let log = read_bytes(LOG_GZ, "log.csv.gz".as_ref(), &stage, &options).expect("sound");
        let sound = log.dataset;
        let model = ModelChoice::Named(Model::of(ModelKind::M31));
        let found = |all: &Dataset| {
            let excerpt = excerpt_of(all, &stage);
            let fit = fit(&excerpt, &stage, &FitSettings::new(model)).expect("a fit");
            let mut found = crate::diagnose::of_log(&excerpt, &stage, Ok(&fit));
            found.retain(|found| found.severity > Severity::Note);
            found
        };
        assert_eq!(found(&sound), []);
        let taken = excerpt_of(&sound, &stage);
        let index = |movement: usize| sound.movements[movement].index;
        let is_taken = |movement: &usize| {
            let mut runs = taken.movements.iter();
            runs.any(|run| run.index == index(*movement))
        };
        let movement = (MOVEMENT..57)
            .find(|movement| !is_taken(movement))
            .expect("not all are taken");
        let mut faulty = sound.clone();
        let rows = sound.movements[movement].rows.clone();
        for row in &mut faulty.rows[rows.start + 400..rows.start + 700] {
            row.reference[0] += 20e-6;
        }
        let found = found(&faulty);
        let name = index(movement).to_string();
        assert!(
            (found.iter()).any(|found| found.code == Code::Step
                && found.channel.as_deref() == Some("ifm_x")
                && found.movement.as_ref() == Some(&name)),
            "{movement} {found:#?}"
        );
    }
}

//! The paper's own experiment has a poor fit, but its log is sound. The verdict is about the fit.

use super::diagnose_log;
use crate::fit::{FitSettings, ModelChoice, fit};
use crate::judge::verdict::Verdict;
use hallstage_input::finding::{Code, Finding};
use hallstage_input::log::{ReadOptions, read_bytes};
use hallstage_input::shipped::{LOG_GZ, stage};
use hallstage_solver::estimator::draw::Draw;
use hallstage_solver::estimator::robust::Loss;
use hallstage_solver::solve::search::kind::SearchKind;
use hallstage_solver::solve::{Projection, Solver, SolverOptions};

#[test]
fn the_signals_of_a_log_are_not_judged_by_a_poor_fit() {
    let stage = stage();
    let read = read_bytes(LOG_GZ, "log".as_ref(), &stage, &ReadOptions::default());
    let all = read.expect("sound").dataset;
    let thinned: Vec<usize> = (0..all.rows.len()).filter(|row| row % 4 != 0).collect();
    let mut dataset = all.without(&thinned);
    dataset.logs[0].rows = 0..dataset.rows.len();
    for seed in 1..=6 {
        let settings = FitSettings {
            train: Some(200),
            draw: Draw::Plain,
            solver: Solver::Search(SearchKind::Shtlbo),
            loss: Loss::None,
            options: SolverOptions::new(Projection::None, seed),
            ..FitSettings::new(ModelChoice::Auto)
        };
        let fitted = fit(&dataset, &stage, &settings);
        let diagnosis = diagnose_log(&dataset, &stage, fitted.as_ref());
        let mut findings = diagnosis.findings.iter();
        let is_of_fit = |found: &Finding| {
            let codes = [
                Code::ModelLacks,
                Code::TermsAtLimit,
                Code::RowsMissing,
                Code::Jitter,
            ];
            codes.contains(&found.code())
        };
        assert!(findings.all(is_of_fit), "{seed}: {diagnosis:#?}");
        assert_eq!(diagnosis.verdict, Some(Verdict::Limited), "{seed}");
        let predicted = diagnosis.predicted.expect("figures");
        assert!(predicted.worst_ratio() > 5.0, "{seed}: {predicted:?}");
    }
}

//! Convergence and course of p: every generation as CSV, medians over the seeds as SVG.

use super::table::{Spread, by_solver};
use super::{ARRIVED, EXACT, Run};
use crate::report::axis::Axis;
use crate::report::chart::{Chart, Mark, Panel, Scale, Tone};
use hallstage_solver::solve::Projection;
use hallstage_solver::solve::search::kind::SearchKind;
use hallstage_solver::solve::search::run::Checkpoint;
use std::fmt::Write;

/// Points of a plotted curve.
const POINTS: usize = 160;

/// Every run in one line: `form,solver,seed,fitness,floor,evaluations,nan_costs,elapsed_s,
/// evaluations_to_1_percent,evaluations_to_floor,x_rms_um,y_rms_um,rz_rms_urad`; empty where there is none.
pub fn runs_csv(runs: &[Run]) -> String {
    let mut text = String::from(
        "form,solver,seed,fitness,floor,evaluations,nan_costs,elapsed_s,\
         evaluations_to_1_percent,evaluations_to_floor,x_rms_um,y_rms_um,rz_rms_urad\n",
    );
    for run in runs {
        let [arrived, exact] = [ARRIVED, EXACT].map(|share| {
            let evaluations = run.evaluations_to(share);
            evaluations.map_or(String::new(), |n| n.to_string())
        });
        let rms = run.rms.map_or([(); 3].map(|()| String::new()), |rms| {
            rms.map(|x| x.to_string())
        });
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{},{},{},{},{},{},{},{:.6},{arrived},{exact},{}",
            run.form.name(),
            run.solver,
            run.seed,
            run.fitness,
            run.floor,
            run.evaluations,
            run.nan_costs,
            run.elapsed_s,
            rms.join(","),
        );
    }
    text
}

/// Every generation of every search in one line: `form,solver,seed,evaluations,fitness,p`.
pub fn history_csv(runs: &[Run]) -> String {
    let mut text = String::from("form,solver,seed,evaluations,fitness,p\n");
    for run in runs {
        for point in &run.history {
            let p = point.p.map_or(String::new(), |p| p.to_string());
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "{},{},{},{},{},{p}",
                run.form.name(),
                run.solver,
                run.seed,
                point.evaluations,
                point.best_cost
            );
        }
    }
    text
}

/// What is plotted over the evaluations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Course {
    /// Best fitness over the floor.
    Convergence,
    /// p of the hybrids.
    P,
}

impl Course {
    /// Its value at the last checkpoint at or before a number of evaluations.
    fn value(self, run: &Run, evaluations: f64) -> Option<f64> {
        let early = |point: &Checkpoint| point.evaluations as f64 <= evaluations;
        let later = run.history.partition_point(early);
        let point = run.history.get(later.checked_sub(1)?)?;
        match self {
            Self::Convergence => Some(point.best_cost / run.floor),
            Self::P => point.p,
        }
    }
}

/// A plot of one form as SVG: the medians over the seeds, a line for each solver.
pub fn plot(runs: &[Run], form: Projection, course: Course) -> String {
    let most = runs.iter().map(|run| run.evaluations).max().unwrap_or(1) as f64;
    let starts = runs.iter().filter_map(|run| run.history.first());
    let least = starts.map(|point| point.evaluations).min();
    let least = least.unwrap_or(1).max(1) as f64;
    let step = libm::pow((most / least).max(1.0), 1.0 / (POINTS - 1) as f64);
    let curve = |runs: &[Run]| {
        let median = |k: usize| {
            let evaluations = least * libm::pow(step, k as f64);
            let values = runs.iter().filter_map(|run| course.value(run, evaluations));
            let median = Spread::of(values)?.median;
            median.is_finite().then_some((evaluations, median))
        };
        let points: Vec<_> = (0..POINTS).filter_map(median).collect();
        // The same colour for a solver in every plot.
        let name = runs[0].solver;
        let place = SearchKind::ALL.iter().position(|kind| kind.name() == name);
        let kind = place.unwrap_or(SearchKind::ALL.len());
        (!points.is_empty()).then_some(((kind, name), Mark::Line(Tone::Of(kind), points)))
    };
    let of_form = by_solver(runs).filter(|runs| runs[0].form == form);
    let (legend, marks): (Vec<_>, Vec<_>) = of_form.filter_map(curve).unzip();
    let (caption, label, scale) = match course {
        Course::Convergence => (
            "best fitness over the floor",
            "fitness / floor",
            Scale::Logarithmic,
        ),
        Course::P => ("p of the hybrids", "p", Scale::FromZero),
    };
    let chart = Chart {
        caption: format!("{caption}, form {}", form.name()),
        x_label: "evaluations".to_owned(),
        x: Axis::Logarithmic(least, most.max(least * 2.0)),
        panels: vec![Panel::new(label, scale, marks)],
    };
    chart.svg_file(&legend)
}

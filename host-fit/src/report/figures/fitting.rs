//! The course of the search, and the zero deviations.

use super::errors::{movement_end, over_movements};
use crate::report::axis::Axis;
use crate::report::chart::{Chart, Mark, Panel, Scale, Tone};
use crate::report::json::MovementZero;
use crate::report::series::lines;
use crate::solve::search::run::Checkpoint;

/// Best fitness and p over the evaluations; `None` where no search was made.
pub(in crate::report) fn search(history: &[Checkpoint]) -> Option<Chart> {
    let x: Vec<f64> = history
        .iter()
        .map(|point| point.evaluations as f64)
        .collect();
    let (first, last) = (*x.first()?, *x.last()?);
    let data = |of: &dyn Fn(&Checkpoint) -> Option<f64>| -> Vec<Mark> {
        let lines = lines(&x, |k| of(&history[k]).filter(|value| value.is_finite()));
        lines
            .into_iter()
            .map(|line| Mark::Line(Tone::Data, line))
            .collect()
    };
    let mut panels = vec![Panel {
        label: "fitness".to_owned(),
        scale: Scale::Logarithmic,
        marks: data(&|point| Some(point.best_cost)),
    }];
    if history.iter().any(|point| point.p.is_some()) {
        panels.push(Panel {
            label: "p".to_owned(),
            scale: Scale::FromZero,
            marks: data(&|point| point.p),
        });
    }
    (last > first).then(|| Chart {
        caption: "Course of the search: best fitness on the rows that it used, and the mutation probability p".to_owned(),
        x_label: "evaluations".to_owned(),
        x: Axis::Linear(first, last),
        panels,
    })
}

/// The zero deviations of the three probes by movement, with the ends of their range (m).
pub(in crate::report) fn zero_deviations(zeros: &[MovementZero], range_m: [f64; 2]) -> Chart {
    let of = |zero: &MovementZero, probe: usize| [zero.a_um, zero.b_um, zero.c_um][probe];
    let end = movement_end(zeros.len());
    let panel = |probe: usize| {
        let [low, high] = range_m.map(|m| m * 1e6);
        let ends = [low, high].map(|um| Mark::Line(Tone::Noise, vec![(0.5, um), (end, um)]));
        let values = over_movements(zeros.len(), |k| of(&zeros[k], probe));
        Panel {
            label: ["A, um", "B, um", "C, um"][probe].to_owned(),
            scale: Scale::Symmetric,
            marks: values.into_iter().chain(ends).collect(),
        }
    };
    Chart {
        caption: "Zero deviations, and the ends of their range".to_owned(),
        x_label: "movement, in the order of the logs".to_owned(),
        x: Axis::Linear(0.5, end),
        panels: [0, 1, 2].map(panel).into(),
    }
}

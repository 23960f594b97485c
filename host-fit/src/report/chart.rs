//! Charts that `chart.html` draws as SVG: three panels over the same abscissa. They follow the page they stand in: its
//! colours, light, dark or printed, and its width.

use super::axis::{Axis, short};
use serde::Serialize;
use std::fmt::Write;

/// Ends of the abscissa and of the ordinate of a panel, in units of the drawing, about half a pixel each.
const X: [f64; 2] = [104.0, 696.0];
const Y: [f64; 2] = [144.0, 6.0];
/// What is free of marks at both ends of an axis, as a part of it.
const ROOM: f64 = 0.04;

/// A role. The style sheet gives each its colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Tone {
    /// What is shown.
    Data,
    /// A second quantity in the same panel.
    Second,
    /// What noise would give.
    Noise,
    /// Lines of the grid and borders between movements.
    Grid,
}

/// What is drawn into a panel.
#[derive(Clone, Debug, PartialEq)]
pub enum Mark {
    /// A line through points.
    Line(Tone, Vec<(f64, f64)>),
    /// A filled band: abscissa, lower end, upper end.
    Band(Tone, Vec<(f64, f64, f64)>),
    /// Lines over the height of the panel.
    Borders(Tone, Vec<f64>),
}

/// A panel: what stands at its ordinate with the unit, places and texts of the ordinate's marks, and tone, class and path
/// of each mark.
type Panel = (
    String,
    Vec<(f64, String)>,
    Vec<(Tone, &'static str, String)>,
);

/// Panels of X, Y and Rz below each other.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Chart {
    caption: String,
    x_label: String,
    x_marks: Vec<(f64, String)>,
    panels: [Panel; 3],
}

impl Chart {
    /// A chart with this caption over an abscissa with a label. `panel` gives the label of each panel and its marks, the
    /// hindmost first.
    pub fn new(
        caption: impl Into<String>,
        (x_label, x): (&str, Axis),
        panel: impl Fn(usize) -> (&'static str, Vec<Mark>),
    ) -> Self {
        Self {
            caption: caption.into(),
            x_label: x_label.to_owned(),
            x_marks: marks(x, 6.0, X),
            panels: [0, 1, 2].map(|k| {
                let (label, all) = panel(k);
                let y = ordinate(&all);
                let paths = all.iter().map(|mark| drawn(mark, x, y));
                (label.to_owned(), marks(y, 4.0, Y), paths.collect())
            }),
        }
    }
}

/// Where a value stands between two ends of the drawing, to a tenth.
fn at(axis: Axis, value: f64, [low, high]: [f64; 2]) -> f64 {
    (10.0 * (low + axis.place(value) * (high - low))).round() / 10.0
}

/// The marks of an axis, at least two, none so near to an end that it meets one of the next panel.
fn marks(axis: Axis, count: f64, ends: [f64; 2]) -> Vec<(f64, String)> {
    let is_inside = |value: &f64| (ROOM..=1.0 - ROOM).contains(&axis.place(*value));
    let marks = [1.0, 2.0, 4.0].map(|finer| {
        let mut marks = axis.marks(finer * count);
        marks.retain(is_inside);
        marks
    });
    let enough = marks.iter().find(|marks| marks.len() > 1);
    let marks = enough.map_or(&[][..], Vec::as_slice);
    let step = marks
        .windows(2)
        .map(|pair| pair[1] - pair[0])
        .next()
        .unwrap_or(1.0);
    let mark = |&value: &f64| (at(axis, value, ends), short(value, step));
    marks.iter().map(mark).collect()
}

/// Tone, class and path of a mark.
fn drawn(mark: &Mark, x: Axis, y: Axis) -> (Tone, &'static str, String) {
    let through = |points: &mut dyn Iterator<Item = (f64, f64)>| {
        let mut path = String::new();
        for (k, (px, py)) in points.enumerate() {
            let letter = if k == 0 { 'M' } else { 'L' };
            // Writing to a string cannot fail.
            let _ = write!(path, "{letter}{} {}", at(x, px, X), at(y, py, Y));
        }
        path
    };
    match mark {
        Mark::Line(tone, points) => (*tone, "line", through(&mut points.iter().copied())),
        Mark::Band(tone, ends) => {
            let lower = ends.iter().map(|&(x, low, _)| (x, low));
            let upper = ends.iter().rev().map(|&(x, _, high)| (x, high));
            (*tone, "band", through(&mut lower.chain(upper)))
        }
        Mark::Borders(tone, places) => {
            let border = |&place: &f64| format!("M{} {}V{}", at(x, place, X), Y[1], Y[0]);
            (*tone, "", places.iter().map(border).collect())
        }
    }
}

/// The ordinate, with some room beyond what is shown: symmetric, or from zero where nothing is below zero.
fn ordinate(marks: &[Mark]) -> Axis {
    let values = |mark: &Mark| match mark {
        Mark::Line(_, points) => points.iter().map(|point| point.1).collect(),
        Mark::Band(_, ends) => ends.iter().flat_map(|end| [end.1, end.2]).collect(),
        Mark::Borders(..) => Vec::new(),
    };
    let values: Vec<f64> = marks.iter().flat_map(values).collect();
    let largest = 1.08 * values.iter().fold(1e-6, |most, x| f64::max(most, x.abs()));
    let is_negative = values.iter().any(|x| *x < 0.0);
    Axis(if is_negative { -largest } else { 0.0 }, largest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_has_two_marks_or_more_with_other_texts_away_from_its_ends() {
        for k in 1..400 {
            let end = 1.03f64.powi(k) * 1e-2;
            for axis in [Axis(-end, end), Axis(20.0, 20.0 + end), Axis(0.0, end)] {
                let marks = marks(axis, 4.0, X);
                let mut texts: Vec<&String> = marks.iter().map(|(_, text)| text).collect();
                texts.dedup();
                assert!(
                    texts.len() > 1 && texts.len() == marks.len(),
                    "{axis:?} {marks:?}"
                );
                let room = 0.9 * ROOM * (X[1] - X[0]);
                assert!(
                    marks
                        .iter()
                        .all(|(x, _)| (X[0] + room..X[1] - room).contains(x))
                );
            }
        }
    }
}

//! Charts as SVG that follow the page they stand in: its colours, light, dark or printed, and its
//! width. A chart is a stack of panels over the same abscissa.

use super::axis::{Axis, short};
use serde::{Serialize, Serializer};
use std::fmt::Write;

/// Size in units of the drawing, about half a pixel each: see `style.css`.
const WIDTH: f64 = 720.0;
const PANEL_HEIGHT: f64 = 150.0;
const TOP: f64 = 8.0;
const BOTTOM: f64 = 58.0;
const LEFT: f64 = 104.0;
const RIGHT: f64 = 696.0;
const MARGIN: f64 = 6.0;

/// A role. The style sheet gives each its colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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

impl Tone {
    /// Its class in the style sheet.
    const fn class(self) -> &'static str {
        match self {
            Self::Data => "data",
            Self::Second => "second",
            Self::Noise => "noise",
            Self::Grid => "grid",
        }
    }
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

/// How the ordinates of a panel are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// About zero, to the same distance.
    Symmetric,
    /// From the smallest to the largest, logarithmic.
    Logarithmic,
}

/// One panel.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// What stands at its ordinate, with the unit.
    pub label: String,
    /// Its scale.
    pub scale: Scale,
    /// What is drawn, the hindmost first.
    pub marks: Vec<Mark>,
}

/// Panels below each other.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    /// What it shows, for the caption.
    pub caption: String,
    /// What stands at the abscissa, with the unit.
    pub x_label: String,
    /// The abscissa.
    pub x: Axis,
    /// The panels, the topmost first.
    pub panels: Vec<Panel>,
}

impl Serialize for Chart {
    /// Caption and drawing, for a page.
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        [&self.caption, &self.svg()].serialize(to)
    }
}

impl Chart {
    /// Three panels, of X, Y and Rz or of the probes, over an abscissa with a label.
    pub fn with_three_panels(
        caption: impl Into<String>,
        (x_label, x): (&str, Axis),
        panel: impl FnMut(usize) -> Panel,
    ) -> Self {
        Self {
            caption: caption.into(),
            x_label: x_label.to_owned(),
            x,
            panels: [0, 1, 2].map(panel).into(),
        }
    }

    /// The chart as an `svg` element for a page. The style sheet of the page gives the colours.
    pub(super) fn svg(&self) -> String {
        let height = TOP + PANEL_HEIGHT * self.panels.len() as f64 + BOTTOM;
        let mut svg = format!("<svg role=\"img\" viewBox=\"0 0 {WIDTH} {height}\">\n");
        for (k, panel) in self.panels.iter().enumerate() {
            let top = TOP + PANEL_HEIGHT * k as f64;
            let area = Area {
                x: self.x,
                y: panel.axis(),
                top: top + MARGIN,
                bottom: top + PANEL_HEIGHT - MARGIN,
            };
            area.draw_axes(&mut svg, &panel.label);
            panel
                .marks
                .iter()
                .for_each(|mark| area.draw(&mut svg, mark));
        }
        let bottom = TOP + PANEL_HEIGHT * self.panels.len() as f64;
        for mark in self.x.marks(6.0) {
            let x = LEFT + self.x.place(mark) * (RIGHT - LEFT);
            let label = short(mark);
            line(
                &mut svg,
                format_args!(
                    "text-anchor=\"middle\" x=\"{x:.1}\" y=\"{}\">{label}",
                    bottom + 20.0
                ),
            );
        }
        let (middle, below) = (0.5 * (LEFT + RIGHT), bottom + 48.0);
        line(
            &mut svg,
            format_args!(
                "text-anchor=\"middle\" x=\"{middle}\" y=\"{below}\">{}",
                self.x_label
            ),
        );
        svg + "</svg>\n"
    }
}

/// Adds a line of text, its attributes first.
fn line(svg: &mut String, text: std::fmt::Arguments<'_>) {
    // Writing to a string cannot fail.
    let _ = writeln!(svg, "<text {text}</text>");
}

/// Where the marks of a panel are drawn.
struct Area {
    x: Axis,
    y: Axis,
    top: f64,
    bottom: f64,
}

impl Area {
    /// A point in the units of the drawing.
    fn at(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (
            LEFT + self.x.place(x) * (RIGHT - LEFT),
            self.bottom - self.y.place(y) * (self.bottom - self.top),
        )
    }

    fn draw_axes(&self, svg: &mut String, label: &str) {
        let (top, bottom) = (self.top, self.bottom);
        let mut grid = String::new();
        for mark in self.x.marks(6.0) {
            let x = LEFT + self.x.place(mark) * (RIGHT - LEFT);
            let _ = write!(grid, "M{x:.1} {top}V{bottom}");
        }
        for mark in self.y.marks(4.0) {
            let y = bottom - self.y.place(mark) * (bottom - top);
            let _ = write!(grid, "M{LEFT} {y:.1}H{RIGHT}");
            let attributes = format!(
                "text-anchor=\"end\" x=\"{}\" y=\"{:.1}\"",
                LEFT - 8.0,
                y + 7.0
            );
            line(svg, format_args!("{attributes}>{}", short(mark)));
        }
        path(svg, Tone::Grid, "stroke=\"currentColor\"", &grid);
        path(
            svg,
            Tone::Noise,
            "stroke=\"currentColor\" fill=\"none\"",
            &format!("M{LEFT} {top}V{bottom}H{RIGHT}"),
        );
        let middle = 0.5 * (top + bottom);
        line(
            svg,
            format_args!(
                "text-anchor=\"middle\" transform=\"rotate(-90)\" x=\"{}\" y=\"24\">{label}",
                -middle
            ),
        );
    }

    fn draw(&self, svg: &mut String, mark: &Mark) {
        let through = |points: &mut dyn Iterator<Item = (f64, f64)>| {
            points.enumerate().fold(String::new(), |mut d, (k, point)| {
                let (x, y) = self.at(point);
                let _ = write!(d, "{}{x:.1} {y:.1}", if k == 0 { 'M' } else { 'L' });
                d
            })
        };
        match mark {
            Mark::Line(tone, points) => {
                let style = "stroke=\"currentColor\" stroke-width=\"2\" fill=\"none\"";
                path(svg, *tone, style, &through(&mut points.iter().copied()));
            }
            Mark::Band(tone, ends) => {
                let lower = ends.iter().map(|&(x, low, _)| (x, low));
                let upper = ends.iter().rev().map(|&(x, _, high)| (x, high));
                let style = "stroke=\"currentColor\" fill=\"currentColor\" opacity=\"0.5\"";
                path(svg, *tone, style, &through(&mut lower.chain(upper)));
            }
            Mark::Borders(tone, places) => {
                let lines = places.iter().map(|&x| {
                    let x = LEFT + self.x.place(x) * (RIGHT - LEFT);
                    format!("M{x:.1} {}V{}", self.top, self.bottom)
                });
                path(
                    svg,
                    *tone,
                    "stroke=\"currentColor\"",
                    &lines.collect::<String>(),
                );
            }
        }
    }
}

fn path(svg: &mut String, tone: Tone, style: &str, d: &str) {
    let _ = writeln!(svg, "<path class=\"{}\" {style} d=\"{d}\"/>", tone.class());
}

impl Panel {
    /// A panel.
    pub fn new(label: &str, scale: Scale, marks: Vec<Mark>) -> Self {
        Self {
            label: label.to_owned(),
            scale,
            marks,
        }
    }

    /// The ordinate, with some room beyond what is shown.
    fn axis(&self) -> Axis {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut take = |y: f64| {
            if y.is_finite() && (y > 0.0 || self.scale != Scale::Logarithmic) {
                (low, high) = (low.min(y), high.max(y));
            }
        };
        for mark in &self.marks {
            match mark {
                Mark::Line(_, points) => {
                    points.iter().for_each(|point| take(point.1));
                }
                Mark::Band(_, ends) => ends.iter().for_each(|&(_, low, high)| {
                    take(low);
                    take(high);
                }),
                Mark::Borders(..) => {}
            }
        }
        let largest = high.max(-low).max(1e-6) * 1.08;
        match self.scale {
            Scale::Symmetric => Axis::Linear(-largest, largest),
            Scale::Logarithmic if low <= high => {
                Axis::Logarithmic(0.9 * low, (1.1 * high).max(2.0 * low))
            }
            Scale::Logarithmic => Axis::Logarithmic(1.0, 10.0),
        }
    }
}

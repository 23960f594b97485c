//! Charts as SVG that follow the page they stand in: its colours, light, dark or printed, and its
//! width. A chart is a stack of panels over the same abscissa.

use super::axis::Axis;
use super::plots::{DrawResult, PlotError, as_svg};
use plotters::coord::Shift;
use plotters::prelude::*;
use std::ops::Range;

/// Size in the units of the drawing, of which two are about a pixel: see `style.css`.
const WIDTH: u32 = 720;
const PANEL_HEIGHT: u32 = 150;
const TOP: u32 = 8;
const BOTTOM: u32 = 58;
const LEFT: u32 = 104;
const TEXT: u32 = 23;

/// A role, to which the style sheet gives its colour by the value that the drawing has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Tone {
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
    const fn colour(self) -> RGBColor {
        match self {
            Self::Data => RGBColor(0x14, 0x5A, 0xA0),
            Self::Second => RGBColor(0xB8, 0x55, 0x1B),
            Self::Noise => RGBColor(0xA8, 0xA8, 0xA8),
            Self::Grid => RGBColor(0xDD, 0xDD, 0xDD),
        }
    }
}

/// What is drawn into a panel.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Mark {
    /// A line through points.
    Line(Tone, Vec<(f64, f64)>),
    /// A dot at each point.
    Dots(Tone, Vec<(f64, f64)>),
    /// A filled band: abscissa, lower end, upper end.
    Band(Tone, Vec<(f64, f64, f64)>),
    /// Bars from zero: left end, right end, value.
    Bars(Tone, Vec<(f64, f64, f64)>),
    /// Lines over the height of the panel.
    Borders(Tone, Vec<f64>),
}

/// How the ordinates of a panel are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scale {
    /// About zero, to the same distance.
    Symmetric,
    /// From zero up.
    FromZero,
    /// From the smallest to the largest, logarithmic.
    Logarithmic,
}

/// One panel.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Panel {
    /// What stands at its ordinate, with the unit.
    pub(super) label: String,
    /// Its scale.
    pub(super) scale: Scale,
    /// What is drawn, the hindmost first.
    pub(super) marks: Vec<Mark>,
}

/// Panels below each other.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Chart {
    /// What it shows, for the caption.
    pub(super) caption: String,
    /// What stands at the abscissa, with the unit.
    pub(super) x_label: String,
    /// The abscissa.
    pub(super) x: Axis,
    /// The panels, the topmost first.
    pub(super) panels: Vec<Panel>,
}

impl Chart {
    /// The chart as an `svg` element to stand in a page.
    ///
    /// # Errors
    /// [`PlotError`] when the drawing library refuses.
    pub(super) fn svg(&self) -> Result<String, PlotError> {
        let svg = as_svg(&self.caption, |svg| self.draw(svg))?;
        // Within a page an element needs no name space, and its width is that of its place.
        let size = format!("width=\"{WIDTH}\" height=\"{}\" ", self.height());
        let svg = svg.replacen(&size, "role=\"img\" ", 1);
        Ok(svg.replacen(" xmlns=\"http://www.w3.org/2000/svg\"", "", 1))
    }

    const fn height(&self) -> u32 {
        TOP + PANEL_HEIGHT * self.panels.len() as u32 + BOTTOM
    }

    fn draw(&self, svg: &mut String) -> DrawResult {
        let root = SVGBackend::with_string(svg, (WIDTH, self.height())).into_drawing_area();
        let (_, mut rest) = root.split_vertically(TOP);
        for (k, panel) in self.panels.iter().enumerate() {
            let last = k + 1 == self.panels.len();
            let height = PANEL_HEIGHT + if last { BOTTOM } else { 0 };
            let (here, below) = rest.split_vertically(height);
            self.draw_panel(&here, panel, last)?;
            rest = below;
        }
        root.present()?;
        Ok(())
    }

    fn draw_panel(
        &self,
        area: &DrawingArea<SVGBackend<'_>, Shift>,
        panel: &Panel,
        last: bool,
    ) -> DrawResult {
        let mut chart = ChartBuilder::on(area)
            .margin_top(6)
            .margin_bottom(6)
            .margin_right(24)
            .x_label_area_size(if last { BOTTOM } else { 0 })
            .y_label_area_size(LEFT)
            .build_cartesian_2d(self.x, panel.axis())?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(Tone::Grid.colour())
            .axis_style(Tone::Noise.colour())
            .x_labels(if last { 6 } else { 0 })
            .x_desc(if last { self.x_label.as_str() } else { "" })
            .y_desc(&panel.label)
            .y_labels(5)
            .label_style(("sans-serif", TEXT))
            .axis_desc_style(("sans-serif", TEXT))
            .draw()?;
        for mark in &panel.marks {
            draw_mark(&mut chart, mark)?;
        }
        Ok(())
    }
}

fn draw_mark<'a>(
    chart: &mut ChartContext<'a, SVGBackend<'a>, Cartesian2d<Axis, Axis>>,
    mark: &Mark,
) -> DrawResult {
    match mark {
        Mark::Line(tone, points) => {
            let style = tone.colour().stroke_width(2);
            chart.draw_series([PathElement::new(points.clone(), style)])?;
        }
        Mark::Dots(tone, points) => {
            let dot = |&point| Circle::new(point, 4, tone.colour().filled());
            chart.draw_series(points.iter().map(dot))?;
        }
        Mark::Band(tone, ends) => {
            let lower = ends.iter().map(|&(x, low, _)| (x, low));
            let upper = ends.iter().rev().map(|&(x, _, high)| (x, high));
            let outline: Vec<_> = lower.chain(upper).collect();
            chart.draw_series([Polygon::new(outline, tone.colour().mix(0.35))])?;
        }
        Mark::Bars(tone, bars) => {
            let bar = |&(left, right, value): &(f64, f64, f64)| {
                Rectangle::new([(left, 0.0), (right, value)], tone.colour().filled())
            };
            chart.draw_series(bars.iter().map(bar))?;
        }
        Mark::Borders(tone, places) => {
            let Range { start, end } = chart.y_range();
            let border = |&x: &f64| PathElement::new([(x, start), (x, end)], tone.colour());
            chart.draw_series(places.iter().map(border))?;
        }
    }
    Ok(())
}

impl Panel {
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
                Mark::Line(_, points) | Mark::Dots(_, points) => {
                    points.iter().for_each(|point| take(point.1));
                }
                Mark::Band(_, ends) => ends.iter().for_each(|&(_, low, high)| {
                    take(low);
                    take(high);
                }),
                Mark::Bars(_, bars) => bars.iter().for_each(|bar| take(bar.2)),
                Mark::Borders(..) => {}
            }
        }
        let largest = high.max(-low).max(1e-6) * 1.08;
        match self.scale {
            Scale::Symmetric => Axis::Linear(-largest, largest),
            Scale::FromZero => Axis::Linear(0.0, largest),
            Scale::Logarithmic if low <= high => {
                Axis::Logarithmic(0.9 * low, (1.1 * high).max(2.0 * low))
            }
            Scale::Logarithmic => Axis::Logarithmic(1.0, 10.0),
        }
    }
}

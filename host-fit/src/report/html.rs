//! The report of a fit as one HTML file with its plots inside, so that it can be mailed.
//!
//! The template is `report.html`; its name makes the engine escape every text.

use super::json::Report;
use minijinja::value::Serde;
use minijinja::{Environment, Error, UndefinedBehavior};
use serde::Serialize;

/// What the page shows.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Page<'a> {
    /// The figures of a fit.
    pub report: &'a Report,
    /// Name of the model.
    pub title: &'a str,
    /// How zero deviations were treated.
    pub zeros: &'a str,
    /// Names of the logs.
    pub logs: &'a [String],
    /// The plots.
    pub plots: &'a [Plot],
}

/// A plot of the page.
#[derive(Clone, Debug, Serialize)]
pub struct Plot {
    /// What stands above it.
    pub caption: &'static str,
    /// The plot, which alone goes into the page without escaping.
    pub svg: String,
}

impl Page<'_> {
    /// The page as HTML.
    ///
    /// # Errors
    /// [`Error`] when the template names something that is not there.
    pub fn to_html(&self) -> Result<String, Error> {
        render("report.html", include_str!("report.html"), self)
    }
}

/// A template filled in; `name` ends in `.html`, so that every text is escaped.
pub(super) fn render(
    name: &str,
    template: &str,
    context: &impl Serialize,
) -> Result<String, Error> {
    let mut engine = Environment::new();
    engine.set_undefined_behavior(UndefinedBehavior::Strict);
    engine.add_filter("scientific", |number: Option<f64>| {
        number.map_or_else(|| "-".to_owned(), |x| format!("{x:.2e}"))
    });
    engine.render_named_str(name, template, Serde(context))
}

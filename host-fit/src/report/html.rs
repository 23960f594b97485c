//! Pages from templates. A template's name ends in `.html`, so that every text is escaped.

use super::plots::PlotError;
use crate::output::OutputError;
use minijinja::value::Serde;
use minijinja::{Environment, Error, UndefinedBehavior};
use serde::Serialize;

/// The style of every page: it stands in the page, which so is complete in one file.
pub(super) const STYLE: &str = include_str!("style.css");

/// Why there is no page.
#[derive(Debug, thiserror::Error)]
pub enum PageError {
    /// A plot could not be drawn.
    #[error(transparent)]
    Plot(#[from] PlotError),
    /// The template names something that is not there.
    #[error("the template of the report: {0}")]
    Template(#[from] Error),
    /// The page was not written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// A template filled in.
pub(super) fn render(
    name: &str,
    template: &str,
    context: &impl Serialize,
) -> Result<String, Error> {
    let mut engine = Environment::new();
    engine.set_undefined_behavior(UndefinedBehavior::Strict);
    engine.render_named_str(name, template, Serde(context))
}

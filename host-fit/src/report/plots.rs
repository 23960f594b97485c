//! Drawing plots as SVG.

/// Why a plot could not be drawn.
#[derive(Debug, thiserror::Error)]
#[error("cannot draw the plot {title}: {cause}")]
pub struct PlotError {
    /// Its title.
    pub title: String,
    /// What the drawing library says.
    pub cause: String,
}

/// What drawing gives: the library has an error type for each backend.
pub(crate) type DrawResult = Result<(), Box<dyn std::error::Error>>;

/// The SVG that `draw` writes.
pub(crate) fn as_svg(
    title: &str,
    draw: impl FnOnce(&mut String) -> DrawResult,
) -> Result<String, PlotError> {
    let mut svg = String::new();
    draw(&mut svg).map_err(|cause| PlotError {
        title: title.to_owned(),
        cause: cause.to_string(),
    })?;
    Ok(svg)
}

//! What a fit, a judgement or a plan shows: JSON, text tables, plots, an HTML page.

mod axis;
mod before_after;
mod chart;
pub mod errors;
pub mod field;
mod figures;
pub mod html;
pub mod json;
pub mod page;
pub mod parameters;
pub mod plan;
pub mod plan_page;
pub mod plots;
pub mod provenance;
mod series;
mod tables;
pub mod text;
pub mod verdict;

use std::path::{Path, PathBuf};

/// The one file of a report in `folder`.
pub fn page_in(folder: &Path) -> PathBuf {
    folder.join("index.html")
}

//! What a fit, a judgement or a plan shows: JSON, text tables, plots, an HTML page.

pub mod axis;
pub mod chart;
pub mod errors;
pub mod field;
mod figures;
pub mod html;
pub mod json;
pub mod page;
pub mod parameters;
pub mod plan;
pub mod provenance;
mod series;
pub mod table;
pub mod trusted;
pub mod verdict;

pub use figures::Density;

//! What a fit, a judgement or a plan shows: JSON, text tables, plots, an HTML page.

pub mod field;
pub mod html;
pub mod json;
pub mod plan;
pub mod plan_page;
pub mod plots;
pub mod text;

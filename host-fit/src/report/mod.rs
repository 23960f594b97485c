//! What a fit or a judgement shows: JSON, text tables, plots, an HTML page.

pub mod field;
pub mod html;
pub mod json;
pub mod plots;
pub mod text;

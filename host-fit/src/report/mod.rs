//! What a fit, a judgement or a plan shows: JSON, text tables, plots, an HTML page.

pub mod axis;
pub mod budget;
pub mod channels;
pub mod chart;
mod charts;
pub mod decision;
pub mod errors;
pub mod field;
pub mod figure;
pub mod html;
mod json;
mod motion;
pub mod page;
pub mod parameters;
pub mod plan;
pub mod provenance;
mod reference;
pub mod result;
mod series;
pub mod table;
pub mod text;
pub mod verdict;

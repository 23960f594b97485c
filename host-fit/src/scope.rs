//! A scope in the terminal: six sensors as traces with their range, rails, noise and spectrum.
//!
//! It shows what one looks for first on a new stage: a sensor that is dead, at a rail, noisy, inverted or exchanged.
//!
//! | module | what it does |
//! |---|---|
//! | `trace` | what the codes of one sensor show |
//! | `history` | the rows so far, and the window of them that is shown |
//! | `view` | the picture |
//! | `screen` | the terminal and its keys |
//! | [`file`](mod@file) | a log, also while it grows |

pub mod file;
mod history;
mod screen;
mod trace;
mod view;

pub use history::{History, ScopeRow};
pub use screen::{Screen, Wish};
pub use trace::Scale;

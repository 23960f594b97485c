//! Population searches: SHTLBO and its relatives.
//!
//! A [`cost::CostFunction`] says what is minimized and in which box; a [`kind::SearchKind`]
//! names a method; [`run::StopCriteria`] say when to stop; a [`run::Outcome`] says what was
//! found, why the search stopped and how it went.
//!
//! | module | what it holds |
//! |---|---|
//! | [`cost`] | the function, ranking of costs |
//! | [`random`] | a stream of random numbers for each individual |
//! | [`operators`] | the steps of TLBO and its relatives (equations 16-22) |
//! | [`mixing`] | p and its adaptation (equations 25, 27-29) |
//! | [`tlbo`] | the phases, the hybrids (equations 23, 24, 26), SHTLBO |
//! | [`population`] | individuals; a generation: what all searches share |
//! | [`run`] | generations, stop criteria, history |
//! | [`kind`] | all searches by name |

pub mod cost;
pub mod kind;
pub mod mixing;
pub mod operators;
pub mod population;
pub mod random;
pub mod run;
pub mod tlbo;

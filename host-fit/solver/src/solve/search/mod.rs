//! SHTLBO and its relatives, for any cost function over a box.
//!
//! A [`cost::CostFunction`] is minimized by a [`kind::SearchKind`] with [`run::SearchOptions`]; a
//! [`run::SearchResult`] has the best individual, the reason to stop and the history.
//!
//! | module | content |
//! |---|---|
//! | [`cost`] | the cost function, the ranking of costs |
//! | [`random`] | a stream of random numbers for each individual |
//! | [`operators`] | the steps of TLBO and its relatives (equations 16-22) |
//! | [`mixing`] | p and its adaptation (equations 25, 27-29) |
//! | [`tlbo`] | a population and its generations (equations 23, 24, 26) |
//! | [`kind`] | the searches by name |
//! | [`run`] | options, the loop over generations, the result |

pub mod cost;
pub mod kind;
pub mod mixing;
pub mod operators;
pub mod random;
pub mod run;
pub mod tlbo;

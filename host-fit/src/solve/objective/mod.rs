//! The fitness of a fit as a cost function of a search, in three forms.
//!
//! The fitness is the root of the mean over rows and axes of the weighted squared pose error,
//! in um, um and urad: [`crate::problem::Problem::fitness`].
//!
//! | module | form | unknowns of Model (31) |
//! |---|---|---|
//! | [`full`] | `none`: the paper's | 21 and three for each movement |
//! | [`delta`] | `delta`: zero deviations in closed form | 18 |
//! | [`linear`] | `linear`: gain and offsets in closed form | 9 |
//!
//! | module | what the forms share |
//! |---|---|
//! | [`form`] | one of the three, behind one type |
//! | [`lanes`] | eight individuals in SIMD registers |
//! | [`model`] | Model (31) for eight individuals |
//! | [`poles`] | keeps `delta` and `linear` away from the poles of 1/phi |

pub mod delta;
pub mod form;
pub mod full;
pub mod lanes;
pub mod linear;
pub mod model;
pub mod poles;

#[cfg(test)]
pub(crate) mod sample;
#[cfg(test)]
mod tests;

//! What is wrong with a log, and by how much it can be trusted: between the fit and the blob.

pub mod finding;

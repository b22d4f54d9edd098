//! Messages of programs to people: progress, and errors.
//!
//! Invariant: everything goes to standard error, so that results on standard output stay clean.

mod failure;
mod meter;

pub use failure::{exit_code, said_once};
pub use indicatif::{HumanBytes, HumanCount};
pub use meter::Meter;

//! Messages of programs to people: progress, errors, and results.
//!
//! Invariant: results alone go to standard output. Everything else goes to standard error.

mod failure;
mod meter;
mod output;

pub use failure::{exit_code, said_once};
pub use indicatif::{HumanBytes, HumanCount};
pub use meter::Meter;
pub use output::print;

//! Tests of the package from outside.

#![allow(clippy::panic, clippy::unwrap_used, reason = "tests")]

mod bad_input;
mod openings;
mod symmetries;
mod written;

//! All drivers: what each of them must do, and frames that stay the same bit by bit.

// Functions beside the tests fail them in the same way.
#![allow(clippy::expect_used, clippy::panic, clippy::unwrap_used)]

mod contract;
mod golden;

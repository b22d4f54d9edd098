//! The known room of `display`'s tests.

#![allow(dead_code, unused_imports, reason = "each test file uses its own part")]

#[path = "../../../../display/tests/common/mod.rs"]
mod room;

pub use room::*;

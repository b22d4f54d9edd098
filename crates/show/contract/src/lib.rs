//! What all drivers have in common, as tests: a room with every kind of surface, samples of it, and
//! each driver as a [`Subject`].
//!
//! - `tests/it/contract.rs` states what every driver must do. A new driver is a line of
//!   [`SUBJECTS`].
//! - `tests/it/golden.rs` compares frames with those of earlier versions, bit by bit.
//!
//! Samples follow from formulas, not from an engine, so that only drivers change the frames.

// Functions beside the tests fail them in the same way.
#![allow(clippy::expect_used, clippy::panic, clippy::unwrap_used)]

mod room;
mod subject;
#[path = "../../display/tests/common/viewer.rs"]
mod viewer;

pub use room::{RoomSample, TestRoom};
pub use subject::{SUBJECTS, Subject, SubjectViewer};

//! Tests of the driver `mesh`, in one program: each one compiles the same generic code again.

#![allow(clippy::unwrap_used, reason = "helpers beside the tests fail them in the same way")]

mod common;
mod driver;
mod pictures;
mod triangulation;
#[path = "../../../display/tests/common/viewer.rs"]
mod viewer;

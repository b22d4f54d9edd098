//! Tests of the public interface, in one program: each one compiles the same generic code again.

mod cells;
mod common;
mod driver;
mod leaf_size;
mod oblique;
mod order;
mod outside;
mod pictures;
mod rooms;
mod unseen;
#[path = "../../../display/tests/common/viewer.rs"]
mod viewer;

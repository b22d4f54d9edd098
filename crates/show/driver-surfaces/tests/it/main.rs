//! Tests of the public interface, in one program: each one compiles the same generic code again.

mod common;
mod covers;
mod curved;
mod driver;
mod edges;
mod filter;
mod likely;
mod reflections;
mod store;
mod texture;
#[path = "../../../display/tests/common/viewer.rs"]
mod viewer;

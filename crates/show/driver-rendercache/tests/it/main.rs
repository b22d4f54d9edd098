//! Tests of the public interface, in one program: each one compiles the same generic code again.

mod drivers;
mod frameless;
mod hints;
mod memory;
mod noise;
mod pictures;
mod same;
mod scenes;
mod settings;
mod unasked;
#[path = "../../../display/tests/common/viewer.rs"]
mod viewer;

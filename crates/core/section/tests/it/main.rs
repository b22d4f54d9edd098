//! Tests of the public interface, in one program: each one compiles the same generic code again.

mod codec;
mod common;
mod importance;
mod line;
mod proximity;
mod sampling;
mod section;

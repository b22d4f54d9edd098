//! Tests of the public interface, in one program: each one compiles the same generic code again.

mod coincident;
mod common;
mod queries;
mod shaft;
mod stress;
mod watertight;

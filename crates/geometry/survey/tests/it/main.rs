//! Tests of the public interface, in one program: each one compiles the same generic code again.

mod findings;
mod survey;

//! Tests of the public interface, in one program: each one compiles the same generic code again.
//! The tests beside this folder need a process of their own.

mod clipping;
mod colours;
mod compare;
mod files;
mod look;
mod view_types;
mod views;

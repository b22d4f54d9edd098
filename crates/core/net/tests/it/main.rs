//! Tests of the public interface, in one program: each one compiles the same generic code again.
//! The tests beside this folder need a process of their own.

mod common;
mod connection;
mod handshake;
mod reach;
mod scene;
mod secure;

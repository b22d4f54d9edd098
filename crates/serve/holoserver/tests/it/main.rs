//! Tests of the public interface, in one program: each one compiles the same generic code again.
//! The tests beside this folder need a process of their own.

mod audits;
mod common;
mod crowd;
mod hostile;
mod joining;
mod parts;
mod restart;
mod shards;
mod status;

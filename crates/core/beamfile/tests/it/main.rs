//! Tests of the public interface, in one program: each one compiles the same generic code again.
//! The tests beside this folder need a process of their own.

mod behaviour;
mod blobs;
mod common;
mod damage;
mod golden;
mod index;
mod layers;
mod lost;
mod model;
mod storage;

//! Tests of splats: the bytes of a file, damaged files, and light from samples to surfels.
#![allow(clippy::unwrap_used)]

mod bytes;
mod common;
mod damage;
mod light;

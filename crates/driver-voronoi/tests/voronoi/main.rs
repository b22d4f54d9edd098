//! What the geometry-guided driver promises, on small scenes whose light is known in closed form.

#![allow(clippy::unwrap_used, reason = "helpers beside the tests fail them in the same way")]

#[path = "../../../display/tests/common/mod.rs"]
mod common;
mod half;
mod light;
mod order;
mod stage;
mod surfaces;

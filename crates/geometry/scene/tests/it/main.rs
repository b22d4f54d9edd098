//! Tests of the public interface, in one program: each one compiles the same generic code again.

mod additions;
mod arrays;
mod common;
mod covers;
mod details;
mod geometry;
mod gltf;
mod habits;
mod instances;
mod luminaires;
mod mended;
mod mtl;
mod obj;
mod packed;
mod posed;
mod shading;
mod shared_scenes;
mod shiny;
mod sky;
mod slabs;

//! Reflection cubes: the light that arrives at an object from all directions around it (Ruff, Clua
//! and Fernandes, "Dynamic per Object Ray Caching Textures for Real-Time Ray Tracing", 2013).
//!
//! A [`ReflectionCube`] has six faces of texels around a centre. A texel is valid once a
//! [`ReflectionSample`] arrived in it. It averages its samples, and stores how far away the
//! surface is that they show. So a ray that leaves the object beside the centre finds the texel of
//! the point that it hits, and not only that of its direction: nearby surroundings shift as they
//! should. [`look_up`](ReflectionCube::look_up) answers in one of three ways ([`CubeAnswer`]).
//! Blurrier levels serve rough surfaces.
//!
//! A cube that ignores distances, as in the paper, is the same cube with samples and look-ups whose
//! origin is the centre.
//!
//! Points and directions are in one system of coordinates, that of the scene or of the object.
//!
//! Invariants:
//! - A cube is a function of its calls, in their order. It knows neither scene nor clock.
//! - A cube never takes more memory than [`bytes_of`] says for its resolution.
//! - Levels average valid texels only, by their solid angle. Nothing is invented for the others.
#![forbid(unsafe_code)]

mod cube;
mod face;
mod grid;
mod levels;
mod parallax;
mod smooth;

pub use cube::{
    CubeAnswer, CubeLight, CubeStatistics, ReflectionCube, ReflectionSample, bytes_of, resolution,
};
pub use face::FACE_AXES;
pub use grid::{CubeGrid, LEAST_RESOLUTION, MOST_RESOLUTION};

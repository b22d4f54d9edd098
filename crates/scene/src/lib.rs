//! Scenes: OBJ/MTL files into a validated, packed [`Scene`], and which features that scene uses.
//!
//! A [`Scene`] is triangles with a material each, in single precision around an `f64` origin, so that a building at map
//! coordinates loses nothing. [`load_obj`] reads one from a file (`tobj` parses it, each line checked before),
//! [`Scene::pack`] turns it into the bytes that travel to workers and lie in a holodeck file, [`Scene::unpack`] reads
//! those back without trusting them.
//!
//! What always holds:
//! - A [`Scene`] is valid: every index is in range, every number finite and within the limits of [`limits`], every
//!   triangle has an area, every albedo lies in [0, 1].
//! - Text and bytes from outside give a clear error or a valid scene, never a panic; every count is bounded before
//!   memory is taken for it.
//! - What a file says and the scene cannot is never dropped silently: it is a [`Warning`] with its line.
//! - `pack` is canonical: a scene has one packing, and `unpack` accepts nothing else.

mod error;
mod faces;
mod inside;
pub mod limits;
mod load;
mod material;
pub mod mtl;
mod mtl_text;
mod obj;
mod obj_text;
pub mod pack;
mod polygon;
mod scene;
mod text;

pub use error::{PackedError, SceneError, Warning};
pub use load::{LoadOptions, LoadProgress, Loaded, load_obj, load_obj_watched};
pub use material::{Bsdf, Material, Rgb};
pub use pack::{HEADER_BYTES, MAGIC, VERSION};
pub use scene::{Features, Scene};

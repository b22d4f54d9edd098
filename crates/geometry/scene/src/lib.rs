//! Scenes: reads model files (OBJ/MTL, glTF 2.0) into a validated, packed [`Scene`] and determines
//! which features it uses.
//!
//! A [`Scene`] is a set of triangles, each with a material. Triangles of meshes that occur several
//! times are stored once, and have a number in each [`Instance`]. Coordinates are f32 around an
//! `f64` origin, so a building at map coordinates loses no precision. [`load()`] reads a scene from
//! a file: `tobj` parses OBJ after each line has been checked, and `gltf` parses glTF.
//! [`Scene::pack`] makes the bytes that are sent to workers and stored in a holodeck file.
//! [`Scene::unpack`] reads those bytes without trusting them.
//!
//! Invariants:
//! - A [`Scene`] is valid. Every index is in range, every number is finite and within [`limits`],
//!   every triangle has an area, and every albedo lies in [0, 1].
//! - Text and bytes from outside give a clear error or a valid scene, never a panic. Every count is
//!   bounded before memory is allocated for it.
//! - Nothing in a file is dropped silently: a [`Warning`] with its line names everything that a
//!   scene cannot represent.
//! - `pack` is canonical: a scene has one packing, and `unpack` accepts nothing else.

mod additions;
mod arrays;
mod assemble;
mod cover;
mod error;
mod exporter;
mod faces;
mod foreign;
mod geometry;
mod glass;
mod gltf_file;
mod habits;
mod hanging;
mod header;
mod inside;
mod instances;
mod kept;
mod lamp_groups;
mod libraries;
pub mod limits;
mod load;
mod load_options;
mod luminaire;
mod luminous_faces;
mod material;
mod model;
pub mod mtl;
mod mtl_maps;
mod mtl_text;
mod named_file;
mod named_photometry;
mod obj;
mod obj_checked;
mod obj_ignored;
mod obj_model;
mod obj_text;
mod other_formats;
pub mod pack;
mod pack_instances;
mod pack_luminaires;
mod pack_punctual;
mod pack_shading;
mod pack_sky;
mod pack_values;
mod placement;
mod polygon;
mod punctual;
mod scene;
mod scene_instances;
mod scene_lights;
mod shaded;
mod shading;
mod sheets;
mod shiny;
mod sky;
mod sky_cube;
mod sky_picture;
mod slabs;
mod smooth;
mod sun;
mod text;
mod texture;
mod texture_decode;
mod texture_files;
mod texture_use;
mod thin;
mod units;
mod warnings;

pub use arrays::SceneArrays;
pub use error::{PackedError, SceneError};
pub use geometry::Geometry;
pub use hanging::HungLuminaire;
pub use header::{ModelCamera, ModelFacts, StatedValue};
pub use instances::Instance;
pub use kept::KeptFiles;
pub use lamp_groups::{SKY, SUN};
pub use load::{Loaded, load, load_watched};
pub use load_options::LoadOptions;
pub use luminaire::{Luminaire, MAX_LUMINAIRES};
pub use luminous_faces::Hanging;
pub use material::{Bsdf, Material, Rgb};
pub use model::LoadProgress;
pub use named_photometry::{LuminousPart, NamedPhotometry};
pub use pack::{HEADER_BYTES, MAGIC, VERSION};
pub use placement::{MAX_STRETCH, Placement, coordinate, greatest};
pub use punctual::{MAX_PUNCTUAL_LIGHTS, PunctualBeam, PunctualLight};
pub use scene::{Features, Scene};
pub use shading::{
    Base, CUT_OUT, Channel, Cover, CutOut, FinishMap, MAX_TEXTURES, Maps, NormalMap, Octahedral,
    Shading, WHITE, WHOLE, from_octahedral, to_octahedral,
};
pub use shiny::ShinyObjects;
pub use sky::{Sky, SkyAxes};
pub use sky_picture::{MAX_SKY_SIDE, SkyPicture};
pub use sun::{MAX_SUNS, SUN_RADIUS, Sun};
pub use texture::{MAX_SIDE, MAX_TEXTURE_BYTES, Texture, Wrap};
pub use warnings::Warning;

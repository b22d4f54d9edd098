//! Errors and warnings about scenes.

use std::path::PathBuf;

/// The reason why a scene could not be read, made or unpacked.
///
/// Lines count from 1.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// The file could not be read.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The file exceeds the size limit.
    #[error("{path}: the file is larger than {limit} bytes")]
    FileTooLarge {
        /// The file.
        path: PathBuf,
        /// The limit of [`crate::limits`] in bytes.
        limit: u64,
    },
    /// A file exceeds a limit of scenes.
    #[error("{path}:{line}: more than {limit} {what}")]
    FileLimit {
        /// The file.
        path: PathBuf,
        /// The line that exceeds it.
        line: usize,
        /// The kind of thing that exceeds the limit.
        what: &'static str,
        /// The limit of [`crate::limits`].
        limit: usize,
    },
    /// `tobj` rejects a file that passed our checks.
    #[error("{path}: {source}")]
    Parser {
        /// The file.
        path: PathBuf,
        /// The error of `tobj`.
        source: tobj::LoadError,
    },
    /// A glTF file is not valid, or a part of it is missing.
    #[error("{path}: {problem}")]
    Gltf {
        /// The file.
        path: PathBuf,
        /// The problem with its place, and what to do.
        problem: String,
    },
    /// The first bytes of a file are of a format that is not read.
    #[error("{path}: {problem}")]
    Foreign {
        /// The file.
        path: PathBuf,
        /// What it is, and what to do.
        problem: &'static str,
    },
    /// A file has no triangle with an area.
    #[error("{path}: no triangle in it: {instead}")]
    Empty {
        /// The file.
        path: PathBuf,
        /// The file's real format, for people.
        instead: String,
    },
    /// A scene would exceed a limit.
    #[error("{count} {what} are more than the limit of {limit}")]
    Limit {
        /// The kind of thing that exceeds the limit.
        what: &'static str,
        /// The number.
        count: u64,
        /// The limit of [`crate::limits`].
        limit: u64,
    },
    /// The origin is not finite or too far away.
    #[error("the origin is not finite or beyond {} units", crate::limits::MAX_COORDINATE)]
    Origin,
    /// A position is not finite or too far away.
    #[error("position {0} is not finite or beyond {limit} units", limit = crate::limits::MAX_COORDINATE)]
    Position(usize),
    /// A triangle refers to a position that does not exist.
    #[error("triangle {triangle} names position {index} of {count}")]
    PositionIndex {
        /// The triangle.
        triangle: usize,
        /// The index of the position.
        index: u32,
        /// Number of positions.
        count: usize,
    },
    /// A triangle refers to a material that does not exist.
    #[error("triangle {triangle} names material {index} of {count}")]
    MaterialIndex {
        /// The triangle.
        triangle: usize,
        /// The index of the material.
        index: u32,
        /// Number of materials.
        count: usize,
    },
    /// The number of material ids differs from the number of triangles.
    #[error("{triangles} triangles have {material_ids} material ids")]
    MaterialIdCount {
        /// Number of triangles.
        triangles: usize,
        /// Number of material ids.
        material_ids: usize,
    },
    /// A triangle has no area (in `f64`, from its `f32` corners), so it has no normal.
    #[error("triangle {0} has no area")]
    NoArea(usize),
    /// An instance of a mesh is not possible.
    #[error("instance {instance}: {problem}")]
    Instance {
        /// The instance.
        instance: usize,
        /// What is wrong.
        problem: &'static str,
    },
    /// An object vanishes at its place in a scene.
    #[error("object `{name}` is so small, large or far away that rounding leaves nothing of it")]
    Object {
        /// The object.
        name: String,
    },
    /// A material has an impossible value.
    #[error("material `{name}`: {problem}")]
    Material {
        /// The material.
        name: String,
        /// What is wrong.
        problem: &'static str,
    },
    /// Normals or textures do not fit the scene.
    #[error("normals or textures: {problem}")]
    Shading {
        /// What is wrong.
        problem: &'static str,
    },
    /// The sky's radiance is negative, not finite or too large.
    #[error("the sky's radiance must be finite numbers from 0 to {}", crate::limits::MAX_RADIANCE)]
    Sky,
    /// The sun of the sky has no unit direction, or no plausible irradiance.
    #[error("the sky's sun has no direction, or its irradiance is none, not finite or too large")]
    SkySun,
    /// A sun has no unit direction, or no plausible irradiance.
    #[error("sun {0} has no direction, or its irradiance is none, not finite or too large")]
    Sun(usize),
    /// A value of a punctual light is not possible.
    #[error(
        "punctual light {0}: its place, direction, angles, size or intensity is not possible, or it \
         has no light"
    )]
    PunctualLight(usize),
    /// A luminaire is not possible.
    #[error(
        "luminaire {0}: its direction or material is not possible, or it is so small or far away that \
         it has no area"
    )]
    Luminaire(usize),
    /// The bytes are not a packed scene.
    #[error("not a packed scene: {0}")]
    Packed(#[from] PackedError),
}

/// The reason why bytes are not a packed scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PackedError {
    /// They do not begin with the magic bytes.
    #[error("it does not begin with the magic bytes")]
    Magic,
    /// Their version is unknown to this program.
    #[error("its version is {found}, this program reads {known}")]
    Version {
        /// Their version.
        found: u32,
        /// The version that this program reads.
        known: u32,
    },
    /// Their length differs from the header.
    #[error("{found} bytes, its header says {expected}")]
    Length {
        /// Length by the header.
        expected: u64,
        /// Actual length.
        found: u64,
    },
    /// Bytes that must be zero are not.
    #[error("reserved bytes are not zero")]
    Reserved,
    /// The bytes of the materials are malformed.
    #[error("material {0} is malformed")]
    Material(usize),
    /// The bytes of meshes and instances are malformed.
    #[error("its instances are malformed")]
    Instances,
    /// An instance has an impossible place.
    #[error("instance {0} is not finite, flat or stretched beyond 1e6")]
    Placement(usize),
    /// The bytes of the sky are malformed.
    #[error("its sky is malformed")]
    Sky,
    /// The bytes of normals and textures are malformed.
    #[error("its normals or textures are malformed")]
    Shading,
    /// The bytes of the luminaires are malformed.
    #[error("its luminaires are malformed")]
    Luminaires,
    /// A texture cannot be decoded.
    #[error("texture {0} cannot be decoded")]
    Texture(usize),
}

//! Limits of scenes, and their reasons.

/// Most triangles of a scene.
///
/// Three indices of each fit into 32 bits. Arrays of this size (4.3 GB of triangles) are about the
/// most that one machine can trace.
pub const MAX_TRIANGLES: usize = 1 << 28;

/// Most positions of a scene; the same as [`MAX_TRIANGLES`].
pub const MAX_POSITIONS: usize = 1 << 28;

/// Most meshes that instances share; as many as materials.
pub const MAX_MESHES: usize = 1 << 16;

/// Most instances of meshes in a scene: 3.1 GB of records.
pub const MAX_INSTANCES: usize = 1 << 24;

/// Most elements of arrays and corners of triangles of a glTF file, beyond four for each of its
/// bytes. So many can only be copies.
///
/// A file of 1 MB can name the same arrays 10,000 times. At this limit, copies take 1 to 3 GB. A
/// box has 150 elements and corners, and a node that places it takes 60 bytes.
pub const MAX_REPEATED: u64 = 1 << 26;

/// Most triangles of instances that are tested for their area, because rounding may leave them
/// without: less than a second. Well-shaped meshes within a kilometre need none.
pub const MAX_THIN_TRIANGLES: usize = 1 << 25;

/// Most triangles of instances that emit light. Each has a record of its own in an engine, so
/// instances save nothing, and readers of models copy lamps.
pub const MAX_SHARED_LAMPS: usize = 1 << 20;

/// Most materials of a scene. A CAD model has hundreds; a material per triangle is an exporter's
/// mistake.
pub const MAX_MATERIALS: usize = 1 << 16;

/// Longest material name in bytes of UTF-8. Names appear in messages and in every packed scene.
pub const MAX_NAME_BYTES: usize = 1024;

/// Largest magnitude of a coordinate, of the origin and of a position relative to it, in scene
/// units.
///
/// Ray and triangle tests multiply three of them in `f32`: (4e12)³ = 6.4e37 is still below 3.4e38.
pub const MAX_COORDINATE: f64 = 1e12;

/// Largest radiance of a material or of the sky, W·sr⁻¹·m⁻². The sun's disc has 2e7. An area times
/// this limit still fits into `f32`.
pub const MAX_RADIANCE: f32 = 1e20;

/// Most bytes of a sky in a packed scene: a picture of 4096 × 2048 pixels of 12 bytes, and its
/// head.
pub const MAX_SKY_BYTES: usize = (96 << 20) + 1024;

/// Least index of refraction. Glass seen from inside has 0.4 to 0.7.
pub const MIN_IOR: f32 = 0.1;

/// Greatest index of refraction of the MTL format.
pub const MAX_IOR: f32 = 10.0;

/// Most corners of a face. An exporter's outline of a round hole has hundreds. A face of millions
/// is a damaged line, and dividing it would take minutes.
pub const MAX_CORNERS: usize = 1 << 16;

/// Largest OBJ file in bytes. [`MAX_TRIANGLES`] would need about 10 GB of text, but the whole text
/// is held in memory.
pub const MAX_OBJ_BYTES: u64 = 4 << 30;

/// Largest MTL file in bytes: [`MAX_MATERIALS`] of 1 KiB each.
pub const MAX_MTL_BYTES: u64 = 64 << 20;

/// Most `mtllib` files of one OBJ file.
pub const MAX_MTL_FILES: usize = 1024;

/// Most warnings that are listed. A last warning counts the others.
pub const MAX_WARNINGS: usize = 1000;

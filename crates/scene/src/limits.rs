//! What a scene may hold, and why no more.

/// Most triangles, and most positions, of a scene.
///
/// Three indices of each fit into 32 bits, and arrays of this size (4.3 GB of triangles) are about what one machine
/// traces at all.
pub const MAX_TRIANGLES: usize = 1 << 28;

/// Most positions of a scene: as [`MAX_TRIANGLES`].
pub const MAX_POSITIONS: usize = 1 << 28;

/// Most materials of a scene: a CAD model has hundreds; a material per triangle is a mistake of an exporter.
pub const MAX_MATERIALS: usize = 1 << 16;

/// Longest material name in bytes of UTF-8. Names are shown in messages and kept in every packed scene.
pub const MAX_NAME_BYTES: usize = 1024;

/// Largest magnitude of a coordinate, of the origin and of a position relative to it, in scene units.
///
/// Ray and triangle tests in `f32` multiply three of them: (4e12)³ = 6.4e37 still fits below 3.4e38.
pub const MAX_COORDINATE: f64 = 1e12;

/// Largest radiance of a material or of the sky, W·sr⁻¹·m⁻². The sun's disc has 2e7; an area times this still fits
/// into `f32`.
pub const MAX_RADIANCE: f32 = 1e20;

/// Least index of refraction: glass seen from inside is 0.4 to 0.7.
pub const MIN_IOR: f32 = 0.1;

/// Greatest index of refraction, as the MTL format has it.
pub const MAX_IOR: f32 = 10.0;

/// Largest OBJ file in bytes: [`MAX_TRIANGLES`] would need about 10 GB of text, but text is held in memory whole.
pub const MAX_OBJ_BYTES: u64 = 4 << 30;

/// Largest MTL file in bytes: [`MAX_MATERIALS`] of 1 KiB each.
pub const MAX_MTL_BYTES: u64 = 64 << 20;

/// Most `mtllib` files of one OBJ file.
pub const MAX_MTL_FILES: usize = 1024;

/// Most warnings that are listed; what comes after is counted in one last warning.
pub const MAX_WARNINGS: usize = 1000;

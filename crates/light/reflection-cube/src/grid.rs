//! The texels of a cube by direction: their numbers, directions and solid angles.
//!
//! Invariant: texels are numbered face by face, in the order of [`FACE_AXES`](crate::FACE_AXES),
//! and row by row.

use crate::face::{FACES, FacePoint, solid_angle};
use glam::Vec3;

/// Least texels along a side of a face.
pub const LEAST_RESOLUTION: u32 = 8;

/// Most texels along a side of a face. A cube of these takes 42 MB.
pub const MOST_RESOLUTION: u32 = 512;

/// A cube whose faces have equal texels. It holds no light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CubeGrid {
    resolution: u32,
}

impl CubeGrid {
    /// Returns the grid of this resolution: texels along a side of a face. It is raised to a power
    /// of two, from [`LEAST_RESOLUTION`] to [`MOST_RESOLUTION`].
    #[must_use]
    pub fn new(resolution: u32) -> CubeGrid {
        let resolution = resolution.clamp(LEAST_RESOLUTION, MOST_RESOLUTION).next_power_of_two();
        CubeGrid { resolution }
    }

    /// Returns the number of texels along a side of a face.
    #[must_use]
    #[inline]
    pub fn resolution(self) -> u32 {
        self.resolution
    }

    /// Returns the number of all texels.
    #[must_use]
    #[inline]
    #[expect(clippy::len_without_is_empty, reason = "a grid always has texels")]
    pub fn len(self) -> usize {
        FACES * (self.resolution as usize).pow(2)
    }

    /// Returns the number of the texel in a direction of any length except 0.
    #[must_use]
    #[inline]
    pub fn texel_of(self, direction: Vec3) -> usize {
        let point = FacePoint::of(direction);
        self.number(point.face, point.texel(self.resolution))
    }

    /// Returns the unit direction of the middle of a texel below [`len`](Self::len).
    #[must_use]
    #[inline]
    pub fn direction_of(self, texel: usize) -> Vec3 {
        self.middle(texel).direction().normalize()
    }

    /// Returns the solid angle of a texel below [`len`](Self::len), steradians.
    #[must_use]
    #[inline]
    pub fn solid_angle_of(self, texel: usize) -> f32 {
        let (_, column, row) = self.place(texel);
        solid_angle((column, row), self.resolution)
    }

    /// Returns the four texels around a direction of any length except 0, with their weights in a
    /// linear interpolation of values at the middles of texels. The weights add up to 1.
    #[must_use]
    #[inline]
    pub fn texels_around(self, direction: Vec3) -> [(usize, f32); 4] {
        let point = FacePoint::of(direction);
        point.around(self.resolution).map(|(place, weight)| {
            let middle = FacePoint::middle(point.face, place, self.resolution);
            (self.texel_of(middle.direction()), weight)
        })
    }

    /// Returns the middle of a texel below [`len`](Self::len).
    #[inline]
    pub(crate) fn middle(self, texel: usize) -> FacePoint {
        let (face, column, row) = self.place(texel);
        FacePoint::middle(face, (column as i32, row as i32), self.resolution)
    }

    /// Returns the face, column and row of a texel.
    #[inline]
    pub(crate) fn place(self, texel: usize) -> (usize, u32, u32) {
        let side = self.resolution as usize;
        let within = texel % (side * side);
        (texel / (side * side), (within % side) as u32, (within / side) as u32)
    }

    /// Returns the number of a texel.
    #[inline]
    pub(crate) fn number(self, face: usize, (column, row): (u32, u32)) -> usize {
        let side = self.resolution as usize;
        (face * side + row as usize) * side + column as usize
    }

    /// Returns the face of a texel.
    #[inline]
    pub(crate) fn face(self, texel: usize) -> usize {
        texel / (self.resolution as usize).pow(2)
    }
}

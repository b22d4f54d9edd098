//! Directions and texels of a cube with faces of equal resolution.

use glam::Vec3;

/// Faces of a cube.
pub(crate) const FACES: usize = 6;

/// The axis of each face outward, and those of its columns and rows: to the right and down, for an
/// eye in the centre. Texels are numbered face by face, and row by row.
pub const FACE_AXES: [[Vec3; 3]; FACES] = [
    [Vec3::X, Vec3::NEG_Y, Vec3::NEG_Z],
    [Vec3::NEG_X, Vec3::Y, Vec3::NEG_Z],
    [Vec3::Y, Vec3::X, Vec3::NEG_Z],
    [Vec3::NEG_Y, Vec3::NEG_X, Vec3::NEG_Z],
    [Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y],
    [Vec3::NEG_Z, Vec3::X, Vec3::NEG_Y],
];

/// A point of the cube with sides of length 2: from -1 to 1 along the columns and rows of a face.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FacePoint {
    pub face: usize,
    pub across: f32,
    pub down: f32,
}

impl FacePoint {
    /// Returns the point in a direction of any length except 0.
    #[inline]
    pub fn of(direction: Vec3) -> FacePoint {
        let size = direction.abs();
        let (axis, negative) = if size.x >= size.y && size.x >= size.z {
            (0, direction.x < 0.0)
        } else if size.y >= size.z {
            (2, direction.y < 0.0)
        } else {
            (4, direction.z < 0.0)
        };
        let face = axis + usize::from(negative);
        let [_, columns, rows] = FACE_AXES[face];
        let scale = 1.0 / size.max_element();
        FacePoint {
            face,
            across: direction.dot(columns) * scale,
            down: direction.dot(rows) * scale,
        }
    }

    /// Returns the middle of a texel. Columns and rows outside the face continue its plane.
    #[inline]
    pub fn middle(face: usize, (column, row): (i32, i32), resolution: u32) -> FacePoint {
        let at = |number: i32| (2 * number + 1) as f32 / resolution as f32 - 1.0;
        FacePoint { face, across: at(column), down: at(row) }
    }

    /// Returns the columns and rows of the four texels around the point, with their weights in a
    /// linear interpolation. They may be beyond the edge of the face.
    #[inline]
    pub fn around(self, resolution: u32) -> [((i32, i32), f32); 4] {
        let at = |place: f32| 0.5 * (place + 1.0) * resolution as f32 - 0.5;
        let (x, y) = (at(self.across), at(self.down));
        let (left, top) = (x.floor(), y.floor());
        let (right_share, below_share) = (x - left, y - top);
        [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(right, below)| {
            let across = if right == 1 { right_share } else { 1.0 - right_share };
            let down = if below == 1 { below_share } else { 1.0 - below_share };
            ((left as i32 + right, top as i32 + below), across * down)
        })
    }

    /// Returns the direction of the point. Its length along the face's axis is 1.
    #[inline]
    pub fn direction(self) -> Vec3 {
        let [outward, columns, rows] = FACE_AXES[self.face];
        outward + self.across * columns + self.down * rows
    }

    /// Returns the column and row of the texel that contains the point.
    #[inline]
    pub fn texel(self, resolution: u32) -> (u32, u32) {
        // The conversion turns what is below 0 into 0.
        let at = |place: f32| {
            ((0.5 * (place + 1.0) * resolution as f32) as u32).min(resolution.saturating_sub(1))
        };
        (at(self.across), at(self.down))
    }
}

/// Returns the depth of a point relative to the centre: its distance along the axis of its face.
#[inline]
pub(crate) fn depth(point: Vec3) -> f32 {
    point.abs().max_element()
}

/// Returns the solid angle of a texel, steradians. Relative error at most 3e-4 with 8 texels along
/// a side, and 16 times smaller with twice as many.
#[inline]
pub(crate) fn solid_angle((column, row): (u32, u32), resolution: u32) -> f32 {
    // The integral of (1 + x² + y²)^(-3/2) over the texel, to the second order around its middle.
    let side = 2.0 / resolution as f32;
    let at = |number: u32| (number as f32 + 0.5) * side - 1.0;
    let away = at(column) * at(column) + at(row) * at(row);
    let inverse = 1.0 / (1.0 + away);
    let area = side * side;
    let curved = (15.0 * away * inverse - 6.0) * inverse * area / 24.0;
    area * inverse * inverse.sqrt() * (1.0 + curved)
}

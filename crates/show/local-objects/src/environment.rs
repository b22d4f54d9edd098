//! Directions around a place as the texels of a cube's six faces, and radiance in them.

use glam::Vec3;

/// The forward and up axes of the faces, in the order of their texels.
pub(crate) const FACES: [(Vec3, Vec3); 6] = [
    (Vec3::X, Vec3::Z),
    (Vec3::NEG_X, Vec3::Z),
    (Vec3::Y, Vec3::Z),
    (Vec3::NEG_Y, Vec3::Z),
    (Vec3::Z, Vec3::Y),
    (Vec3::NEG_Z, Vec3::Y),
];

/// Side of the smallest face of an [`Environment`], texels.
const LEAST_SIDE: usize = 4;

/// A cube of texels, face by face, and row by row from the top of each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Cube {
    /// Texels on a side of a face.
    pub side: usize,
}

impl Cube {
    pub(crate) fn texels(self) -> usize {
        6 * self.side * self.side
    }

    /// Returns the face of a texel, and its place there: from -1 to 1, to the right and upwards.
    fn place(self, texel: usize) -> (usize, f32, f32) {
        let (face, rest) = (texel / (self.side * self.side), texel % (self.side * self.side));
        let step = 2.0 / self.side as f32;
        let (column, row) = (rest % self.side, rest / self.side);
        (face, (column as f32 + 0.5) * step - 1.0, 1.0 - (row as f32 + 0.5) * step)
    }

    /// Returns the unit direction of a texel's middle.
    #[inline]
    pub(crate) fn direction(self, texel: usize) -> Vec3 {
        let (face, x, y) = self.place(texel);
        let (forward, up) = FACES[face];
        (forward + forward.cross(up) * x + up * y).normalize()
    }

    /// Returns the solid angle of a texel.
    pub(crate) fn solid_angle(self, texel: usize) -> f32 {
        let (_, x, y) = self.place(texel);
        let half = 1.0 / self.side as f32;
        // The solid angle of a rectangle between the middle of a face and a corner.
        let corner = |x: f32, y: f32| (x * y).atan2((x * x + y * y + 1.0).sqrt());
        corner(x + half, y + half) - corner(x - half, y + half) - corner(x + half, y - half)
            + corner(x - half, y - half)
    }

    /// Returns the face that a direction goes through, and where, in texels from its left and from
    /// its top.
    #[inline]
    fn point(self, direction: Vec3) -> (usize, f32, f32) {
        let size = direction.abs();
        let axis = if size.x >= size.y && size.x >= size.z {
            0
        } else if size.y >= size.z {
            1
        } else {
            2
        };
        let face = 2 * axis + usize::from(direction[axis] < 0.0);
        let (forward, up) = FACES[face];
        let along = direction.dot(forward).max(f32::MIN_POSITIVE);
        let (x, y) = (direction.dot(forward.cross(up)) / along, direction.dot(up) / along);
        let half = 0.5 * self.side as f32;
        (face, (x + 1.0) * half, (1.0 - y) * half)
    }

    /// Returns the texel that a direction goes through.
    #[inline]
    pub(crate) fn texel(self, direction: Vec3) -> usize {
        let (face, x, y) = self.point(direction);
        let whole = |c: f32| (c.max(0.0) as usize).min(self.side - 1);
        (face * self.side + whole(y)) * self.side + whole(x)
    }

    /// Returns the texels on both sides of a texel in its face: left and right, above and below.
    /// At the edge of a face, the texel itself stands for the missing one.
    pub(crate) fn around(self, texel: usize) -> [[usize; 2]; 2] {
        let (column, row) = (texel % self.side, texel / self.side % self.side);
        let last = self.side - 1;
        let before = |at: usize, step: usize| if at > 0 { texel - step } else { texel };
        let after = |at: usize, step: usize| if at < last { texel + step } else { texel };
        [[before(column, 1), after(column, 1)], [before(row, self.side), after(row, self.side)]]
    }

    /// Returns the value in a direction, interpolated between the nearest texels of its face.
    #[inline]
    pub(crate) fn interpolate(self, texels: &[Vec3], direction: Vec3) -> Vec3 {
        let (face, x, y) = self.point(direction);
        let between = |c: f32| {
            let c = (c - 0.5).clamp(0.0, (self.side - 1) as f32);
            let first = (c as usize).min(self.side - 1);
            (first, (first + 1).min(self.side - 1), c - first as f32)
        };
        let ((left, right, across), (top, bottom, down)) = (between(x), between(y));
        let of = |column: usize, row: usize| texels[(face * self.side + row) * self.side + column];
        let upper = of(left, top).lerp(of(right, top), across);
        upper.lerp(of(left, bottom).lerp(of(right, bottom), across), down)
    }
}

/// Radiance from all directions, also blurred.
#[derive(Clone, Debug)]
pub(crate) struct Environment {
    /// Each level has half as many texels on a side as the one before.
    levels: Vec<(Cube, Vec<Vec3>)>,
}

impl Environment {
    pub(crate) fn new(cube: Cube, radiance: Vec<Vec3>) -> Environment {
        let mut levels = vec![(cube, radiance)];
        while let Some((fine, texels)) =
            levels.last().filter(|(cube, _)| cube.side > LEAST_SIDE && cube.side.is_multiple_of(2))
        {
            let coarse = Cube { side: fine.side / 2 };
            let mean = |texel: usize| {
                let (column, row) = (texel % coarse.side, texel / coarse.side);
                // Rows of all faces follow each other.
                let first = 2 * row * fine.side + 2 * column;
                let four = [0, 1, fine.side, fine.side + 1].map(|step| texels[first + step]);
                four.into_iter().sum::<Vec3>() * 0.25
            };
            let blurred = (0..coarse.texels()).map(mean).collect();
            levels.push((coarse, blurred));
        }
        Environment { levels }
    }

    /// Returns the radiance in a direction, blurred over about this angle, radians.
    pub(crate) fn radiance(&self, direction: Vec3, blur: f32) -> Vec3 {
        let [first, .., last] = self.levels.as_slice() else {
            return self.at_level(0, direction);
        };
        let (finest, _) = first;
        // A texel of a face covers about 2 / side radians.
        let level = (0.5 * blur * finest.side as f32).max(1.0).log2();
        let level = level.min(((finest.side / last.0.side) as f32).log2());
        let below = level as usize;
        let fine = self.at_level(below, direction);
        match level - below as f32 {
            0.0 => fine,
            share => fine.lerp(self.at_level(below + 1, direction), share),
        }
    }

    fn at_level(&self, level: usize, direction: Vec3) -> Vec3 {
        let level = level.min(self.levels.len() - 1);
        let (cube, texels) = &self.levels[level];
        cube.interpolate(texels, direction)
    }

    /// Returns the finest level with at most this many texels on a side, or else the coarsest.
    pub(crate) fn level(&self, most_side: usize) -> (Cube, &[Vec3]) {
        let fits = |(cube, _): &&(Cube, Vec<Vec3>)| cube.side <= most_side;
        let level = self.levels.iter().find(fits).unwrap_or(&self.levels[self.levels.len() - 1]);
        (level.0, &level.1)
    }

    /// Returns the radiance of a texel.
    #[inline]
    pub(crate) fn texel(&self, texel: usize) -> Vec3 {
        self.levels[0].1[texel]
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use super::*;

    #[test]
    fn texels_tile_the_sphere_and_directions_find_their_own() {
        for side in [4, 17] {
            let cube = Cube { side };
            let mut whole = 0.0;
            for texel in 0..cube.texels() {
                assert_eq!(cube.texel(cube.direction(texel)), texel);
                whole += cube.solid_angle(texel);
            }
            assert!((whole - 4.0 * PI).abs() < 1e-4, "{whole}");
        }
    }

    #[test]
    fn blurred_radiance_has_the_same_mean() {
        let cube = Cube { side: 16 };
        let radiance = (0..cube.texels()).map(|texel| {
            let direction = cube.direction(texel);
            Vec3::splat(if direction.z > 0.9 { 10.0 } else { 1.0 })
        });
        let environment = Environment::new(cube, radiance.collect());
        assert!((environment.radiance(Vec3::Z, 0.0).x - 10.0).abs() < 1e-4);
        let blurred = environment.radiance(Vec3::Z, 1.0).x;
        assert!(blurred < 9.0 && blurred > 1.0, "{blurred}");
        assert!((environment.radiance(Vec3::NEG_Z, 2.0).x - 1.0).abs() < 1e-4);
    }
}

//! A cell: the exact sums of the samples in one place, on one side of a surface.
//!
//! Cells are cubes of a grid; those of level n + 1 have twice the size of those of level n. A key names a cell by level,
//! place, range of normals, material and, of glossy surfaces, range of directions.

use glam::Vec3;

/// Sizes of cells: each level's are twice as wide as those of the level before.
pub const LEVELS: usize = 7;

/// Bits of a cell's coordinate: its index along one axis on the finest level.
const COORDINATE_BITS: u32 = 21;

/// Offset of the grid, in cells: walls at round coordinates do not lie on the border of two cells.
const OFFSET: f32 = 0.3819;

/// Sums over samples. Light is in fixed-point steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sums {
    /// Of light, by channel.
    pub light: [u64; 3],
    /// Of squared luminance.
    pub square: u128,
    /// How many.
    pub count: u32,
    /// The brightest sample: its luminance above its colour.
    pub brightest: u64,
}

impl Sums {
    /// Adds other sums: in any order, with the same result.
    pub fn add(&mut self, other: &Sums) {
        for (sum, more) in self.light.iter_mut().zip(other.light) {
            *sum = sum.saturating_add(more);
        }
        self.square = self.square.saturating_add(other.square);
        self.count = self.count.saturating_add(other.count);
        self.brightest = self.brightest.max(other.brightest);
    }

    /// Sums of one sample.
    pub fn of(light: [u64; 3]) -> Sums {
        let bright = u128::from(luminance(light.map(|c| c as f32)) as u64);
        Sums { light, square: bright * bright, count: 1, brightest: pack(light) }
    }
}

/// Luminance, in the unit of its channels.
#[inline]
pub(crate) fn luminance(rgb: [f32; 3]) -> f32 {
    0.265 * rgb[0] + 0.670 * rgb[1] + 0.065 * rgb[2]
}

/// A sample's light as one number that is greater for brighter samples: luminance above, colour below.
fn pack(light: [u64; 3]) -> u64 {
    let rgb = light.map(|c| c as f32);
    let bright = luminance(rgb);
    let most = rgb[0].max(rgb[1]).max(rgb[2]).max(1.0);
    let [r, g, b] = rgb.map(|c| (c / most * 1023.0) as u64);
    u64::from(bright.to_bits()) << 32 | r << 20 | g << 10 | b
}

/// Luminance and light of the brightest sample of a cell.
pub(crate) fn brightest(packed: u64) -> (f32, [f32; 3]) {
    let bright = f32::from_bits((packed >> 32) as u32);
    let rgb = [20, 10, 0].map(|shift| (packed >> shift & 1023) as f32);
    let scale = bright / luminance(rgb).max(1e-6);
    (bright, rgb.map(|c| c * scale))
}

/// The place of a point on the finest level: its cell's index along each axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Place([i32; 3]);

impl Place {
    #[inline]
    pub fn new(point: Vec3, finest: f32) -> Place {
        let cells = point / finest + OFFSET * 64.0;
        // The conversion saturates.
        Place(cells.floor().to_array().map(|c| c as i32))
    }
}

/// What a cell's samples have in common besides their place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Face(u64);

impl Face {
    /// Of a side with this normal; glossy ones, by the direction in which light leaves them.
    #[inline]
    pub fn new(normal: Vec3, material: u32, leaving: Option<Vec3>) -> Face {
        let leaving = leaving.map_or(0, |direction| 1 + bin(direction, 6.0));
        Face(u64::from(material) << 16 | bin(normal, 3.0) << 9 | leaving)
    }

    /// The key of the cell at a place.
    #[inline]
    pub fn key(self, place: Place, level: usize) -> u64 {
        let mask = (1 << COORDINATE_BITS) - 1;
        let [x, y, z] = place.0.map(|c| (c >> level) as u64 & mask);
        let at = x | y << COORDINATE_BITS | z << (2 * COORDINATE_BITS);
        mix(mix(at) ^ (self.0 << 3 | level as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15)).max(1)
    }
}

/// Which of 6 × `across`² parts of the sphere a direction lies in: the faces of a cube, divided.
#[inline]
fn bin(direction: Vec3, across: f32) -> u64 {
    let size = direction.abs();
    let (axis, u, v) = if size.x >= size.y && size.x >= size.z {
        (0, direction.y / size.x, direction.z / size.x)
    } else if size.y >= size.z {
        (1, direction.z / size.y, direction.x / size.y)
    } else {
        (2, direction.x / size.z, direction.y / size.z)
    };
    let part = |t: f32| ((t * 0.5 + 0.5) * across).clamp(0.0, across - 1.0) as u64;
    let side = 2 * axis + u64::from(direction[axis as usize] < 0.0);
    (side * across as u64 + part(u)) * across as u64 + part(v)
}

/// A bijection in which each input bit flips each output bit with probability ½ (SplitMix64's finaliser).
#[inline]
fn mix(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

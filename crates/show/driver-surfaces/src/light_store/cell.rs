//! Groups samples by place and kind of surface, and sums them exactly.

use glam::Vec3;
use std::sync::LazyLock;

/// Divisions along each side of a cube's faces for sorting normals: 54 ranges of about 30°.
const NORMALS: u64 = 3;

/// Divisions for sorting the directions in which light leaves glossy surfaces: 216 ranges of about
/// 15°.
const DIRECTIONS: u64 = 6;

/// Least cosine between a surface's normal and the middle of a range for its samples to count.
const SAME_SIDE: f32 = 0.5;

/// Least cosine between a direction and the middle of a range for its samples to count.
const SAME_DIRECTION: f32 = 0.96;

/// Sums over samples. Each sample's light, in fixed-point steps, is multiplied by its number of
/// paths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sums {
    /// Sum of light, by channel.
    pub light: [u64; 3],
    /// Sum of squared luminance, in units of 2^16 squared steps.
    pub square: u64,
    /// Number of paths.
    pub paths: u32,
    /// Number of samples.
    pub count: u32,
    /// Luminance of the brightest sample, as the bits of an `f32`.
    brightest: u32,
}

/// Most light of a sample, in fixed-point steps: a thousand times the brightest lamp.
const MOST_LIGHT: f32 = (1_u64 << 36) as f32;

/// Bits of a channel.
const CHANNEL_BITS: u32 = 14;

/// Bits of the channels' common exponent.
const EXPONENT_BITS: u32 = 6;

/// One sample's light: three channels with a common exponent of 2, and the number of paths.
///
/// Light below 2^14 fixed-point steps is exact. Brighter light is rounded to the nearest value,
/// by at most 2^-14 of its brightest channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct SampleLight(u64);

impl SampleLight {
    /// Returns light of this many fixed-point steps, by channel, as the mean of so many paths.
    /// Light is rounded to whole steps and ends at [`MOST_LIGHT`], paths end at 65,535.
    #[inline]
    pub fn new(steps: [f32; 3], paths: u32) -> SampleLight {
        // Conversions from floats to integers saturate.
        let steps = steps.map(|c| c.min(MOST_LIGHT).round() as u64);
        let bits = u64::BITS - (steps[0] | steps[1] | steps[2]).leading_zeros();
        let mut exponent = bits.saturating_sub(CHANNEL_BITS);
        let rounded = |c: u64, exponent: u32| (c + (1 << exponent >> 1)) >> exponent;
        let is_too_bright = |&c: &u64| rounded(c, exponent) >> CHANNEL_BITS > 0;
        if steps.iter().any(is_too_bright) {
            exponent += 1;
        }
        let colour = steps.iter().fold(0, |sum, &c| sum << CHANNEL_BITS | rounded(c, exponent));
        let paths = u64::from(paths.min(u32::from(u16::MAX)));
        SampleLight((paths << EXPONENT_BITS | u64::from(exponent)) << (3 * CHANNEL_BITS) | colour)
    }

    /// Returns the light in fixed-point steps, by channel.
    #[inline]
    pub fn steps(self) -> [f32; 3] {
        let exponent = self.0 >> (3 * CHANNEL_BITS) & ((1 << EXPONENT_BITS) - 1);
        let scale = (1_u64 << exponent) as f32;
        let channel = |place: u32| self.0 >> (place * CHANNEL_BITS) & ((1 << CHANNEL_BITS) - 1);
        [2, 1, 0].map(|place| channel(place) as f32 * scale)
    }

    /// Returns the number of paths whose mean this is.
    #[inline]
    pub fn paths(self) -> u32 {
        (self.0 >> (3 * CHANNEL_BITS + EXPONENT_BITS)) as u32
    }

    /// Returns a number that equal light shares.
    pub fn number(self) -> u64 {
        self.0
    }
}

impl Sums {
    /// Adds other sums. Any order of additions gives the same result.
    pub fn add(&mut self, other: &Sums) {
        for (sum, more) in self.light.iter_mut().zip(other.light) {
            *sum = sum.saturating_add(more);
        }
        self.square = self.square.saturating_add(other.square);
        self.paths = self.paths.saturating_add(other.paths);
        self.count = self.count.saturating_add(other.count);
        self.brightest = self.brightest.max(other.brightest);
    }

    /// Returns the sums of one sample.
    #[inline]
    pub(crate) fn of(light: SampleLight) -> Sums {
        let (steps, bright) = (light.steps(), luminance(light.steps()));
        let paths = u64::from(light.paths());
        // Conversions from floats to integers saturate.
        Sums {
            light: steps.map(|c| (c as u64).saturating_mul(paths)),
            square: ((bright * bright / 65536.0) as u64).saturating_mul(paths),
            paths: light.paths(),
            count: 1,
            brightest: bright.to_bits(),
        }
    }

    /// Returns the mean light.
    #[inline]
    pub(crate) fn mean(&self) -> Vec3 {
        Vec3::from_array(self.light.map(|c| c as f32)) / (self.paths as f32).max(1.0)
    }

    /// Returns the mean of squared luminance.
    #[inline]
    pub(crate) fn mean_square(&self) -> f32 {
        self.square as f32 * 65536.0 / (self.paths as f32).max(1.0)
    }

    /// Returns the luminance of the brightest sample.
    #[inline]
    pub(crate) fn brightest(&self) -> f32 {
        f32::from_bits(self.brightest)
    }
}

pub(crate) use holo_picture::relative_luminance as luminance;

/// Properties that samples on one side of a surface share besides their place: material, range of
/// normals and, on glossy surfaces, range of directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FaceClass(u64);

/// Bits of a face: 20 for the material, 6 for the normal, 8 for the direction.
const FACE_BITS: u32 = 34;

/// Bits of a coordinate within a bucket.
const PLACE_BITS: u32 = 10;

/// Places along one side of a bucket.
pub(crate) const PLACES: f32 = (1 << PLACE_BITS) as f32;

impl FaceClass {
    /// Returns the face of a side with this unit normal. For a glossy side, `direction` is that of
    /// the ray that meets it; light leaves the opposite way.
    #[inline]
    pub fn new(normal: Vec3, material: u32, direction: Option<Vec3>) -> FaceClass {
        let direction = direction.map_or(0, |direction| 1 + range(direction, DIRECTIONS));
        let face = u64::from(material) << 14 | range(normal, NORMALS) << 8 | direction;
        FaceClass(face & ((1 << FACE_BITS) - 1))
    }

    /// Returns the face as a number.
    pub fn number(self) -> u64 {
        self.0
    }

    /// Returns true if samples of this face apply to a surface of this material and normal, seen
    /// along this direction.
    #[inline]
    pub fn serves(self, normal: Vec3, material: u32, direction: Vec3) -> bool {
        self.is_on(normal, material)
            && (self.0 & 255 == 0
                || MIDDLES.directions[(self.0 & 255) as usize].dot(direction) > SAME_DIRECTION)
    }

    /// Returns true if samples of this face lie on a surface of this material and normal, whatever
    /// direction it is seen along.
    #[inline]
    pub fn is_on(self, normal: Vec3, material: u32) -> bool {
        self.0 >> 14 == u64::from(material) & 0xf_ffff
            && MIDDLES.normals[(self.0 >> 8 & 63) as usize].dot(normal) > SAME_SIDE
    }
}

/// A sample's place in its bucket, in units of 1/[`PLACES`] along each axis, and its face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Key(pub u64);

impl Key {
    /// Returns the key of a point. `at` is relative to the bucket's corner, in places.
    #[inline]
    pub fn new(at: Vec3, face: FaceClass) -> Key {
        // Conversions from floats to integers saturate.
        let [x, y, z] = at.to_array().map(|c| (c as u64).min((1 << PLACE_BITS) - 1));
        Key((face.0 << PLACE_BITS | x) << (2 * PLACE_BITS) | y << PLACE_BITS | z)
    }

    /// Returns the middle of the place, relative to the bucket's corner, in places.
    #[inline]
    pub fn at(self) -> Vec3 {
        let part = |shift: u32| (self.0 >> shift & ((1 << PLACE_BITS) - 1)) as f32 + 0.5;
        Vec3::new(part(2 * PLACE_BITS), part(PLACE_BITS), part(0))
    }

    /// Returns the face.
    #[inline]
    pub fn face(self) -> FaceClass {
        FaceClass(self.0 >> (3 * PLACE_BITS))
    }
}

/// The middles of all ranges, by number.
struct Middles {
    normals: [Vec3; 64],
    /// Number 0 stands for no direction and is unused.
    directions: [Vec3; 256],
}

static MIDDLES: LazyLock<Middles> = LazyLock::new(|| {
    let mut middles = Middles { normals: [Vec3::ZERO; 64], directions: [Vec3::ZERO; 256] };
    for (number, normal) in (0..6 * NORMALS * NORMALS).zip(&mut middles.normals) {
        *normal = middle(number, NORMALS);
    }
    let directions = middles.directions.iter_mut().skip(1);
    for (number, direction) in (0..6 * DIRECTIONS * DIRECTIONS).zip(directions) {
        *direction = middle(number, DIRECTIONS);
    }
    middles
});

/// Returns the part of the sphere that a direction lies in. The 6 × `across`² parts are the faces
/// of a cube, divided.
#[inline]
fn range(direction: Vec3, across: u64) -> u64 {
    let size = direction.abs();
    let (axis, u, v) = if size.x >= size.y && size.x >= size.z {
        (0, direction.y / size.x, direction.z / size.x)
    } else if size.y >= size.z {
        (1, direction.z / size.y, direction.x / size.y)
    } else {
        (2, direction.x / size.z, direction.y / size.z)
    };
    let last = across as f32 - 1.0;
    let part = |t: f32| ((t * 0.5 + 0.5) * across as f32).clamp(0.0, last) as u64;
    let side = 2 * axis + u64::from(direction[axis as usize] < 0.0);
    (side * across + part(u)) * across + part(v)
}

/// Returns the middle of a part of the sphere, a unit vector.
fn middle(number: u64, across: u64) -> Vec3 {
    let part = |number: u64| (number as f32 + 0.5) / across as f32 * 2.0 - 1.0;
    let (u, v) = (part(number / across % across), part(number % across));
    let side = number / (across * across);
    let main = if side % 2 == 1 { -1.0 } else { 1.0 };
    let direction = match side / 2 {
        0 => Vec3::new(main, u, v),
        1 => Vec3::new(v, main, u),
        _ => Vec3::new(u, v, main),
    };
    direction.normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns numbers between 0 and 1, always the same ones.
    fn numbers() -> impl Iterator<Item = f32> {
        (0..).map(|n| (holo_display::split_mix(n) >> 40) as f32 / (1_u32 << 24) as f32)
    }

    #[test]
    fn light_of_few_steps_is_exact() {
        for steps in [[0.0; 3], [1.0, 0.0, 2.0], [16383.0, 1.0, 8192.0], [0.0, 0.0, 16383.0]] {
            let light = SampleLight::new(steps, 21);
            assert_eq!((light.steps(), light.paths()), (steps, 21));
        }
    }

    #[test]
    fn bright_light_is_rounded_by_little_and_not_to_one_side() {
        let mut numbers = numbers();
        let (mut signed, mut count) = (0.0, 0.0);
        for _ in 0..20_000 {
            let size = (numbers.next().unwrap() * 36.0).exp2();
            let steps = [(); 3].map(|()| (size * numbers.next().unwrap()).round());
            let greatest = steps.iter().fold(0.0, |a: f32, &b| a.max(b));
            let light = SampleLight::new(steps, 1);
            for (channel, wanted) in light.steps().into_iter().zip(steps) {
                let error = (channel - wanted) / greatest.max(1.0) * 16384.0;
                assert!(error.abs() <= 1.0, "{steps:?} became {:?}", light.steps());
                signed += error;
                count += 1.0;
            }
        }
        // Halves go up, which is 0.01 in the mean of these exponents. Errors are at most 1, so the
        // mean's standard error is at most 1/√60,000 = 0.004.
        assert!((signed / count).abs() < 0.022, "{}", signed / count);
    }

    #[test]
    fn light_and_paths_end_at_their_limits() {
        for too_much in [f32::MAX, f32::INFINITY, 2.0 * MOST_LIGHT] {
            let light = SampleLight::new([too_much, 0.0, -1.0], u32::MAX);
            assert_eq!(light.steps(), [MOST_LIGHT, 0.0, 0.0]);
            assert_eq!(light.paths(), 65_535);
        }
        let nearly = SampleLight::new([16_383.6 * 1024.0; 3], 0);
        assert_eq!((nearly.steps(), nearly.paths()), ([16_384.0 * 1024.0; 3], 0));
    }
}

//! A node in 8 bytes.
//!
//! | bits | what |
//! | --- | --- |
//! | 0 to 14 | centre in the parent's sphere: 5 bits each for x, y and z |
//! | 15 to 17 | radius: as a share of the parent's; without children, as a multiple of the spacing |
//! | 18 and 19 | children: none, 2, 3 or 4 |
//! | 20 | true if the light depends on the direction: mirrors, glass, gloss |
//! | 21 to 30 | normal: a place on an octahedron of 31 by 31 places |
//! | 31 and 32 | cone of the normals below |
//! | 33 to 63 | light: [`LightCode`] |
//!
//! Invariants: normals along an axis are exact. A node is encoded against its parent as it is
//! decoded, so rounding does not add up from level to level.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::LightCode;

/// Steps of a coordinate between the ends of the parent's diameter.
const PLACES: f32 = 30.0;

/// Number of codes of a radius.
const RADII: u32 = 8;

/// Octaves between two codes of a radius.
const RADIUS_STEP: f32 = 0.4;

/// Radius of a leaf with code 0, over the spacing.
const LEAST_LEAF: f32 = 0.15;

/// Octaves between two codes of a leaf's radius.
const LEAF_STEP: f32 = 0.5;

/// Steps of an octahedral coordinate.
const NORMAL_STEPS: f32 = 30.0;

/// Sines of the half angles of cones of normals. The last one contains every direction.
pub(crate) const CONES: [f32; 4] = [0.0625, 0.25, 0.5625, 1.0];

/// A sphere, relative to the origin of the file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sphere {
    /// Its centre.
    pub centre: Vec3,
    /// Its radius.
    pub radius: f32,
}

impl Sphere {
    /// Returns the smallest sphere around two.
    pub fn around(self, other: Sphere) -> Sphere {
        let offset = other.centre - self.centre;
        let distance = offset.length();
        if distance + other.radius <= self.radius {
            return self;
        }
        if distance + self.radius <= other.radius {
            return other;
        }
        let radius = 0.5 * (distance + self.radius + other.radius);
        let along = (radius - self.radius) / distance.max(f32::MIN_POSITIVE);
        Sphere { centre: self.centre + offset * along, radius }
    }
}

/// What a node shows, besides its sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disc {
    /// Unit normal of the surface, on the lit side.
    pub normal: Vec3,
    /// Sine of the greatest angle between the normal and the normals below; 1 for any.
    pub cone: f32,
    /// The light that leaves the surface.
    pub light: LightCode,
    /// True if the light depends on the direction, and is a mean over directions.
    pub is_directional: bool,
}

/// A node as it is stored.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct PackedNode([u8; 8]);

const _: () = assert!(size_of::<PackedNode>() == 8 && align_of::<PackedNode>() == 1);

impl PackedNode {
    /// Encodes a node. `parent` is the parent's sphere as it is decoded, `children` 0, 2, 3 or 4,
    /// and `spacing` the file's.
    ///
    /// The decoded sphere of a node with children contains `sphere`, unless `sphere` is larger than
    /// the parent. That of a leaf has the nearest radius from 0.15 to 1.7 times the spacing.
    pub fn new(
        parent: Sphere,
        sphere: Sphere,
        children: u32,
        disc: Disc,
        spacing: f32,
    ) -> PackedNode {
        let scale = parent.radius.max(f32::MIN_POSITIVE);
        let offset = (sphere.centre - parent.centre) / scale;
        let place =
            ((offset + 1.0) * (0.5 * PLACES)).round().clamp(Vec3::ZERO, Vec3::splat(PLACES));
        let place = place.to_array().map(|axis| axis as u64);
        let places = place[0] | place[1] << 5 | place[2] << 10;
        let centre = decoded_centre(parent, places);
        let code = match children {
            0 => ((sphere.radius / (LEAST_LEAF * spacing)).log2() / LEAF_STEP).round(),
            _ => {
                let radius = sphere.radius + centre.distance(sphere.centre);
                let code = (radius / scale).log2() / RADIUS_STEP + (RADII - 1) as f32;
                // A little less than a whole code is rounding.
                (code - 1e-4).ceil()
            }
        };
        let radius = code.clamp(0.0, (RADII - 1) as f32) as u64;
        let structure = u64::from(children.clamp(1, 4) - 1);
        let normal = normal_code(disc.normal);
        let off = Vec3::from(normal_of(normal)).angle_between(disc.normal);
        let angle = (disc.cone.min(1.0).asin() + off).min(std::f32::consts::FRAC_PI_2);
        let cone = CONES.iter().position(|&sine| angle.sin() <= sine && disc.cone < 1.0);
        let cone = cone.unwrap_or(CONES.len() - 1) as u64;
        let bits = places
            | radius << 15
            | structure << 18
            | u64::from(disc.is_directional) << 20
            | u64::from(normal) << 21
            | cone << 31
            | u64::from(disc.light.0) << 33;
        PackedNode(bits.to_le_bytes())
    }

    fn bits(self) -> u64 {
        u64::from_le_bytes(self.0)
    }

    /// Returns the number of children: 0, 2, 3 or 4.
    #[inline]
    pub fn children(self) -> u32 {
        let code = (self.bits() >> 18 & 3) as u32;
        if code == 0 { 0 } else { code + 1 }
    }

    /// Returns the sphere, from the parent's and the file's spacing.
    #[inline]
    pub fn sphere(self, parent: Sphere, spacing: f32) -> Sphere {
        let bits = self.bits();
        let code = (bits >> 15 & 7) as f32;
        let radius = match self.children() {
            0 => spacing * LEAST_LEAF * (code * LEAF_STEP).exp2(),
            _ => parent.radius * ((code - (RADII - 1) as f32) * RADIUS_STEP).exp2(),
        };
        Sphere { centre: decoded_centre(parent, bits), radius }
    }

    /// Returns what the node shows.
    #[inline]
    pub fn disc(self) -> Disc {
        let bits = self.bits();
        Disc {
            normal: normal_of((bits >> 21 & 0x3FF) as u32).into(),
            cone: CONES[(bits >> 31 & 3) as usize],
            light: LightCode((bits >> 33) as u32),
            is_directional: bits >> 20 & 1 == 1,
        }
    }
}

#[inline]
fn decoded_centre(parent: Sphere, bits: u64) -> Vec3 {
    let axis = |shift: u32| (bits >> shift & 31) as f32;
    let place = Vec3::new(axis(0), axis(5), axis(10));
    parent.centre + (place * (2.0 / PLACES) - 1.0) * parent.radius
}

/// Returns the code of a unit normal.
fn normal_code(normal: Vec3) -> u32 {
    let sum = normal.abs().element_sum();
    let flat = normal / if sum > 0.0 { sum } else { 1.0 };
    let (mut u, mut v) = (flat.x, flat.y);
    if flat.z < 0.0 {
        (u, v) = ((1.0 - v.abs()).copysign(u), (1.0 - u.abs()).copysign(v));
    }
    let (u, v) = ((u + 1.0) * (0.5 * NORMAL_STEPS), (v + 1.0) * (0.5 * NORMAL_STEPS));
    // The nearest place on the octahedron need not be the nearest direction.
    let mut best = (f32::NEG_INFINITY, 0);
    for (u, v) in
        [(u.floor(), v.floor()), (u.floor(), v.ceil()), (u.ceil(), v.floor()), (u.ceil(), v.ceil())]
    {
        let code = u as u32 + v as u32 * (NORMAL_STEPS as u32 + 1);
        let cosine = Vec3::from(normal_of(code)).dot(normal);
        if cosine > best.0 {
            best = (cosine, code);
        }
    }
    best.1
}

/// Returns the unit normal of a code. Codes that no normal has give some unit vector, too.
#[inline]
fn normal_of(code: u32) -> [f32; 3] {
    let side = NORMAL_STEPS as u32 + 1;
    let axis = |code: u32| code as f32 * (2.0 / NORMAL_STEPS) - 1.0;
    let (u, v) = (axis(code % side), axis((code / side).min(side - 1)));
    let z = 1.0 - u.abs() - v.abs();
    let (x, y) = match z < 0.0 {
        true => ((1.0 - v.abs()).copysign(u), (1.0 - u.abs()).copysign(v)),
        false => (u, v),
    };
    Vec3::new(x, y, z).normalize_or(Vec3::Z).to_array()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn disc(normal: Vec3) -> Disc {
        let light = LightCode::new([0.5, 0.25, 0.125], 0.1, 0.0);
        Disc { normal, cone: 0.0, light, is_directional: true }
    }

    #[test]
    fn a_node_comes_back_within_its_steps() {
        let parent = Sphere { centre: Vec3::new(3.0, -2.0, 1.0), radius: 2.0 };
        for at in 0..500_u32 {
            let part = |n: u32| (at.wrapping_mul(n) >> 8 & 0xFFFF) as f32 / 65535.0 * 2.0 - 1.0;
            let axes = Vec3::new(part(2_654_435_761), part(40_503_001), part(977_777_777));
            let offset = axes.clamp_length_max(0.6);
            let sphere = Sphere { centre: parent.centre + offset * 2.0, radius: 0.4 };
            let normal = axes.normalize();
            for children in [0, 2, 3, 4] {
                let node = PackedNode::new(parent, sphere, children, disc(normal), 0.3);
                let back = node.sphere(parent, 0.3);
                let moved = back.centre.distance(sphere.centre);
                assert_eq!(node.children(), children);
                assert!(moved <= 2.0 / 30.0 * 3_f32.sqrt() + 1e-5, "{moved}");
                match children {
                    0 => assert!((back.radius / 0.4).log2().abs() <= 0.2501, "{back:?}"),
                    _ => assert!(moved + 0.4 <= back.radius * 1.0001, "{back:?}"),
                }
                let shown = node.disc();
                let angle = shown.normal.angle_between(normal);
                assert!(angle < 0.11 && angle.sin() <= shown.cone, "{angle}");
                assert_eq!((shown.light, shown.is_directional), (disc(normal).light, true));
            }
        }
    }

    #[test]
    fn normals_along_axes_are_exact() {
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            for normal in [axis, -axis] {
                let parent = Sphere { centre: Vec3::ZERO, radius: 1.0 };
                let shown = PackedNode::new(parent, parent, 0, disc(normal), 1.0).disc();
                assert_eq!((shown.normal, shown.cone), (normal, CONES[0]));
            }
        }
    }

    #[test]
    fn any_eight_bytes_are_a_node() {
        let parent = Sphere { centre: Vec3::ONE, radius: 1.0 };
        for seed in 0..20_000_u64 {
            let bits = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ seed << 21;
            let node = PackedNode(bits.to_le_bytes());
            let sphere = node.sphere(parent, 0.2);
            assert!(sphere.centre.is_finite() && sphere.radius <= 1.0 && sphere.radius >= 0.03);
            assert!((node.disc().normal.length() - 1.0).abs() < 1e-5);
            assert!([0, 2, 3, 4].contains(&node.children()));
        }
    }

    #[test]
    fn the_sphere_around_two_touches_both() {
        let (a, b) = (Vec3::ZERO, Vec3::X * 4.0);
        let (a, b) = (Sphere { centre: a, radius: 1.0 }, Sphere { centre: b, radius: 2.0 });
        assert_eq!(a.around(b), Sphere { centre: Vec3::X * 2.5, radius: 3.5 });
        let inside = Sphere { centre: b.centre, radius: 0.5 };
        assert_eq!((b.around(inside), inside.around(b)), (b, b));
    }
}

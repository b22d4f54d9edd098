//! A few facets that stand for all that an eye sees of a rough surface. Each mirrors the mean light
//! of its share of directions (Křivánek and Colbert 2008, "Real-time Shading with Filtered
//! Importance Sampling").

use glam::Vec3;

use crate::{Ggx, reflect};

/// Places of facets among those that the eye sees: the points of Hammersley.
const PLACES: [[f32; 2]; FACETS] = [
    [0.0625, 0.0625],
    [0.1875, 0.5625],
    [0.3125, 0.3125],
    [0.4375, 0.8125],
    [0.5625, 0.1875],
    [0.6875, 0.6875],
    [0.8125, 0.4375],
    [0.9375, 0.9375],
];

/// Number of facets. Each stands for the same share of what the eye sees.
pub const FACETS: usize = 8;

/// A facet, and the directions that it stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GlossFacet {
    /// The middle of the directions that it mirrors to the eye.
    pub towards: Vec3,
    /// The cosine of the angle between the facet and the eye.
    pub cosine: f32,
    /// The share of their light that other facets let pass.
    pub share: f32,
    /// The width of the directions, radians.
    pub width: f32,
}

/// Returns the facets of a surface of this normal and GGX roughness, seen from the direction `eye`
/// above it. Those that mirror what is below the surface are left out.
pub fn facets(normal: Vec3, eye: Vec3, alpha: f32) -> impl Iterator<Item = GlossFacet> {
    let (right, ahead) = normal.any_orthonormal_pair();
    let local = |v: Vec3| Vec3::new(v.dot(right), v.dot(ahead), v.dot(normal));
    let (eye, ggx) = (local(eye), Ggx::new(alpha));
    PLACES.into_iter().filter_map(move |place| {
        let facet = ggx.sample(eye, place);
        let towards = reflect(eye, facet);
        if towards.z <= 0.0 {
            return None;
        }
        let cosine = eye.dot(facet);
        let density = ggx.pdf(eye, facet) / (4.0 * cosine);
        Some(GlossFacet {
            towards: towards.x * right + towards.y * ahead + towards.z * normal,
            cosine,
            share: ggx.shadowing(eye, towards),
            width: (1.0 / (FACETS as f32 * density)).sqrt().min(1.0),
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the share of even light that all facets mirror, by many of them.
    fn mirrored(alpha: f32, eye: Vec3) -> f32 {
        let (side, ggx) = (64, Ggx::new(alpha));
        let place = |at: usize| (at as f32 + 0.5) / side as f32;
        let share = |at: usize| {
            let facet = ggx.sample(eye, [place(at % side), place(at / side)]);
            let towards = reflect(eye, facet);
            if towards.z > 0.0 { ggx.shadowing(eye, towards) } else { 0.0 }
        };
        (0..side * side).map(share).sum::<f32>() / (side * side) as f32
    }

    #[test]
    fn facets_mirror_as_much_even_light_as_all_of_them_and_cover_the_lobe() {
        for (alpha, angle) in
            [0.05, 0.2, 0.5].into_iter().flat_map(|a| [0.0, 0.6, 1.2].map(|t| (a, t)))
        {
            let eye = Vec3::new(f32::sin(angle), 0.0, f32::cos(angle));
            // In a frame of its own, as surfaces have them.
            let turn = glam::Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 1.1);
            let found: Vec<GlossFacet> = facets(turn * Vec3::Z, turn * eye, alpha).collect();
            let sum = found.iter().map(|facet| facet.share).sum::<f32>() / FACETS as f32;
            let expected = mirrored(alpha, eye);
            // Eight facets miss the end of the lobe, or give it too much.
            assert!((sum - expected).abs() < 0.08, "{alpha} {angle}: {sum}, not {expected}");
            for facet in found {
                assert!((facet.towards.length() - 1.0).abs() < 1e-4 && facet.cosine > 0.0);
                assert!(facet.width > 0.0 && facet.width <= 1.0);
                let half = (facet.towards + turn * eye).normalize();
                assert!((half.dot(turn * eye) - facet.cosine).abs() < 1e-3);
            }
        }
    }
}

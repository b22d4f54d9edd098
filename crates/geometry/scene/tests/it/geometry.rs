//! Tests queries about a scene's geometry against models.

#![allow(clippy::unwrap_used)]

use glam::{DMat3, DVec3};
use holo_scene::{Bsdf, Material, Scene};
use proptest::prelude::*;

fn scene(triangles: &[[DVec3; 3]]) -> Scene {
    let corners: Vec<[u32; 3]> =
        (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let ids = vec![0; triangles.len()];
    Scene::from_world(triangles.as_flattened(), &corners, &ids, vec![Material::grey("m")], [0.0; 3])
        .unwrap()
        .0
}

/// Returns the six faces of a box as twelve triangles.
fn box_faces(low: DVec3, high: DVec3) -> Vec<[DVec3; 3]> {
    let corner = |bits: usize| {
        let pick = |axis: usize| if bits >> axis & 1 == 1 { high[axis] } else { low[axis] };
        DVec3::new(pick(0), pick(1), pick(2))
    };
    let quads =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    quads
        .iter()
        .flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]])
        .map(|t| t.map(corner))
        .collect()
}

/// Clips a triangle to the cube of half side `half` around (½, ½, ½) (Sutherland and Hodgman). This
/// is an independent way to the result.
fn clipped_is_empty(triangle: [DVec3; 3], half: f64) -> bool {
    let mut polygon = triangle.to_vec();
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let inside = |p: DVec3| half - sign * (p[axis] - 0.5);
            let mut next = Vec::new();
            for k in 0..polygon.len() {
                let (p, q) = (polygon[k], polygon[(k + 1) % polygon.len()]);
                let (dp, dq) = (inside(p), inside(q));
                if dp > 0.0 {
                    next.push(p);
                }
                if dp > 0.0 && dq < 0.0 || dp < 0.0 && dq > 0.0 {
                    next.push(p + (q - p) * (dp / (dp - dq)));
                }
            }
            polygon = next;
        }
    }
    polygon.is_empty()
}

const UNIT: [DVec3; 3] = [DVec3::X, DVec3::Y, DVec3::Z];

#[test]
fn a_section_that_fits_a_room_exactly_has_nothing_inside() {
    // Corners that f32 cannot represent: rounding must not move the walls inside.
    for scale in [1e-4, 0.1, 1.0, 3.3e3, 1e8] {
        let low = DVec3::new(0.1, 0.7, -1.3) * scale;
        let size = DVec3::new(3.3, 2.1, 0.9) * scale;
        let room = scene(&box_faces(low, low + size));
        let axes = [DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z];
        assert!(!room.geometry_inside(low, axes), "{scale}");
        assert!(room.geometry_inside(low - size * 1e-5, axes), "{scale}");
        let negative = [axes[1], -axes[0], -axes[2]];
        assert!(!room.geometry_inside(low + axes[0] + axes[2], negative), "{scale}");
        assert!(!room.geometry_inside(low + size * 0.05, axes.map(|a| a * 0.9)), "{scale}");
    }
}

#[test]
fn a_large_triangle_that_cuts_the_box_counts_and_one_beyond_its_corner_does_not() {
    // x + y + z = c cuts the unit cube for 0 < c < 3; no corner of the triangle is inside.
    let cut = |c: f64| {
        let far = 100.0;
        scene(&[[
            DVec3::new(c + 2.0 * far, -far, -far),
            DVec3::new(-far, c + 2.0 * far, -far),
            DVec3::new(-far, -far, c + 2.0 * far),
        ]])
    };
    assert!([0.01, 1.5, 2.99].iter().all(|&c| cut(c).geometry_inside(DVec3::ZERO, UNIT)));
    assert!([-0.01, 3.01].iter().all(|&c| !cut(c).geometry_inside(DVec3::ZERO, UNIT)));
}

#[test]
fn a_section_without_volume_has_no_interior() {
    let room = scene(&box_faces(DVec3::ZERO, DVec3::ONE));
    let here = DVec3::splat(-1.0);
    assert!(room.geometry_inside(here, UNIT.map(|a| a * 3.0)));
    assert!(!room.geometry_inside(here, [DVec3::X * 3.0, DVec3::Y * 3.0, DVec3::X]));
    assert!(!room.geometry_inside(here, [DVec3::ZERO; 3]));
    assert!(!room.geometry_inside(here, [DVec3::NAN; 3]));
    assert!(!room.geometry_inside(DVec3::splat(f64::INFINITY), UNIT));
}

#[test]
fn features_are_those_of_materials_that_triangles_have() {
    let alpha = 0.25;
    let (kd, ks, ior, transmittance) = ([0.5; 3], [0.5; 3], 1.5, [1.0; 3]);
    let kinds = [
        Bsdf::Diffuse { kd },
        Bsdf::Mirror { ks },
        Bsdf::Conductor { ks, alpha },
        Bsdf::ThinGlass { ior, transmittance },
        Bsdf::Dielectric { ior, transmittance, alpha: 0.0 },
        Bsdf::Dielectric { ior, transmittance, alpha },
        Bsdf::Coated { kd, ks, ior, alpha },
    ];
    let materials =
        kinds.map(|bsdf| Material { bsdf, emission: [0.0, 0.0, 1.0], ..Material::grey("m") });
    for used in 0..kinds.len() {
        let positions = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let ids = vec![used as u32; 2];
        let triangles = vec![[0, 1, 2]; 2];
        let scene =
            Scene::new(DVec3::ZERO, positions, triangles, ids, materials.to_vec(), [0.0, 0.1, 0.0])
                .unwrap();
        let f = scene.features();
        let flags = [
            f.diffuse,
            f.mirror,
            f.conductor,
            f.thin_glass,
            f.dielectric,
            f.rough_dielectric,
            f.coated,
        ];
        let expected: Vec<bool> = (0..kinds.len()).map(|kind| kind == used).collect();
        assert_eq!(flags.as_slice(), expected);
        assert_eq!((f.emitters, f.two_sided_emission, f.sky), (2, false, true));
    }
}

#[test]
fn a_scene_without_triangles_is_allowed_and_has_nothing() {
    let scene = Scene::new(DVec3::ONE, vec![], vec![], vec![], vec![], [0.0; 3]).unwrap();
    assert_eq!(scene.bounds(), (DVec3::ONE, DVec3::ONE));
    assert_eq!(scene.features(), holo_scene::Features::default());
    assert!(!scene.geometry_inside(DVec3::ZERO, UNIT.map(|a| a * 10.0)));
    assert_eq!(Scene::unpack(&scene.pack()).unwrap(), scene);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4000, failure_persistence: None, ..ProptestConfig::default() })]

    /// Compares with clipping, in parallelepipeds of any shear, except where rounding decides.
    #[test]
    fn inside_agrees_with_clipping(
        corners in prop::array::uniform3(prop::array::uniform3(-0.6..1.6f64)),
        axes in prop::array::uniform3(prop::array::uniform3(-5.0..5.0f64)),
        origin in prop::array::uniform3(-10.0..10.0f64),
    ) {
        let axes = axes.map(DVec3::from_array);
        let origin = DVec3::from_array(origin);
        let matrix = DMat3::from_cols(axes[0], axes[1], axes[2]);
        prop_assume!(matrix.determinant().abs() > 1.0);
        let local = corners.map(DVec3::from_array);
        prop_assume!((local[1] - local[0]).cross(local[2] - local[0]).length() > 1e-3);
        let inside = scene(&[local.map(|p| origin + matrix * p)]).geometry_inside(origin, axes);
        if !clipped_is_empty(local, 0.5 - 1e-4) {
            prop_assert!(inside);
        } else if clipped_is_empty(local, 0.5 + 1e-4) {
            prop_assert!(!inside);
        }
    }

    #[test]
    fn bounds_are_those_of_the_corners(corners in prop::collection::vec(prop::array::uniform3(-1e3..1e3f64), 3..30)) {
        let corners: Vec<DVec3> = corners.into_iter().map(DVec3::from_array).collect();
        let triangles: Vec<[DVec3; 3]> = corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
        let used = triangles.as_flattened();
        let low = used.iter().copied().reduce(DVec3::min).unwrap();
        let high = used.iter().copied().reduce(DVec3::max).unwrap();
        let (l, h) = scene(&triangles).bounds();
        // Half a unit of f32 at the largest relative coordinate, 1e3.
        let rounding = 1e3 * 2f64.powi(-24) * 1.001;
        prop_assert!((l - low).abs().max_element() <= rounding && (h - high).abs().max_element() <= rounding);
    }
}

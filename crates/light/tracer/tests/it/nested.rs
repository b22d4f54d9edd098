//! Tests nested, overlapping and touching glass against closed forms.
//!
//! Consider a ray through parallel boundaries without absorption, which reflect shares r. With all
//! reflections between them they transmit 1 / (1 + Σ r / (1 - r)).

use crate::common::{BLACK, Model, estimate, expect, fresnel};
use glam::{DMat3, DVec3};
use holo_scene::Bsdf;

const LE: [f32; 3] = [3.0, 5.0, 7.0];
const CLEAR: [f32; 3] = [1.0; 3];
const GLASS: f64 = 1.5;
const WATER: f64 = 1.33_f32 as f64;

fn solid(ior: f32) -> Bsdf {
    Bsdf::Dielectric { ior, transmittance: CLEAR, alpha: 0.0 }
}

/// Adds a slab that is too wide for its sides to matter.
fn slab(model: &mut Model, low: f64, high: f64, outwards: bool, material: u32) {
    // No two slabs share their sides.
    let half = 500.0 + model.triangles.len() as f64;
    model.cuboid([-half, -half, low], [half, half, high], outwards, material);
}

/// Returns the transmission of a ray with this cosine in air through the media in order and back to
/// air.
fn through(cosine: f64, media: &[f64]) -> f64 {
    let sine = (1.0 - cosine * cosine).sqrt();
    let all: Vec<f64> = [&[1.0], media, &[1.0]].concat();
    let sum: f64 = all
        .windows(2)
        .map(|pair| {
            let r = fresnel((1.0 - (sine / pair[0]).powi(2)).sqrt(), pair[1] / pair[0]);
            r / (1.0 - r)
        })
        .sum();
    1.0 / (1.0 + sum)
}

/// Checks that the light below, seen from above, is `LE` times `share`.
#[track_caller]
fn expect_through(model: &mut Model, cosine: f64, share: f64) {
    expect_through_turned(model, cosine, share, DMat3::IDENTITY);
}

/// The same with the scene rotated by `turn`.
#[track_caller]
fn expect_through_turned(model: &mut Model, cosine: f64, share: f64, turn: DMat3) {
    let light = model.material(BLACK, LE);
    model.square(-30.0, 2000.0, true, light);
    let direction = DVec3::new((1.0 - cosine * cosine).sqrt(), 0.0, -cosine);
    let expected = LE.map(|c| f64::from(c) * share);
    model.positions.iter_mut().for_each(|p| *p = turn * *p);
    let eye = turn * DVec3::new(0.1, 0.2, 1.0);
    expect(estimate(&model.tracer(Some(0)), eye, turn * direction, 20_000), expected);
}

#[test]
fn a_bubble_in_glass_is_air_however_it_is_drawn() {
    // The index of the bubble's own material, and which way it faces. `None`: the glass's own
    // material.
    for (ior, outwards) in [
        (None, false),
        (Some(1.5), false),
        (Some(1.0), true),
        (Some(1.0), false),
        (Some(1.0 / 1.5), true),
    ] {
        for bubble_first in [true, false] {
            for cosine in [1.0, 0.6] {
                let mut model = Model::default();
                let mut bubble = if bubble_first {
                    ior.map(|n| model.material(solid(n), [0.0; 3]))
                } else {
                    None
                };
                let glass = model.material(solid(1.5), [0.0; 3]);
                if !bubble_first {
                    bubble = ior.map(|n| model.material(solid(n), [0.0; 3]));
                }
                slab(&mut model, -4.0, 0.0, true, glass);
                slab(&mut model, -3.0, -1.0, outwards, bubble.unwrap_or(glass));
                expect_through(&mut model, cosine, through(cosine, &[GLASS, 1.0, GLASS]));
            }
        }
    }
}

#[test]
fn a_radial_ray_through_a_shell_transmits_its_four_boundaries() {
    // Octahedra: the ray along (1, 1, 1) meets every face at right angles, as a sphere's.
    let mut model = Model::default();
    let glass = model.material(solid(1.5), [0.0; 3]);
    for (radius, outwards) in [(2.0, true), (1.0, false)] {
        for octant in 0..8 {
            let sign = |bit: i32| if octant >> bit & 1 == 0 { radius } else { -radius };
            let mut corners = [[sign(0), 0.0, 0.0], [0.0, sign(1), 0.0], [0.0, 0.0, sign(2)]];
            if (sign(0) * sign(1) * sign(2) > 0.0) != outwards {
                corners.reverse();
            }
            model.polygon(&corners, glass);
        }
    }
    // The light fills the half space ahead. Reflected light returns to the eye's side, which is
    // dark.
    let light = model.material(BLACK, LE);
    let (a, b) = (DVec3::new(1.0, -1.0, 0.0).normalize(), DVec3::new(1.0, 1.0, -2.0).normalize());
    let centre = DVec3::splat(-5.0);
    let corner = |s: f64, t: f64| (centre + a * s * 100.0 + b * t * 100.0).to_array();
    let mut corners = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    if a.cross(b).dot(DVec3::ONE) < 0.0 {
        corners.reverse();
    }
    model.polygon(&corners, light);
    let e = estimate(&model.tracer(Some(0)), DVec3::splat(4.0), DVec3::splat(-1.0), 40_000);
    expect(e, LE.map(|c| f64::from(c) / (1.0 + 4.0 * 0.04 / 0.96)));
}

#[test]
fn glass_of_the_index_of_its_surroundings_is_invisible() {
    // The same material again as an overlapping piece, or another material of the same index.
    for own in [true, false] {
        for cosine in [1.0, 0.6, 0.2] {
            let mut model = Model::default();
            let glass = model.material(solid(1.5), [0.0; 3]);
            let other = if own { glass } else { model.material(solid(1.5), [0.0; 3]) };
            slab(&mut model, -4.0, 0.0, true, glass);
            slab(&mut model, -3.0, -1.0, true, other);
            expect_through(&mut model, cosine, through(cosine, &[GLASS]));
        }
    }
}

#[test]
fn a_ray_through_matched_media_does_not_bend() {
    // A panel of 1 mm seen from inside the glass, through two nested boxes of the same index.
    // Without noise.
    let mut model = Model::default();
    let eye = DVec3::new(-3.0, 0.2, 0.3);
    let target = DVec3::new(3.0, -1.1, 0.9);
    for half in [9.0, 2.0, 1.0] {
        let glass = model.material(solid(1.5), [0.0; 3]);
        model.cuboid([-half; 3], [half; 3], true, glass);
    }
    let light = model.material(BLACK, LE);
    let h = 5e-4;
    let [x, y, z] = target.to_array();
    model.polygon(
        &[[x, y - h, z - h], [x, y - h, z + h], [x, y + h, z + h], [x, y + h, z - h]],
        light,
    );
    let traced = model.tracer(Some(0)).trace(eye, (target - eye).normalize(), 3);
    assert_eq!(traced.radiance, LE);
    // The distance is to the first surface, even an invisible one.
    let first = (eye.x + 2.0) / -(target - eye).normalize().x;
    assert!((traced.distance - first).abs() < 1e-5, "{}", traced.distance);
}

#[test]
fn water_in_glass_is_the_same_drawn_touching_or_overlapping() {
    // (lower, upper) faces of the water between walls of thickness 1, and which of the two comes
    // first in the file.
    for (low, high) in [(-3.0, -1.0), (-3.5, -0.5)] {
        for water_first in [false, true] {
            for cosine in [1.0, 0.6, 0.3] {
                let mut model = Model::default();
                let (glass, water);
                if water_first {
                    water = model.material(solid(1.33), [0.0; 3]);
                    glass = model.material(solid(1.5), [0.0; 3]);
                } else {
                    glass = model.material(solid(1.5), [0.0; 3]);
                    water = model.material(solid(1.33), [0.0; 3]);
                }
                slab(&mut model, -4.0, -3.0, true, glass);
                slab(&mut model, -1.0, 0.0, true, glass);
                slab(&mut model, low, high, true, water);
                // Rotation rounds corners, so planes that touch differ in the last bits.
                for turn in [DMat3::IDENTITY, DMat3::from_euler(glam::EulerRot::XYZ, 0.4, 0.7, 0.3)]
                {
                    let mut model = model.clone();
                    let share = through(cosine, &[GLASS, WATER, GLASS]);
                    expect_through_turned(&mut model, cosine, share, turn);
                }
            }
        }
    }
}

#[test]
fn pieces_of_one_glass_that_touch_are_one_piece() {
    for cosine in [1.0, 0.6] {
        let mut model = Model::default();
        let glass = model.material(solid(1.5), [0.0; 3]);
        for piece in 0..4 {
            slab(&mut model, f64::from(-piece - 1), f64::from(-piece), true, glass);
        }
        // A duplicate face, as careless exporters write.
        slab(&mut model, -4.0, 0.0, true, glass);
        expect_through(&mut model, cosine, through(cosine, &[GLASS]));
    }
}

#[test]
fn glass_that_lies_on_a_surface_shows_it() {
    // Index 1, so nothing is reflected. The lamp is seen through the top boundary alone, and
    // coloured by it.
    let tf = [0.9, 0.6, 0.3];
    for glass_first in [true, false] {
        let mut model = Model::default();
        let glass =
            model.material(Bsdf::Dielectric { ior: 1.0, transmittance: tf, alpha: 0.0 }, [0.0; 3]);
        let light = model.material(BLACK, LE);
        let parts: [u32; 2] = if glass_first { [0, 1] } else { [1, 0] };
        for part in parts {
            match part {
                0 => slab(&mut model, -1.0, 0.0, true, glass),
                _ => model.square(-1.0, 50.0, true, light),
            }
        }
        let traced =
            model.tracer(Some(0)).trace(DVec3::new(0.1, 0.2, 1.0), DVec3::new(0.1, 0.2, -1.0), 0);
        for c in 0..3 {
            assert!((traced.radiance[c] - LE[c] * tf[c]).abs() < 1e-5, "{traced:?}");
        }
    }
}

#[test]
fn each_boundary_colours_once_and_surfaces_without_effect_do_not() {
    let tf = [0.9, 0.6, 0.3];
    let bsdf = Bsdf::Dielectric { ior: 1.5, transmittance: tf, alpha: 0.0 };
    let mut model = Model::default();
    let glass = model.material(bsdf, [0.0; 3]);
    slab(&mut model, -4.0, 0.0, true, glass);
    slab(&mut model, -3.0, -1.0, true, glass);
    let light = model.material(BLACK, LE);
    model.square(-30.0, 2000.0, true, light);
    let share = through(1.0, &[GLASS]);
    let expected = [0, 1, 2].map(|c| f64::from(LE[c]) * f64::from(tf[c]).powi(2) * share);
    // Reflections inside are not coloured; only the first and last boundary are.
    expect(
        estimate(&model.tracer(Some(0)), DVec3::new(0.1, 0.2, 1.0), -DVec3::Z, 40_000),
        expected,
    );
}

/// Glass around water around a bubble, boxes within boxes, and eyes in each, under an even sky.
#[test]
fn eyes_inside_glass_water_and_bubbles_see_the_sky_by_the_square_of_their_index() {
    for alpha in [0.0, 0.3] {
        let mut model = Model { sky: [1.0, 2.0, 4.0], ..Model::default() };
        for (half, ior, outwards) in
            [(4.0, 1.5, true), (3.0, 1.33, true), (2.0, 1.0, true), (1.0, 1.5, true)]
        {
            let bsdf = Bsdf::Dielectric { ior, transmittance: CLEAR, alpha };
            let material = model.material(bsdf, [0.0; 3]);
            model.cuboid([-half; 3], [half; 3], outwards, material);
        }
        let tracer = model.tracer(None);
        for (x, index) in [(5.0, 1.0), (3.5, GLASS), (2.5, WATER), (1.5, 1.0)] {
            // The innermost box has the lowest priority, because a bubble of index 1 precedes all.
            // It is air in air.
            let expected = model.sky.map(|c| f64::from(c) * index * index);
            let e =
                estimate(&tracer, DVec3::new(x, 0.13, 0.21), DVec3::new(-0.6, 0.5, 0.4), 20_000);
            for (c, wanted) in expected.into_iter().enumerate() {
                // Rough boundaries: the error of their tables at a few scatterings.
                let tables = if alpha > 0.0 { 3e-3 } else { 3e-6 };
                let bound = 4.5 * e.error[c] + tables * wanted;
                assert!(
                    (e.mean[c] - wanted).abs() <= bound,
                    "alpha {alpha}, eye at {x}: {e:?} is not {expected:?}"
                );
            }
        }
    }
}

#[test]
fn light_beyond_the_critical_angle_is_reflected_totally_into_an_eye_in_glass() {
    // An eye inside looks at the top at 60 degrees. It sees the panel below as in a mirror, without
    // noise, and not the sky.
    let mut model = Model { sky: [9.0; 3], ..Model::default() };
    let glass = model.material(solid(1.5), [0.0; 3]);
    slab(&mut model, -10.0, 0.0, true, glass);
    let light = model.material(BLACK, LE);
    model.square(-9.0, 100.0, true, light);
    let sine = 0.75_f64.sqrt();
    let traced =
        model.tracer(Some(0)).trace(DVec3::new(0.0, 0.0, -1.0), DVec3::new(sine, 0.0, 0.5), 0);
    assert_eq!(traced.radiance, LE);
    // On a triangle of size 1000, a point is exact to about 2⁻²³ of that.
    assert!((traced.distance - 2.0).abs() < 2e-4);
}

#[test]
fn glass_drawn_inside_out_is_still_glass_and_open_sheets_have_no_inside() {
    for cosine in [1.0, 0.6] {
        let mut model = Model::default();
        let glass = model.material(solid(1.5), [0.0; 3]);
        slab(&mut model, -4.0, 0.0, false, glass);
        expect_through(&mut model, cosine, through(cosine, &[GLASS]));
    }
    // An eye between two sheets that face away from each other and have no sides is in air. Each
    // sheet reflects 4 %.
    let mut model = Model { sky: [1.0; 3], ..Model::default() };
    let glass = model.material(solid(1.5), [0.0; 3]);
    model.polygon(&[[-1.0, -1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, 1.0], [-1.0, 1.0, 1.0]], glass);
    model.polygon(
        &[[-9.0, -9.0, -9.0], [-9.0, 9.0, -9.0], [9.0, 9.0, -9.0], [9.0, -9.0, -9.0]],
        glass,
    );
    let light = model.material(BLACK, LE);
    model.square(-5.0, 8.0, true, light);
    // 4 % of the panel, and the sky through what then counts as glass: 96 % over n².
    let e = estimate(&model.tracer(Some(0)), DVec3::new(0.1, 0.2, -3.0), DVec3::Z, 40_000);
    expect(e, LE.map(|c| 0.04 * f64::from(c) + 0.96 / 2.25));
}

//! Tests a lamp that lies slightly inside its housing: the rim casts a shadow.
//!
//! Renderers that end shadow rays a fixed share before the light lose occluders that are closer to
//! it than that. In a room with such lamps the picture is up to a percent too bright.

#![allow(clippy::unwrap_used, reason = "a test that cannot set up its scene has failed")]

use std::{f64::consts::PI, sync::Arc};

use glam::DVec3;
use holo_scene::{Bsdf, Material, Scene};
use holo_tracer::{Settings, Tracer};

/// Number of corners of lamp and housing.
const CORNERS: usize = 32;
const RADIUS: f64 = 0.25;
const HEIGHT: f64 = 8.0;
/// Depth of the lamp: a thousandth of its distance to the floor.
const DEPTH: f64 = 0.008;
const RADIANCE: f64 = 60.0;
const ALBEDO: f64 = 0.5;

fn corner(index: usize, height: f64) -> DVec3 {
    let angle = 2.0 * PI * index as f64 / CORNERS as f64;
    DVec3::new(RADIUS * angle.cos(), RADIUS * angle.sin(), height)
}

/// Returns a polygonal lamp that shines downwards from inside a tube, above a floor.
fn scene() -> Scene {
    let (mut points, mut triangles, mut materials) = (Vec::new(), Vec::new(), Vec::new());
    let mut add = |corners: [DVec3; 3], material: u32| {
        let first = points.len() as u32;
        points.extend(corners);
        triangles.push([first, first + 1, first + 2]);
        materials.push(material);
    };
    for index in 0..CORNERS {
        let (here, next) = (corner(index, HEIGHT), corner(index + 1, HEIGHT));
        // Counter-clockwise from below.
        add([DVec3::new(0.0, 0.0, HEIGHT), next, here], 0);
        let (below, next_below) =
            (corner(index, HEIGHT - DEPTH), corner(index + 1, HEIGHT - DEPTH));
        add([here, next, below], 1);
        add([next, next_below, below], 1);
    }
    let floor = [(-40.0, -40.0), (40.0, -40.0), (40.0, 40.0), (-40.0, 40.0)]
        .map(|(x, y)| DVec3::new(x, y, 0.0));
    add([floor[0], floor[1], floor[2]], 2);
    add([floor[0], floor[2], floor[3]], 2);
    let diffuse = |name: &str, kd: f32, ke: f32| Material {
        name: name.into(),
        bsdf: Bsdf::Diffuse { kd: [kd; 3] },
        emission: [ke; 3],
        two_sided_emission: false,
    };
    let palette = vec![
        diffuse("lamp", 0.0, RADIANCE as f32),
        diffuse("housing", 0.0, 0.0),
        diffuse("floor", ALBEDO as f32, 0.0),
    ];
    Scene::from_world(&points, &triangles, &materials, palette, [0.0; 3]).unwrap().0
}

/// Returns the floor's radiance at `x`. It is the sum over the points of the lamp that are visible
/// through the mouth of the housing, weighted with their form factors. The strata are so fine that
/// the shadow's edge costs less than 1e-4.
fn expected(x: DVec3) -> f64 {
    const RINGS: usize = 600;
    const SPOKES: usize = 600;
    let inside = |p: DVec3| {
        (0..CORNERS).all(|index| {
            let (a, b) = (corner(index, p.z), corner(index + 1, p.z));
            (b - a).cross(p - a).z >= 0.0
        })
    };
    let mut sum = 0.0;
    for ring in 0..RINGS {
        // Rings of equal area of the circumscribed circle; what lies outside the polygon is
        // skipped.
        let radius = RADIUS * ((ring as f64 + 0.5) / RINGS as f64).sqrt();
        for spoke in 0..SPOKES {
            let angle = 2.0 * PI * (spoke as f64 + 0.5) / SPOKES as f64;
            let y = DVec3::new(radius * angle.cos(), radius * angle.sin(), HEIGHT);
            let mouth = y + (x - y) * (DEPTH / HEIGHT);
            if inside(y) && inside(mouth) {
                let to = y - x;
                let cosine = to.z / to.length();
                sum += cosine * cosine / to.length_squared();
            }
        }
    }
    let area = PI * RADIUS * RADIUS / (RINGS * SPOKES) as f64;
    RADIANCE * ALBEDO / PI * sum * area
}

#[test]
fn a_rim_close_to_its_lamp_casts_its_shadow() {
    const PATHS: u64 = 200_000;
    let tracer =
        Tracer::new(Arc::new(scene()), Settings { bounces: Some(0), ..Settings::default() })
            .unwrap();
    for (index, x) in
        [DVec3::new(3.0, 0.5, 0.0), DVec3::new(-6.0, 4.0, 0.0), DVec3::new(10.0, 1.0, 0.0)]
            .iter()
            .enumerate()
    {
        let (mut sum, mut squares) = (0.0, 0.0);
        for path in 0..PATHS {
            // A seed for each path makes paths independent, so that the standard error below is
            // correct.
            let seed = path.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ index as u64;
            let found =
                f64::from(tracer.trace_path(*x + DVec3::Z * 0.01, -DVec3::Z, seed, 0).radiance[0]);
            sum += found;
            squares += found * found;
        }
        let n = PATHS as f64;
        let mean = sum / n;
        let error = ((squares / n - mean * mean) / (n - 1.0)).sqrt();
        let exact = expected(*x);
        // 99.99 % for three points together, plus the error of the quadrature.
        let allowed = 4.2 * error + 1e-4 * exact;
        assert!((mean - exact).abs() < allowed, "at {x}: {mean} instead of {exact} ± {allowed}");
        // The shadow must be large enough for the test to notice its absence.
        let unshadowed = 60.0 * ALBEDO / PI * PI * RADIUS * RADIUS * HEIGHT * HEIGHT
            / (HEIGHT * HEIGHT + x.truncate().length_squared()).powi(2);
        assert!(
            unshadowed - exact > 3.0 * allowed,
            "the test could not see the rim: {unshadowed} and {exact}"
        );
    }
}

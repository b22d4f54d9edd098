//! Tests scenes of any size and position, and large and small things in one scene, against each
//! other and against closed forms.

use crate::common::{BLACK, Model, estimate, expect, form_factor};
use glam::DVec3;
use holo_scene::Bsdf;
use holo_tracer::Tracer;

/// A room with every material, lit by a lamp, a small bright lamp, and a sky where a wall is
/// missing.
fn room() -> Model {
    let mut model = Model { sky: [0.3, 0.4, 0.6], ..Model::default() };
    let t = [0.9, 0.8, 0.7];
    let wall = model.material(Bsdf::Diffuse { kd: [0.7, 0.6, 0.5] }, [0.0; 3]);
    let lamp = model.material(BLACK, [4.0, 5.0, 6.0]);
    let spot = model.material(BLACK, [40.0, 30.0, 20.0]);
    let mirror = model.material(Bsdf::Mirror { ks: t }, [0.0; 3]);
    let gloss = model.material(Bsdf::Conductor { ks: t, alpha: 0.2 }, [0.0; 3]);
    let coated =
        model.material(Bsdf::Coated { kd: [0.2, 0.3, 0.6], ks: t, ior: 1.5, alpha: 0.1 }, [0.0; 3]);
    let pane = model.material(Bsdf::ThinGlass { ior: 1.5, transmittance: t }, [0.0; 3]);
    let glass =
        model.material(Bsdf::Dielectric { ior: 1.5, transmittance: t, alpha: 0.0 }, [0.0; 3]);
    let frosted =
        model.material(Bsdf::Dielectric { ior: 1.5, transmittance: t, alpha: 0.3 }, [0.0; 3]);
    let (l, h) = (-2.0, 2.0);
    for corners in [
        [[l, l, l], [h, l, l], [h, h, l], [l, h, l]],
        [[l, l, h], [l, h, h], [h, h, h], [h, l, h]],
        [[l, l, l], [l, h, l], [l, h, h], [l, l, h]],
        [[h, l, l], [h, l, h], [h, h, h], [h, h, l]],
        [[l, h, l], [h, h, l], [h, h, h], [l, h, h]],
    ] {
        model.polygon(&corners, wall);
    }
    model.polygon(
        &[[-0.7, -0.7, 1.95], [-0.7, 0.7, 1.95], [0.7, 0.7, 1.95], [0.7, -0.7, 1.95]],
        lamp,
    );
    model.polygon(&[[-1.5, 1.5, 1.0], [-1.5, 1.6, 1.0], [-1.4, 1.6, 1.0], [-1.4, 1.5, 1.0]], spot);
    model.polygon(
        &[[-1.9, 1.2, -1.5], [-1.2, 1.9, -1.5], [-1.2, 1.9, 0.5], [-1.9, 1.2, 0.5]],
        mirror,
    );
    model
        .polygon(&[[0.4, -0.4, -1.9], [1.7, -0.4, -1.9], [1.7, -0.2, 0.2], [0.4, -0.2, 0.2]], pane);
    model.cuboid([0.6, 0.6, -1.99], [1.6, 1.6, -0.9], true, gloss);
    model.cuboid([-0.7, 0.6, -1.99], [0.3, 1.6, -1.2], true, coated);
    model.cuboid([-0.6, 0.8, -1.1], [0.1, 1.4, -0.4], true, glass);
    model.cuboid([0.8, 0.8, -0.8], [1.4, 1.4, -0.2], true, frosted);
    model
}

fn placed(mut model: Model, scale: f64, offset: DVec3) -> Model {
    model.positions.iter_mut().for_each(|p| *p = *p * scale + offset);
    model
}

const WIDTH: usize = 20;
const HEIGHT: usize = 15;
const EYE: DVec3 = DVec3::new(0.1, -1.9, -0.3);

fn ray(pixel: usize) -> DVec3 {
    let (x, y) = ((pixel % WIDTH) as f64 + 0.5, (pixel / WIDTH) as f64 + 0.5);
    DVec3::new(2.0 * x / WIDTH as f64 - 1.0, 1.2, 0.75 - 1.5 * y / HEIGHT as f64).normalize()
}

/// Returns single paths of every pixel, each with its own seed, in grey.
fn paths(tracer: &Tracer, eye: DVec3, count: usize, first_seed: u64) -> Vec<Vec<f64>> {
    let seeds = |pixel| first_seed + (pixel * count) as u64;
    let grey = |[r, g, b]: [f32; 3]| f64::from(r) + f64::from(g) + f64::from(b);
    let path = |pixel, i| grey(tracer.trace(eye, ray(pixel), seeds(pixel) + i as u64).radiance);
    let found =
        (0..WIDTH * HEIGHT).map(|pixel| (0..count).map(|i| path(pixel, i)).collect()).collect();
    assert_eq!(tracer.nonfinite_paths(), 0);
    found
}

/// Returns the sum over the square root of the sum of squares.
///
/// `differences` must be independent and symmetric about 0, as the differences of two estimates of
/// the same quantity are. The magnitude then exceeds z with probability at most 2 exp(-z²/2),
/// whatever their tails (Efron 1969, "Student's t-Test under Symmetry Conditions").
fn self_normalised(differences: impl Iterator<Item = f64>) -> f64 {
    let (sum, squares) = differences.fold((0.0, 0.0), |(s, q): (f64, f64), d| (s + d, q + d * d));
    if squares == 0.0 { 0.0 } else { sum / squares.sqrt() }
}

/// Returns the value that [`self_normalised`] exceeds in any of `tests` tests with probability
/// 1e-4.
fn limit(tests: usize) -> f64 {
    (2.0 * (2.0 * tests as f64 / 1e-4).ln()).sqrt()
}

fn differences(a: &[f64], b: &[f64]) -> impl Iterator<Item = f64> {
    a.iter().zip(b).map(|(a, b)| a - b)
}

/// Returns the worst pixel's statistic, and that of the means of all pixels.
fn compare(a: &[Vec<f64>], b: &[Vec<f64>]) -> (f64, f64) {
    let pixels =
        a.iter().zip(b).map(|(a, b)| self_normalised(differences(a, b)).abs()).fold(0.0, f64::max);
    (pixels, self_normalised(a.iter().zip(b).flat_map(|(a, b)| differences(a, b))).abs())
}

const PATHS: usize = 512;

#[test]
fn a_scene_of_any_size_anywhere_gives_statistically_the_same_picture() {
    let truth = paths(&room().tracer(None), EYE, PATHS, 0);
    let far = DVec3::new(0.6, -0.8, 0.1).normalize() * 1e6;
    let places = [
        (1e-3, DVec3::ZERO),
        (1e5, DVec3::ZERO),
        (1e-3, far),
        (1.0, far),
        (1.0, far * 4.0),
        (1e5, far),
    ];
    let tests = places.len() * (WIDTH * HEIGHT + 1);
    for (i, (scale, offset)) in (1..).zip(places) {
        let tracer = placed(room(), scale, offset).tracer(None);
        let found = paths(&tracer, EYE * scale + offset, PATHS, i << 32);
        let (worst, mean) = compare(&truth, &found);
        assert!(worst.max(mean) < limit(tests), "{scale} at {offset}: pixels {worst}, mean {mean}");
    }
}

#[test]
fn the_comparison_of_pictures_detects_a_lamp_that_is_dimmer_by_a_tenth() {
    // Otherwise the test above might pass because of noise.
    let truth = paths(&room().tracer(None), EYE, PATHS, 0);
    let mut dimmer = room();
    dimmer.materials[1].emission = [3.6, 4.5, 5.4];
    let (_, mean) = compare(&truth, &paths(&dimmer.tracer(None), EYE, PATHS, 1 << 32));
    assert!(mean > limit(6 * (WIDTH * HEIGHT + 1)), "{mean}");
}

#[test]
fn a_scene_of_twice_any_size_gives_the_same_bits() {
    // Multiplication by a power of two does not change rounding, so any length that does not come
    // from the scene would show.
    let tracer = room().tracer(None);
    for power in [-14, -10, -1, 1, 17, 27] {
        let scale = 2.0_f64.powi(power);
        let other = placed(room(), scale, DVec3::ZERO).tracer(None);
        for pixel in 0..WIDTH * HEIGHT {
            for path in 0..4 {
                let seed = (pixel * 4 + path) as u64;
                let (a, b) = (
                    tracer.trace(EYE, ray(pixel), seed),
                    other.trace(EYE * scale, ray(pixel), seed),
                );
                assert_eq!(
                    (a.radiance, a.distance * scale),
                    (b.radiance, b.distance),
                    "2^{power}, pixel {pixel}"
                );
            }
        }
    }
}

/// A site of 500 by 500, and objects within `size` of its farthest corner. They are 50,000 times
/// smaller than their distance from the centre.
const SITE: f64 = 250.0;
const SMALL: f64 = 0.005;

fn site() -> Model {
    let mut model = Model::default();
    let ground = model.material(BLACK, [0.0; 3]);
    model.square(-20.0, SITE, true, ground);
    let tower = model.material(Bsdf::Diffuse { kd: [0.5; 3] }, [0.0; 3]);
    model.cuboid([-20.0; 3], [20.0; 3], true, tower);
    model
}

/// Returns the corners as stored: rounded to f32 relative to the scene's origin.
fn stored(corners: &[[f64; 3]], origin: DVec3) -> Vec<[f64; 3]> {
    corners
        .iter()
        .map(|&c| ((DVec3::from_array(c) - origin).as_vec3().as_dvec3() + origin).to_array())
        .collect()
}

#[test]
fn a_box_of_millimetres_in_a_scene_of_hundreds_of_metres_neither_leaks_nor_loses_light() {
    // In a closed box that emits everywhere, L = Le / (1 - kd).
    let corner = [SITE - 1.0, SITE - 1.0, 5.0];
    let mut model = site();
    let glowing = model.material(Bsdf::Diffuse { kd: [0.5, 0.75, 0.0] }, [1.0, 2.0, 3.0]);
    model.cuboid(corner, corner.map(|c| c + SMALL), false, glowing);
    // The outside is bright, so leaks would show.
    model.sky = [1e6; 3];
    let tracer = model.tracer(None);
    let eye = DVec3::from_array(corner) + SMALL * DVec3::new(0.4, 0.45, 0.6);
    for direction in [DVec3::X, DVec3::new(-1.0, 0.9, 0.8), DVec3::new(0.1, -0.2, -1.0), DVec3::ONE]
    {
        expect(estimate(&tracer, eye, direction, 20_000), [2.0, 8.0, 3.0]);
    }
}

#[test]
fn a_lamp_of_millimetres_beside_hundreds_of_metres_lights_as_its_form_factor_says() {
    let [x, y, z] = [SITE - 1.0, SITE - 1.0, 5.0];
    let mut model = site();
    let table = model.material(Bsdf::Diffuse { kd: [0.8, 0.5, 0.2] }, [0.0; 3]);
    let lamp = model.material(BLACK, [3.0, 5.0, 7.0]);
    let top = [
        [x - 0.5, y - 0.5, z],
        [x + 0.5, y - 0.5, z],
        [x + 0.5, y + 0.5, z],
        [x - 0.5, y + 0.5, z],
    ];
    model.polygon(&top, table);
    let (half, above) = (SMALL / 2.0, z + SMALL);
    let square = [
        [x - half, y - half, above],
        [x - half, y + half, above],
        [x + half, y + half, above],
        [x + half, y - half, above],
    ];
    model.polygon(&square, lamp);
    let tracer = model.tracer(Some(0));
    let origin = tracer.raycaster().scene().origin;
    let lit = stored(&square, origin);
    let level = stored(&top, origin)[0][2];
    let expected = |point| {
        let factor = form_factor(&lit, point, DVec3::Z);
        [0.8 * 3.0, 0.5 * 5.0, 0.2 * 7.0].map(|light| light * factor)
    };
    // From the side, below the lamp's plane.
    let from = DVec3::new(0.003, -0.02, 0.002);
    for (dx, dy) in [(0.0013, -0.0007), (0.004, -0.002), (0.02, 0.01)] {
        let point = DVec3::new(x + dx, y + dy, level);
        expect(estimate(&tracer, point + from, -from, 20_000), expected(point));
    }
    // Points within 16 roundings of an edge (here the table's diagonal) are moved off it, by at
    // most 0.5 mm.
    let point = DVec3::new(x + 0.001, y + 0.001, level);
    let found = estimate(&tracer, point + from, -from, 20_000);
    let near = [(5e-4, 0.0), (-5e-4, 0.0), (0.0, 5e-4), (0.0, -5e-4)]
        .map(|(dx, dy)| expected(point + DVec3::new(dx, dy, 0.0)));
    for c in 0..3 {
        let (low, high) =
            near.iter().fold((f64::INFINITY, 0.0_f64), |(l, h), e| (l.min(e[c]), h.max(e[c])));
        let error = 4.5 * found.error[c];
        assert!(low - error < found.mean[c] && found.mean[c] < high + error, "{found:?} {near:?}");
    }
}

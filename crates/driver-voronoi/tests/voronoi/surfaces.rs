//! What is seen where: silhouettes, colours, mirrors, the sky.

use crate::common::{self, section, view};
use crate::stage::{Quad, SIZE, Stage, diffuse, error, even, plate, shadow, wall};
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, Material};
use holo_section::ViewClass;
use std::f64::consts::TAU;
use std::sync::Arc;

#[test]
fn a_silhouette_is_exact_from_few_samples_and_nothing_bleeds_over_it() {
    let stage = plate();
    let truth = stage.truth(even);
    let drawn = stage.draw(&stage.samples(even, 4000, common::clean));
    // Samples' colours are known to 1 in 256, and an edge pixel is the mean of 8 points: the share of a half plane by 8
    // rooks is wrong by 1/8 at the most, of a contrast of 0.65.
    let (most, _) = error(&drawn, &truth);
    assert!(most <= 0.65 / 8.0 + 0.004, "{most}");
    let away = |pixel: usize| {
        let truth = truth[pixel][1];
        (truth - 0.05).abs() < 1e-6 || (truth - 0.7).abs() < 1e-6
    };
    for (pixel, colour) in drawn.picture.pixels.iter().enumerate().filter(|&(pixel, _)| away(pixel))
    {
        // A step of RGBE, of the brightest channel: 1 in 256 of the power of two above it.
        assert!((colour[1] - truth[pixel][1]).abs() < 1.0 / 256.0, "{pixel}: {colour:?}");
    }
}

#[test]
fn two_colours_in_one_plane_do_not_mix() {
    let quads = [wall(8.0, [-8.0, -8.0], [2.3, 12.0], 0), wall(8.0, [2.3, -8.0], [12.0, 12.0], 1)];
    let stage = Stage::new(&quads, vec![diffuse([0.8, 0.8, 0.8]), diffuse([0.02, 0.02, 0.02])]);
    let drawn = stage.draw(&stage.samples(even, 4000, common::clean));
    let truth = stage.truth(even);
    for (pixel, colour) in drawn.picture.pixels.iter().enumerate() {
        let expected = truth[pixel][1];
        let pure = (expected - 0.8).abs() < 1e-6 || (expected - 0.02).abs() < 1e-6;
        // RGBE's step is 1 in 128 of the value; means are nearer.
        assert!(
            !pure || (colour[1] - expected).abs() < 0.008 * expected,
            "{pixel}: {colour:?} {expected}"
        );
    }
}

#[test]
fn a_mirror_shows_what_lies_before_it_with_its_edges() {
    // Behind the eye a wall of two colours; before it a mirror.
    let quads = [
        wall(8.0, [-8.0, -8.0], [12.0, 12.0], 0),
        wall(-2.0, [-30.0, -30.0], [1.9, 30.0], 1),
        wall(-2.0, [1.9, -30.0], [30.0, 30.0], 2),
    ];
    let mirror = Material { bsdf: Bsdf::Mirror { ks: [0.8; 3] }, ..Material::grey("mirror") };
    let stage = Stage::new(&quads, vec![mirror, diffuse([0.6; 3]), diffuse([0.1; 3])]);
    let drawn = stage.draw(&stage.samples(even, 20_000, common::clean));
    let truth = stage.truth(even);
    let seen = |value: f32| truth.iter().filter(|pixel| (pixel[1] - value).abs() < 1e-5).count();
    assert!(seen(0.48) > 500 && seen(0.08) > 500, "both are seen in the mirror");
    for (pixel, (colour, truth)) in drawn.picture.pixels.iter().zip(&truth).enumerate() {
        let pure = (truth[1] - 0.48).abs() < 1e-5 || (truth[1] - 0.08).abs() < 1e-5;
        assert!(
            !pure || (colour[1] - truth[1]).abs() < 0.008 * truth[1],
            "{pixel}: {colour:?} {truth:?}"
        );
    }
}

#[test]
fn a_curved_mirror_comes_to_show_what_its_own_samples_do() {
    // A column of more facets than there are images of, before the eye; behind that a wall in half shadow.
    let facets = 200;
    let corner = |number: u32| {
        let (sin, cos) = (f64::from(number % facets) / f64::from(facets) * TAU).sin_cos();
        [8.0 + 3.6 * cos, 2.03 + 3.6 * sin]
    };
    let facet = |number: u32| {
        let ([a, b], [c, d]) = (corner(number), corner(number + 1));
        ([[a, b, -8.0], [c, d, -8.0], [c, d, 12.0], [a, b, 12.0]], 0)
    };
    let side = |y: f64| ([[-2.0, y, -30.0], [12.0, y, -30.0], [12.0, y, 30.0], [-2.0, y, 30.0]], 1);
    let walls = [
        wall(12.0, [-8.0, -8.0], [12.0, 12.0], 1),
        wall(-2.0, [-8.0, -30.0], [12.0, 30.0], 2),
        side(-8.0),
        side(12.0),
    ];
    let quads: Vec<Quad> = (0..facets).map(facet).chain(walls).collect();
    let mirror = Material { bsdf: Bsdf::Mirror { ks: [0.8; 3] }, ..Material::grey("mirror") };
    let mut stage = Stage::new(&quads, vec![mirror, diffuse([0.3; 3]), diffuse([0.9; 3])]);
    // Rays that all pass near the eye.
    stage.section = section([0.3, 1.83, 1.81], [0.4; 3], [6; 3], ViewClass::Interior, true);
    let truth = stage.truth(shadow);
    let rms = |count: usize| {
        let drawn = stage.draw(&stage.samples(shadow, count, common::clean));
        let (mut sum, mut pixels) = (0.0, 0);
        for (pixel, (colour, truth)) in drawn.picture.pixels.iter().zip(&truth).enumerate() {
            // The column, without its sides, where it is narrow and reflects at grazing angles.
            if (16..48).contains(&(pixel as u32 % SIZE.0)) {
                sum += (colour[1] - truth[1]).powi(2);
                pixels += 1;
            }
        }
        (sum / pixels as f32).sqrt()
    };
    // What is guessed is wrong for most of it. Samples replace it where they are, then come closer together.
    let [none, few, many] = [0, 10_000, 300_000].map(rms);
    assert!(few < none && many < 0.5 * few, "{none} {few} {many}");
}

#[test]
fn what_meets_nothing_is_the_sky_exactly() {
    let mut stage = plate();
    let mut scene = (**stage.raycaster.scene()).clone();
    scene.sky = [0.25, 0.5, 1.0];
    stage.raycaster = Arc::new(Raycaster::build(Arc::new(scene)).unwrap());
    stage.view = view([0.5, 2.03, 2.01], [-8.0, 2.1, 2.05], 50.0, SIZE);
    let drawn = stage.draw(&stage.samples(even, 1000, common::clean));
    assert!(drawn.picture.pixels.iter().all(|pixel| *pixel == [0.25, 0.5, 1.0]));
    assert!(drawn.depth.iter().all(|&depth| depth == f32::INFINITY));
}

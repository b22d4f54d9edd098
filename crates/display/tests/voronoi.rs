//! What the geometry-guided driver promises, on small scenes whose light is known in closed form.

#![allow(clippy::unwrap_used, reason = "helpers beside the tests fail them in the same way")]

mod common;

use common::{Random, section, view};
use glam::DVec3;
use holo_display::{Drawn, Voronoi};
use holo_light::{Record, Store};
use holo_picture::View;
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, Material, Scene};
use holo_section::{BeamId, RayCoords, Sample, Section, ViewClass};
use proptest::prelude::*;
use std::sync::Arc;

const SIZE: (u32, u32) = (64, 48);

/// Walls of a scene: four corners and a material each.
type Quad = ([[f64; 3]; 4], usize);

fn diffuse(kd: [f32; 3]) -> Material {
    Material { bsdf: Bsdf::Diffuse { kd }, ..Material::grey("wall") }
}

fn raycaster(quads: &[Quad], materials: Vec<Material>) -> Arc<Raycaster> {
    let positions: Vec<DVec3> = quads.iter().flat_map(|(corners, _)| corners.map(DVec3::from_array)).collect();
    let triangles: Vec<[u32; 3]> =
        (0..quads.len() as u32).flat_map(|quad| [[0, 1, 2], [0, 2, 3]].map(|t| t.map(|k| 4 * quad + k))).collect();
    let ids: Vec<u32> = quads.iter().flat_map(|&(_, material)| [material as u32; 2]).collect();
    let (scene, _) = Scene::from_world(&positions, &triangles, &ids, materials, [0.0; 3]).unwrap();
    Arc::new(Raycaster::build(Arc::new(scene)).unwrap())
}

/// A wall across x at `at`, from `low` to `high` in y and z.
fn wall(at: f64, low: [f64; 2], high: [f64; 2], material: usize) -> Quad {
    ([[at, low[0], low[1]], [at, high[0], low[1]], [at, high[0], high[1]], [at, low[0], high[1]]], material)
}

/// Radiance of a point of a surface.
type Light = fn(DVec3, &Material) -> [f32; 3];

fn kd(material: &Material) -> [f32; 3] {
    match material.bsdf {
        Bsdf::Diffuse { kd } => kd,
        _ => [0.0; 3],
    }
}

/// Any rays of the section, all over, with the light that they meet. Mirrors show what they reflect.
fn samples(
    section: &Section,
    raycaster: &Raycaster,
    light: Light,
    count: usize,
    noise: common::Noise,
) -> Vec<(BeamId, Sample)> {
    let mut random = Random(7);
    (0..count)
        .filter_map(|_| {
            let beam = BeamId(random.bits() % section.beam_count());
            let coords = RayCoords((random.bits() as u32).to_le_bytes());
            let ray = section.ray(section.cells(beam)?, coords);
            let (distance, colour) = shine(raycaster, ray.origin, ray.direction, light)?;
            let factor = noise(&mut random);
            let rgb = colour.map(|channel| channel * factor);
            Some((beam, Sample::encode(coords, rgb, distance, section.diagonal(), random.bits() as u32)))
        })
        .collect()
}

/// Distance of what a ray meets, and its light.
fn shine(raycaster: &Raycaster, origin: DVec3, direction: DVec3, light: Light) -> Option<(f64, [f32; 3])> {
    let (ray, skipped) = raycaster.localize(origin, direction)?;
    let hit = raycaster.nearest(&ray)?;
    let material = raycaster.scene().material(hit.triangle);
    let distance = f64::from(hit.t) + skipped;
    let at = origin + direction * distance;
    let colour = match material.bsdf {
        Bsdf::Mirror { ks } => {
            let normal = raycaster.geometric_normal(hit.triangle).as_dvec3();
            let mirrored = direction - 2.0 * direction.dot(normal) * normal;
            let (_, colour) = shine(raycaster, at + mirrored * 1e-6, mirrored, light)?;
            [0, 1, 2].map(|channel| colour[channel] * ks[channel])
        }
        // A lobe about a direction of its own, as of a lamp far away.
        Bsdf::Conductor { .. } => {
            let towards = DVec3::new(0.95, 0.25, 0.1).normalize();
            let gleam = 0.1 + 0.8 * (-40.0 * (1.0 - direction.dot(towards))).exp() as f32;
            [gleam; 3]
        }
        _ => light(at, material),
    };
    Some((distance, colour))
}

struct Stage {
    section: Section,
    raycaster: Arc<Raycaster>,
    view: View,
}

impl Stage {
    fn new(quads: &[Quad], materials: Vec<Material>) -> Stage {
        Stage {
            section: section([0.0; 3], [4.0; 3], [6; 3], ViewClass::Interior, true),
            raycaster: raycaster(quads, materials),
            view: view([0.5, 2.03, 2.01], [8.0, 2.1, 2.05], 50.0, SIZE),
        }
    }

    fn empty(&self) -> Voronoi {
        Voronoi::new(Arc::from([self.section.clone()]), Arc::clone(&self.raycaster), self.view, SIZE)
    }

    fn draw(&self, samples: &[(BeamId, Sample)]) -> Drawn {
        let mut canvas = self.empty();
        samples.iter().for_each(|(beam, sample)| canvas.insert(0, *beam, 1, std::slice::from_ref(sample)));
        canvas.draw()
    }

    fn samples(&self, light: Light, count: usize, noise: common::Noise) -> Vec<(BeamId, Sample)> {
        samples(&self.section, &self.raycaster, light, count, noise)
    }

    /// Each pixel the mean of 16 × 16 rays.
    fn truth(&self, light: Light) -> Vec<[f32; 3]> {
        let side = 16;
        let pixel = |column: u32, row: u32| {
            let mut sum = [0.0_f64; 3];
            for part in 0..side * side {
                let x = f64::from(column) + (f64::from(part % side) + 0.5) / f64::from(side);
                let y = f64::from(row) + (f64::from(part / side) + 0.5) / f64::from(side);
                let (eye, along) = self.view.ray(x / f64::from(SIZE.0), 1.0 - y / f64::from(SIZE.1));
                let colour = shine(&self.raycaster, eye, along, light).map_or([0.0; 3], |(_, colour)| colour);
                (0..3).for_each(|channel| sum[channel] += f64::from(colour[channel]));
            }
            sum.map(|channel| (channel / f64::from(side * side)) as f32)
        };
        (0..SIZE.1).flat_map(|row| (0..SIZE.0).map(move |column| pixel(column, row))).collect()
    }
}

/// Largest and root mean square error of green.
fn error(drawn: &Drawn, truth: &[[f32; 3]]) -> (f32, f32) {
    let errors: Vec<f32> = drawn.frame.picture.pixels.iter().zip(truth).map(|(a, b)| (a[1] - b[1]).abs()).collect();
    let square: f32 = errors.iter().map(|error| error * error).sum();
    (errors.iter().fold(0.0, |most, error| error.max(most)), (square / errors.len() as f32).sqrt())
}

fn even(_: DVec3, material: &Material) -> [f32; 3] {
    kd(material)
}

/// A near plate before a far wall, both evenly lit.
fn plate() -> Stage {
    let quads = [wall(8.0, [-8.0, -8.0], [12.0, 12.0], 0), wall(5.0, [1.2, 1.4], [2.4, 3.1], 1)];
    Stage::new(&quads, vec![diffuse([0.2, 0.7, 0.2]), diffuse([0.1, 0.05, 0.6])])
}

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
    for (pixel, colour) in drawn.frame.picture.pixels.iter().enumerate().filter(|&(pixel, _)| away(pixel)) {
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
    for (pixel, colour) in drawn.frame.picture.pixels.iter().enumerate() {
        let expected = truth[pixel][1];
        let pure = (expected - 0.8).abs() < 1e-6 || (expected - 0.02).abs() < 1e-6;
        // RGBE's step is 1 in 128 of the value; means are nearer.
        assert!(!pure || (colour[1] - expected).abs() < 0.008 * expected, "{pixel}: {colour:?} {expected}");
    }
}

fn shadow(at: DVec3, material: &Material) -> [f32; 3] {
    kd(material).map(|channel| channel * if at.y + 0.3 * at.z > 2.7 { 1.0 } else { 0.25 })
}

#[test]
fn light_converges_to_the_mean_of_each_pixel_and_shadows_stay_sharp() {
    let stage = Stage::new(&[wall(8.0, [-8.0, -8.0], [12.0, 12.0], 0)], vec![diffuse([0.5; 3])]);
    let truth = stage.truth(shadow);
    let all = stage.samples(shadow, 1_200_000, common::exponential);
    let rms: Vec<f32> = [100, 10, 1].map(|part| error(&stage.draw(&all[..all.len() / part]), &truth).1).into();
    // Ten times the samples: of even light alone the error would fall to a third, of edges alone too.
    assert!(rms[1] < 0.7 * rms[0] && rms[2] < 0.7 * rms[1], "{rms:?}");
    // Samples on a pixel at the end, by the wall's share of all rays: the error is below that of the pixels' own means.
    let landed = stage.draw(&all).frame.samples_used as f32 / truth.len() as f32;
    assert!(landed > 20.0 && rms[2] < 0.5 / landed.sqrt(), "{landed} {rms:?}");
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
    for (pixel, (colour, truth)) in drawn.frame.picture.pixels.iter().zip(&truth).enumerate() {
        let pure = (truth[1] - 0.48).abs() < 1e-5 || (truth[1] - 0.08).abs() < 1e-5;
        assert!(!pure || (colour[1] - truth[1]).abs() < 0.008 * truth[1], "{pixel}: {colour:?} {truth:?}");
    }
}

#[test]
fn without_samples_surfaces_are_lit_from_the_eye_and_counted_and_lamps_shine() {
    let quads = [wall(8.0, [-8.0, -8.0], [12.0, 12.0], 0), wall(5.0, [1.2, 3.1], [2.4, 1.4], 1)];
    let lamp = Material { emission: [3.0, 2.0, 1.0], two_sided_emission: true, ..diffuse([0.0; 3]) };
    let stage = Stage::new(&quads, vec![diffuse([0.5; 3]), lamp]);
    let drawn = stage.empty().draw();
    let shining = drawn.frame.picture.pixels.iter().filter(|pixel| **pixel == [3.0, 2.0, 1.0]).count();
    assert!(shining > 50, "{shining}");
    assert!(drawn.frame.picture.pixels.iter().all(|pixel| pixel[1] > 0.0), "nothing is black");
    assert_eq!(drawn.frame.empty_pixels, u64::from(SIZE.0 * SIZE.1));
    let middles = drawn.frame.depth.iter().filter(|&&depth| depth > 6.0).count();
    assert_eq!(drawn.guessed_pixels, middles as u64, "a lamp's light is no guess");
    assert!(drawn.guessed_pixels > 2000);
    let known = stage.draw(&stage.samples(even, 4000, common::clean));
    assert_eq!(known.guessed_pixels, 0);
}

/// A record of even light at a point of the wall at x = 8.
fn record(y: f32, z: f32, irradiance: f32, scene: &Scene) -> Record {
    let point = DVec3::new(8.0, f64::from(y), f64::from(z)) - scene.origin;
    Record {
        point: point.as_vec3().to_array(),
        radius: 3.0,
        normal: [-1.0, 0.0, 0.0],
        nearest: 2.0,
        irradiance: [irradiance; 3],
        error: 0.0,
        shift: [[0.0; 3]; 3],
        turn: [[0.0; 3]; 3],
        rays: 1,
        flags: 0,
        id: u64::from(y.to_bits()) << 32 | u64::from(z.to_bits()),
    }
}

#[test]
fn records_of_indirect_light_light_what_has_no_samples_and_nothing_that_they_do_not_see() {
    let stage = plate();
    let records = Store::new(0.01);
    let even = std::f32::consts::PI * 0.5;
    for y in -4..=8 {
        (-4..=8).for_each(|z| assert!(records.insert(record(y as f32, z as f32, even, stage.raycaster.scene()))));
    }
    let records = Arc::new(records);
    let drawn = stage.empty().with_records(Arc::clone(&records)).draw();
    let (mut wall, mut plate) = (0, 0);
    for (pixel, depth) in drawn.frame.picture.pixels.iter().zip(&drawn.frame.depth) {
        if *depth > 6.0 {
            wall += 1;
            // Half the light of the records: radiance is albedo times irradiance over π. Edges are mixtures.
            assert!((pixel[1] - 0.35).abs() < 1e-4 || pixel[1] < 0.35, "{pixel:?}");
        } else {
            plate += 1;
        }
    }
    assert!(wall > 1500 && plate > 300, "{wall} {plate}");
    assert_eq!(drawn.guessed_pixels, plate, "no record lies on the plate");
    let exact = drawn.frame.picture.pixels.iter().filter(|pixel| (pixel[1] - 0.35).abs() < 1e-4).count();
    assert!(exact > 1300, "{exact}");
    // Where there are samples they alone decide.
    let samples = stage.samples(bright, 20_000, common::clean);
    let mut canvas = stage.empty().with_records(records);
    samples.iter().for_each(|(beam, sample)| canvas.insert(0, *beam, 1, std::slice::from_ref(sample)));
    assert_eq!(bits(&canvas.draw()), bits(&stage.draw(&samples)));
}

/// Half of the light is indirect; a lamp's is its own.
fn lamp_or_lit(_: DVec3, material: &Material) -> [f32; 3] {
    if material.emits() { material.emission } else { kd(material).map(|channel| 0.75 * channel) }
}

#[test]
fn a_material_without_samples_gets_the_direct_light_of_surfaces_and_not_that_of_lamps() {
    // Side by side: a material of which no sample comes, one with samples, and a lamp.
    let strip = |low: f64, high: f64, material| wall(8.0, [low, -8.0], [high, 12.0], material);
    let quads = [strip(-8.0, 1.0, 0), strip(1.0, 3.0, 1), strip(3.0, 12.0, 2)];
    let lamp = Material { emission: [50.0; 3], ..Material::grey("lamp") };
    let stage = Stage::new(&quads, vec![diffuse([0.2, 0.4, 0.8]), diffuse([0.5; 3]), lamp]);
    let records = Store::new(0.01);
    let half = std::f32::consts::PI * 0.5;
    for y in -4..=8 {
        (-4..=8).for_each(|z| assert!(records.insert(record(y as f32, z as f32, half, stage.raycaster.scene()))));
    }
    let samples = stage.samples(lamp_or_lit, 20_000, common::clean);
    let mut canvas = stage.empty().with_records(Arc::new(records));
    let grey = samples.iter().filter(|(_, sample)| sample.rgb()[2] < 1.5 * sample.rgb()[0]);
    grey.for_each(|(beam, sample)| canvas.insert(0, *beam, 1, std::slice::from_ref(sample)));
    let pixels = canvas.draw().frame.picture.pixels;
    // Indirect light by the records, direct light as on the other: 1 % for the samples' codes.
    let lit = (44..64).flat_map(|column| (0..48).map(move |row| row * 64 + column)).map(|pixel: usize| pixels[pixel]);
    for pixel in lit {
        assert!((0..3).all(|channel| (pixel[channel] / [0.15, 0.3, 0.6][channel] - 1.0).abs() < 0.01), "{pixel:?}");
    }
}

fn bright(_: DVec3, material: &Material) -> [f32; 3] {
    kd(material).map(|channel| 3.0 * channel)
}

/// Rays of the section that pass near the eye, as a session's own samples do.
fn own_samples(stage: &Stage, light: Light, count: usize) -> Vec<(BeamId, Sample)> {
    let mut random = Random(11);
    let mut number = || random.unit();
    let mut found = Vec::new();
    while found.len() < count {
        let (eye, along) = stage.view.ray(number(), number());
        let near = eye + DVec3::new(number() - 0.5, number() - 0.5, number() - 0.5) * 0.01;
        let Some(line) = stage.section.line(near, along) else { continue };
        let bits = (number() * f64::from(u32::MAX)) as u32;
        let at = line.coords;
        let ray = stage.section.ray(line.pair, at);
        let Some((distance, colour)) = shine(&stage.raycaster, ray.origin, ray.direction, light) else { continue };
        let sample = Sample::encode(at, colour, distance, stage.section.diagonal(), bits);
        found.push((stage.section.beam(line.pair), sample));
    }
    found
}

#[test]
fn light_that_depends_on_the_direction_converges_to_that_of_the_eyes_rays() {
    let metal = Material { bsdf: Bsdf::Conductor { ks: [0.8; 3], alpha: 0.3 }, ..Material::grey("metal") };
    let stage = Stage::new(&[wall(8.0, [-8.0, -8.0], [12.0, 12.0], 0)], vec![metal]);
    let truth = stage.truth(even);
    let elsewhere = stage.samples(even, 60_000, common::clean);
    let own = own_samples(&stage, even, 60_000);
    let rms = |count: usize| {
        let all: Vec<_> = elsewhere.iter().chain(&own[..count]).copied().collect();
        error(&stage.draw(&all), &truth).1
    };
    let found = [rms(0), rms(2000), rms(60_000)];
    assert!(found[1] < 0.7 * found[0] && found[2] < 0.5 * found[1], "{found:?}");
    // Of a lobe from 0.1 to 0.9.
    assert!(found[2] < 0.01, "{found:?}");
}

#[test]
fn what_meets_nothing_is_the_sky_exactly() {
    let mut stage = plate();
    let mut scene = (**stage.raycaster.scene()).clone();
    scene.sky = [0.25, 0.5, 1.0];
    stage.raycaster = Arc::new(Raycaster::build(Arc::new(scene)).unwrap());
    stage.view = view([0.5, 2.03, 2.01], [-8.0, 2.1, 2.05], 50.0, SIZE);
    let drawn = stage.draw(&stage.samples(even, 1000, common::clean));
    assert!(drawn.frame.picture.pixels.iter().all(|pixel| *pixel == [0.25, 0.5, 1.0]));
    assert!(drawn.frame.depth.iter().all(|&depth| depth == f32::INFINITY));
}

#[test]
fn beams_of_what_is_seen_are_in_order_and_hold_the_samples_that_serve() {
    let stage = plate();
    let canvas = stage.empty();
    let beams = canvas.surface_beams();
    assert!(beams.is_sorted() && beams.windows(2).all(|pair| pair[0] != pair[1]));
    let all = stage.samples(even, 60_000, common::clean);
    let (chosen, others): (Vec<_>, Vec<_>) = all.into_iter().partition(|(beam, _)| beams.contains(&(0, *beam)));
    let used = |samples: &[(BeamId, Sample)]| stage.draw(samples).frame.samples_used;
    let (inside, outside) = (used(&chosen), used(&others));
    assert!(inside > 2000 && outside * 20 < inside, "{inside} {outside}");
    // Of those, the best hold more for each beam.
    let best = canvas.best_surface_beams();
    assert!(best.is_sorted() && best.len() < beams.len() && best.iter().all(|beam| beams.contains(beam)));
    let held: Vec<_> = chosen.iter().filter(|(beam, _)| best.contains(&(0, *beam))).copied().collect();
    let per_beam = |used: u64, beams: usize| used as f64 / beams as f64;
    assert!(per_beam(used(&held), best.len()) > per_beam(inside, beams.len()));
}

#[test]
fn what_is_seen_through_a_portal_is_drawn_by_its_samples_and_all_else_is_as_without() {
    // A wall with a doorway, and the room behind it, of which the stand-in has nothing.
    let front = [wall(2.5, [0.0, 0.0], [1.4, 4.0], 0), wall(2.5, [2.6, 0.0], [4.0, 4.0], 0)];
    let all: Vec<Quad> = front.into_iter().chain([wall(3.9, [0.0, 0.0], [4.0, 4.0], 1)]).collect();
    let materials = || vec![diffuse([0.8; 3]), diffuse([0.3, 0.5, 0.7])];
    let (full, standing) = (Stage::new(&all, materials()), Stage::new(&front, materials()));
    let portal = raycaster(&[wall(2.5, [1.4, 0.0], [2.6, 4.0], 0)], materials());
    let samples = full.samples(even, 60_000, common::clean);
    let draw = |raycaster: &Arc<Raycaster>, portals: Option<&Arc<Raycaster>>| {
        let sections = Arc::from([full.section.clone()]);
        let mut canvas =
            Voronoi::through_portals(sections, Arc::clone(raycaster), portals.map(Arc::clone), full.view, SIZE);
        samples.iter().for_each(|(beam, sample)| canvas.insert(0, *beam, 1, std::slice::from_ref(sample)));
        canvas.draw().frame
    };
    let (through, blind) = (draw(&standing.raycaster, Some(&portal)), draw(&standing.raycaster, None));
    let truth = full.truth(even);
    let (mut seen, mut other) = (0, 0);
    for (pixel, truth) in truth.iter().enumerate() {
        let (x, y) = (pixel as u32 % SIZE.0, pixel as u32 / SIZE.0);
        // Where a ray through the doorway's plane passes, in units of its width; next to its sides pixels are mixed.
        let (eye, along) = full.view.ray((f64::from(x) + 0.5) / 64.0, 1.0 - (f64::from(y) + 0.5) / 48.0);
        let across = (eye + along * ((2.5 - eye.x) / along.x)).y;
        let off = ((across - 1.4).abs()).min((across - 2.6).abs());
        if off < 0.1 {
            continue;
        }
        let (drawn, without) = (through.picture.pixels[pixel], blind.picture.pixels[pixel]);
        if (1.4..2.6).contains(&across) {
            seen += 1;
            assert_eq!(without, [0.0; 3], "{x} {y}");
            // RGBE's dither is 0.4 % of the largest channel.
            let near = (0..3).all(|channel| (drawn[channel] - truth[channel]).abs() < 0.01 * truth[2]);
            assert!(near, "{x} {y}: {drawn:?}, {truth:?}");
        } else {
            other += 1;
            assert_eq!(drawn, without, "{x} {y}");
        }
    }
    assert!(seen > 500 && other > 500, "{seen} {other}");
    // A portal that stands behind a wall hides nothing.
    let hidden = raycaster(&[wall(3.0, [3.0, 0.0], [4.0, 4.0], 0)], materials());
    assert!(draw(&standing.raycaster, Some(&hidden)).picture.pixels == blind.picture.pixels);
}

#[test]
fn a_picture_drawn_between_samples_changes_no_bit_of_the_next_one() {
    let stage = plate();
    let all = stage.samples(even, 20_000, common::exponential);
    let mut canvas = stage.empty();
    for (number, (beam, sample)) in all.iter().enumerate() {
        canvas.insert(0, *beam, 1, std::slice::from_ref(sample));
        if number % 7_000 == 0 {
            let first = canvas.draw();
            assert_eq!(bits(&first), bits(&canvas.draw()), "the same samples give the same picture");
        }
    }
    assert_eq!(bits(&canvas.draw()), bits(&stage.draw(&all)));
}

#[test]
fn a_picture_of_many_blocks_that_is_mended_where_samples_come_is_the_same_as_one_made_anew() {
    // A shadow's edge, noise, and a plate that hides some of the wall: tents of all widths, and blocks far from all that is new.
    let stage = plate();
    let size = (300, 220);
    let view = view([0.5, 2.03, 2.01], [8.0, 2.1, 2.05], 50.0, size);
    let empty = || Voronoi::new(Arc::from([stage.section.clone()]), Arc::clone(&stage.raycaster), view, size);
    let mut all = stage.samples(shadow, 60_000, common::exponential);
    let (mut mended, mut anew) = (empty(), empty());
    // Beam after beam, so that what comes between two pictures lies in a part of it.
    let third = all.len() / 3;
    all[third..].sort_by_key(|(beam, _)| *beam);
    for part in all.chunks(4_000) {
        for canvas in [&mut mended, &mut anew] {
            part.iter().for_each(|(beam, sample)| canvas.insert(0, *beam, 1, std::slice::from_ref(sample)));
        }
        assert!(mended.draw().frame.samples_used > 0);
    }
    let (mended, anew) = (mended.draw(), anew.draw());
    assert_eq!(bits(&mended), bits(&anew));
    assert_eq!(mended.frame.empty_pixels, anew.frame.empty_pixels);
    assert_eq!(mended.guessed_pixels, anew.guessed_pixels);
}

fn bits(drawn: &Drawn) -> Vec<[u32; 3]> {
    drawn.frame.picture.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

/// Any ten bytes as a sample of any beam: all exponents, all distances.
fn any_samples() -> impl Strategy<Value = Vec<(u64, u16, Sample)>> {
    let sample = (any::<[u8; 4]>(), any::<[u8; 4]>(), any::<u16>(), any::<bool>()).prop_map(
        |(coords, mut rgbe, code, ordinary)| {
            if ordinary {
                rgbe[3] = 120 + rgbe[3] % 16;
            }
            Sample::from_codes(RayCoords(coords), rgbe, if ordinary { code % 4096 } else { code })
        },
    );
    prop::collection::vec((any::<u64>(), any::<u16>(), sample), 1..400)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn any_samples_give_a_finite_picture_and_their_order_changes_no_bit(
        wild in any_samples(), seed in any::<u64>(), size in (1..40_u32, 1..40_u32),
    ) {
        let mut stage = plate();
        stage.view = View::new(DVec3::new(0.5, 2.0, 2.0), DVec3::X, DVec3::Z, Some(70.0), Some(60.0), size).unwrap();
        let real = stage.samples(even, 2000, common::one_path).into_iter().map(|(beam, sample)| (beam.0, 1, sample));
        let count = stage.section.beam_count();
        let mut samples: Vec<_> = wild.into_iter().map(|(beam, paths, sample)| (beam % count, paths, sample)).chain(real).collect();
        let draw = |samples: &[(u64, u16, Sample)]| {
            let mut canvas =
                Voronoi::new(Arc::from([stage.section.clone()]), Arc::clone(&stage.raycaster), stage.view, size);
            for (beam, paths, sample) in samples {
                canvas.insert(0, BeamId(*beam), *paths, std::slice::from_ref(sample));
            }
            canvas.draw()
        };
        let first = draw(&samples);
        prop_assert!(first.frame.picture.pixels.as_flattened().iter().all(|x| x.is_finite() && *x >= 0.0));
        let mut random = Random(seed);
        for last in (1..samples.len()).rev() {
            samples.swap(last, (random.bits() % (last as u64 + 1)) as usize);
        }
        prop_assert_eq!(bits(&first), bits(&draw(&samples)));
    }
}

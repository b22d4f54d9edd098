//! Tests that images of lamps are chosen with the stated density, and bring the light that mirrors
//! and panes reflect.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use holo_raycast::{Hit, Ray, Raycaster};
use holo_scene::{Bsdf, Material, Scene};

use crate::engine::PathEngine;
use crate::images::Images;
use crate::mirrors::Mirrors;
use crate::sampler::{Purpose, Sampler};
use crate::weighting::Direct;

/// A floor at z = 0 on which a mirror (x = 2) and a pane (y = 2) stand. Above it are `lamps` lamps
/// of two triangles each, at heights of 1 to 2, facing all sides.
fn room(lamps: usize) -> Arc<Raycaster> {
    let (mut positions, mut triangles, mut ids) = (Vec::new(), Vec::new(), Vec::new());
    let mut quad = |corners: [DVec3; 4], id: u32| {
        let base = positions.len() as u32;
        positions.extend(corners);
        triangles.extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
        ids.extend([id, id]);
    };
    let at = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    quad([at(-4.0, -4.0, 0.0), at(4.0, -4.0, 0.0), at(4.0, 4.0, 0.0), at(-4.0, 4.0, 0.0)], 0);
    quad([at(2.0, -1.0, 0.0), at(2.0, 1.0, 0.0), at(2.0, 1.0, 2.0), at(2.0, -1.0, 2.0)], 1);
    quad([at(-1.0, 2.0, 0.0), at(1.0, 2.0, 0.0), at(1.0, 2.0, 2.0), at(-1.0, 2.0, 2.0)], 2);
    let mut s = Sampler::new(5, 0);
    for _ in 0..lamps {
        let mut signed = || f64::from(s.one()) * 2.0 - 1.0;
        let (middle, u) = (
            at(1.5 * signed(), 1.5 * signed(), 1.5 + 0.5 * signed()),
            at(signed(), signed(), signed()),
        );
        let u = 0.3 * u.normalize();
        let v = u.normalize().any_orthonormal_vector() * 0.15;
        quad([middle - u - v, middle + u - v, middle + u + v, middle - u + v], 3);
    }
    let material =
        |bsdf, emission| Material { name: "m".into(), bsdf, emission, two_sided_emission: false };
    let black = Bsdf::Diffuse { kd: [0.0; 3] };
    let materials = vec![
        material(black, [0.0; 3]),
        material(Bsdf::Mirror { ks: [0.9, 0.7, 0.5] }, [0.0; 3]),
        material(Bsdf::ThinGlass { ior: 1.5, transmittance: [0.8; 3] }, [0.0; 3]),
        material(black, [10.0, 20.0, 30.0]),
    ];
    let (scene, _) = Scene::from_world(&positions, &triangles, &ids, materials, [0.0; 3])
        .expect("a valid scene");
    Arc::new(Raycaster::build(Arc::new(scene)).expect("built"))
}

/// Returns a point of the floor and its normal.
fn place(raycaster: &Raycaster, x: f64, y: f64) -> (holo_raycast::SurfacePoint, Vec3) {
    let from = (DVec3::new(x, y, 1e-3) - raycaster.scene().origin).as_vec3();
    let hit = raycaster.nearest(&Ray::new(from, -Vec3::Z)).expect("the floor");
    (raycaster.surface(hit.triangle, hit.u, hit.v), Vec3::Z)
}

#[test]
fn images_are_chosen_with_the_density_that_they_are_weighted_with() {
    for lamps in [1, 40, 400] {
        let raycaster = room(lamps);
        let engine = PathEngine::new(&raycaster, None, Direct::Both, 1);
        let mirrors = Mirrors::find(raycaster.scene(), &engine.surfaces);
        assert_eq!(mirrors.planes.len(), 2);
        let (point, normal) = place(&raycaster, 0.3, -0.4);
        let Some(images) = Images::visible_from(
            &raycaster,
            &engine.lights,
            &engine.panes,
            &mirrors,
            [point.point, normal],
        ) else {
            assert_eq!(lamps, 1);
            continue;
        };
        let mut chosen = 0;
        for number in 0..2000 {
            let mut sampler = Sampler::new(9, number);
            sampler.turn(0, Purpose::Image);
            let (first, second) = sampler.pairs(1).at(0);
            let Some(image) = images.choose(first, second) else { continue };
            chosen += 1;
            let [u, v] = image.barycentrics;
            let met = Hit { t: 1.0, triangle: image.triangle, u, v };
            let cosine = image.towards.normalize().dot(image.normal).abs();
            let again = images.density(image.plane, &met, cosine);
            // Both are computed in f32, in different ways.
            assert!(
                (again / image.density - 1.0).abs() < 1e-3,
                "{lamps} lamps: {again} and {}",
                image.density
            );
        }
        assert!(chosen > 100, "{lamps} lamps: {chosen}");
    }
}

#[test]
fn images_bring_the_light_that_hemisphere_rays_find_by_one_reflection() {
    let raycaster = room(40);
    let engine = PathEngine::new(&raycaster, None, Direct::Both, 1);
    let mirrors = Mirrors::find(raycaster.scene(), &engine.surfaces);
    for (number, (x, y)) in [(0.3, -0.4), (-1.0, 1.2), (1.2, 1.5)].into_iter().enumerate() {
        let (point, normal) = place(&raycaster, x, y);
        let images = Images::visible_from(
            &raycaster,
            &engine.lights,
            &engine.panes,
            &mirrors,
            [point.point, normal],
        );
        let images = images.expect("the mirror shows lamps");
        let aimed = statistics(40_000, |sampler| {
            let (first, second) = sampler.pairs(1).at(0);
            let Some(image) = images.choose(first, second) else { return 0.0 };
            let cosine = image.towards.normalize().dot(normal).max(0.0);
            f64::from(images.arriving(&point, &image).y * cosine / image.density)
        });
        // Directions are uniform over the hemisphere; the lamps' emission counts as 1.
        let by_chance = statistics(2_000_000, |sampler| {
            let [a, b] = sampler.two();
            let (z, angle) = (a, 2.0 * std::f32::consts::PI * b);
            let r = (1.0 - z * z).max(0.0).sqrt();
            let direction = Vec3::new(r * angle.cos(), r * angle.sin(), z);
            2.0 * PI * f64::from(z * by_one_mirror(&raycaster, &engine, &mirrors, point, direction))
        });
        let [(a, va), (b, vb)] = [aimed, by_chance];
        // Three comparisons at 4.5 sigma: by chance once in 50,000 sets of seeds.
        assert!(
            (a - b).abs() <= 4.5 * (va + vb).sqrt(),
            "place {number}: {a} and {b}, +- {}",
            (va + vb).sqrt()
        );
        assert!(b > 20.0 * vb.sqrt(), "place {number}: {b} +- {}", vb.sqrt());
    }
}

/// Returns the mean of a function of random numbers, and the variance of that mean.
fn statistics(count: u64, of: impl Fn(&mut Sampler) -> f64) -> (f64, f64) {
    let (mut sum, mut squares) = (0.0, 0.0);
    for number in 0..count {
        let mut sampler = Sampler::new(11, number);
        sampler.turn(0, Purpose::Image);
        let value = of(&mut sampler);
        sum += value;
        squares += value * value;
    }
    let n = count as f64;
    (sum / n, (squares / n - (sum / n).powi(2)).max(0.0) / n)
}

/// Returns the green channel of light that arrives from lamps by one reflection, through any panes
/// before and after it.
fn by_one_mirror(
    raycaster: &Raycaster,
    engine: &PathEngine,
    mirrors: &Mirrors,
    mut from: holo_raycast::SurfacePoint,
    mut direction: Vec3,
) -> f32 {
    // The surfaces reached by going straight on, and by the reflection: a pane offers both.
    let mut arriving = 0.0;
    let mut share = 1.0;
    for _ in 0..8 {
        let Some(hit) = raycaster.nearest_from(&ray(from, direction), from.triangle) else { break };
        from = raycaster.surface(hit.triangle, hit.u, hit.v);
        let Some(&(plane, face)) = mirrors.faces.get(&hit.triangle) else { break };
        let reflectance = face.reflectance(direction.dot(from.normal)).y;
        let reflected = mirrors.planes[usize::from(plane)].reflect_direction(direction);
        arriving += share * reflectance * straight(raycaster, engine, mirrors, from, reflected);
        if !matches!(face, crate::mirrors::Face::Pane(_)) {
            break;
        }
        share *= 0.8 * (1.0 - reflectance);
        direction = direction.normalize();
    }
    arriving
}

/// Returns the light that arrives straight from lamps, through any panes.
fn straight(
    raycaster: &Raycaster,
    engine: &PathEngine,
    mirrors: &Mirrors,
    mut from: holo_raycast::SurfacePoint,
    direction: Vec3,
) -> f32 {
    let mut share = 1.0;
    for _ in 0..8 {
        let Some(hit) = raycaster.nearest_from(&ray(from, direction), from.triangle) else { break };
        from = raycaster.surface(hit.triangle, hit.u, hit.v);
        let surface = &engine.surfaces[raycaster.scene().material_id(hit.triangle) as usize];
        if surface.emits {
            return if direction.dot(from.normal) < 0.0 { share } else { 0.0 };
        }
        match mirrors.faces.get(&hit.triangle) {
            Some((_, face @ crate::mirrors::Face::Pane(_))) => {
                share *= 0.8 * (1.0 - face.reflectance(direction.dot(from.normal)).y);
            }
            _ => break,
        }
    }
    0.0
}

fn ray(from: holo_raycast::SurfacePoint, direction: Vec3) -> Ray {
    Ray::new(holo_raycast::spawn(from.point, from.error, from.normal, direction), direction)
}

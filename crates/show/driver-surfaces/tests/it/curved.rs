//! Curved mirrors and solid glass: a picture shows what the tracer's rays meet.

#![allow(clippy::unwrap_used, missing_docs)]

use crate::common::seen_by;
use glam::DVec3;
use holo_picture::View as Eye;
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, Material, Scene, Shading, to_octahedral};
use holo_tracer::{Settings, Tracer};
use std::sync::Arc;

const SIDE: usize = 64;

/// A box of 8 × 8 × 8 whose six walls glow, each in another light, around a ball of radius 1 in the
/// origin, of 12 × 6 patches with smooth normals.
pub fn glowing_box(ball: Bsdf) -> Arc<Raycaster> {
    let around = 12;
    let at = |i: usize, j: usize| {
        let (turn, down) = (i as f64 * 2.0, j as f64 * 2.0);
        let (turn, down) = [turn, down].map(|angle| angle * std::f64::consts::PI / 12.0).into();
        DVec3::new(f64::sin(down) * f64::cos(turn), f64::sin(down) * f64::sin(turn), f64::cos(down))
    };
    let (mut positions, mut triangles, mut ids) = (Vec::new(), Vec::new(), Vec::new());
    for (i, j) in (0..around).flat_map(|i| (0..around / 2).map(move |j| (i, j))) {
        let first = positions.len() as u32;
        positions.extend([at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)]);
        // Patches at the poles are triangles.
        let halves = [[first, first + 1, first + 2], [first, first + 2, first + 3]];
        let halves = halves[usize::from(j + 1 == around / 2)..].iter().take(1 + usize::from(j > 0));
        for half in halves {
            triangles.push(*half);
            ids.push(0);
        }
    }
    let normals: Vec<_> = triangles
        .iter()
        .map(|triangle| triangle.map(|c| to_octahedral(positions[c as usize].as_vec3())))
        .collect();
    let mut named = vec![Material { bsdf: ball, ..Material::grey("ball") }];
    for wall in 0..6u32 {
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        let sign = if wall % 2 == 0 { 4.0 } else { -4.0 };
        let (out, a, b) = (wall / 2, (wall / 2 + 1) % 3, (wall / 2 + 2) % 3);
        let [out, a, b] = [out, a, b].map(|axis| axes[axis as usize]);
        let first = positions.len() as u32;
        positions.extend(
            [(-4.0, -4.0), (4.0, -4.0), (4.0, 4.0), (-4.0, 4.0)]
                .map(|(x, y)| sign * out + x * a + y * b),
        );
        triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        ids.extend([wall + 1; 2]);
        let emission = [0.2 + 0.3 * wall as f32, 1.0, 2.0 - 0.3 * wall as f32];
        let black = Bsdf::Diffuse { kd: [0.0; 3] };
        named.push(Material {
            bsdf: black,
            emission,
            two_sided_emission: true,
            ..Material::grey(format!("wall {wall}"))
        });
    }
    let (scene, _) = Scene::from_world(&positions, &triangles, &ids, named, [0.0; 3]).unwrap();
    let mut all = normals;
    all.extend(
        scene
            .triangles()
            .skip(all.len())
            .map(|triangle| [to_octahedral(scene.normal(triangle)); 3]),
    );
    let scene = scene.with_shading(Shading { normals: all.into(), ..Shading::default() }).unwrap();
    Arc::new(Raycaster::build(Arc::new(scene)).unwrap())
}

fn eye() -> Eye {
    let (at, ahead) = (DVec3::new(0.4, -3.0, 0.7), DVec3::new(-0.13, 1.0, -0.24));
    Eye::new(at, ahead, DVec3::Z, Some(60.0), None, (SIDE as u32, SIDE as u32)).unwrap()
}

/// Returns for each pixel on the ball what is drawn, and the mean of `paths` traced paths through
/// its middle. Edges of reflections, where pixels are means of several things, are left out.
fn compared(ball: Bsdf, paths: u64) -> Vec<([f32; 3], [f32; 3])> {
    let room = glowing_box(ball);
    let tracer = Tracer::with_raycaster(room.clone(), Settings::default()).unwrap();
    let (_, drawn) = seen_by(&room, &[], &eye());
    let mut pairs = Vec::new();
    for pixel in 0..SIDE * SIDE {
        let (x, y) = ((pixel % SIDE) as f64 + 0.5, (pixel / SIDE) as f64 + 0.5);
        let (origin, direction) = eye().ray(x / SIDE as f64, 1.0 - y / SIDE as f64);
        let towards = origin.dot(direction);
        if towards * towards - origin.length_squared() + 0.9 < 0.0 {
            continue;
        }
        let mut mean = [0.0; 3];
        for seed in 0..paths {
            let traced = tracer.trace(origin, direction, seed * 7919 + pixel as u64).radiance;
            mean.iter_mut().zip(traced).for_each(|(mean, c)| *mean += c / paths as f32);
        }
        pairs.push((drawn.pixels[pixel], mean));
    }
    pairs
}

#[test]
fn a_curved_mirror_shows_what_its_smooth_normals_reflect() {
    let pairs = compared(Bsdf::Mirror { ks: [0.9, 0.8, 0.7] }, 1);
    assert!(pairs.len() > 500, "{}", pairs.len());
    let agrees = |(drawn, traced): &&([f32; 3], [f32; 3])| {
        drawn.iter().zip(traced).all(|(drawn, traced)| (drawn - traced).abs() < 1e-3)
    };
    let right = pairs.iter().filter(agrees).count();
    assert!(100 * right > 97 * pairs.len(), "{right} of {}", pairs.len());
}

#[test]
fn solid_glass_shows_what_it_refracts_and_what_it_mirrors_first() {
    for (ior, transmittance) in [(1.5, [1.0; 3]), (1.33, [0.9, 0.8, 0.95])] {
        let pairs = compared(Bsdf::Dielectric { ior, transmittance, alpha: 0.0 }, 64);
        let mut away: Vec<f32> = pairs
            .iter()
            .flat_map(|(drawn, traced)| {
                drawn.iter().zip(traced).map(|(drawn, traced)| (drawn - traced).abs() / traced)
            })
            .collect();
        away.sort_by(f32::total_cmp);
        let [half, most] = [away.len() / 2, away.len() * 9 / 10].map(|rank| away[rank]);
        // A tenth of the light is reflected inside the ball, and 64 paths have noise.
        assert!(half < 0.05 && most < 0.2, "{half} {most} {ior}");
        let sum = |of: fn(&([f32; 3], [f32; 3])) -> f32| pairs.iter().map(of).sum::<f32>();
        let ratio = sum(|pair| pair.0[1]) / sum(|pair| pair.1[1]);
        assert!((ratio - 1.0).abs() < 0.02, "{ratio} {ior}");
    }
}

#[test]
fn glass_in_even_light_is_as_bright_as_the_light() {
    let (positions, triangles) = box_of_glass();
    let glass = Bsdf::Dielectric { ior: 1.5, transmittance: [1.0; 3], alpha: 0.0 };
    let named = vec![Material { bsdf: glass, ..Material::grey("glass") }];
    let ids = vec![0; triangles.len()];
    let (scene, _) = Scene::from_world(&positions, &triangles, &ids, named, [0.7; 3]).unwrap();
    let room = Arc::new(Raycaster::build(Arc::new(scene)).unwrap());
    let (_, drawn) = seen_by(&room, &[], &eye());
    let even = |pixel: &&[f32; 3]| (pixel[1] - 0.7).abs() < 1e-3;
    let right = drawn.pixels.iter().filter(even).count();
    // A few rays are reflected inside more often than they are followed.
    assert!(100 * right > 99 * drawn.pixels.len(), "{right}");
}

/// A box of glass, turned against the axes.
fn box_of_glass() -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 0.5, 0.7);
    let corner = |n: u32| {
        let bit = |b: u32| if n >> b & 1 == 1 { 0.8 } else { -0.8 };
        turn * DVec3::new(bit(0), bit(1), bit(2))
    };
    let faces =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let halves = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
    ((0..8).map(corner).collect(), halves.collect())
}

//! Tests that cached reflections are the traced ones, but for the width of texels.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use glam::DVec3;
use holo_optics::reflect;
use holo_raycast::{Ray, Raycaster, spawn};
use holo_reflection_cube::CubeGrid;
use holo_scene::{Bsdf, Material, Scene, ShinyObjects};

use crate::{ReflectionReport, ReflectionSettings, Settings, Tracer};

/// A closed box of half side 2 whose walls shine differently, with a shape of this material inside.
fn scene(shape: &[[DVec3; 3]], bsdf: Bsdf) -> Arc<Scene> {
    let mut positions = Vec::new();
    let mut ids = Vec::new();
    let mut materials = vec![Material { bsdf, ..Material::grey("shape") }];
    for wall in 0..6 {
        let axis = wall / 2;
        let side = if wall % 2 == 0 { 2.0 } else { -2.0 };
        let corner = |u: f64, v: f64| {
            let mut point = DVec3::splat(side);
            (point[(axis + 1) % 3], point[(axis + 2) % 3]) = (u, v);
            point
        };
        let quad = [corner(-2.0, -2.0), corner(2.0, -2.0), corner(2.0, 2.0), corner(-2.0, 2.0)];
        positions.extend([quad[0], quad[1], quad[2], quad[0], quad[2], quad[3]]);
        ids.extend([wall as u32 + 1; 2]);
        materials.push(Material {
            bsdf: Bsdf::Diffuse { kd: [0.0; 3] },
            emission: [1.0 + wall as f32; 3],
            two_sided_emission: true,
            ..Material::grey("wall")
        });
    }
    positions.extend(shape.as_flattened());
    ids.extend(vec![0; shape.len()]);
    let triangles: Vec<[u32; 3]> =
        (0..positions.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let made = Scene::from_world(&positions, &triangles, &ids, materials, [0.0; 3]);
    Arc::new(made.expect("valid").0)
}

/// A surface of revolution about z through rings of radius and height.
fn lathe(rings: &[(f64, f64)]) -> Vec<[DVec3; 3]> {
    let around = 48;
    let at = |ring: usize, turn: usize| {
        let (sin, cos) = (TAU * (turn % around) as f64 / around as f64).sin_cos();
        DVec3::new(rings[ring].0 * cos, rings[ring].0 * sin, rings[ring].1)
    };
    let mut shape = Vec::new();
    for ring in 1..rings.len() {
        for turn in 0..around {
            let [a, b] = [at(ring - 1, turn), at(ring - 1, turn + 1)];
            let [c, d] = [at(ring, turn), at(ring, turn + 1)];
            shape.extend([[a, b, d], [a, d, c]]);
        }
    }
    shape.retain(|[a, b, c]| (b - a).cross(c - a).length() > 1e-9);
    shape
}

/// A ball of radius 0.5 beside the middle.
fn ball() -> Vec<[DVec3; 3]> {
    let ring = |n: usize| {
        let angle = PI * n as f64 / 24.0;
        (0.5 * angle.sin(), -0.5 * angle.cos())
    };
    let beside = DVec3::new(0.3, 0.2, -0.2);
    lathe(&(0..=24).map(ring).collect::<Vec<_>>()).iter().map(|t| t.map(|p| p + beside)).collect()
}

const MIRROR: Bsdf = Bsdf::Mirror { ks: [0.8, 0.5, 0.25] };
const GLASS: Bsdf = Bsdf::Dielectric { ior: 1.5, transmittance: [1.0; 3], alpha: 0.0 };

fn tracer(scene: &Arc<Scene>) -> Tracer {
    Tracer::new(Arc::clone(scene), Settings::default()).expect("tracer")
}

/// As in the paper, but for the distances.
const SETTINGS: ReflectionSettings = ReflectionSettings {
    resolution: 64,
    least_paths: 1,
    has_parallax: true,
    traces_self_hits: true,
};

/// Rays from a circle around the shape.
fn rays(count: u32, turn: f64) -> impl Iterator<Item = (DVec3, DVec3)> {
    (0..count * count).map(move |n| {
        let at = |k: u32| 1.4 * ((f64::from(k) + 0.5) / f64::from(count) - 0.5);
        let eye = DVec3::new(1.8 * turn.cos(), 1.8 * turn.sin(), 0.3);
        let across = DVec3::new(-turn.sin(), turn.cos(), 0.0);
        (eye, across * at(n % count) + DVec3::Z * at(n / count) - 0.5 * eye)
    })
}

/// The relative difference of all rays' light, as a mean, after all texels were filled.
fn difference(scene: &Arc<Scene>, settings: ReflectionSettings) -> (f64, ReflectionReport) {
    let (exact, cached) = (tracer(scene), tracer(scene).with_cached_reflections(settings));
    for turn in 0..24 {
        for (n, (eye, direction)) in rays(200, f64::from(turn)).enumerate() {
            _ = cached.trace(eye, direction, n as u64);
        }
    }
    let (mut sum, mut differ) = (0.0, 0.0);
    for (n, (eye, direction)) in rays(64, 0.5).enumerate() {
        let mean = |tracer: &Tracer| {
            let path = |k: u64| tracer.trace(eye, direction, 1000 * n as u64 + k).radiance[0];
            (0..16).map(path).sum::<f32>() / 16.0
        };
        let (one, other) = (mean(&exact), mean(&cached));
        sum += f64::from(one);
        differ += f64::from((one - other).abs());
    }
    (differ / sum, cached.reflection_report())
}

/// The number of texels that show what the ball's rays meet, if each ray is followed.
fn texels_met(scene: &Arc<Scene>) -> usize {
    let raycaster = Raycaster::build(Arc::clone(scene)).expect("a hierarchy");
    let centre = ShinyObjects::find(scene).expect("a ball").centres()[0];
    let grid = CubeGrid::new(SETTINGS.resolution);
    let mut met = vec![false; grid.len()];
    for (eye, direction) in (0..24).flat_map(|turn| rays(200, f64::from(turn))) {
        let (ray, _) = raycaster.localize(eye, direction.normalize()).expect("a ray");
        let Some(hit) = raycaster.nearest(&ray) else { continue };
        if scene.material_id(hit.triangle) != 0 {
            continue;
        }
        let surface = raycaster.surface(hit.triangle, hit.u, hit.v);
        let towards = reflect(-ray.direction, surface.normal);
        let origin = spawn(surface.point, surface.error, surface.normal, towards);
        let wall = raycaster.nearest(&Ray::new(origin, towards)).expect("a wall");
        met[grid.texel_of(origin + wall.t * towards - centre)] = true;
    }
    met.into_iter().filter(|met| *met).count()
}

#[test]
fn a_mirror_ball_shows_what_it_would_show_traced() {
    let scene = scene(&ball(), MIRROR);
    let (parallax, report) = difference(&scene, SETTINGS);
    assert_eq!((report.objects, report.marked), (1, 0));
    // A ray that finds the light of a texel beside its own teaches nothing.
    let (met, valid) = (texels_met(&scene) as f64, report.valid as f64);
    assert!(valid <= met && valid > 0.9 * met, "{valid} of {met}");
    // Rays near the edges of walls may find the wall beside.
    assert!(parallax < 0.01, "{parallax}");
    let (without, _) = difference(&scene, ReflectionSettings { has_parallax: false, ..SETTINGS });
    assert!(without > 2.0 * parallax && without < 0.2, "{without} {parallax}");
    let (coarse, _) = difference(&scene, ReflectionSettings { resolution: 8, ..SETTINGS });
    assert!(coarse > 2.0 * parallax, "{coarse} {parallax}");
}

#[test]
fn a_glass_ball_is_traced_inside_and_cached_outside() {
    let (differs, report) = difference(&scene(&ball(), GLASS), SETTINGS);
    assert!(report.valid * 2 > report.texels, "{report:?}");
    // 16 paths of a pixel choose between reflection and refraction at random.
    assert!(differs < 0.05, "{differs}");
}

#[test]
fn rays_that_meet_their_own_object_are_traced() {
    // A bowl: its inside mirrors itself.
    let rings: Vec<(f64, f64)> = (0..=12)
        .map(|n| f64::from(n) * PI / 24.0)
        .map(|a| (0.6 * a.sin(), -0.6 * a.cos()))
        .collect();
    let scene = scene(&lathe(&rings), MIRROR);
    let (marked, report) = difference(&scene, SETTINGS);
    assert!(report.marked > 100, "{report:?}");
    let (unmarked, as_paper) =
        difference(&scene, ReflectionSettings { traces_self_hits: false, ..SETTINGS });
    assert_eq!(as_paper.marked, 0);
    assert!(marked < 0.5 * unmarked, "{marked} {unmarked}");
}

#[test]
fn a_scene_without_shiny_objects_is_traced_as_ever() {
    let scene = scene(&ball(), Bsdf::Diffuse { kd: [0.6; 3] });
    let (exact, cached) = (tracer(&scene), tracer(&scene).with_cached_reflections(SETTINGS));
    assert_eq!(cached.reflection_report(), ReflectionReport::default());
    for (n, (eye, direction)) in rays(16, 0.0).enumerate() {
        let seed = n as u64;
        assert_eq!(exact.trace(eye, direction, seed), cached.trace(eye, direction, seed));
    }
}

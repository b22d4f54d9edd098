//! Tests that hits on instances have the same bits as on copies.

use super::tests::{Bits, bits, random};
use super::*;
use crate::Shaft;
use holo_scene::{Geometry, Material, Placement};

type Positions = Vec<[f32; 3]>;

/// Returns a bumpy sheet of `side` × `side` squares and as many loose triangles, around `middle`.
fn mesh(side: u32, middle: Vec3, point: &mut impl FnMut() -> Vec3) -> (Positions, Vec<[u32; 3]>) {
    let mut positions: Positions = Vec::new();
    for (x, y) in (0..=side).flat_map(|y| (0..=side).map(move |x| (x, y))) {
        let at = Vec3::new(x as f32, y as f32, 0.0) / side as f32 - Vec3::new(0.5, 0.5, 0.0);
        positions.push((middle + at + point() * (0.3 / side as f32)).to_array());
    }
    let mut triangles = Vec::new();
    for (x, y) in (0..side).flat_map(|y| (0..side).map(move |x| (x, y))) {
        let at = |x: u32, y: u32| y * (side + 1) + x;
        let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
        triangles.extend([[a, b, c], [a, c, d]]);
        let first = positions.len() as u32;
        let loose = middle + point();
        let corners = [loose, loose + point() * 0.2, loose + point() * 0.2];
        positions.extend(corners.map(|corner| corner.to_array()));
        triangles.push([first, first + 1, first + 2]);
    }
    (positions, triangles)
}

/// Returns a map that stretches by about `scale`, and takes `middle` to a random place.
fn placement(
    scale: f32,
    middle: Vec3,
    kind: u32,
    point: &mut impl FnMut() -> Vec3,
) -> Option<Placement> {
    let mut columns = [point(), point(), point()];
    if kind.is_multiple_of(3) {
        // Turned and stretched along the axes.
        let x = columns[0].try_normalize()?;
        let y = x.cross(columns[1]).try_normalize()?;
        let mirror = if kind.is_multiple_of(2) { 1.0 } else { -1.0 };
        let stretch = (point() + 0.6) * 3.0;
        columns = [x * stretch.x, y * stretch.y, x.cross(y) * (stretch.z * mirror)];
    }
    let columns = columns.map(|column| (column * scale).as_dvec3());
    let place = (point() * 8.0 * scale).as_dvec3();
    let middle = middle.as_dvec3();
    let moved = columns[0] * middle.x + columns[1] * middle.y + columns[2] * middle.z;
    Placement::new([0, 1, 2].map(|axis| {
        let [x, y, z] = columns.map(|column| column[axis]);
        [x, y, z, (place - moved)[axis]]
    }))
}

/// Returns a scene with instances of two meshes, and with some triangles of its own if wanted.
fn scene(scale: f32, middle: Vec3, has_own: bool, point: &mut impl FnMut() -> Vec3) -> Scene {
    let meshes = [mesh(3, middle, point), mesh(17, middle, point)];
    let ids = [0, 1].map(|k: u32| vec![k; meshes[k as usize].1.len()]);
    let meshes = [0, 1].map(|k: usize| {
        let (positions, triangles) = &meshes[k];
        Geometry { positions, triangles, material_ids: &ids[k] }
    });
    let mut placed = Vec::new();
    while placed.len() < 40 {
        let kind = placed.len() as u32;
        let size = scale * [1.0, 0.1, 5.0, 1.0][placed.len() % 4];
        placed.extend(placement(size, middle, kind, point).map(|place| (kind / 2 % 2, place)));
    }
    let (mut corners, mut triangles) = (Vec::new(), Vec::new());
    for i in 0..if has_own { 100 } else { 0 } {
        let from = point() * 8.0 * scale;
        let to = [from, from + point() * scale, from + point() * scale];
        corners.extend(to.map(|corner| corner.to_array()));
        triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    let (ids, materials) = (vec![0; triangles.len()], vec![Material::grey("m"); 2]);
    Scene::new(DVec3::ZERO, corners, triangles, ids, materials, [0.0; 3])
        .and_then(|scene| scene.with_instances(&meshes, &placed))
        .expect("valid")
}

/// Returns rays between points near the scene. Every second one aims at an edge or a corner of a
/// triangle.
fn rays(scene: &Scene, count: usize, scale: f32, point: &mut impl FnMut() -> Vec3) -> Vec<Ray> {
    let all = scene.triangles().len();
    let ray = |i: usize| {
        let from = point() * 16.0 * scale;
        let weights = point() + 0.5;
        let triangle = ((point().x + 0.5) * all as f32) as usize % all;
        let [a, b, c] = scene.corners(triangle as u32);
        let to = match i % 4 {
            0 => a,
            1 => a.lerp(b, weights.x),
            _ => a.lerp(b, weights.x).lerp(c, weights.y),
        };
        let direction =
            (to - from) * if i.is_multiple_of(3) { 1.0 } else { (to - from).length_recip() };
        let t_max = if i.is_multiple_of(5) { 1.0 + weights.z } else { f32::INFINITY };
        Ray { t_max, ..Ray::new(from, direction) }
    };
    (0..count).map(ray).collect()
}

/// All answers for some rays.
fn answers(raycaster: &Raycaster, rays: &[Ray]) -> Vec<(Bits, Bits, Bits, bool, bool)> {
    let mut together = vec![None; rays.len()];
    raycaster.nearest_many(rays, &mut together);
    let one = |(ray, together): (&Ray, &Option<Hit>)| {
        let hit = raycaster.nearest(ray);
        let from = hit.map_or(NO_TRIANGLE, |hit| hit.triangle);
        let next = raycaster.nearest_from(ray, from);
        let is_occluded = raycaster.occluded_from(ray, from);
        (bits(hit), bits(*together), bits(next), raycaster.occluded(ray), is_occluded)
    };
    rays.iter().zip(&together).map(one).collect()
}

/// The scales and places of meshes' own coordinates.
const CASES: [(f32, f32); 6] =
    [(1.0, 0.0), (1.0, 100.0), (1e-3, 0.0), (1e3, 0.0), (3e4, 1.0), (1e-4, 0.0)];

#[test]
fn hits_on_instances_have_the_same_bits_as_on_copies() {
    let mut point = random();
    for (case, (scale, offset)) in CASES.into_iter().enumerate() {
        let middle = Vec3::new(offset, -2.0 * offset, 0.3 * offset);
        let shared = Arc::new(scene(scale, middle, case % 2 == 0, &mut point));
        let rays = rays(&shared, 5_000, scale, &mut point);
        let flat = Arc::new(shared.flattened());
        assert!(flat.instances().is_empty() && shared.instances().len() == 40);
        for triangle in shared.triangles() {
            assert_eq!(shared.corners(triangle), flat.corners(triangle));
            assert_eq!(shared.material_id(triangle), flat.material_id(triangle));
        }
        let mut shared = Raycaster::build(shared).expect("built");
        let flat = Raycaster::build(flat).expect("built");
        assert_eq!(shared.reach, flat.reach);
        let expected = answers(&flat, &rays);
        for isa in RayIsa::all() {
            shared.isa = isa;
            let found = answers(&shared, &rays);
            for (i, (found, expected)) in found.iter().zip(&expected).enumerate() {
                assert_eq!(found, expected, "case {case}, {isa:?}, {:?}", rays[i]);
            }
        }
        let hits = expected.iter().filter(|found| found.0.is_some()).count();
        let own = flat.scene().triangles().len() - 20 * (27 + 867);
        let on_instances =
            expected.iter().flat_map(|found| found.0).filter(|hit| hit.1 >= own as u32).count();
        assert!(hits > 3_300 && on_instances > 3_000, "case {case}: {hits} {on_instances}");
    }
}

#[test]
fn surfaces_of_instances_are_those_of_copies() {
    let mut point = random();
    let shared = Arc::new(scene(1.0, Vec3::splat(3.0), true, &mut point));
    let flat = Raycaster::build(Arc::new(shared.flattened())).expect("built");
    let shared = Raycaster::build(shared).expect("built");
    for triangle in flat.scene().triangles() {
        assert_eq!(shared.vertices(triangle), flat.vertices(triangle));
        assert_eq!(shared.geometric_normal(triangle), flat.geometric_normal(triangle));
        assert_eq!(shared.surface(triangle, 0.3, 0.2), flat.surface(triangle, 0.3, 0.2));
        assert_eq!(shared.surface(triangle, 0.0, 1.0), flat.surface(triangle, 0.0, 1.0));
    }
}

#[test]
fn tiles_and_far_rays_meet_instances() {
    let mut point = random();
    let shared = Arc::new(scene(1.0, Vec3::ZERO, true, &mut point));
    let flat = Raycaster::build(Arc::new(shared.flattened())).expect("built");
    let shared = Raycaster::build(shared).expect("built");
    let mut met = 0;
    for tile in 0..300 {
        let distance = if tile % 3 == 0 { 1e4 } else { 12.0 };
        let eye = point().normalize() * distance;
        let middle = point() * 3.0 - eye;
        let rays: Vec<Ray> =
            (0..MAX_TILE).map(|_| Ray::new(eye, (middle + point()).normalize())).collect();
        let (mut found, mut expected) = (vec![None; MAX_TILE], vec![None; MAX_TILE]);
        shared.nearest_tile(&rays, &mut found);
        flat.nearest_tile(&rays, &mut expected);
        let all_bits = |hits: &[Option<Hit>]| hits.iter().map(|hit| bits(*hit)).collect::<Vec<_>>();
        assert_eq!(all_bits(&found), all_bits(&expected), "tile {tile}");
        met += found.iter().flatten().count();
    }
    assert!(met > 3_000, "{met}");
}

#[test]
fn shafts_that_may_hit_nothing_pass_no_instance() {
    let mut point = random();
    let shared = Raycaster::build(Arc::new(scene(1.0, Vec3::ZERO, false, &mut point)));
    let shared = shared.expect("built");
    let (mut free, mut blocked) = (0, 0);
    for _ in 0..2_000 {
        let mut square = || {
            let (at, a, b) = (point() * 12.0, point() * 0.1, point() * 0.1);
            [at, at + a, at + a + b, at + b].map(|corner| corner.as_dvec3())
        };
        let shaft = Shaft { from: square(), through: square(), between: true };
        let meets = (0..20).any(|k| {
            let (from, to) = (shaft.from[k % 4].as_vec3(), shaft.through[k / 5].as_vec3());
            shared.nearest(&Ray::new(from, (to - from).normalize())).is_some()
        });
        assert!(!meets || shared.may_hit(&shaft));
        free += usize::from(!shared.may_hit(&shaft));
        blocked += usize::from(meets);
    }
    assert!(free > 50 && blocked > 200, "{free} {blocked}");
}

//! Tests that all forms of a query give the same bits.

use super::*;
use holo_scene::Material;

pub(super) fn random() -> impl FnMut() -> Vec3 {
    let mut state = 7_u64;
    let mut unit = move || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 24) as f32 - 0.5
    };
    move || Vec3::new(unit(), unit(), unit())
}

/// Returns random triangles in a cube.
fn soup(count: u32, mut point: impl FnMut() -> Vec3) -> Raycaster {
    let corners: Vec<[f32; 3]> = (0..count)
        .flat_map(|_| {
            let a = point();
            [a, a + point() * 0.3, a + point() * 0.3]
        })
        .map(|p| p.to_array())
        .collect();
    let triangles: Vec<[u32; 3]> = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let materials = vec![0; count as usize];
    let scene =
        Scene::new(DVec3::ZERO, corners, triangles, materials, vec![Material::grey("m")], [0.0; 3]);
    Raycaster::build(Arc::new(scene.expect("valid"))).expect("built")
}

pub(super) type Bits = Option<(u32, u32, u32, u32)>;

pub(super) fn bits(hit: Option<Hit>) -> Bits {
    hit.map(|h| (h.t.to_bits(), h.triangle, h.u.to_bits(), h.v.to_bits()))
}

#[test]
fn small_scenes_give_the_same_bits_as_the_hierarchy() {
    let mut point = random();
    for count in [1, 15, 16, 17, 33, 63, 64, 65] {
        let mut raycaster = soup(count, &mut point);
        assert_eq!(raycaster.hierarchy.few.is_some(), count <= 64);
        // Every fourth ray runs along an axis from above a corner of a triangle: it hits edges.
        let rays: Vec<Ray> = (0..20_000)
            .map(|i| {
                let (from, to) = (point() * 2.0, point());
                if i % 4 == 0 {
                    Ray::new(
                        Vec3::from(raycaster.scene().own().positions[i % count as usize]) - Vec3::X,
                        Vec3::X,
                    )
                } else {
                    Ray {
                        t_max: if i % 4 == 1 { 1.0 } else { f32::INFINITY },
                        ..Ray::new(from, to - from)
                    }
                }
            })
            .collect();
        let ask = |raycaster: &Raycaster| -> Vec<(Bits, Bits, bool)> {
            let skip = |i: usize| i as u32 % count;
            let ask = |(i, ray): (usize, &Ray)| {
                let from = bits(raycaster.nearest_from(ray, skip(i)));
                (bits(raycaster.nearest(ray)), from, raycaster.occluded_from(ray, skip(i)))
            };
            rays.iter().enumerate().map(ask).collect()
        };
        let mut answers = Vec::new();
        for isa in RayIsa::all() {
            raycaster.isa = isa;
            answers.push(ask(&raycaster));
        }
        Arc::get_mut(&mut raycaster.hierarchy).unwrap().few = None;
        let by_hierarchy = ask(&raycaster);
        assert!(answers.iter().all(|found| *found == by_hierarchy), "{count}");
        let hits = by_hierarchy.iter().filter(|(hit, _, _)| hit.is_some()).count();
        assert!(hits > 50 * count as usize, "{count}: {hits}");
    }
}

/// Returns a ray from the origin of `first`, near its direction; `other` decides how near.
fn eye_ray(first: &Ray, other: &Ray) -> Ray {
    let t_max = if first.direction.y > 0.7 { 0.5 } else { f32::INFINITY };
    Ray { t_max, ..Ray::new(first.origin, (first.direction + 0.1 * other.direction).normalize()) }
}

#[test]
fn every_instruction_set_gives_the_same_bits() {
    let mut point = random();
    let mut raycaster = soup(2000, &mut point);
    // Alternately 21 rays of a beam and 21 rays in all directions.
    let mut rays = Vec::new();
    for i in 0..4_000 {
        let (from, to) = (point() * 2.0, point());
        let spread = if i % 2 == 0 { 0.05 } else { 1.0 };
        rays.extend((0..MAX_TOGETHER).map(|_| {
            let from = from + point() * spread;
            Ray::new(from, (to + point() * spread - from).normalize())
        }));
    }
    let mut answers = Vec::new();
    for isa in RayIsa::all() {
        raycaster.isa = isa;
        let mut together = vec![None; rays.len()];
        raycaster.nearest_many(&rays, &mut together);
        let found: Vec<_> = rays
            .iter()
            .map(|ray| (bits(raycaster.nearest(ray)), raycaster.occluded(ray)))
            .collect();
        assert!(together.into_iter().map(bits).eq(found.iter().map(|(hit, _)| *hit)), "{isa:?}");
        // The rays of tiles from one eye, and rays of two eyes in one tile.
        for size in [64, 40] {
            let tiles: Vec<Ray> = rays
                .iter()
                .enumerate()
                .map(|(i, ray)| eye_ray(&rays[i / size * size], ray))
                .collect();
            let mut hits = vec![None; rays.len()];
            raycaster.nearest_tile(&tiles, &mut hits);
            let alone = tiles.iter().map(|ray| bits(raycaster.nearest(ray)));
            assert!(hits.into_iter().map(bits).eq(alone), "{isa:?} {size}");
        }
        answers.push(found);
    }
    assert!(answers.iter().all(|found| *found == answers[0]));
    let hits = answers[0].iter().flat_map(|(hit, _)| hit).count();
    assert!(hits > 20_000, "{hits}");
}

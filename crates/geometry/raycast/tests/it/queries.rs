//! Tests that queries agree with brute force in f64, and that every bit pattern is an acceptable
//! ray.

use crate::common::{Mesh, Random};
use glam::{DVec3, Vec3};
use holo_raycast::{NO_TRIANGLE, Ray, Raycaster, SurfacePoint};
use proptest::prelude::*;

/// Returns the nearest hit in f64 (Möller and Trumbore 1997), and how far inside the triangle it is
/// (the least barycentric coordinate).
fn brute_force(mesh: &Mesh, ray: &Ray) -> Option<(f64, u32, f64)> {
    let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let mut best: Option<(f64, u32, f64)> = None;
    for (id, t) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = t.map(|i| mesh.vertex(i).as_dvec3());
        let (e1, e2) = (b - a, c - a);
        let p = d.cross(e2);
        let det = e1.dot(p);
        if det == 0.0 {
            continue;
        }
        let s = o - a;
        let q = s.cross(e1);
        let (u, v, t) = (s.dot(p) / det, d.dot(q) / det, e2.dot(q) / det);
        let margin = u.min(v).min(1.0 - u - v);
        if margin >= 0.0
            && t > f64::from(ray.t_min)
            && t < f64::from(ray.t_max)
            && best.is_none_or(|(nearest, _, _)| t < nearest)
        {
            best = Some((t, id as u32, margin));
        }
    }
    best
}

/// Compares many rays with brute force. Rays within rounding of an edge or of a second surface may
/// differ.
fn agree(mesh: &Mesh, raycaster: &Raycaster, rays: usize, random: &mut Random) {
    let mut compared = 0;
    for _ in 0..rays {
        let mut ray = Ray::new(random.cube() * 1.5, random.direction());
        if random.below(4) == 0 {
            ray.t_max = random.unit() * 2.0;
        }
        let found = raycaster.nearest(&ray);
        assert_eq!(found.is_some(), raycaster.occluded(&ray));
        match (brute_force(mesh, &ray), found) {
            (None, None) => compared += 1,
            (Some((t, id, margin)), Some(hit)) if hit.triangle == id => {
                // Edge functions have a rounding error of 1e-7 of the products. For a triangle seen
                // at an angle, they are divided by a small area.
                let slant = f64::from(raycaster.geometric_normal(id).dot(ray.direction).abs());
                assert!(
                    (f64::from(hit.t) - t).abs() < 1e-5 / slant.max(1e-4),
                    "{hit:?} against {t} margin {margin}"
                );
                compared += 1;
            }
            (expected, found) => {
                let margin = expected.map_or(0.0, |(_, _, margin)| margin);
                let at_limit =
                    expected.is_some_and(|(t, _, _)| (t - f64::from(ray.t_max)).abs() < 1e-5);
                let tie = matches!((expected, found), (Some((t, _, _)), Some(hit)) if (t - f64::from(hit.t)).abs() < 1e-5);
                assert!(
                    margin < 1e-3 || tie || at_limit,
                    "{ray:?}: {expected:?} against {found:?}"
                );
            }
        }
    }
    assert!(compared * 1000 > rays * 995, "only {compared} of {rays} rays were comparable");
}

#[test]
fn nearest_and_occluded_agree_with_brute_force() {
    let mut random = Random(11);
    for (count, size) in [(1, 1.0), (2, 1.0), (5, 0.8), (40, 0.5), (400, 0.3), (1500, 0.05)] {
        let mesh = Mesh::soup(count, size, &mut random);
        let raycaster = mesh.raycaster();
        agree(&mesh, &raycaster, 6_000, &mut random);
    }
}

#[test]
fn large_triangles_among_small_ones_are_found() {
    // Spatial splits cut the large ones into several boxes.
    let mut random = Random(12);
    let mut mesh = Mesh::soup(800, 0.02, &mut random);
    for _ in 0..20 {
        mesh.push([random.cube() * 3.0, random.cube() * 3.0, random.cube() * 3.0]);
    }
    agree(&mesh, &mesh.raycaster(), 10_000, &mut random);
}

#[test]
fn an_empty_scene_hits_nothing() {
    let raycaster = Mesh::default().raycaster();
    assert_eq!(raycaster.nearest(&Ray::new(Vec3::ZERO, Vec3::X)), None);
    assert!(!raycaster.occluded(&Ray::new(Vec3::ONE, Vec3::X)));
    assert!(raycaster.localize(DVec3::ZERO, DVec3::X).is_some());
}

#[test]
fn a_single_triangle_is_hit_from_both_sides_with_its_barycentrics() {
    let mut mesh = Mesh::default();
    mesh.push([Vec3::ZERO, Vec3::X, Vec3::Y]);
    let raycaster = mesh.raycaster();
    assert_eq!(raycaster.geometric_normal(0), Vec3::Z);
    for z in [1.0, -1.0] {
        let hit =
            raycaster.nearest(&Ray::new(Vec3::new(0.25, 0.5, z), Vec3::Z * -z)).expect("a hit");
        assert_eq!((hit.t, hit.triangle, hit.u, hit.v), (1.0, 0, 0.25, 0.5));
        assert_eq!(raycaster.surface_point(&hit).0, Vec3::new(0.25, 0.5, 0.0));
    }
}

#[test]
fn near_hits_and_limits_are_exact() {
    let mut mesh = Mesh::default();
    mesh.push([Vec3::new(-1.0, -1.0, 0.0), Vec3::new(3.0, -1.0, 0.0), Vec3::new(-1.0, 3.0, 0.0)]);
    let raycaster = mesh.raycaster();
    for height in [1e-3_f32, 1e-6, 1e-9, 1e-20] {
        let hit = raycaster
            .nearest(&Ray::new(Vec3::new(0.1, 0.2, height), -Vec3::Z))
            .expect("a near hit");
        assert_eq!(hit.t, height);
    }
    let ray = |t_min, t_max| Ray { origin: Vec3::Z, direction: -Vec3::Z, t_min, t_max };
    assert!(raycaster.occluded(&ray(0.0, 1.0_f32.next_up())));
    assert!(!raycaster.occluded(&ray(0.0, 1.0)));
    assert!(raycaster.occluded(&ray(1.0_f32.next_down(), 2.0)));
    assert!(!raycaster.occluded(&ray(1.0, 2.0)));
}

#[test]
fn a_far_origin_finds_the_same_surface() {
    let mesh = Mesh::sphere(4, Vec3::ZERO, 1.0);
    let raycaster = mesh.raycaster();
    let mut random = Random(13);
    for distance in [10.0, 1e3, 1e7] {
        for _ in 0..1000 {
            let direction = random.direction().as_dvec3();
            let start = -direction * distance;
            let (ray, skipped) = raycaster.localize(start, direction).expect("towards the scene");
            let hit = raycaster.nearest(&ray).expect("the sphere's front");
            let t = f64::from(hit.t) + skipped;
            // A chord of a facet is at most 1 - cos(edge/2) inside the sphere. Edges of level 4 are
            // shorter than 0.15.
            assert!((distance - t - 1.0).abs() < 0.006, "{distance}: {t}");
            assert_eq!(raycaster.localize(start, -direction), None);
        }
        let far = Ray::new(Vec3::X * distance as f32, -Vec3::X);
        assert!(raycaster.nearest(&far).is_some() && raycaster.occluded(&far));
        assert!(!raycaster.occluded(&Ray { t_max: distance as f32 * 0.5, ..far }));
        assert!(!raycaster.occluded(&Ray { direction: Vec3::X, ..far }));
    }
}

#[test]
fn surface_points_are_within_their_stated_error() {
    let mut random = Random(14);
    let mesh = Mesh::soup(300, 1.0, &mut random);
    let raycaster = mesh.raycaster();
    for _ in 0..100_000 {
        let triangle = random.below(300) as u32;
        let (u, v) = (random.unit(), random.unit());
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        // Points closer to an edge than this may be moved off it.
        if u.min(v).min(1.0 - u - v) < 0.01 {
            continue;
        }
        let SurfacePoint { point, error, .. } = raycaster.surface(triangle, u, v);
        let [a, b, c] = raycaster.vertices(triangle).map(|p| p.as_dvec3());
        let exact = a + (b - a) * f64::from(u) + (c - a) * f64::from(v);
        assert!((point.as_dvec3() - exact).abs().cmple(error.as_dvec3()).all());
        // A bound that is several times too large hides contact shadows.
        assert!(error.max_element() < 3e-6);
    }
}

#[test]
fn segments_between_surfaces_ignore_both_surfaces() {
    // Two parallel walls, and between them a blocker that covers half of the segments.
    let mut mesh = Mesh::default();
    let wall =
        |z: f32| [Vec3::new(-1.0, -1.0, z), Vec3::new(1.0, -1.0, z), Vec3::new(-1.0, 1.0, z)];
    mesh.push(wall(0.0));
    mesh.push(wall(1.0));
    // Just beyond the far wall, where a segment that is too long would hit it.
    mesh.push(wall(1.0 + 1e-5));
    let open = mesh.raycaster();
    mesh.push(wall(0.5).map(|p| p * Vec3::new(2.0, 2.0, 1.0)));
    let closed = mesh.raycaster();
    let mut random = Random(15);
    for _ in 0..10_000 {
        let mut point = |raycaster: &Raycaster, wall| {
            let (u, v) = (random.unit() * 0.5, random.unit() * 0.5);
            raycaster.surface(wall, u, v)
        };
        let (from, to) = (point(&open, 0), point(&open, 1));
        assert_eq!((open.blocker(&from, &to), open.blocker(&to, &from)), (None, None));
        assert!(closed.blocker(&from, &to).is_some() && closed.blocker(&to, &from).is_some());
    }
}

/// Returns the bits of a hit.
fn bits(hit: Option<holo_raycast::Hit>) -> Option<[u32; 4]> {
    hit.map(|h| [h.triangle, h.t.to_bits(), h.u.to_bits(), h.v.to_bits()])
}

#[test]
fn rays_traced_together_find_the_same_hits_as_alone() {
    let mut random = Random(17);
    let mut doubled = Mesh::sphere(4, Vec3::ZERO, 1.0);
    // Every triangle twice, and coplanar ones: equal distances must be decided in the same way.
    doubled.triangles.extend(doubled.triangles.clone());
    let meshes = [
        Mesh::soup(1, 1.0, &mut random),
        Mesh::soup(30_000, 0.05, &mut random),
        Mesh::sliver_box(Vec3::ONE, 3, 300),
        doubled,
    ];
    let mut hits = 0;
    for mesh in &meshes {
        let raycaster = mesh.raycaster();
        for beam in 0..3_000 {
            // From one small square to another. Some bundles are incoherent; some rays hit nothing
            // or are invalid.
            let (from, to) = (random.cube() * 1.5, random.cube());
            let spread = [0.0, 1e-3, 0.1, 1.0][beam % 4];
            let mut rays: Vec<Ray> = (0..random.below(50))
                .map(|_| {
                    let from = from + random.cube() * spread;
                    Ray::new(from, (to + random.cube() * spread - from).normalize_or(Vec3::Z))
                })
                .collect();
            for ray in &mut rays {
                match random.below(20) {
                    0 => ray.t_max = random.unit(),
                    1 => ray.t_min = random.unit(),
                    2 => ray.origin.x = f32::NAN,
                    3 => ray.origin = ray.direction * -1e4,
                    4 => ray.direction = Vec3::ZERO,
                    _ => {}
                }
            }
            // Previous contents of the array must not matter.
            let mut together =
                vec![Some(holo_raycast::Hit { t: 1.0, triangle: 0, u: 0.0, v: 0.0 }); rays.len()];
            raycaster.nearest_many(&rays, &mut together);
            for (ray, together) in rays.iter().zip(&together) {
                let alone = raycaster.nearest(ray);
                assert_eq!(bits(*together), bits(alone), "{ray:?}");
                hits += usize::from(alone.is_some());
            }
            // The same rays without the triangles that they hit.
            let left: Vec<u32> =
                together.iter().map(|hit| hit.map_or(NO_TRIANGLE, |hit| hit.triangle)).collect();
            raycaster.nearest_many_from(&rays, &left, &mut together);
            for ((ray, &left), together) in rays.iter().zip(&left).zip(together) {
                assert_eq!(
                    bits(together),
                    bits(raycaster.nearest_from(ray, left)),
                    "{ray:?} from {left}"
                );
            }
        }
    }
    assert!(hits > 50_000, "{hits}");
}

#[test]
fn the_first_of_two_triangles_at_the_same_distance_wins() {
    let mut random = Random(18);
    let mut mesh = Mesh::soup(2_000, 0.2, &mut random);
    let copies = mesh.triangles.clone();
    mesh.triangles.extend(copies);
    let raycaster = mesh.raycaster();
    for _ in 0..100_000 {
        if let Some(hit) = raycaster.nearest(&Ray::new(random.cube(), random.direction())) {
            assert!(hit.triangle < 2_000);
        }
    }
}

fn any_float() -> impl Strategy<Value = f32> {
    prop_oneof![
        any::<u32>().prop_map(f32::from_bits),
        Just(0.0),
        Just(-0.0),
        Just(f32::NAN),
        Just(f32::INFINITY),
        Just(f32::NEG_INFINITY),
        -2.0_f32..2.0
    ]
}

proptest! {
    #[test]
    fn any_bit_pattern_is_an_acceptable_ray(f in prop::array::uniform8(any_float())) {
        thread_local! { static SCENE: Raycaster = Mesh::soup(100, 1.0, &mut Random(16)).raycaster(); }
        let ray = Ray { origin: Vec3::new(f[0], f[1], f[2]), direction: Vec3::new(f[3], f[4], f[5]), t_min: f[6], t_max: f[7] };
        SCENE.with(|raycaster| {
            let hit = raycaster.nearest(&ray);
            prop_assert_eq!(hit.is_some(), raycaster.occluded(&ray));
            if let Some(hit) = hit {
                prop_assert!(ray.origin.is_finite() && ray.direction.is_finite() && ray.direction != Vec3::ZERO);
                prop_assert!(hit.triangle < 100 && hit.t.is_finite() && hit.u.is_finite() && hit.v.is_finite());
            }
            Ok(())
        })?;
    }
}

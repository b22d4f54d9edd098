//! Tests that closed meshes do not leak: neither rays aimed at their edges and vertices, nor rays
//! that start on their surface.

use crate::common::{Mesh, Random};
use glam::Vec3;
use holo_raycast::{Ray, Raycaster, spawn};

/// Traces rays from random inside points to points on edges and to vertices. Returns how many hit
/// nothing.
fn leaks(mesh: &Mesh, inside: f32, rays: usize, seed: u64) -> usize {
    let raycaster = mesh.raycaster();
    let mut random = Random(seed);
    let mut leaks = 0;
    for i in 0..rays {
        let origin = random.cube() * inside;
        let triangle = mesh.triangles[random.below(mesh.triangles.len())];
        let k = random.below(3);
        let (a, b) = (mesh.vertex(triangle[k]), mesh.vertex(triangle[(k + 1) % 3]));
        let target = if i % 4 == 0 { a } else { a.lerp(b, random.unit()) };
        let ray = Ray::new(origin, (target - origin).normalize());
        let hit = raycaster.nearest(&ray);
        leaks += usize::from(hit.is_none() || !raycaster.occluded(&ray));
    }
    leaks
}

#[test]
fn no_ray_leaves_a_sphere_of_131072_triangles() {
    assert_eq!(leaks(&Mesh::sphere(7, Vec3::ZERO, 1.0), 0.5, 500_000, 1), 0);
}

#[test]
fn no_ray_leaves_a_sphere_far_from_the_origin() {
    // The mesh has size 1 at distance 100, so coordinates keep 17 bits of it. Rays start inside it,
    // so they are moved by the same amount.
    let centre = Vec3::new(100.0, -70.0, 40.0);
    let mesh = Mesh::sphere(5, centre, 1.0);
    let raycaster = mesh.raycaster();
    let mut random = Random(2);
    for _ in 0..200_000 {
        let origin = centre + random.cube() * 0.5;
        let t = mesh.triangles[random.below(mesh.triangles.len())];
        let target = mesh.vertex(t[0]).lerp(mesh.vertex(t[1]), random.unit());
        assert!(raycaster.nearest(&Ray::new(origin, (target - origin).normalize())).is_some());
    }
}

#[test]
fn no_ray_leaves_a_box_of_slivers() {
    assert_eq!(leaks(&Mesh::sliver_box(Vec3::new(2.0, 1.0, 3.0), 3, 900), 0.9, 300_000, 3), 0);
}

#[test]
fn rays_nearly_along_an_axis_do_not_leak_between_the_boxes_of_a_grid() {
    // Such a ray is nearly parallel to the faces at which boxes meet, and the boxes of a flat face
    // have no depth.
    let mesh = Mesh::sliver_box(Vec3::new(1.1, 0.9, 1.3), 50, 50);
    let raycaster = mesh.raycaster();
    let mut random = Random(7);
    let mut leaks = 0;
    for _ in 0..400_000 {
        let t = mesh.triangles[random.below(mesh.triangles.len())];
        let target = mesh.vertex(t[0]).lerp(mesh.vertex(t[1 + random.below(2)]), random.unit());
        let axis = random.below(3);
        let mut towards = random.cube() * 10.0_f32.powf(-1.0 - 6.0 * random.unit());
        towards[axis] = target[axis].signum();
        let origin = target - towards * random.unit();
        if (origin.abs().cmplt(Vec3::new(1.0999, 0.8999, 1.2999))).all() {
            leaks +=
                usize::from(raycaster.nearest(&Ray::new(origin, towards.normalize())).is_none());
        }
    }
    assert_eq!(leaks, 0);
}

#[test]
fn axis_parallel_rays_along_grid_lines_do_not_leak() {
    // Origins lie on the planes of the grid, and directions along axes have zeros of both signs.
    // Every ray runs along edges or through vertices of both end faces.
    let mesh = Mesh::sliver_box(Vec3::ONE, 8, 8);
    let raycaster = mesh.raycaster();
    for axis in 0..3 {
        for sign in [1.0, -1.0] {
            for zeros in 0..4 {
                let mut direction = [0.0_f32; 3];
                direction[axis] = sign;
                direction[(axis + 1) % 3] = if zeros & 1 == 0 { 0.0 } else { -0.0 };
                direction[(axis + 2) % 3] = if zeros & 2 == 0 { 0.0 } else { -0.0 };
                for i in 1..8 {
                    for j in 1..8 {
                        let mut origin = [0.0; 3];
                        origin[(axis + 1) % 3] = i as f32 * 0.25 - 1.0;
                        origin[(axis + 2) % 3] = j as f32 * 0.25 - 1.0;
                        let hit = raycaster.nearest(&Ray::new(origin.into(), direction.into()));
                        assert_eq!(hit.map(|h| h.t), Some(1.0), "{origin:?} {direction:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn a_ray_in_the_plane_of_a_face_ends_at_the_next_face() {
    let raycaster = Mesh::sliver_box(Vec3::ONE, 4, 4).raycaster();
    // In the plane x = 1 the side face is seen edge-on, which is no hit. The face z = 1 begins at
    // its edge.
    let hit = raycaster
        .nearest(&Ray::new(Vec3::new(1.0, 0.3, 0.1), Vec3::Z))
        .expect("the face at the end");
    assert!((hit.t - 0.9).abs() < 1e-6, "{hit:?}");
}

/// Bounces rays that restart from each surface. Returns how many escape within `bounces`.
fn escapes(raycaster: &Raycaster, seed: u64, bounces: usize) -> usize {
    let mut random = Random(seed);
    let mut escapes = 0;
    let mut ray = Ray::new(Vec3::splat(0.01), random.direction());
    let mut from = holo_raycast::NO_TRIANGLE;
    for _ in 0..bounces {
        let Some(hit) = raycaster.nearest_from(&ray, from) else {
            escapes += 1;
            ray = Ray::new(Vec3::splat(0.01), random.direction());
            from = holo_raycast::NO_TRIANGLE;
            continue;
        };
        let surface = raycaster.surface(hit.triangle, hit.u, hit.v);
        let inwards =
            if surface.normal.dot(ray.direction) > 0.0 { -surface.normal } else { surface.normal };
        let mut direction = random.direction();
        if direction.dot(inwards) < 0.0 {
            direction = -direction;
        }
        ray = Ray::new(spawn(surface.point, surface.error, surface.normal, direction), direction);
        from = hit.triangle;
    }
    escapes
}

#[test]
fn light_stays_in_closed_meshes_over_hundreds_of_thousands_of_bounces() {
    assert_eq!(escapes(&Mesh::sphere(6, Vec3::ZERO, 1.0).raycaster(), 4, 300_000), 0);
    assert_eq!(
        escapes(&Mesh::sliver_box(Vec3::new(2.0, 1.0, 3.0), 2, 2).raycaster(), 5, 300_000),
        0
    );
}

#[test]
fn a_ray_that_starts_within_rounding_of_an_edge_stays_inside() {
    // Far from the origin, where points have the largest rounding error, and coarse meshes, which
    // have sharp edges.
    let middle = Vec3::new(300.0, -41.0, 7.0);
    let turn = glam::Quat::from_euler(glam::EulerRot::XYZ, 0.3, 0.7, 1.1);
    let mut tetrahedron = Mesh::default();
    let corners = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
    let [a, b, c, d] = corners.map(|p| turn * Vec3::from(p) + middle);
    for face in [[a, b, c], [a, d, b], [a, c, d], [b, d, c]] {
        tetrahedron.push(face);
    }
    let mut random = Random(11);
    let mut escapes = 0;
    for mesh in [Mesh::sphere(2, middle, 1.0), tetrahedron] {
        let raycaster = mesh.raycaster();
        for _ in 0..200_000 {
            let triangle = random.below(mesh.triangles.len()) as u32;
            let (near, along) = (random.unit() * 1e-6, random.unit());
            let (u, v) =
                [(near, along), (along, near), (1.0 - along - near, along)][random.below(3)];
            let (u, v) = (u.max(0.0), v.min(1.0 - u.max(0.0)));
            let surface = raycaster.surface(triangle, u, v);
            let to_middle = middle - surface.point;
            let inwards =
                if surface.normal.dot(to_middle) < 0.0 { -surface.normal } else { surface.normal };
            let direction = random.direction();
            let direction = if direction.dot(inwards) < 0.0 { -direction } else { direction };
            let start = spawn(surface.point, surface.error, surface.normal, direction);
            escapes += usize::from(
                raycaster.nearest_from(&Ray::new(start, direction), triangle).is_none(),
            );
        }
    }
    assert_eq!(escapes, 0);
}

#[test]
fn a_spawned_ray_does_not_meet_its_own_plane() {
    // A wall of slivers that rays leave at all angles down to grazing: they must hit nothing. The
    // skipped triangle cannot hide an error, because its neighbours lie in the same plane.
    let mut mesh = Mesh::default();
    let turn = glam::Quat::from_euler(glam::EulerRot::XYZ, 0.3, 0.7, 1.1);
    for i in 0..200 {
        let (x0, x1) = (i as f32 * 0.05 - 5.0, (i + 1) as f32 * 0.05 - 5.0);
        let corner = |x: f32, y: f32| turn * Vec3::new(x, y, 0.0) + Vec3::new(3.0, 1.0, 2.0);
        mesh.push([corner(x0, -5.0), corner(x1, -5.0), corner(x1, 5.0)]);
        mesh.push([corner(x0, -5.0), corner(x1, 5.0), corner(x0, 5.0)]);
    }
    let raycaster = mesh.raycaster();
    let mut random = Random(6);
    let mut false_hits = 0;
    for _ in 0..300_000 {
        let triangle = random.below(mesh.triangles.len()) as u32;
        let (mut u, mut v) = (random.unit(), random.unit());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        let s = raycaster.surface(triangle, u, v);
        let grazing = 10.0_f32.powf(-3.0 * random.unit());
        let along = (turn * Vec3::new(random.unit() - 0.5, random.unit() - 0.5, 0.0))
            .normalize_or(turn * Vec3::X);
        let direction = (along + s.normal * grazing).normalize();
        let ray = Ray::new(spawn(s.point, s.error, s.normal, direction), direction);
        false_hits += usize::from(raycaster.nearest_from(&ray, triangle).is_some());
    }
    // The vertices are rounded, so neighbours are tilted by up to 1e-5; a ray at 1e-3 cannot hit
    // them.
    assert_eq!(false_hits, 0);
}

//! Rays that are difficult for ray tracers, against closed meshes: a million in tests, 100 million
//! in the example.

use glam::Vec3;
use holo_raycast::{Hit, MAX_TOGETHER, Ray, Raycaster, spawn};

use super::{Mesh, Random};

/// The results of a case.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    pub rays: u64,
    /// Rays inside a closed mesh, or aimed at it from outside, that hit nothing: alone, together,
    /// or as an occlusion query.
    pub leaks: u64,
    pub not_a_number: u64,
}

/// Makes a ray that must hit the mesh.
type Aim = fn(&Mesh, f32, &mut Random) -> Ray;

fn corner(mesh: &Mesh, random: &mut Random) -> [Vec3; 3] {
    let triangle = mesh.triangles[random.below(mesh.triangles.len())];
    let first = random.below(3);
    [0, 1, 2].map(|i| mesh.vertex(triangle[(first + i) % 3]))
}

fn towards(origin: Vec3, target: Vec3) -> Ray {
    Ray::new(origin, (target - origin).normalize_or(Vec3::X))
}

/// From inside at a point of an edge.
fn at_edges(mesh: &Mesh, size: f32, random: &mut Random) -> Ray {
    let [a, b, _] = corner(mesh, random);
    towards(random.cube() * (0.3 * size), a.lerp(b, random.unit()))
}

/// From inside at a vertex.
fn at_vertices(mesh: &Mesh, size: f32, random: &mut Random) -> Ray {
    let [a, _, _] = corner(mesh, random);
    towards(random.cube() * (0.3 * size), a)
}

/// From inside along an axis, if possible from below a vertex: zeros of both signs in the
/// direction.
fn along_axes(mesh: &Mesh, size: f32, random: &mut Random) -> Ray {
    let axis = random.below(3);
    let mut direction = [0, 1, 2].map(|_| if random.below(2) == 0 { 0.0 } else { -0.0 });
    direction[axis] = if random.below(2) == 0 { 1.0 } else { -1.0 };
    let [mut origin, _, _] = corner(mesh, random);
    origin[axis] = 0.0;
    if origin.abs().max_element() > 0.3 * size {
        origin *= 0.3 * size / origin.abs().max_element();
    }
    Ray::new(origin, direction.into())
}

/// In the plane of a face perpendicular to an axis, from a point of that face. It ends at the next
/// face and is parallel to others.
fn in_face_planes(mesh: &Mesh, size: f32, random: &mut Random) -> Ray {
    let [a, b, c] = corner(mesh, random);
    let Some(axis) = (0..3).find(|&axis| a[axis] == b[axis] && b[axis] == c[axis]) else {
        return Ray::new(random.cube() * (0.3 * size), (b - a).normalize_or(Vec3::X));
    };
    let mut origin = random.cube() * (0.9 * size);
    origin[axis] = a[axis];
    let mut direction = random.direction();
    direction[axis] = 0.0;
    Ray::new(origin, direction.normalize_or((b - a).normalize_or(Vec3::X)))
}

/// From outside at an inside point, a million sizes away or as far as coordinates allow.
fn from_afar(_: &Mesh, size: f32, random: &mut Random) -> Ray {
    let direction = random.direction();
    // In f32 the origin is rounded by 1e6 · 2⁻²⁴ sizes: the target is within 0.1.
    Ray::new(direction * (-1e6 * size), direction)
}

/// Towards a surface from 1e-6 to 2e-6 of the size in front of it; nothing else is beyond.
fn very_near(mesh: &Mesh, _: f32, random: &mut Random) -> Ray {
    let [a, b, c] = corner(mesh, random);
    let (mut u, mut v) = (random.unit(), random.unit());
    if u + v > 1.0 {
        (u, v) = (1.0 - u, 1.0 - v);
    }
    let point = a + (b - a) * u + (c - a) * v;
    towards(point * (1.0 - 1e-6 * (1.0 + random.unit())), point)
}

const AIMS: [(&str, Aim); 6] = [
    ("edges", at_edges),
    ("vertices", at_vertices),
    ("axes", along_axes),
    ("face planes", in_face_planes),
    ("a million sizes off", from_afar),
    ("hits at 1e-6 of the size", very_near),
];

fn mesh_middle(mesh: &mut Mesh, a: u32, b: u32) -> u32 {
    mesh.positions.push(mesh.vertex(a).lerp(mesh.vertex(b), 1e-3).to_array());
    mesh.positions.len() as u32 - 1
}

/// Returns closed meshes of size about 1 (half the edge of their cube). The last ones have every
/// fault that keeps them closed.
fn meshes() -> Vec<(&'static str, Mesh)> {
    let mut faulty = Mesh::sphere(3, Vec3::ZERO, 1.0);
    // Duplicates: once unchanged and once turned inside out.
    let copies: Vec<[u32; 3]> = faulty.triangles.iter().step_by(2).copied().collect();
    faulty.triangles.extend(copies.iter().copied());
    faulty.triangles.extend(copies.iter().map(|&[a, b, c]| [a, c, b]));
    // Thin coplanar parts of others, with a vertex in the middle of an edge that is not split.
    for [a, b, c] in copies {
        let middle = mesh_middle(&mut faulty, a, b);
        faulty.triangles.push([a, middle, c]);
    }
    let mut inverted = Mesh::sphere(2, Vec3::ZERO, 1.0);
    inverted.triangles.iter_mut().step_by(3).for_each(|t| t.swap(0, 1));
    vec![
        ("sphere", Mesh::sphere(5, Vec3::ZERO, 1.0)),
        ("box of slivers", Mesh::sliver_box(Vec3::ONE, 3, 900)),
        ("box on a grid", Mesh::sliver_box(Vec3::ONE, 16, 16)),
        ("duplicates, coplanar slivers", faulty),
        ("inverted normals", inverted),
    ]
}

fn scaled(mesh: &Mesh, scale: f32) -> Mesh {
    let positions = mesh.positions.iter().map(|p| p.map(|c| c * scale)).collect();
    Mesh { positions, triangles: mesh.triangles.clone() }
}

fn check(counts: &mut Counts, raycaster: &Raycaster, rays: &[Ray], together: &mut [Option<Hit>]) {
    raycaster.nearest_many(rays, together);
    for (ray, together) in rays.iter().zip(together) {
        let hit = raycaster.nearest(ray);
        let met = hit.is_some() && *together == hit && raycaster.occluded(ray);
        counts.rays += 1;
        counts.leaks += u64::from(!met);
        counts.not_a_number += u64::from(
            hit.is_some_and(|h| !(h.t.is_finite() && h.u.is_finite() && h.v.is_finite())),
        );
    }
}

/// Bounces rays in the mesh. They restart from each surface by error bounds and must never escape.
fn bounce(counts: &mut Counts, raycaster: &Raycaster, rays: u64, random: &mut Random) {
    let mut ray = Ray::new(Vec3::ZERO, random.direction());
    let mut from = holo_raycast::NO_TRIANGLE;
    for _ in 0..rays {
        counts.rays += 1;
        let Some(hit) = raycaster.nearest_from(&ray, from) else {
            counts.leaks += 1;
            (ray, from) = (Ray::new(Vec3::ZERO, random.direction()), holo_raycast::NO_TRIANGLE);
            continue;
        };
        let surface = raycaster.surface(hit.triangle, hit.u, hit.v);
        // The mesh is around the origin, so the origin is inside.
        let inwards =
            if surface.normal.dot(surface.point) > 0.0 { -surface.normal } else { surface.normal };
        let direction = random.direction();
        let direction = if direction.dot(inwards) < 0.0 { -direction } else { direction };
        ray = Ray::new(spawn(surface.point, surface.error, surface.normal, direction), direction);
        counts.not_a_number += u64::from(!ray.origin.is_finite());
        from = hit.triangle;
    }
}

/// Traces about `rays` rays over all meshes, scales from 1e-3 to 1e5, and ways to aim.
pub fn run(rays: u64) -> Vec<(String, Counts)> {
    let scales = [1e-3, 1.0, 1e5];
    let meshes = meshes();
    let share = rays / (meshes.len() * scales.len() * (AIMS.len() + 1)) as u64 + 1;
    let mut random = Random(2024);
    let mut results: Vec<(String, Counts)> = Vec::new();
    for (mesh_name, mesh) in &meshes {
        let mut counts = [Counts::default(); AIMS.len() + 1];
        for scale in scales {
            let mesh = scaled(mesh, scale);
            let Ok(raycaster) = Raycaster::build(mesh.scene()) else {
                counts[0].leaks += share;
                continue;
            };
            let mut batch = Vec::with_capacity(MAX_TOGETHER);
            let mut together = [None; MAX_TOGETHER];
            for ((_, aim), counts) in AIMS.iter().zip(&mut counts) {
                for first in (0..share).step_by(MAX_TOGETHER) {
                    batch.clear();
                    batch.extend(
                        (first..share).take(MAX_TOGETHER).map(|_| aim(&mesh, scale, &mut random)),
                    );
                    check(counts, &raycaster, &batch, &mut together);
                }
            }
            bounce(&mut counts[AIMS.len()], &raycaster, share, &mut random);
        }
        let names = AIMS.iter().map(|(name, _)| *name).chain(["bounces"]);
        results.extend(
            names.zip(counts).map(|(name, counts)| (format!("{mesh_name}: {name}"), counts)),
        );
    }
    results
}

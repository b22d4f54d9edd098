//! The shapes that furniture is made of: boxes, boxes with rounded edges, cushions, lathed parts,
//! tubes, sheets.
//!
//! Invariant: closed shapes face outwards. A shape stands on z = 0, centred in x and y, unless
//! its documentation says otherwise.

use crate::material::NamedMaterial;
use crate::mesh::Mesh;
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

/// Cells along each side of a cushion's six faces.
const CUSHION: usize = 8;

/// Returns the box between two corners.
pub fn cuboid(material: &'static NamedMaterial, min: [f64; 3], max: [f64; 3]) -> Mesh {
    let mut mesh = Mesh::default();
    for i in 0..8 {
        let pick = |axis: usize| if i >> axis & 1 == 0 { min[axis] } else { max[axis] };
        mesh.point(DVec3::new(pick(0), pick(1), pick(2)));
    }
    for quad in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    {
        mesh.quad(material, quad);
    }
    mesh
}

/// Returns a box of a size.
pub fn block(material: &'static NamedMaterial, [w, d, h]: [f64; 3]) -> Mesh {
    cuboid(material, [-w / 2.0, -d / 2.0, 0.0], [w / 2.0, d / 2.0, h])
}

/// Returns a box of a size whose edges are rounded to `radius`.
pub fn rounded(material: &'static NamedMaterial, size: [f64; 3], radius: f64) -> Mesh {
    let half = DVec3::from(size) / 2.0;
    let radius = radius.min(half.min_element());
    let inner = half - radius;
    // Segments per 45 degrees of an edge. An edge of a few millimetres needs only a chamfer.
    let arc = if radius < 0.012 { 1 } else { 2 };
    // Along an axis, as fractions: the two arcs in equal angles, and one flat cell between them.
    let stops: Vec<(f64, f64)> = (0..=arc)
        .map(|i| (-1.0, -((arc - i) as f64 / arc as f64 * FRAC_PI_4).tan()))
        .chain((0..=arc).map(|i| (1.0, (i as f64 / arc as f64 * FRAC_PI_4).tan())))
        .collect();
    cube_faces(material, stops.len() - 1, |face| {
        let mut sign = DVec3::ZERO;
        let mut lean = DVec3::ZERO;
        for axis in 0..3 {
            let (s, l) = match face[axis] {
                Along::Wall(side) => (side, side),
                Along::Stop(i) => stops[i],
            };
            sign[axis] = s;
            lean[axis] = l;
        }
        sign * inner + lean.normalize() * radius + DVec3::new(0.0, 0.0, half.z)
    })
}

/// Returns a cushion: square in outline, round in profile.
pub fn cushion(material: &'static NamedMaterial, size: [f64; 3]) -> Mesh {
    superellipsoid(material, size, 5.0, 2.4)
}

/// Returns a superellipsoid with separate exponents for outline (x, y) and profile; 2 is an
/// ellipse, and more is squarer.
pub fn superellipsoid(
    material: &'static NamedMaterial,
    size: [f64; 3],
    outline: f64,
    profile: f64,
) -> Mesh {
    let half = DVec3::from(size) / 2.0;
    cube_faces(material, CUSHION, |face| {
        let at = DVec3::from(face.map(|along| match along {
            Along::Wall(side) => side,
            // Denser near the edges, where it curves.
            Along::Stop(i) => ((2.0 * i as f64 / CUSHION as f64 - 1.0) * FRAC_PI_2).sin(),
        }));
        let around = (at.x.abs().powf(outline) + at.y.abs().powf(outline)).powf(1.0 / outline);
        let norm = (around.powf(profile) + at.z.abs().powf(profile)).powf(1.0 / profile);
        at / norm * half + DVec3::new(0.0, 0.0, half.z)
    })
}

/// A coordinate on a cube's surface: the wall itself (-1 or 1), or the number of a stop across it.
#[derive(Clone, Copy)]
enum Along {
    Wall(f64),
    Stop(usize),
}

/// Returns the six faces of a cube, of `n` by `n` cells each, mapped by `bend`.
fn cube_faces(
    material: &'static NamedMaterial,
    n: usize,
    bend: impl Fn([Along; 3]) -> DVec3,
) -> Mesh {
    Mesh::of((0..6).map(|face| {
        let (axis, side) = (face / 2, if face % 2 == 0 { -1.0 } else { 1.0 });
        // (axis, u, v) is right-handed, so the far wall runs u then v, and the near wall v then u.
        let (mut u, mut v) = ((axis + 1) % 3, (axis + 2) % 3);
        if side < 0.0 {
            (u, v) = (v, u);
        }
        indexed(material, n, n, |i, j| {
            let mut at = [Along::Wall(side); 3];
            at[u] = Along::Stop(i);
            at[v] = Along::Stop(j);
            bend(at)
        })
    }))
}

/// Returns a sheet of `nu` by `nv` cells with points `at(u, v)`, both in [0, 1]. Its outside is the
/// side of ∂u × ∂v.
pub fn sheet(
    material: &'static NamedMaterial,
    nu: usize,
    nv: usize,
    at: impl Fn(f64, f64) -> DVec3,
) -> Mesh {
    indexed(material, nu, nv, |i, j| at(i as f64 / nu as f64, j as f64 / nv as f64))
}

fn indexed(
    material: &'static NamedMaterial,
    nu: usize,
    nv: usize,
    at: impl Fn(usize, usize) -> DVec3,
) -> Mesh {
    let mut mesh = Mesh::default();
    for j in 0..=nv {
        for i in 0..=nu {
            mesh.point(at(i, j));
        }
    }
    let index = |i: usize, j: usize| (j * (nu + 1) + i) as u32;
    for j in 0..nv {
        for i in 0..nu {
            mesh.quad(
                material,
                [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)],
            );
        }
    }
    mesh
}

/// Returns a rectangle from a corner along two edges. Its outside is the side of `u` × `v`.
pub fn rectangle(
    material: &'static NamedMaterial,
    corner: [f64; 3],
    u: [f64; 3],
    v: [f64; 3],
) -> Mesh {
    let (corner, u, v) = (DVec3::from(corner), DVec3::from(u), DVec3::from(v));
    sheet(material, 1, 1, |s, t| corner + u * s + v * t)
}

/// Returns a solid of revolution about the z axis; `profile` holds pairs of radius and height.
/// Going up, its outside is away from the axis.
pub fn lathe(material: &'static NamedMaterial, segments: usize, profile: &[(f64, f64)]) -> Mesh {
    let mut mesh = Mesh::default();
    for &(radius, z) in profile {
        for i in 0..segments {
            let (sin, cos) = (TAU * i as f64 / segments as f64).sin_cos();
            mesh.point(DVec3::new(radius * cos, radius * sin, z));
        }
    }
    let index = |i: usize, j: usize| (j * segments + i % segments) as u32;
    for j in 0..profile.len().saturating_sub(1) {
        for i in 0..segments {
            mesh.quad(
                material,
                [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)],
            );
        }
    }
    mesh
}

/// Returns a solid of revolution with a smooth profile through the given pairs of radius and
/// height.
pub fn turned(material: &'static NamedMaterial, segments: usize, profile: &[(f64, f64)]) -> Mesh {
    lathe(material, segments, &smooth(profile, 2))
}

/// Returns a ball about the origin.
pub fn ball(material: &'static NamedMaterial, radius: f64, segments: usize) -> Mesh {
    let rings = segments / 2;
    let profile: Vec<_> = (0..=rings)
        .map(|j| {
            let (sin, cos) = (std::f64::consts::PI * j as f64 / rings as f64).sin_cos();
            // The poles lie exactly on the axis; otherwise slivers would surround them.
            (if j == 0 || j == rings { 0.0 } else { radius * sin }, -radius * cos)
        })
        .collect();
    lathe(material, segments, &profile)
}

/// Returns a round rod along `path`, with caps.
pub fn tube(
    material: &'static NamedMaterial,
    path: &[DVec3],
    radius: f64,
    segments: usize,
) -> Mesh {
    let mut mesh = Mesh::default();
    let last = path.len() - 1;
    let tangent = |i: usize| (path[(i + 1).min(last)] - path[i.saturating_sub(1)]).normalize();
    let mut side = tangent(0).any_orthonormal_vector();
    for (i, &at) in path.iter().enumerate() {
        // Transported along the path, so that the rod does not twist.
        let along = tangent(i);
        side = (side - along * side.dot(along)).normalize();
        let other = along.cross(side);
        for k in 0..segments {
            let (sin, cos) = (TAU * k as f64 / segments as f64).sin_cos();
            mesh.point(at + (side * cos + other * sin) * radius);
        }
    }
    let index = |k: usize, i: usize| (i * segments + k % segments) as u32;
    for i in 0..last {
        for k in 0..segments {
            mesh.quad(
                material,
                [index(k, i), index(k + 1, i), index(k + 1, i + 1), index(k, i + 1)],
            );
        }
    }
    let (foot, head) = (mesh.point(path[0]), mesh.point(path[last]));
    for k in 0..segments {
        mesh.quad(material, [foot, index(k + 1, 0), index(k, 0), foot]);
        mesh.quad(material, [head, index(k, last), index(k + 1, last), head]);
    }
    mesh
}

/// Returns a rod that bends smoothly through the given points.
pub fn bent(material: &'static NamedMaterial, through: &[[f64; 3]], radius: f64) -> Mesh {
    let xy: Vec<_> = through.iter().map(|p| (p[0], p[1])).collect();
    let z: Vec<_> = through.iter().map(|p| (p[2], 0.0)).collect();
    let path: Vec<_> = smooth(&xy, 4)
        .iter()
        .zip(smooth(&z, 4))
        .map(|(&(x, y), (z, _))| DVec3::new(x, y, z))
        .collect();
    // A stalk of a few millimetres needs few sides.
    tube(material, &path, radius, if radius < 0.0065 { 5 } else { 10 })
}

/// Returns a Catmull-Rom curve through the pairs, with `steps` pieces between neighbours.
fn smooth(points: &[(f64, f64)], steps: usize) -> Vec<(f64, f64)> {
    let last = points.len() - 1;
    let mut curve = Vec::with_capacity(last * steps + 1);
    for i in 0..last {
        let around = [i.saturating_sub(1), i, i + 1, (i + 2).min(last)].map(|k| points[k]);
        for step in 0..steps {
            let t = step as f64 / steps as f64;
            let blend = |[a, b, c, d]: [f64; 4]| {
                let (linear, square, cube) =
                    (c - a, 2.0 * a - 5.0 * b + 4.0 * c - d, 3.0 * (b - c) + d - a);
                b + 0.5 * t * (linear + t * (square + t * cube))
            };
            curve.push((blend(around.map(|p| p.0)), blend(around.map(|p| p.1))));
        }
    }
    curve.push(points[last]);
    curve
}

//! Rooms and objects of faces, in metres with +z up.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

/// A face with normals and texture coordinates at its corners, counter-clockwise from the front.
pub(super) struct PartFace {
    pub corners: Vec<DVec3>,
    pub normals: Vec<DVec3>,
    pub uvs: Vec<DVec2>,
    pub material: &'static str,
    pub is_curved: bool,
}

/// A flat face. Its texture repeats every metre.
fn flat(corners: impl IntoIterator<Item = DVec3>, material: &'static str) -> PartFace {
    let corners: Vec<DVec3> = corners.into_iter().collect();
    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
    let uv = |p: &DVec3| {
        if normal.z.abs() > 0.5 { DVec2::new(p.x, p.y) } else { DVec2::new(p.x + p.y, p.z) }
    };
    let (normals, uvs) = (vec![normal; corners.len()], corners.iter().map(uv).collect());
    PartFace { corners, normals, uvs, material, is_curved: false }
}

/// A box seen from outside, or from inside.
fn cuboid(low: DVec3, high: DVec3, inside: bool, material: &'static str) -> Vec<PartFace> {
    let mut faces = Vec::new();
    for axis in 0..3 {
        for (side, at) in [(0, low), (1, high)] {
            let corner = |a: usize, b: usize| {
                let mut p = at;
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                p[u] = if a == 0 { low[u] } else { high[u] };
                p[v] = if b == 0 { low[v] } else { high[v] };
                p
            };
            let mut corners = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
            if (side == 1) == inside {
                corners.reverse();
            }
            faces.push(flat(corners, material));
        }
    }
    faces
}

/// A turned shape of so many sides, on the floor at the origin.
pub(super) fn vase(sides: usize) -> Vec<PartFace> {
    let rings = 32;
    let radius = |z: f64| 0.08 + 0.05 * (z / 0.3 * 5.0).sin() + 0.03 * (z / 0.3);
    let slope = |z: f64| (radius(z + 1e-5) - radius(z - 1e-5)) / 2e-5;
    let at = |i: usize, j: usize| {
        let (z, angle) = (0.3 * j as f64 / rings as f64, TAU * i as f64 / sides as f64);
        let (sin, cos) = angle.sin_cos();
        let normal = DVec3::new(cos, sin, -slope(z)).normalize();
        (DVec3::new(radius(z) * cos, radius(z) * sin, z), normal)
    };
    let mut faces = Vec::new();
    for (i, j) in (0..sides).flat_map(|i| (0..rings).map(move |j| (i, j))) {
        let corners = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        faces.push(PartFace {
            corners: corners.iter().map(|c| c.0).collect(),
            normals: corners.iter().map(|c| c.1).collect(),
            uvs: vec![DVec2::ZERO; 4],
            material: "Vase",
            is_curved: true,
        });
    }
    faces.push(flat((0..sides).rev().map(|i| at(i, 0).0), "Vase"));
    faces
}

/// A table with a vase on it.
fn table(at: DVec3) -> Vec<PartFace> {
    let mut faces =
        cuboid(at + DVec3::new(-0.7, -0.4, 0.7), at + DVec3::new(0.7, 0.4, 0.75), false, "Table");
    for (x, y) in [(-0.62, -0.32), (0.62, -0.32), (0.62, 0.32), (-0.62, 0.32)] {
        let leg = at + DVec3::new(x, y, 0.0);
        let (low, high) = (leg - DVec3::new(0.03, 0.03, 0.0), leg + DVec3::new(0.03, 0.03, 0.7));
        faces.extend(cuboid(low, high, false, "Table"));
    }
    let mut vase = vase(24);
    for corner in vase.iter_mut().flat_map(|face| &mut face.corners) {
        *corner += at + DVec3::new(0.1, 0.0, 0.751);
    }
    faces.extend(vase);
    faces
}

/// A room of 5 by 4 by 2.6 m with a window in its wall at y = 4, a table, and a lamp if wanted.
pub(super) fn room(lamp: bool) -> Vec<PartFace> {
    let (low, high) = (DVec3::ZERO, DVec3::new(5.0, 4.0, 2.6));
    let mut faces = shell(low, high, &[1.5, 3.5]);
    faces.extend(table(DVec3::new(2.6, 1.8, 0.0)));
    if lamp {
        let corners = [[2.0, 1.5], [2.0, 2.5], [3.0, 2.5], [3.0, 1.5]];
        faces.push(flat(corners.map(|[x, y]| DVec3::new(x, y, 2.58)), "Lamp"));
    }
    faces
}

/// The floor, ceiling and walls of a room. Its far wall has glazed windows, each from one of
/// `windows` to the next.
fn shell(low: DVec3, high: DVec3, windows: &[f64]) -> Vec<PartFace> {
    let mut faces = cuboid(low, high, true, "Wall");
    // In the order of `cuboid`: the far wall is the fourth, floor and ceiling are the last two.
    faces[4].material = "Floor";
    faces.remove(3);
    let x = [&[low.x], windows, &[high.x]].concat();
    let z = [low.z, 0.9, 2.1, high.z];
    for (i, j) in (0..x.len() - 1).flat_map(|i| (0..3).map(move |j| (i, j))) {
        let at = |i: usize, j: usize| DVec3::new(x[i], high.y, z[j]);
        let corners = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        faces.push(flat(corners, if (i % 2, j) == (1, 1) { "Glass" } else { "Wall" }));
    }
    faces
}

/// Two rooms with a door between them, each with a window.
pub(super) fn two_rooms() -> Vec<PartFace> {
    let high = DVec3::new(8.5, 4.0, 2.6);
    let mut faces = shell(DVec3::ZERO, high, &[1.5, 3.5, 5.8, 7.4]);
    for (from, to, up) in [(0.0, 1.4, 2.6), (2.3, 4.0, 2.6)] {
        faces.extend(cuboid(DVec3::new(4.9, from, 0.0), DVec3::new(5.0, to, up), false, "Wall"));
    }
    let lintel = (DVec3::new(4.9, 1.4, 2.0), DVec3::new(5.0, 2.3, 2.6));
    faces.extend(cuboid(lintel.0, lintel.1, false, "Wall"));
    faces.extend(table(DVec3::new(2.6, 1.8, 0.0)));
    faces.extend(cuboid(DVec3::new(7.5, 0.3, 0.0), DVec3::new(8.2, 1.7, 0.45), false, "Table"));
    faces
}

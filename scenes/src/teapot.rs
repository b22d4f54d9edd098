//! A teapot of chrome, for carrying it into a room: Martin Newell's (1975), whose Bézier patches
//! are published data, with the bottom that others added. Metres, +Z up, on the plane z = 0.
//!
//! Rim, body, lid and bottom are surfaces of revolution. Handle and spout are the same on both
//! sides.

use std::fmt::Write as _;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use glam::DVec3;

/// Length of a unit of the data, metres: the teapot is 17 cm high.
const UNIT: f64 = 0.055;

/// Steps along a side of a patch.
const STEPS: usize = 14;

/// Shares of the radius at which the control points of a quarter of a circle lie.
const CIRCLE: [(f64, f64); 4] = [(1.0, 0.0), (1.0, 0.56), (0.56, 1.0), (0.0, 1.0)];

/// Radii and heights of profiles, from the inside of the top to the outside of the bottom.
const PROFILES: [[(f64, f64); 4]; 6] = [
    [(0.0, 3.15), (0.8, 3.15), (0.0, 2.85), (0.2, 2.7)],
    [(0.2, 2.7), (0.4, 2.55), (1.3, 2.55), (1.3, 2.4)],
    [(1.4, 2.4), (1.3375, 2.53125), (1.4375, 2.53125), (1.5, 2.4)],
    [(1.5, 2.4), (1.75, 1.875), (2.0, 1.35), (2.0, 0.9)],
    [(2.0, 0.9), (2.0, 0.45), (1.5, 0.225), (1.5, 0.15)],
    [(1.5, 0.15), (1.5, 0.075), (1.425, 0.0), (0.0, 0.0)],
];

/// Sections of handle and spout: (x, z) on the one edge of the half, half the width, and (x, z) on
/// the other edge.
type HalfSection = ((f64, f64), f64, (f64, f64));

const HANDLE: [HalfSection; 7] = [
    ((-1.6, 2.025), 0.3, (-1.5, 2.25)),
    ((-2.3, 2.025), 0.3, (-2.5, 2.25)),
    ((-2.7, 2.025), 0.3, (-3.0, 2.25)),
    ((-2.7, 1.8), 0.3, (-3.0, 1.8)),
    ((-2.7, 1.575), 0.3, (-3.0, 1.35)),
    ((-2.5, 1.125), 0.3, (-2.65, 0.9375)),
    ((-2.0, 0.9), 0.3, (-1.9, 0.6)),
];

const SPOUT: [HalfSection; 7] = [
    ((1.7, 1.425), 0.66, (1.7, 0.6)),
    ((2.6, 1.425), 0.66, (3.1, 0.825)),
    ((2.3, 2.1), 0.25, (2.4, 2.025)),
    ((2.7, 2.4), 0.25, (3.3, 2.4)),
    ((2.8, 2.475), 0.25, (3.525, 2.49375)),
    ((2.9, 2.475), 0.15, (3.45, 2.5125)),
    ((2.8, 2.4), 0.15, (3.2, 2.4)),
];

const MTL: &str = "newmtl chrome\nKd 0 0 0\nKs 0.65 0.66 0.67\nNs 1000\nillum 3\n";

/// The control points of a bicubic patch. Its outside is where the first direction times the second
/// points to.
type ControlNet = [[DVec3; 4]; 4];

fn transposed(net: &ControlNet) -> ControlNet {
    [0, 1, 2, 3].map(|row| [0, 1, 2, 3].map(|column| net[column][row]))
}

/// Returns all patches.
fn patches() -> Vec<ControlNet> {
    let mut patches = Vec::new();
    for profile in PROFILES {
        let net = profile.map(|(radius, height)| {
            CIRCLE.map(|(along, across)| DVec3::new(radius * along, radius * across, height))
        });
        for turn in 0..4 {
            let turned = |p: DVec3| match turn {
                0 => p,
                1 => DVec3::new(-p.y, p.x, p.z),
                2 => DVec3::new(-p.x, -p.y, p.z),
                _ => DVec3::new(p.y, -p.x, p.z),
            };
            patches.push(net.map(|row| row.map(turned)));
        }
    }
    for sections in [HANDLE, SPOUT] {
        for first in [0, 3] {
            let half: ControlNet = [0, 1, 2, 3].map(|row| {
                let ((x0, z0), width, (x1, z1)) = sections[first + row];
                [(x0, 0.0, z0), (x0, width, z0), (x1, width, z1), (x1, 0.0, z1)].map(DVec3::from)
            });
            patches.push(half);
            let mirrored = half.map(|row| row.map(|p| DVec3::new(p.x, -p.y, p.z)));
            patches.push(transposed(&mirrored));
        }
    }
    patches
}

/// Returns the weights of four control points, and their changes.
fn weights(t: f64) -> ([f64; 4], [f64; 4]) {
    let s = 1.0 - t;
    (
        [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t],
        [-3.0 * s * s, 3.0 * s * (s - 2.0 * t), 3.0 * t * (2.0 * s - t), 3.0 * t * t],
    )
}

fn sum(net: &ControlNet, u: [f64; 4], v: [f64; 4]) -> DVec3 {
    let row = |row: usize| -> DVec3 { (0..4).map(|k| net[row][k] * v[k]).sum() };
    (0..4).map(|k| row(k) * u[k]).sum()
}

/// Returns a point of a patch and the normal on its outside.
fn point_and_normal(net: &ControlNet, u: f64, v: f64) -> (DVec3, DVec3) {
    let ((u0, u1), (v0, v1)) = (weights(u), weights(v));
    let normal = sum(net, u1, v0).cross(sum(net, u0, v1));
    let normal = normal.try_normalize().filter(|_| normal.length() > 1e-6).unwrap_or_else(|| {
        // At a pole, a row of the patch is one point: the normal is that of the places beside it.
        let (beside, v) = (u.clamp(1e-3, 1.0 - 1e-3), 0.5);
        let ((u0, u1), (v0, v1)) = (weights(beside), weights(v));
        let near = sum(net, u1, v0).cross(sum(net, u0, v1));
        DVec3::new(0.0, 0.0, near.z.signum())
    });
    (sum(net, u0, v0), normal)
}

/// Returns the text of the OBJ file.
fn obj() -> String {
    let mut text =
        "# Martin Newell's teapot. Metres, +Z up.\nmtllib teapot.mtl\nusemtl chrome\n".to_owned();
    let mut first = 1;
    for net in patches() {
        let mut points = Vec::new();
        for (row, column) in (0..=STEPS).flat_map(|row| (0..=STEPS).map(move |at| (row, at))) {
            let share = |step: usize| step as f64 / STEPS as f64;
            let (point, normal) = point_and_normal(&net, share(row), share(column));
            let point = point * UNIT;
            let _ = writeln!(text, "v {:.6} {:.6} {:.6}", point.x, point.y, point.z);
            let _ = writeln!(text, "vn {:.5} {:.5} {:.5}", normal.x, normal.y, normal.z);
            points.push(point);
        }
        for (row, column) in (0..STEPS).flat_map(|row| (0..STEPS).map(move |at| (row, at))) {
            let corner = row * (STEPS + 1) + column;
            let quad = [corner, corner + STEPS + 1, corner + STEPS + 2, corner + 1];
            for half in [[0, 1, 2], [0, 2, 3]].map(|half| half.map(|k| quad[k])) {
                let [p, q, r] = half.map(|k| points[k]);
                if (q - p).cross(r - p).length() > 1e-12 {
                    let [p, q, r] = half.map(|k| format!("{0}//{0}", first + k));
                    let _ = writeln!(text, "f {p} {q} {r}");
                }
            }
        }
        first += points.len();
    }
    text
}

/// Writes `teapot.obj` and `teapot.mtl` into `dir`, which is created if it does not exist. Returns
/// the path of the first.
///
/// # Errors
/// Those of the file system.
pub fn write_teapot(dir: &Path) -> io::Result<PathBuf> {
    fs::create_dir_all(dir)?;
    fs::write(dir.join("teapot.mtl"), MTL)?;
    let path = dir.join("teapot.obj");
    fs::write(&path, obj())?;
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_teapot_stands_on_its_bottom_and_shows_its_outside() {
        let folder = tempfile::tempdir().unwrap();
        let path = write_teapot(folder.path()).unwrap();
        let scene = holo_scene::load(&path, &Default::default()).unwrap().scene;
        let (low, high) = scene.bounds();
        assert!(low.z.abs() < 1e-6 && (high.z - 3.15 * UNIT).abs() < 1e-5, "{low} {high}");
        assert!((low.y + high.y).abs() < 1e-6 && (high.y - 2.0 * UNIT).abs() < 1e-4);
        let (mut volume, mut parts) = (0.0, 0);
        for triangle in scene.triangles() {
            let corners = scene.corners(triangle).map(|c| scene.origin + c.as_dvec3());
            let [a, b, c] = corners;
            volume += a.dot(b.cross(c)) / 6.0;
            parts += 1;
            // Smooth normals lie on the side that the triangle shows.
            if let Some(smooth) = scene.smooth_normal(triangle, 0.3, 0.3) {
                assert!(smooth.dot(scene.normal(triangle)) > 0.5, "{triangle}: {smooth}");
            }
            // Away from handle and spout, the body shows its outside.
            let middle = (a + b + c) / 3.0;
            if middle.x.abs() < UNIT && (0.3 * UNIT..2.3 * UNIT).contains(&middle.z) {
                let outward = DVec3::new(middle.x, middle.y, 0.0);
                assert!(scene.normal(triangle).as_dvec3().dot(outward) > 0.0, "{triangle}");
            }
        }
        // A pot of about this radius and height.
        let litres = volume * 1e3;
        assert!(parts > 10_000 && (3.0..6.0).contains(&litres), "{parts} {litres}");
    }
}

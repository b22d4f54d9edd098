//! Scenes for measuring cached reflections, after those of Ruff, Clua and Fernandes 2013 ("Dynamic
//! per Object Ray Caching Textures for Real-Time Ray Tracing"). Metres, +Z up.
//!
//! Shapes are perfect mirrors with smooth normals, in a room of plain walls, a chequered floor and
//! a lamp. The usual eye is at (0, -4, 0), and looks along +Y at a sphere of radius 1 around zero.

use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use glam::DVec3;

/// Numbers of further spheres in the paper's tables.
const FURTHER_SPHERES: [usize; 7] = [0, 1, 2, 4, 8, 16, 32];

const MTL: &str = "\
newmtl mirror
Kd 0 0 0
Ks 0.9 0.9 0.9
Ns 1000
illum 3

newmtl light_tile
Kd 0.75 0.75 0.7
illum 1

newmtl dark_tile
Kd 0.2 0.12 0.1
illum 1

newmtl left
Kd 0.65 0.15 0.1
illum 1

newmtl right
Kd 0.15 0.5 0.2
illum 1

newmtl wall
Kd 0.6 0.6 0.65
illum 1

newmtl lamp
Kd 0.5 0.5 0.5
Ke 20 19 17
illum 1
";

/// The text of an OBJ file, and the numbers of its points and normals.
struct ObjText {
    text: String,
    points: usize,
    normals: usize,
}

/// A scene of this module: its name and its text.
type NamedScene = (String, String);

impl ObjText {
    fn new() -> Self {
        let text = "# Metres, +Z up.\nmtllib reflections.mtl\n".to_owned();
        Self { text, points: 0, normals: 0 }
    }

    /// Adds a quadrilateral, counter-clockwise from the visible side.
    fn quad(&mut self, material: &str, corners: [[f64; 3]; 4]) {
        for [x, y, z] in corners {
            let _ = writeln!(self.text, "v {x:.5} {y:.5} {z:.5}");
        }
        let [a, b, c, d] = [1, 2, 3, 4].map(|k| self.points + k);
        let _ = writeln!(self.text, "usemtl {material}\nf {a} {b} {c} {d}");
        self.points += 4;
    }

    /// Adds the room between two corners. The lamp is in the middle of the ceiling.
    fn room(&mut self, [x0, y0, z0]: [f64; 3], [x1, y1, z1]: [f64; 3], tiles: usize) {
        let at = |low: f64, high: f64, n: usize| low + (high - low) * n as f64 / tiles as f64;
        for row in 0..tiles {
            for column in 0..tiles {
                let (left, right) = (at(x0, x1, column), at(x0, x1, column + 1));
                let (near, far) = (at(y0, y1, row), at(y0, y1, row + 1));
                let tile = if (row + column) % 2 == 0 { "light_tile" } else { "dark_tile" };
                self.quad(
                    tile,
                    [[left, near, z0], [right, near, z0], [right, far, z0], [left, far, z0]],
                );
            }
        }
        self.quad("wall", [[x0, y0, z1], [x0, y1, z1], [x1, y1, z1], [x1, y0, z1]]);
        self.quad("left", [[x0, y0, z0], [x0, y1, z0], [x0, y1, z1], [x0, y0, z1]]);
        self.quad("right", [[x1, y0, z0], [x1, y0, z1], [x1, y1, z1], [x1, y1, z0]]);
        self.quad("wall", [[x0, y1, z0], [x1, y1, z0], [x1, y1, z1], [x0, y1, z1]]);
        self.quad("wall", [[x0, y0, z0], [x0, y0, z1], [x1, y0, z1], [x1, y0, z0]]);
        let (x, y, half) = ((x0 + x1) / 2.0, (y0 + y1) / 2.0, 0.15 * (x1 - x0));
        let z = z1 - 1e-3 * (x1 - x0);
        self.quad(
            "lamp",
            [
                [x - half, y - half, z],
                [x - half, y + half, z],
                [x + half, y + half, z],
                [x + half, y - half, z],
            ],
        );
    }

    /// Adds a mirror of points and unit normals `at(u, v)`, with u and v in [0, 1].
    fn mirror(&mut self, columns: usize, rows: usize, at: impl Fn(f64, f64) -> (DVec3, DVec3)) {
        let _ = writeln!(self.text, "usemtl mirror");
        let mut points = Vec::new();
        for row in 0..=rows {
            for column in 0..=columns {
                let (point, normal) = at(column as f64 / columns as f64, row as f64 / rows as f64);
                let _ = writeln!(self.text, "v {:.6} {:.6} {:.6}", point.x, point.y, point.z);
                let _ = writeln!(self.text, "vn {:.5} {:.5} {:.5}", normal.x, normal.y, normal.z);
                points.push(point);
            }
        }
        for row in 0..rows {
            for column in 0..columns {
                let corner = row * (columns + 1) + column;
                let quad = [corner, corner + 1, corner + columns + 2, corner + columns + 1];
                for half in [[0, 1, 2], [0, 2, 3]].map(|half| half.map(|k| quad[k])) {
                    let [p, q, r] = half.map(|k| points[k]);
                    // At poles, two corners are one.
                    if (q - p).cross(r - p).length() < 1e-9 {
                        continue;
                    }
                    let [p, q, r] =
                        half.map(|k| format!("{}//{}", self.points + k + 1, self.normals + k + 1));
                    let _ = writeln!(self.text, "f {p} {q} {r}");
                }
            }
        }
        self.points += points.len();
        self.normals += points.len();
    }

    /// Adds a mirror ball.
    fn ball(&mut self, centre: DVec3, radius: f64, rows: usize) {
        self.mirror(2 * rows, rows, |u, v| {
            let (turn, height) = (TAU * u, PI * v);
            // The poles and the seam are the same points bit for bit.
            let flat = if v == 0.0 || v == 1.0 { 0.0 } else { height.sin() };
            let turn = if u == 1.0 { 0.0 } else { turn };
            let normal = DVec3::new(flat * turn.cos(), flat * turn.sin(), -height.cos());
            (centre + radius * normal, normal)
        });
    }
}

/// Returns a point and a normal of a surface of revolution about a vertical axis. The pairs are
/// its radius and height, and their changes.
fn turned(u: f64, (radius, height): (f64, f64), (outward, upward): (f64, f64)) -> (DVec3, DVec3) {
    let (sin, cos) = (TAU * if u == 1.0 { 0.0 } else { u }).sin_cos();
    let normal = DVec3::new(upward * cos, upward * sin, -outward).normalize();
    (DVec3::new(radius * cos, radius * sin, height), normal)
}

/// The room of the tables, with the sphere of radius 1 around zero.
fn room_with_ball() -> ObjText {
    let mut obj = ObjText::new();
    obj.room([-6.0, -12.0, -2.0], [6.0, 6.0, 5.0], 16);
    obj.ball(DVec3::ZERO, 1.0, 64);
    obj
}

/// One sphere, and further ones behind the eye, visible only in it (Table I, Fig. 5).
fn behind(further: usize) -> String {
    let mut obj = room_with_ball();
    for number in 0..further {
        let (column, row) = ((number % 8) as f64, (number / 8) as f64);
        obj.ball(DVec3::new(1.4 * column - 4.9, -7.0, 1.2 * row - 1.2), 0.5, 32);
    }
    obj.text
}

/// Spheres side by side in front of the eye (Table II).
fn before(further: usize) -> String {
    let mut obj = ObjText::new();
    obj.room([-6.0, -12.0, -2.0], [6.0, 6.0, 5.0], 16);
    let across = ((further + 1) as f64).sqrt().ceil();
    let (radius, step) = (1.6 / across, 3.3 / across);
    for number in 0..=further {
        let (column, row) = (number as f64 % across, (number as f64 / across).floor());
        let at = |k: f64| step * (k - (across - 1.0) / 2.0);
        obj.ball(DVec3::new(at(column), 0.0, at(row)), radius, 32);
    }
    obj.text
}

/// The sphere among ten diffuse blocks (Fig. 1, top).
fn blocks() -> String {
    let mut obj = room_with_ball();
    for number in 0..10 {
        let (sin, cos) = (TAU * (f64::from(number) + 0.3) / 10.0).sin_cos();
        let (x, y, half, top) = (2.6 * cos, 2.6 * sin, 0.3, 0.2 * f64::from(number % 4) - 0.6);
        let ([x0, y0, z0], [x1, y1, z1]) = ([x - half, y - half, -2.0], [x + half, y + half, top]);
        let material = ["left", "right", "wall"][number as usize % 3];
        obj.quad(material, [[x0, y0, z1], [x1, y0, z1], [x1, y1, z1], [x0, y1, z1]]);
        obj.quad(material, [[x0, y0, z0], [x1, y0, z0], [x1, y0, z1], [x0, y0, z1]]);
        obj.quad(material, [[x1, y0, z0], [x1, y1, z0], [x1, y1, z1], [x1, y0, z1]]);
        obj.quad(material, [[x1, y1, z0], [x0, y1, z0], [x0, y1, z1], [x1, y1, z1]]);
        obj.quad(material, [[x0, y1, z0], [x0, y0, z0], [x0, y0, z1], [x0, y1, z1]]);
    }
    obj.text
}

/// The sphere in a cube of this half side, as many radii away.
fn surrounded(half: f64) -> String {
    let mut obj = ObjText::new();
    obj.room([-half, -half, -half], [half, half, half], 16);
    obj.ball(DVec3::ZERO, 1.0, 64);
    obj.text
}

/// A shape of revolution in the room of the tables.
fn shape(profile: impl Fn(f64) -> ((f64, f64), (f64, f64))) -> String {
    let mut obj = ObjText::new();
    obj.room([-6.0, -12.0, -2.0], [6.0, 6.0, 5.0], 16);
    obj.mirror(128, 64, |u, v| {
        let (place, slope) = profile(v);
        turned(u, place, slope)
    });
    obj.text
}

/// All scenes.
fn scenes() -> Vec<NamedScene> {
    let mut scenes: Vec<NamedScene> = Vec::new();
    for further in FURTHER_SPHERES {
        scenes.push((format!("behind-{further}"), behind(further)));
        scenes.push((format!("before-{further}"), before(further)));
    }
    scenes.push(("blocks".to_owned(), blocks()));
    scenes.push(("near".to_owned(), surrounded(4.5)));
    scenes.push(("far".to_owned(), surrounded(45.0)));
    // Figs. 8 and 9. A vase meets its own rays: it is hollow at its waist.
    scenes.push(("cone".to_owned(), shape(|v| ((1.2 - 1.199 * v, 2.4 * v - 1.2), (-1.2, 2.4)))));
    scenes.push(("cylinder".to_owned(), shape(|v| ((0.8, 2.4 * v - 1.2), (0.0, 1.0)))));
    let waist = |v: f64| 0.75 + 0.4 * (TAU * v).cos();
    let slope = |v: f64| -0.4 * TAU * (TAU * v).sin();
    scenes.push(("concave".to_owned(), shape(|v| ((waist(v), 2.4 * v - 1.2), (slope(v), 2.4)))));
    scenes
}

/// Writes all scenes as NAME.obj into `dir`, which is created if it does not exist, with the
/// library `reflections.mtl`. Returns the paths.
///
/// # Errors
/// Those of the file system.
pub fn write_reflections(dir: &Path) -> io::Result<Vec<PathBuf>> {
    fs::create_dir_all(dir)?;
    fs::write(dir.join("reflections.mtl"), MTL)?;
    let write = |(name, text): NamedScene| {
        let path = dir.join(format!("{name}.obj"));
        fs::write(&path, text).map(|()| path)
    };
    scenes().into_iter().map(write).collect()
}

//! OBJ text with the habits of a program.

use std::fmt::Write;

use glam::{DVec2, DVec3};

use super::parts::PartFace;

/// The habits of a program.
#[derive(Clone, Copy, Default)]
pub(super) struct Style<'a> {
    pub header: &'a str,
    pub library: &'a str,
    /// Units in a metre; 0 is one.
    pub scale: f64,
    /// Whether the text has +y up.
    pub y_up: bool,
    /// Every so many faces are turned round; 0 for none.
    pub turned: usize,
    /// Whether indices count back from the latest.
    pub negative: bool,
    /// Whether curved faces have a smoothing group and no normals.
    pub groups: bool,
}

/// Returns the text of a model.
pub(super) fn obj(faces: &[PartFace], style: &Style) -> String {
    let mut text = format!("{}mtllib {}\n", style.header, style.library);
    let scale = if style.scale == 0.0 { 1.0 } else { style.scale };
    let turn = |v: DVec3| if style.y_up { DVec3::new(v.x, v.z, -v.y) } else { v };
    let (mut material, mut group) = ("", false);
    let (mut vertices, mut normals) = (0i64, 0i64);
    for (number, face) in faces.iter().enumerate() {
        for corner in &face.corners {
            let DVec3 { x, y, z } = turn(*corner) * scale;
            let _ = writeln!(text, "v {x:.6} {y:.6} {z:.6}");
        }
        for DVec2 { x, y } in &face.uvs {
            let _ = writeln!(text, "vt {x:.6} {y:.6}");
        }
        for normal in face.normals.iter().filter(|_| !style.groups) {
            let DVec3 { x, y, z } = turn(*normal);
            let _ = writeln!(text, "vn {x:.5} {y:.5} {z:.5}");
        }
        let count = face.corners.len() as i64;
        vertices += count;
        normals += if style.groups { 0 } else { count };
        if face.material != material {
            material = face.material;
            let _ = writeln!(text, "usemtl {material}");
        }
        if style.groups && face.is_curved != group {
            group = face.is_curved;
            let _ = writeln!(text, "s {}", if group { "1" } else { "off" });
        }
        let mut order: Vec<i64> = (0..count).collect();
        if style.turned > 0 && number % style.turned == 1 {
            order.reverse();
        }
        text += "f";
        for k in order {
            let (v, n) = match style.negative {
                true => (k - count, k - count),
                false => (vertices - count + 1 + k, normals - count + 1 + k),
            };
            let _ =
                if style.groups { write!(text, " {v}/{v}") } else { write!(text, " {v}/{v}/{n}") };
        }
        text += "\n";
    }
    text
}

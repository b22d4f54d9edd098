//! Writing objects as OBJ text.
//!
//! Invariant: coordinates are whole multiples of 10 µm. Triangles that this rounding flattens and
//! unused points are not written.

use crate::rooms::Object;
use glam::DVec3;
use std::collections::HashMap;
use std::fmt::Write;

/// Steps per metre to which coordinates are rounded.
const STEPS: f64 = 1e5;
/// Area in steps² below which a triangle is a sliver that rounding made: 1e-9 m².
const SLIVER: f64 = 10.0;

/// Returns the OBJ file of `objects`, with `library` as its materials.
pub fn write(objects: &[Object], library: &str) -> String {
    let mut text = format!("# Metres, +Z up.\nmtllib {library}\n");
    let mut written = 0;
    for Object { name, mesh } in objects {
        let _ = writeln!(text, "o {name}");
        let steps: Vec<[i64; 3]> =
            mesh.points.iter().map(|p| (*p * STEPS).to_array().map(|c| c.round() as i64)).collect();
        let mut numbers: HashMap<[i64; 3], usize> = HashMap::new();
        let mut faces: Vec<(&str, [usize; 3])> = Vec::with_capacity(mesh.faces.len());
        for face in &mesh.faces {
            let corners = face.corners.map(|c| steps[c as usize]);
            if area(corners) < SLIVER {
                continue;
            }
            let numbered = corners.map(|corner| {
                *numbers.entry(corner).or_insert_with(|| {
                    written += 1;
                    let [x, y, z] = corner.map(|c| c as f64 / STEPS);
                    let _ = writeln!(text, "v {x} {y} {z}");
                    written
                })
            });
            faces.push((face.material.name, numbered));
        }
        // One `usemtl` for each material of an object.
        faces.sort_by_key(|&(material, _)| material);
        let mut current = "";
        for (material, [a, b, c]) in faces {
            if material != current {
                let _ = writeln!(text, "usemtl {material}");
                current = material;
            }
            let _ = writeln!(text, "f {a} {b} {c}");
        }
    }
    text
}

fn area(corners: [[i64; 3]; 3]) -> f64 {
    let [a, b, c] = corners.map(|p| DVec3::from(p.map(|c| c as f64)));
    (b - a).cross(c - a).length() / 2.0
}

//! Photometric files that nodes name: in `extras`, as `{"ies": "lamp.ies"}`, or by their own name,
//! as `lamp.ies` or `lamp.ies.001`.
//!
//! A node hangs its luminaire upright: its nadir is the node's -Y. If the node has a punctual
//! light, the file takes that light's place, and the nadir is the light's direction.

use std::f64::consts::FRAC_PI_2;
use std::path::Path;

use glam::DMat4;
use serde_json::Value;

use super::reading::GltfReading;
use crate::luminaire::MAX_LUMINAIRES;
use crate::named_file::beside;
use crate::text::excerpt;
use crate::{LuminousPart, NamedPhotometry};

/// Endings of photometric files.
const ENDINGS: [&str; 2] = [".ies", ".ldt"];

/// Returns the photometric file that a node of a file's JSON names.
pub(super) fn named_by(node: &Value) -> Option<String> {
    let stated = node.get("extras").and_then(|extras| extras.get("ies"));
    if let Some(file) = stated.and_then(Value::as_str) {
        return Some(file.to_owned());
    }
    let name = node.get("name")?.as_str()?;
    let lower = name.to_ascii_lowercase();
    let end = ENDINGS.iter().find_map(|ending| Some(lower.find(ending)? + ending.len()))?;
    // Programs number nodes of the same name.
    let rest = name.get(end..)?.trim_start_matches(['.', '_', ' ', '-']);
    rest.bytes().all(|byte| byte.is_ascii_digit()).then(|| name[..end].to_owned())
}

/// Adds the luminaire of a node. Returns whether there is one.
pub(super) fn add(reading: &mut GltfReading, node: &gltf::Node, name: &str, matrix: DMat4) -> bool {
    let Some(file) = reading.photometry.get(&node.index()) else { return false };
    let folder = reading.path.parent().unwrap_or(Path::new(""));
    let path = beside(folder, file, "ies");
    if !path.is_file() {
        let text = format!("node {name}: there is no photometric file {}", excerpt(file));
        reading.count(text);
        return false;
    }
    if reading.model.photometry.len() == MAX_LUMINAIRES {
        reading.count("luminaires beyond the 65536th are ignored");
        return false;
    }
    let matrix = match node.light() {
        // The light's -z as the luminaire's -y.
        Some(_) => matrix * DMat4::from_rotation_x(FRAC_PI_2),
        None => matrix,
    };
    let part = LuminousPart::Node { name: name.to_owned(), matrix };
    reading.model.photometry.push(NamedPhotometry { path, part });
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extras_and_names_name_files() {
        let file = |json: &str| named_by(&serde_json::from_str(json).unwrap());
        let is = |json: &str, name: &str| assert_eq!(file(json).as_deref(), Some(name), "{json}");
        is(r#"{"extras":{"ies":"a b.ies"},"name":"desk"}"#, "a b.ies");
        is(r#"{"name":"desk.ies"}"#, "desk.ies");
        is(r#"{"name":"Desk.LDT.001"}"#, "Desk.LDT");
        for json in [r#"{"name":"desk"}"#, r#"{"name":"a.iesx"}"#, r#"{"extras":{"ies":1}}"#, "{}"]
        {
            assert_eq!(file(json), None, "{json}");
        }
    }
}

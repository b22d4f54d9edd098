//! glTF files from parts, for tests.

#![allow(clippy::panic)]

use base64::Engine as _;
use holo_scene::{LoadOptions, Loaded, SceneError};

/// The arrays of a glTF file, each with a view and an accessor of its own.
#[derive(Default)]
pub struct Arrays {
    bytes: Vec<u8>,
    views: Vec<String>,
    accessors: Vec<String>,
}

impl Arrays {
    /// Adds bytes as an array of `count` elements. `more` are further members of its accessor.
    pub fn add(
        &mut self,
        bytes: &[u8],
        component: u32,
        kind: &str,
        count: usize,
        more: &str,
    ) -> usize {
        let view = self.view(bytes, "");
        self.accessors.push(format!(
            r#"{{"bufferView":{view},"componentType":{component},"count":{count},"type":"{kind}"{more}}}"#
        ));
        self.accessors.len() - 1
    }

    /// Adds an array of floats.
    pub fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let size = ["SCALAR", "VEC2", "VEC3", "VEC4"].iter().position(|k| *k == kind);
        let size = size.map_or(16, |k| k + 1);
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.add(&bytes, 5126, kind, values.len() / size, "")
    }

    /// Adds a view without an accessor. `more` are further members.
    pub fn view(&mut self, bytes: &[u8], more: &str) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let (offset, length) = (self.bytes.len(), bytes.len());
        self.bytes.extend(bytes);
        self.views
            .push(format!(r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{length}{more}}}"#));
        self.views.len() - 1
    }

    /// Adds an accessor by its members.
    pub fn accessor(&mut self, members: &str) -> usize {
        self.accessors.push(format!("{{{members}}}"));
        self.accessors.len() - 1
    }

    /// Returns the members of the file's object.
    pub fn members(&self) -> String {
        let (length, data) = (self.bytes.len(), base64(&self.bytes));
        let (views, accessors) = (self.views.join(","), self.accessors.join(","));
        format!(
            r#""asset":{{"version":"2.0"}},"bufferViews":[{views}],"accessors":[{accessors}],
            "buffers":[{{"byteLength":{length},"uri":"data:;base64,{data}"}}]"#
        )
    }
}

pub fn base64(bytes: &[u8]) -> String {
    base64::engine::general_purpose::STANDARD.encode(bytes)
}

/// The arrays of a square from -1 to 1: positions, normals, texture coordinates and indices.
pub fn square() -> Arrays {
    let mut arrays = Arrays::default();
    arrays.floats("VEC3", &[-1.0, -1.0, 0.0, 1.0, -1.0, 0.0, 1.0, 1.0, 0.0, -1.0, 1.0, 0.0]);
    arrays.floats("VEC3", &[0.0, 0.0, 1.0].repeat(4));
    arrays.floats("VEC2", &[0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    arrays.add(&[0, 1, 2, 0, 2, 3], 5121, "SCALAR", 6, "");
    arrays
}

/// The attributes and indices of the square.
pub const SQUARE: &str = r#""attributes":{"POSITION":0,"NORMAL":1,"TEXCOORD_0":2},"indices":3"#;

/// A diffuse material.
pub const MATERIAL: &str =
    r#"{"pbrMetallicRoughness":{"baseColorFactor":[0.2,0.4,0.6,1],"metallicFactor":0}}"#;

/// A file with one mesh of one primitive. `more` are further members of the file.
pub fn file(arrays: &Arrays, primitive: &str, nodes: &str, materials: &str, more: &str) -> String {
    format!(
        r#"{{{},"meshes":[{{"primitives":[{{{primitive}}}]}}],"nodes":[{nodes}],
        "materials":[{materials}]{more}}}"#,
        arrays.members()
    )
}

/// Loads a file of this name and text from a folder of its own.
pub fn load_bytes(name: &str, bytes: impl AsRef<[u8]>) -> Result<Loaded, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    holo_scene::load(&path, &LoadOptions::default())
}

/// Loads a file that is valid.
pub fn load(json: &str) -> Loaded {
    load_bytes("s.gltf", json).unwrap_or_else(|error| panic!("{error}\n{json}"))
}

/// Returns the message of the error for a file that is not valid, without the file's name.
pub fn problem(json: &str) -> String {
    let error = load_bytes("s.gltf", json).unwrap_err().to_string();
    error.split_once("s.gltf: ").unwrap().1.to_owned()
}

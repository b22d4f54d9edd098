//! Scenes from text, for tests.

#![allow(dead_code, clippy::unwrap_used)]

pub mod gltf;
pub mod instanced;

use holo_scene::{LoadOptions, Loaded, Scene, SceneArrays, SceneError, Warning};
use std::path::Path;

/// The arrays of a scene without instances.
pub fn arrays_of(scene: &Scene) -> SceneArrays {
    let own = scene.own();
    let shading = scene.shading.as_deref().cloned().unwrap_or_default();
    SceneArrays {
        positions: own.positions.to_vec().into(),
        triangles: own.triangles.to_vec().into(),
        material_ids: own.material_ids.to_vec().into(),
        uvs: shading.uvs,
        normals: shading.normals,
        colours: shading.colours,
        opacities: shading.opacities,
    }
}

/// Loads `s.obj` with this text and `s.mtl` with that text, from a folder of their own.
pub fn load_with(
    obj: impl AsRef<[u8]>,
    mtl: &str,
    options: &LoadOptions,
) -> Result<Loaded, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("s.mtl"), mtl).unwrap();
    load_in(folder.path(), obj, options)
}

/// The same without an MTL file and with default options.
pub fn load(obj: impl AsRef<[u8]>) -> Result<Loaded, SceneError> {
    load_in(tempfile::tempdir().unwrap().path(), obj, &LoadOptions::default())
}

/// Writes and loads `s.obj` in a folder.
pub fn load_in(
    folder: &Path,
    obj: impl AsRef<[u8]>,
    options: &LoadOptions,
) -> Result<Loaded, SceneError> {
    let path = folder.join("s.obj");
    std::fs::write(&path, obj).unwrap();
    holo_scene::load(&path, options)
}

/// The messages of warnings, with only the name of the file.
pub fn messages(loaded: &Loaded) -> Vec<String> {
    let short = |warning: &Warning| {
        let name = warning.path.file_name().unwrap().to_string_lossy();
        warning.to_string().replacen(&warning.path.display().to_string(), &name, 1)
    };
    loaded.warnings.iter().map(short).collect()
}

/// The message of an error, with only the name of the file.
pub fn error(result: Result<Loaded, SceneError>) -> String {
    let shown = result.unwrap_err().to_string();
    let at = ["s.obj", "s.mtl"].iter().filter_map(|name| shown.find(name)).min().unwrap();
    shown[at..].to_owned()
}

//! Loading a scene from an OBJ file and its MTL files.
//!
//! `tobj` parses text that has been checked and simplified line by line. What cannot be interpreted
//! is left out. What is left out or replaced is a warning with its line and a count. A missing MTL
//! file or material becomes grey diffuse 0.5.

use crate::limits::{MAX_MATERIALS, MAX_MTL_BYTES, MAX_OBJ_BYTES};
use crate::mtl::MtlMaterial;
use crate::mtl_text::parse_mtl;
use crate::named_file::beside;
use crate::obj::{ObjFile, parse_obj};
use crate::obj_text::LoadProgress;
use crate::text::{excerpt, name_without_comment, read_text};
use crate::warnings::{Warning, Warnings};
use crate::{About, Material, Rgb, Scene, SceneError};
use serde::{Deserialize, Serialize};
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

/// Options for what a file cannot express.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LoadOptions {
    /// Radiance of the sky, the same in all directions, W·sr⁻¹·m⁻².
    pub sky: Rgb,
    /// Surfaces with `Ke` emit on both sides.
    pub two_sided_lights: bool,
}

/// A scene from a file, and warnings about what it does not represent.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// The scene, with at least one triangle. Its materials are those that triangles use, in order
    /// of first use.
    pub scene: Scene,
    /// What was ignored or replaced.
    pub warnings: Vec<Warning>,
    /// What the file says about its unit, its up axis and its cameras.
    pub about: About,
}

/// Reads a scene from an OBJ file and the MTL files that it names (relative to its folder).
///
/// Polygons, concave ones too, become triangles with the same winding. Normals, texture
/// coordinates, lines, points and triangles without area are ignored with a warning. The table of
/// [`crate::mtl`] defines the materials. In short, `illum` 3 is a mirror or rough metal, 4 a thin
/// pane, 7 a solid dielectric, 2 with `Ks` a coat; otherwise `Kd` is diffuse. `Ke` is one-sided
/// radiance.
///
/// # Errors
/// A file that cannot be read (except MTL files) or has no triangle; a sky that is not plausible;
/// more of anything than [`crate::limits`] allow.
pub fn load_obj(path: &Path, options: &LoadOptions) -> Result<Loaded, SceneError> {
    load_obj_watched(path, options, &mut |_| {})
}

/// Reads a scene as [`load_obj`] does, and calls `watch` some times a second while it reads.
///
/// # Errors
/// As [`load_obj`].
pub fn load_obj_watched(
    path: &Path,
    options: &LoadOptions,
    watch: &mut dyn FnMut(LoadProgress),
) -> Result<Loaded, SceneError> {
    let mut warnings = Warnings::default();
    let text = read_text(path, MAX_OBJ_BYTES)?;
    let obj = parse_obj(path, &text, watch, &mut warnings)?;
    let about = crate::header::read(&text);
    drop(text);
    if let Some(instead) = obj.instead {
        return Err(SceneError::Empty { path: path.to_owned(), instead });
    }
    let materials = materials(path, &obj, options, &mut warnings)?;
    let (scene, left_out) = Scene::from_world(
        &obj.positions,
        &obj.triangles,
        &obj.faces.material_ids(),
        materials,
        options.sky,
    )?;
    if let Some(&first) = left_out.first() {
        let text = format!("triangles without area are left out ({} in the file)", left_out.len());
        warnings.push(path, Some(obj.faces.line(first)), text);
    }
    if scene.triangles.is_empty() {
        let instead = format!("none of its triangles ({}) has an area", left_out.len());
        return Err(SceneError::Empty { path: path.to_owned(), instead });
    }
    Ok(Loaded { scene, warnings: warnings.finish(path), about })
}

/// Returns the materials of `obj.uses`, in that order.
fn materials(
    path: &Path,
    obj: &ObjFile,
    options: &LoadOptions,
    warnings: &mut Warnings,
) -> Result<Vec<Material>, SceneError> {
    let (library, any_file) = read_libraries(path, obj, warnings)?;
    let by_name = index(&library, warnings);
    let mut undefined = Vec::new();
    let mut materials = Vec::with_capacity(obj.uses.len());
    for wanted in &obj.uses {
        let Some(name) = wanted.name.as_deref() else {
            let text = "faces before any `usemtl`; grey diffuse 0.5 is taken".to_owned();
            warnings.push(path, Some(wanted.line), text);
            materials.push(Material::grey("default"));
            continue;
        };
        let found = by_name.get(name).or_else(|| by_name.get(name_without_comment(name)));
        materials.push(match found {
            Some(&id) => library[id].resolve(options.two_sided_lights, warnings),
            None => {
                undefined.push(wanted);
                Material::grey(name)
            }
        });
    }
    if any_file {
        for wanted in undefined {
            let name = excerpt(wanted.name.as_deref().unwrap_or_default());
            let text = format!("no MTL file has a material `{name}`; grey diffuse 0.5 is taken");
            warnings.push(path, Some(wanted.line), text);
        }
    } else if let Some(first) = undefined.first() {
        // One message for all materials, because the reason is the same.
        let text = format!(
            "no MTL file was read; grey diffuse 0.5 is taken for all materials ({})",
            undefined.len()
        );
        warnings.push(path, Some(first.line), text);
    }
    Ok(materials)
}

/// Returns an index of the materials by name, with and without what looks like a comment. Of
/// several materials with one name, the last counts.
fn index<'a>(library: &'a [MtlMaterial], warnings: &mut Warnings) -> HashMap<&'a str, usize> {
    let mut by_name = HashMap::new();
    for (id, material) in library.iter().enumerate() {
        if let Some(earlier) = by_name.insert(material.name.as_str(), id) {
            let earlier: &MtlMaterial = &library[earlier];
            let (name, line) = (excerpt(&material.name), earlier.line);
            let text = format!(
                "material `{name}` again; this one counts, not {}:{line}",
                earlier.path.display()
            );
            warnings.push(&material.path, Some(material.line), text);
        }
    }
    for (id, material) in library.iter().enumerate() {
        by_name.entry(name_without_comment(&material.name)).or_insert(id);
    }
    by_name
}

/// Returns all materials of all MTL files, and whether any file was read.
fn read_libraries(
    obj_path: &Path,
    obj: &ObjFile,
    warnings: &mut Warnings,
) -> Result<(Vec<MtlMaterial>, bool), SceneError> {
    let folder = obj_path.parent().unwrap_or(Path::new(""));
    let mut library = Vec::new();
    let mut seen = HashSet::new();
    let mut any_file = false;
    for (line, names) in &obj.libraries {
        for path in library_paths(folder, names) {
            if !seen.insert(path.clone()) {
                continue;
            }
            match read_library(&path) {
                Ok(text) => {
                    any_file = true;
                    library.extend(parse_mtl(&path, &text, warnings)?);
                    if library.len() > MAX_MATERIALS {
                        let (path, line) = (obj_path.to_owned(), *line);
                        let (what, limit) = ("materials in MTL files", MAX_MATERIALS);
                        return Err(SceneError::FileLimit { path, line, what, limit });
                    }
                }
                Err(error @ SceneError::FileTooLarge { .. }) => return Err(error),
                Err(error) => warnings.push(
                    obj_path,
                    Some(*line),
                    format!("`mtllib` cannot be read: {error}"),
                ),
            }
        }
    }
    let own = obj_path.with_extension("mtl");
    if !any_file && own.is_file() && !seen.contains(&own) {
        let text = format!("materials are taken from {}, which lies beside it", own.display());
        warnings.push(obj_path, None, text);
        library = parse_mtl(&own, &read_library(&own)?, warnings)?;
        any_file = true;
    }
    Ok((library, any_file))
}

/// Reads the text of an MTL file. Only regular files are read: a pipe or device might never end.
fn read_library(path: &Path) -> Result<String, SceneError> {
    if path.exists() && !path.is_file() {
        let source = std::io::Error::new(std::io::ErrorKind::InvalidInput, "not a file");
        return Err(SceneError::Io { path: path.to_owned(), source });
    }
    read_text(path, MAX_MTL_BYTES)
}

/// Returns the files that a `mtllib` line names. Spaces separate names in the format, but are
/// common within names. So the whole is one name if that file exists, or if no part of it is a
/// file.
fn library_paths(folder: &Path, names: &str) -> Vec<PathBuf> {
    let names = name_without_comment(names).trim_matches('"');
    let whole = beside(folder, names, "mtl");
    let parts: Vec<_> =
        names.split_ascii_whitespace().map(|name| beside(folder, name, "mtl")).collect();
    if whole.is_file() || !parts.iter().any(|part| part.is_file()) { vec![whole] } else { parts }
}

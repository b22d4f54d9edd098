//! Loading a scene from a model file.
//!
//! Parts of the file that cannot be interpreted are left out. A warning reports everything that is
//! left out or replaced, with a count, and with the line if the format has lines. A missing
//! material is grey diffuse 0.5.

use crate::assemble::{Assembled, assemble};
use crate::model::{FormatReader, LoadProgress, ModelFile};
use crate::warnings::{Warning, Warnings};
use crate::{
    LoadOptions, ModelFacts, NamedPhotometry, Scene, SceneError, glass, gltf_file, obj_model,
    other_formats,
};
use std::io::Read;
use std::path::Path;

/// A scene from a file, and warnings about what it does not represent.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// The scene, with at least one triangle. Its materials are those that triangles use, in order
    /// of first use.
    pub scene: Scene,
    /// Reports on everything that was ignored or replaced.
    pub warnings: Vec<Warning>,
    /// The unit, the up axis and the cameras that the file states.
    pub about: ModelFacts,
    /// Photometric files that the file names. They are not read yet.
    pub photometry: Vec<NamedPhotometry>,
}

/// Reads a scene from a model file: OBJ with its MTL files, or glTF 2.0 (`.gltf`, `.glb`). The
/// format follows from the contents.
///
/// Polygons, concave ones too, become triangles with the same winding. Lines, points and triangles
/// without area are ignored with a warning. The table of [`crate::mtl`] defines the materials of
/// OBJ. In short, `illum` 3 is a mirror or rough metal, 4 a thin pane, and 7 a solid dielectric. 2
/// with `Ks` is a coat; otherwise `Kd` is diffuse. `Ke` is one-sided radiance. The module
/// `gltf_file` does the same for glTF.
///
/// # Errors
/// A file that cannot be read or has no triangle; a sky that is not plausible; more of anything
/// than [`crate::limits`] allow. For glTF also missing or short buffers, and cyclic nodes.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Loaded, SceneError> {
    load_watched(path, options, &mut |_| {})
}

/// Reads a scene as [`load`] does, and calls `watch` some times a second while it reads.
///
/// # Errors
/// As [`load`].
pub fn load_watched(
    path: &Path,
    options: &LoadOptions,
    watch: &mut dyn FnMut(LoadProgress),
) -> Result<Loaded, SceneError> {
    let mut warnings = Warnings::default();
    let source = ModelFile { path, options, watch, warnings: &mut warnings };
    let mut model = (reader_for(path)?.read)(source)?;
    if let Some(instead) = model.instead.take() {
        let instead = other_formats::by_name(path).map_or(instead, ToOwned::to_owned);
        return Err(SceneError::Empty { path: path.to_owned(), instead });
    }
    let panes = glass::to_panes(&mut model);
    for (count, what) in [
        (
            panes.sheets,
            "sheets of solid glass with open edges enclose nothing: they are taken as panes",
        ),
        (panes.slabs, "thin slabs of solid glass are taken as panes in their middle"),
    ] {
        if count > 0 {
            warnings.push(path, None, format!("{what} ({count})"));
        }
    }
    let about = std::mem::take(&mut model.about);
    let photometry = std::mem::take(&mut model.photometry);
    let lines = std::mem::take(&mut model.lines);
    let Assembled { scene, left_out, left_out_of_meshes } = assemble(model, options.sky)?;
    let has_area_in_file = |triangle: &&usize| panes.left_out.binary_search(triangle).is_ok();
    let flat = || left_out.iter().filter(|triangle| !has_area_in_file(triangle));
    let count = flat().count() + left_out_of_meshes - panes.left_out_of_meshes;
    if count > 0 {
        let line = flat().next().and_then(|&first| lines.line(first));
        let text = format!("triangles without area are left out ({count} in the file)");
        warnings.push(path, line, text);
    }
    if scene.triangles().is_empty() {
        let instead = format!("none of its triangles ({count}) has an area");
        return Err(SceneError::Empty { path: path.to_owned(), instead });
    }
    Ok(Loaded { scene, warnings: warnings.finish(path), about, photometry })
}

/// All readers. The last one accepts every file. If it cannot read the file, its error names the
/// file's format.
const READERS: [FormatReader; 2] = [gltf_file::READER, obj_model::READER];

/// Bytes at the beginning of a file that are used to recognise its format.
const FIRST_BYTES: u64 = 256;

/// Returns the reader for a file.
fn reader_for(path: &Path) -> Result<FormatReader, SceneError> {
    let io = |source| SceneError::Io { path: path.to_owned(), source };
    let mut first = Vec::new();
    let file = std::fs::File::open(path).map_err(io)?;
    // A pipe can be read only once.
    if file.metadata().map_err(io)?.is_file() {
        file.take(FIRST_BYTES).read_to_end(&mut first).map_err(io)?;
    }
    if let Some(problem) = other_formats::by_content(&first, path) {
        return Err(SceneError::Foreign { path: path.to_owned(), problem });
    }
    let found = READERS.into_iter().find(|reader| (reader.recognises)(&first, path));
    Ok(found.unwrap_or(obj_model::READER))
}

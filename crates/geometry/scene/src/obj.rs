//! Reading OBJ text: world-space triangles and names of materials.
//!
//! `tobj` parses the text as [`CleanObj`] passes it on: indices are in range, and coordinates are
//! finite and within [`crate::limits::MAX_COORDINATE`]. Faces arrive with all their corners.
//! Polygons are divided here, because `tobj` only makes fans, which are wrong for concave polygons.

use crate::SceneError;
use crate::faces::Faces;
use crate::foreign;
use crate::model::LoadProgress;
use crate::obj_checked::{Checked, MaterialUse};
use crate::obj_ignored::CROSSED;
use crate::obj_text::CleanObj;
use crate::polygon::triangulate;
use crate::warnings::Warnings;
use glam::{DVec3, Vec3};
use std::path::Path;

/// The contents of an OBJ file.
pub(crate) struct ObjFile {
    /// Positions that faces use; each once, or once for each [`crate::obj_text::FACES_AT_ONCE`]
    /// faces.
    pub positions: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
    /// The line of each triangle's face, and an index into `uses`.
    pub faces: Faces,
    /// The materials that faces use, in order of first use.
    pub uses: Vec<MaterialUse>,
    /// The text after each `mtllib`, with its line.
    pub libraries: Vec<(usize, String)>,
    /// For each triangle, which corners of the file's faces it has. Empty without `attributes` and
    /// `colours`.
    pub corners: Vec<[u32; 3]>,
    /// Texture coordinate and normal of each corner of the file's faces.
    pub attributes: Vec<[u32; 2]>,
    pub texcoords: Vec<[f32; 2]>,
    pub normals: Vec<Vec3>,
    /// The smoothing group of each triangle. Empty if there is none.
    pub groups: Vec<u32>,
    /// The colour of each vertex of the file. Empty if none has one.
    pub colours: Vec<[f32; 3]>,
    /// The vertex of each corner of the file's faces. Empty without `colours`.
    pub coloured: Vec<u32>,
    /// The file's real format, for people, if it has no triangle.
    pub instead: Option<String>,
}

/// Reads OBJ text; `path` is for messages.
pub(crate) fn parse_obj(
    path: &Path,
    text: &str,
    watch: &mut dyn FnMut(LoadProgress),
    warnings: &mut Warnings,
) -> Result<ObjFile, SceneError> {
    let mut clean = CleanObj::new(path, text, watch);
    // The clean text names no MTL file. They are read when the used materials are known.
    let no_library = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
    let parsed = tobj::load_obj_buf(&mut clean, &tobj::LoadOptions::default(), no_library);
    let mut checked = clean.finish()?;
    let (models, _) =
        parsed.map_err(|source| SceneError::Parser { path: path.to_owned(), source })?;

    let mut positions = Vec::new();
    let mut triangles = Vec::with_capacity(checked.faces.triangles());
    // Reused for all faces: allocating them costs more than a face.
    let (mut corners, mut cut) = (Vec::new(), Vec::new());
    // Corners of faces so far, and those of each triangle.
    let (mut passed, mut corners_of) = (0u32, Vec::new());
    let has_attributes = !(checked.corners.is_empty() && checked.colours.is_empty());
    for tobj::Model { mesh, .. } in models {
        let first = positions.len() as u32;
        positions.extend(mesh.positions.chunks_exact(3).map(DVec3::from_slice));
        if mesh.face_arities.is_empty() {
            let triangle = |t: &[u32]| [first + t[0], first + t[1], first + t[2]];
            triangles.extend(mesh.indices.chunks_exact(3).map(triangle));
            if has_attributes {
                let added = mesh.indices.len() as u32 / 3;
                corners_of.extend((0..added).map(|k| [0, 1, 2].map(|j| passed + 3 * k + j)));
            }
            passed += mesh.indices.len() as u32;
            continue;
        }
        let mut indices = mesh.indices.iter().map(|index| first + index);
        let mut face: Vec<u32> = Vec::new();
        for &arity in &mesh.face_arities {
            face.clear();
            face.extend(indices.by_ref().take(arity as usize));
            corners.clear();
            corners.extend(face.iter().map(|&k| positions[k as usize]));
            cut.clear();
            if !triangulate(&corners, &mut cut) {
                let line = checked.faces.line(triangles.len()).unwrap_or(0);
                checked.ignored.count(CROSSED, line);
            }
            triangles.extend(cut.iter().map(|t| t.map(|k| face[k])));
            if has_attributes {
                corners_of.extend(cut.iter().map(|t| t.map(|k| passed + k as u32)));
            }
            passed += arity;
        }
    }
    let instead = triangles.is_empty().then(|| recognise(text, &checked));
    checked.ignored.warn(path, warnings);
    Ok(ObjFile {
        positions,
        triangles,
        faces: checked.faces,
        uses: checked.uses,
        libraries: checked.libraries,
        corners: corners_of,
        attributes: checked.corners,
        texcoords: checked.texcoords,
        normals: checked.normals,
        groups: checked.groups,
        colours: checked.colours,
        coloured: checked.coloured,
        instead,
    })
}

/// Returns what a file without triangles is, and what to do.
fn recognise(text: &str, checked: &Checked) -> String {
    let start = text.trim_start_matches(['\u{feff}', ' ', '\t', '\r', '\n']);
    if let Some((line, example)) = checked.ignored.first_left_out()
        && checked.faces_left_out > 0
    {
        let count = checked.faces_left_out;
        return format!(
            "all faces ({count}) are left out; the first reason, line {line}: {example}"
        );
    }
    if let Some(what) = foreign::format(text) {
        return what.to_owned();
    }
    if checked.vertices > 0 {
        let kind = if checked.ignored.has_lines() { "points and lines" } else { "points" };
        return format!("it has only {kind} ({} `v` lines) and no face", checked.vertices);
    }
    if start.is_empty() {
        return "it is empty".to_owned();
    }
    if text.chars().take(4096).any(|c| c == '\0' || c == char::REPLACEMENT_CHARACTER) {
        return "it is a binary file, and OBJ is text".to_owned();
    }
    "it has no `v` and no `f` line, so it is no OBJ file".to_owned()
}

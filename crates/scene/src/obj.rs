//! Reading OBJ text: world-space triangles and names of materials.
//!
//! `tobj` parses the text as [`CleanObj`] passes it on: indices are in range, and coordinates are
//! finite and within [`crate::limits::MAX_COORDINATE`]. Faces arrive with all their corners.
//! Polygons are divided here, because `tobj` only makes fans, which are wrong for concave polygons.

use crate::faces::Faces;
use crate::limits::MAX_OBJ_BYTES;
use crate::obj_text::{CROSSED, Checked, CleanObj, LoadProgress, MaterialUse};
use crate::polygon::triangulate;
use crate::reader::{Model, Reader};
use crate::text::read_text;
use crate::warnings::Warnings;
use crate::{LoadOptions, SceneError, libraries};
use glam::DVec3;
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
    /// What the file is, for people, if it has no triangle.
    pub instead: Option<String>,
}

pub(crate) const READER: Reader = Reader { recognises: |_, _| true, read };

fn read(
    path: &Path,
    options: &LoadOptions,
    watch: &mut dyn FnMut(LoadProgress),
    warnings: &mut Warnings,
) -> Result<Model, SceneError> {
    let text = read_text(path, MAX_OBJ_BYTES)?;
    let about = crate::header::read(&text);
    let obj = parse_obj(path, &text, watch, warnings)?;
    drop(text);
    let materials = match obj.instead {
        None => libraries::materials(path, &obj, options, warnings)?,
        Some(_) => Vec::new(),
    };
    Ok(Model {
        positions: obj.positions,
        triangles: obj.triangles,
        material_ids: obj.faces.material_ids(),
        materials,
        about,
        lines: obj.faces,
        instead: obj.instead,
    })
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
    for tobj::Model { mesh, .. } in models {
        let first = positions.len() as u32;
        positions.extend(mesh.positions.chunks_exact(3).map(DVec3::from_slice));
        if mesh.face_arities.is_empty() {
            let triangle = |t: &[u32]| [first + t[0], first + t[1], first + t[2]];
            triangles.extend(mesh.indices.chunks_exact(3).map(triangle));
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
        instead,
    })
}

/// First bytes of formats that are not OBJ, and what to say.
const OTHERS: [(&str, &str); 16] = [
    ("ply", "it is a PLY file"),
    ("solid", "it is an STL file"),
    ("Kaydara FBX", "it is an FBX file"),
    ("; FBX", "it is an FBX file"),
    ("BLENDER", "it is a Blender file"),
    ("PK\u{3}\u{4}", "it is a zip archive: unpack it"),
    ("<?xml", "it is XML, perhaps COLLADA"),
    ("<COLLADA", "it is a COLLADA file"),
    ("<!DOCTYPE", "it is a web page"),
    ("<html", "it is a web page"),
    ("#VRML", "it is a VRML file"),
    ("#?RADIANCE", "it is a Radiance picture or octree"),
    ("ISO-10303-21", "it is a STEP or IFC file"),
    ("newmtl", "it is an MTL file: name the .obj file that uses it"),
    ("3D Geometry File Format", "it is a 3DM file"),
    ("version https://git-lfs", "it is a pointer of Git LFS: fetch the file itself"),
];

/// Returns what a file without triangles is, and what to do.
fn recognise(text: &str, checked: &Checked) -> String {
    let start = text.trim_start_matches(['\u{feff}', ' ', '\t', '\r', '\n']);
    let begins = |with: &str| start.get(..with.len()).is_some_and(|s| s.eq_ignore_ascii_case(with));
    if let Some((line, example)) = checked.ignored.first_left_out()
        && checked.faces_left_out > 0
    {
        let count = checked.faces_left_out;
        return format!(
            "all faces ({count}) are left out; the first reason, line {line}: {example}"
        );
    }
    if let Some((_, what)) = OTHERS.iter().find(|(with, _)| begins(with)) {
        return (*what).to_owned();
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

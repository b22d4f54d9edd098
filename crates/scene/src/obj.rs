//! OBJ text into world-space triangles and names of materials.
//!
//! `tobj` parses it, reading through [`CleanObj`]: what comes out has indices in range and finite coordinates within
//! [`crate::limits::MAX_COORDINATE`]. Faces arrive with all their corners; polygons are cut here, since `tobj` knows
//! only fans, which are wrong for concave ones.

use crate::SceneError;
use crate::faces::Faces;
use crate::load::{LoadProgress, Warnings};
use crate::obj_text::{CROSSED, CleanObj, MaterialUse};
use crate::polygon::triangulate;
use glam::DVec3;
use std::path::Path;

/// What an OBJ file says.
pub(crate) struct ObjFile {
    /// Those that faces use; each once, or once for each [`crate::obj_text::FACES_AT_ONCE`] faces.
    pub positions: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
    /// For each triangle, the line of its face, and an index into `uses`.
    pub faces: Faces,
    /// The materials that faces have, in order of first use.
    pub uses: Vec<MaterialUse>,
    /// What follows each `mtllib`, with its line.
    pub libraries: Vec<(usize, String)>,
}

/// Reads OBJ text; `path` is for messages.
pub(crate) fn parse_obj(
    path: &Path,
    text: &str,
    watch: &mut dyn FnMut(LoadProgress),
    warnings: &mut Warnings,
) -> Result<ObjFile, SceneError> {
    let mut clean = CleanObj::new(path, text, watch);
    // The clean text names no MTL file: those are read once it is known which materials are used.
    let no_library = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
    let parsed = tobj::load_obj_buf(&mut clean, &tobj::LoadOptions::default(), no_library);
    let mut checked = clean.finish()?;
    let (models, _) =
        parsed.map_err(|source| SceneError::Parser { path: path.to_owned(), source })?;

    let mut positions = Vec::new();
    let mut triangles = Vec::with_capacity(checked.faces.triangles());
    // Kept between faces: allocating them anew for each costs more than the face.
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
                checked.ignored.count(CROSSED, checked.faces.line(triangles.len()));
            }
            triangles.extend(cut.iter().map(|t| t.map(|k| face[k])));
        }
    }
    checked.ignored.warn(path, warnings);
    Ok(ObjFile {
        positions,
        triangles,
        faces: checked.faces,
        uses: checked.uses,
        libraries: checked.libraries,
    })
}

//! Contents of an OBJ text other than the numbers and faces that are passed on to `tobj`.

use glam::Vec3;

use crate::faces::Faces;
use crate::obj_ignored::Ignored;

/// No texture coordinate, or no normal.
pub(crate) const NONE: u32 = u32::MAX;

/// The colour of a vertex that has none.
pub(crate) const NO_COLOUR: [f32; 3] = [f32::NAN; 3];

/// A material as an OBJ file names it.
pub(crate) struct MaterialUse {
    /// `None` for faces before any `usemtl`.
    pub name: Option<String>,
    /// The line of the first `usemtl`, or of the first face without one.
    pub line: usize,
}

/// Contents of a text other than numbers and faces.
#[derive(Default)]
pub(crate) struct Checked {
    /// The line of each face, and its material as an index into `uses`.
    pub faces: Faces,
    /// The materials that faces use, in order of first use.
    pub uses: Vec<MaterialUse>,
    /// The text after each `mtllib`, with its line.
    pub libraries: Vec<(usize, String)>,
    pub ignored: Ignored,
    /// `vt` and `vn`; a normal that cannot be read is 0.
    pub texcoords: Vec<[f32; 2]>,
    pub normals: Vec<Vec3>,
    /// Texture coordinate and normal of each corner of each face that was passed on; [`NONE`] if it
    /// has none. Empty if no corner has any.
    pub corners: Vec<[u32; 2]>,
    /// The smoothing group of each triangle. Empty if all are in group 0.
    pub groups: Vec<u32>,
    /// The colour after the coordinates of each `v`, or [`NO_COLOUR`]. Empty if none has a colour.
    pub colours: Vec<[f32; 3]>,
    /// The vertex, from 0, of each corner of each face that was passed on. Empty without `colours`.
    pub coloured: Vec<u32>,
    /// Number of `v` lines.
    pub vertices: usize,
    /// Number of faces that were left out.
    pub faces_left_out: usize,
}

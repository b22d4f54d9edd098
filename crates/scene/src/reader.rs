//! Readers of model files, one for each format, behind one interface.
//!
//! A format is one module that has a [`Reader`], and an entry in [`READERS`].

use std::io::Read as _;
use std::path::Path;

use glam::DVec3;

use crate::obj_text::LoadProgress;
use crate::warnings::Warnings;
use crate::{About, LoadOptions, Material, SceneError, gltf_file, obj};

/// What a reader finds in a file, in world coordinates.
#[derive(Default)]
pub(crate) struct Model {
    pub positions: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
    /// An index into `materials` for each triangle.
    pub material_ids: Vec<u32>,
    pub materials: Vec<Material>,
    pub about: About,
    /// The line of each triangle, for messages. Empty if the format has no lines.
    pub lines: crate::faces::Faces,
    /// What the file is, for people, if it has no triangle.
    pub instead: Option<String>,
}

/// Reads a file, and reports how far it is.
pub(crate) type Read = fn(
    &Path,
    &LoadOptions,
    &mut dyn FnMut(LoadProgress),
    &mut Warnings,
) -> Result<Model, SceneError>;

/// Reads one format.
pub(crate) struct Reader {
    /// Returns whether a file is of this format, by its first bytes and its name.
    pub recognises: fn(&[u8], &Path) -> bool,
    /// Reads a file.
    pub read: Read,
}

/// All readers. The last one takes every file, and says what it is if it cannot read it.
const READERS: [Reader; 2] = [gltf_file::READER, obj::READER];

/// Bytes by which a format is recognised.
const FIRST_BYTES: u64 = 256;

/// Returns the reader for a file.
pub(crate) fn reader_for(path: &Path) -> Result<Reader, SceneError> {
    let io = |source| SceneError::Io { path: path.to_owned(), source };
    let mut first = Vec::new();
    let file = std::fs::File::open(path).map_err(io)?;
    // A pipe can be read only once.
    if file.metadata().map_err(io)?.is_file() {
        file.take(FIRST_BYTES).read_to_end(&mut first).map_err(io)?;
    }
    let found = READERS.into_iter().find(|reader| (reader.recognises)(&first, path));
    Ok(found.unwrap_or(obj::READER))
}

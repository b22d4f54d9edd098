//! The buffers of a glTF file: in it, or in files beside it.

use std::cell::Cell;
use std::path::Path;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use crate::SceneError;
use crate::limits::MAX_OBJ_BYTES;
use crate::named_file::{beside, read_file};
use crate::text::excerpt;

/// The bytes of all buffers, by index. A buffer that cannot be read is an error.
pub(super) struct Buffers {
    all: Vec<Vec<u8>>,
    /// Number of elements and corners of triangles that may still be read.
    left: Cell<u64>,
    most: u64,
}

impl Buffers {
    /// Loads the buffers of a file of `file_bytes` bytes. `repeated` is
    /// [`MAX_REPEATED`](crate::limits::MAX_REPEATED).
    pub(super) fn load(
        path: &Path,
        document: &gltf::Document,
        blob: Option<Vec<u8>>,
        file_bytes: u64,
        repeated: u64,
    ) -> Result<Buffers, SceneError> {
        let mut blob = blob;
        let mut left = MAX_OBJ_BYTES;
        let mut bytes_in_all = file_bytes;
        let mut all = Vec::new();
        for buffer in document.buffers() {
            let bytes = match buffer.source() {
                gltf::buffer::Source::Bin => blob.take().ok_or_else(|| SceneError::Gltf {
                    path: path.to_owned(),
                    problem: "its buffer is missing: the .glb has no binary part".to_owned(),
                })?,
                gltf::buffer::Source::Uri(uri) => bytes_of(path, uri, left)?,
            };
            left = left.saturating_sub(bytes.len() as u64);
            bytes_in_all = bytes_in_all.saturating_add(bytes.len() as u64);
            all.push(bytes);
        }
        // A byte may be an index in a strip, which is an element and makes a triangle.
        let most = bytes_in_all.saturating_mul(4).saturating_add(repeated);
        Ok(Buffers { all, left: Cell::new(most), most })
    }

    /// Counts elements of arrays that are to be read, or corners of triangles that are to be made.
    /// An error is a text for people.
    pub(super) fn count(&self, elements: usize) -> Result<(), String> {
        let left = self.left.get().checked_sub(elements as u64).ok_or_else(|| {
            let most = self.most;
            format!(
                "the nodes up to here need more than {most} elements of arrays, so nearly all of \
                 these are copies: join or remove nodes whose meshes shine or have few triangles"
            )
        })?;
        self.left.set(left);
        Ok(())
    }

    /// Returns the bytes of a view. An error is a text for people.
    pub(super) fn view(&self, view: &gltf::buffer::View) -> Result<&[u8], String> {
        let buffer = self.all.get(view.buffer().index()).map_or(&[][..], Vec::as_slice);
        let end = view.offset().checked_add(view.length());
        end.and_then(|end| buffer.get(view.offset()..end)).ok_or_else(|| {
            format!(
                "buffer view {} ends beyond its buffer, which has {} bytes",
                view.index(),
                buffer.len()
            )
        })
    }
}

/// Returns the bytes that a URI names: in the URI itself, or in a file in the folder of `path`.
pub(super) fn bytes_of(path: &Path, uri: &str, limit: u64) -> Result<Vec<u8>, SceneError> {
    let problem = |problem: String| SceneError::Gltf { path: path.to_owned(), problem };
    if let Some(data) = uri.strip_prefix("data:") {
        let (_, text) = data
            .split_once(";base64,")
            .ok_or_else(|| problem(format!("`{}` has no base64 data", excerpt(uri))))?;
        let decoded = STANDARD.decode(text.trim());
        return decoded.map_err(|error| problem(format!("its base64 data are damaged: {error}")));
    }
    let name = percent_decoded(uri);
    let file = beside(path.parent().unwrap_or(Path::new("")), &name, "bin");
    if !file.is_file() {
        return Err(problem(format!(
            "`{}` is not in its folder: put it there (files elsewhere are not read)",
            excerpt(&name)
        )));
    }
    read_file(&file, limit)
}

/// Returns a URI's path with `%20` and the like decoded.
fn percent_decoded(uri: &str) -> String {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((&first, after)) = rest.split_first() {
        let code = after.get(..2).and_then(|hex| str::from_utf8(hex).ok());
        match code.and_then(|hex| u8::from_str_radix(hex, 16).ok()).filter(|_| first == b'%') {
            Some(byte) => {
                bytes.push(byte);
                rest = &after[2..];
            }
            None => {
                bytes.push(first);
                rest = after;
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escapes_of_uris_are_decoded_and_nothing_else() {
        assert_eq!(percent_decoded("my%20file%2e.bin"), "my file..bin");
        assert_eq!(percent_decoded("100%"), "100%");
        assert_eq!(percent_decoded("%zz%C3%A4"), "%zzä");
    }
}

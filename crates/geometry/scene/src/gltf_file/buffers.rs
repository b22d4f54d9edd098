//! The buffers of a glTF file: in it, or in files beside it.

use std::cell::Cell;
use std::path::Path;

use base64::Engine as _;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

use crate::foreign;
use crate::limits::MAX_OBJ_BYTES;
use crate::named_file::{beside, read_file};
use crate::text::excerpt;

/// The bytes of all buffers, by index.
pub(super) struct Buffers {
    /// A buffer that cannot be read is an error once its bytes are needed.
    all: Vec<Result<Vec<u8>, String>>,
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
    ) -> Buffers {
        let mut blob = blob;
        let mut left = MAX_OBJ_BYTES;
        let mut bytes_in_all = file_bytes;
        let mut all = Vec::new();
        for buffer in document.buffers() {
            let bytes = match buffer.source() {
                gltf::buffer::Source::Bin => blob
                    .take()
                    .ok_or_else(|| "its buffer is missing: the .glb has no binary part".to_owned()),
                gltf::buffer::Source::Uri(uri) => bytes_of(path, uri, left),
            };
            let length = bytes.as_ref().map_or(0, |bytes| bytes.len() as u64);
            left = left.saturating_sub(length);
            bytes_in_all = bytes_in_all.saturating_add(length);
            all.push(bytes);
        }
        // A byte may be an index in a strip, which is an element and makes a triangle.
        let most = bytes_in_all.saturating_mul(4).saturating_add(repeated);
        Buffers { all, left: Cell::new(most), most }
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

    /// Returns the bytes of a view; fewer if the view ends beyond its buffer, because what is read
    /// may still be there. An error is a text for people.
    pub(super) fn view(&self, view: &gltf::buffer::View) -> Result<&[u8], String> {
        let buffer = match self.all.get(view.buffer().index()) {
            Some(bytes) => bytes.as_ref().map_err(Clone::clone)?.as_slice(),
            None => &[],
        };
        let end = view.offset().saturating_add(view.length()).min(buffer.len());
        buffer.get(view.offset()..end).ok_or_else(|| {
            let (view, bytes) = (view.index(), buffer.len());
            format!("buffer view {view} begins beyond its buffer, which has {bytes} bytes")
        })
    }
}

/// Returns the bytes that a URI names: in the URI itself, or in a file in the folder of `path`. An
/// error is a text for people.
pub(super) fn bytes_of(path: &Path, uri: &str, limit: u64) -> Result<Vec<u8>, String> {
    let is_data = |scheme: &str| scheme.eq_ignore_ascii_case("data:");
    if let Some((_, data)) = uri.trim_start().split_at_checked(5).filter(|(s, _)| is_data(s)) {
        return data_of(data).map_err(|problem| format!("`{}` {problem}", excerpt(uri)));
    }
    let name = percent_decoded(uri);
    let file = beside(path.parent().unwrap_or(Path::new("")), &name, "bin");
    if !file.is_file() {
        return Err(format!(
            "`{}` is not in its folder: put it there (files elsewhere are not read)",
            excerpt(&name)
        ));
    }
    let bytes = read_file(&file, limit).map_err(|error| error.to_string())?;
    match foreign::pointer(&bytes) {
        Some(what) => Err(format!("`{}`: {what}", excerpt(&name))),
        None => Ok(bytes),
    }
}

/// Reads base64 as browsers do: with or without padding, in lines, and with escapes.
const LOOSE: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true),
);

/// Returns the bytes of a data URI, without its scheme.
fn data_of(data: &str) -> Result<Vec<u8>, String> {
    let none = || "has no base64 data".to_owned();
    let (kind, text) = data.split_once(',').ok_or_else(none)?;
    let encoding = kind.rsplit(';').next().unwrap_or_default();
    if !encoding.trim().eq_ignore_ascii_case("base64") {
        return Err(none());
    }
    let mut text: Vec<u8> = match text.contains('%') {
        true => percent_decoded(text).into_bytes(),
        false => text.as_bytes().to_vec(),
    };
    text.retain(|byte| !byte.is_ascii_whitespace());
    for byte in &mut text {
        // The alphabet for URIs.
        *byte = match *byte {
            b'-' => b'+',
            b'_' => b'/',
            other => other,
        };
    }
    LOOSE.decode(text).map_err(|error| format!("is damaged: its base64 data: {error}"))
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
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn escapes_of_uris_are_decoded_and_nothing_else() {
        assert_eq!(percent_decoded("my%20file%2e.bin"), "my file..bin");
        assert_eq!(percent_decoded("100%"), "100%");
        assert_eq!(percent_decoded("%zz%C3%A4"), "%zzä");
    }

    #[test]
    fn data_are_read_as_browsers_read_them() {
        let path = Path::new("s.gltf");
        for uri in [
            "data:image/png;base64,/+8AAQ==",
            "data:image/png;base64,/+8AAQ",
            "data:;base64,/+8A\n  AQ=\r\n=",
            "DATA:application/octet-stream;charset=utf-8;BASE64,/+8AAQ==",
            "data:;base64,%2F%2B8AAQ%3D%3D",
            " data:;base64,_-8AAQ",
        ] {
            assert_eq!(bytes_of(path, uri, 0), Ok(vec![0xff, 0xef, 0, 1]), "{uri}");
        }
        for (uri, problem) in [
            ("data:;base64,*", "is damaged"),
            ("data:text/plain,abc", "has no base64 data"),
            ("data:", "has no base64 data"),
        ] {
            let found = bytes_of(path, uri, 0).unwrap_err();
            assert!(found.contains(problem), "{uri}: {found}");
        }
    }
}

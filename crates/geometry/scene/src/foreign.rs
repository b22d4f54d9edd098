//! Recognises files that are no model, or models in formats that are not read.

/// The beginning of what Git has in place of a large file.
const POINTER: &str = "version https://git-lfs";

const IS_POINTER: &str = "it is a pointer of Git LFS: fetch the file itself";
const IS_PAGE: &str = "it is a web page";

/// Returns what a file is that came in place of another one, such as a buffer or a picture.
pub(crate) fn pointer(bytes: &[u8]) -> Option<&'static str> {
    let first = String::from_utf8_lossy(bytes.get(..64).unwrap_or(bytes));
    format(&first).filter(|what| [IS_POINTER, IS_PAGE].contains(what))
}

/// First bytes of such files, and what to say.
const FORMATS: [(&str, &str); 23] = [
    ("ply", "it is a PLY file"),
    ("solid", "it is an STL file"),
    ("Kaydara FBX", "it is an FBX file"),
    ("; FBX", "it is an FBX file"),
    ("BLENDER", "it is a Blender file"),
    ("PK\u{3}\u{4}", "it is a zip archive: unpack it"),
    ("<?xml", "it is XML, perhaps COLLADA"),
    ("<COLLADA", "it is a COLLADA file"),
    ("<!DOCTYPE", IS_PAGE),
    ("<html", IS_PAGE),
    ("#VRML", "it is a VRML file"),
    ("#?RADIANCE", "it is a Radiance picture or octree"),
    ("ISO-10303-21", "it is a STEP or IFC file"),
    ("newmtl", "it is an MTL file: name the .obj file that uses it"),
    ("3D Geometry File Format", "it is a 3DM file"),
    (POINTER, IS_POINTER),
    ("#usda", "it is a USD file, which is not read: export it as glTF"),
    ("PXR-USDC", "it is a USD file, which is not read: export it as glTF"),
    ("%PDF", "it is a PDF file"),
    ("7z\u{bc}\u{af}", "it is a 7z archive: unpack it"),
    ("Rar!", "it is a RAR archive: unpack it"),
    ("\u{89}PNG", "it is a picture"),
    ("AC10", "it is a DWG file"),
];

/// Returns what a text is and what to do, if its beginning is that of another format. Bytes that
/// are not UTF-8 may have become U+FFFD.
pub(crate) fn format(text: &str) -> Option<&'static str> {
    let start = text.trim_start_matches(['\u{feff}', ' ', '\t', '\r', '\n']);
    // The magic number of gzip is not UTF-8.
    if start.starts_with("\u{1f}\u{fffd}\u{8}") || start.starts_with("\u{1f}\u{8b}\u{8}") {
        return Some("it is compressed by gzip: unpack it");
    }
    let begins = |with: &str| {
        let mut found = start.chars();
        with.chars().all(|wanted| {
            let is_same = |c: char| c.eq_ignore_ascii_case(&wanted);
            found.next().is_some_and(|c| is_same(c) || (!wanted.is_ascii() && c == '\u{fffd}'))
        })
    };
    FORMATS.iter().find(|(with, _)| begins(with)).map(|(_, what)| *what)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_recognised_by_their_first_bytes() {
        let of = |bytes: &[u8]| format(&String::from_utf8_lossy(bytes)).unwrap_or("nothing");
        for (bytes, what) in [
            (&b"version https://git-lfs.github.com/spec/v1\noid"[..], "a pointer of Git LFS"),
            (b"  <!doctype html><html>", "a web page"),
            (b"\x1f\x8b\x08\x00abc", "compressed by gzip"),
            (b"#usda 1.0", "a USD file"),
            (b"PXR-USDC\0\0", "a USD file"),
            (b"\x89PNG\r\n\x1a\n", "a picture"),
            (b"7z\xbc\xaf\x27\x1c", "a 7z archive"),
            (b"v 0 0 0", "nothing"),
            (b"", "nothing"),
        ] {
            assert!(of(bytes).contains(what), "{what}: {}", of(bytes));
        }
    }
}

//! Formats of picture files.

use std::path::Path;

/// A file format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Format {
    /// Radiance RGBE, `.hdr` and `.pic`: exact to 0.4 % of the largest channel.
    Hdr,
    /// Portable float map, `.pfm`: exact.
    Pfm,
    /// OpenEXR with 32-bit floats, `.exr`: exact.
    Exr,
    /// Tone mapped, 8 bits, `.png`: for writing only.
    Png,
}

impl Format {
    /// Returns the format of a path's extension, in upper or lower case.
    pub fn of_path(path: &Path) -> Option<Format> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "hdr" | "pic" => Some(Format::Hdr),
            "pfm" => Some(Format::Pfm),
            "exr" => Some(Format::Exr),
            "png" => Some(Format::Png),
            _ => None,
        }
    }

    /// Returns the format that the first bytes of a file belong to.
    pub fn of_bytes(bytes: &[u8]) -> Option<Format> {
        match bytes {
            [b'#', b'?', ..] => Some(Format::Hdr),
            [b'P', b'F' | b'f', ..] => Some(Format::Pfm),
            [0x76, 0x2f, 0x31, 0x01, ..] => Some(Format::Exr),
            [0x89, b'P', b'N', b'G', ..] => Some(Format::Png),
            _ => None,
        }
    }
}

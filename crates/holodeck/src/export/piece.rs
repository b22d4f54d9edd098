//! Pieces of an export's data: files that the page requests, or parts of its one file.

use serde::Serialize;

/// A piece of the data.
#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct Piece {
    pub file: String,
    bytes: usize,
    crc: u32,
}

impl Piece {
    /// The folder of the pieces.
    pub const FOLDER: &str = "data";

    /// Returns the piece of these bytes.
    pub fn new(name: String, bytes: &[u8]) -> Piece {
        Piece {
            file: format!("{}/{name}.bin", Piece::FOLDER),
            bytes: bytes.len(),
            crc: crc32fast::hash(bytes),
        }
    }
}

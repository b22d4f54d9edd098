//! What can go wrong with a picture and its file.

use std::path::PathBuf;

use crate::picture::{MAX_PIXELS, MAX_SIDE};

/// Why a picture could not be read, written or made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PictureError {
    /// Something is wrong with a file: which one, and what.
    #[error("{}: {error}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        error: Box<PictureError>,
    },
    /// The disk or the system said no.
    #[error("{0}")]
    Io(#[from] std::io::Error),
    /// Neither the first bytes nor the extension say what this is.
    #[error("not a picture that can be read: its first bytes are not those of .hdr, .pfm or .exr")]
    UnknownFormat,
    /// An extension that is none of those that can be written.
    #[error("pictures are written as .exr, .hdr, .pfm or .png: `{0}` is none of them")]
    UnknownExtension(String),
    /// A `.png`, which has display colours and no radiance.
    #[error("a .png holds display colours, not radiance: give .hdr, .pfm or .exr")]
    PngIsNotRadiance,
    /// A picture without pixels, or too large.
    #[error(
        "{width}x{height} pixels: each side must be 1 to {MAX_SIDE}, and at most {MAX_PIXELS} in all"
    )]
    Size {
        /// Pixels across.
        width: u64,
        /// Pixels down.
        height: u64,
    },
    /// More bytes than any picture within the limits has.
    #[error("{0} bytes are more than any picture of at most {MAX_PIXELS} pixels has")]
    TooLong(u64),
    /// The number of pixels is not that of the size.
    #[error("{width}x{height} pixels are stated but {pixels} are there")]
    PixelCount {
        /// Stated pixels across.
        width: u32,
        /// Stated pixels down.
        height: u32,
        /// Pixels there.
        pixels: usize,
    },
    /// An exposure that is not a positive number.
    #[error("exposure {0} must be positive and finite")]
    Exposure(f32),
    /// The header of the file is wrong.
    #[error("header: {0}")]
    Header(String),
    /// The file ends too early.
    #[error("the file ends within its pixels: row {row} of {rows} is not whole")]
    Truncated {
        /// Row in the file's order, from 0.
        row: u32,
        /// Rows that the header states.
        rows: u32,
    },
    /// The encoding of a row is wrong.
    #[error("row {row}: {what}")]
    Encoding {
        /// Row in the file's order, from 0.
        row: u32,
        /// What is wrong with it.
        what: &'static str,
    },
    /// The OpenEXR library refused the file.
    #[error("OpenEXR: {0}")]
    Exr(String),
    /// The PNG library refused the picture.
    #[error("PNG: {0}")]
    Png(String),
}

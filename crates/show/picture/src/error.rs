//! Errors of pictures and their files.

use std::path::PathBuf;

use crate::size::{MAX_PIXELS, MAX_SIDE};
use crate::view_error::ViewError;

/// The reason why a picture could not be read, written or made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PictureError {
    /// An error in a file.
    #[error("{}: {error}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        error: Box<PictureError>,
    },
    /// An error of the operating system.
    #[error("{0}")]
    Io(#[from] std::io::Error),
    /// Neither the first bytes nor the extension belong to a known format.
    #[error("not a picture that can be read: its first bytes are not those of .hdr, .pfm or .exr")]
    UnknownFormat,
    /// A file name whose extension belongs to no format that can be written.
    #[error("pictures are written as .exr, .hdr, .pfm or .png, not as `{0}`")]
    UnknownExtension(String),
    /// A `.png`, which contains display colours instead of radiance.
    #[error("a .png holds display colours, not radiance: give .hdr, .pfm or .exr")]
    PngIsNotRadiance,
    /// A picture without pixels, or too large.
    #[error(
        "{width}x{height} pixels: each side must be 1 to {MAX_SIDE}, and at most {MAX_PIXELS} in all"
    )]
    Size {
        /// Width in pixels.
        width: u64,
        /// Height in pixels.
        height: u64,
    },
    /// A file larger than any picture within the limits.
    #[error("{0} bytes are more than any picture of at most {MAX_PIXELS} pixels has")]
    TooLong(u64),
    /// The number of pixels does not match the size.
    #[error("the size is {width}x{height}, but there are {pixels} pixels")]
    PixelCount {
        /// Stated width in pixels.
        width: u32,
        /// Stated height in pixels.
        height: u32,
        /// Number of pixels.
        pixels: usize,
    },
    /// The view of a file cannot be understood.
    #[error("{0}")]
    View(#[from] ViewError),
    /// An exposure that is not a positive number.
    #[error("exposure {0} must be positive and finite")]
    Exposure(f32),
    /// The header of the file is wrong.
    #[error("header: {0}")]
    Header(String),
    /// The file ends too early.
    #[error("the file ends within its pixels: row {row} of {rows} is incomplete")]
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

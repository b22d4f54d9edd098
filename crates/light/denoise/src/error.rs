//! The reasons why a picture cannot be denoised.

use std::path::PathBuf;

/// The reason why a picture cannot be denoised.
#[derive(Debug, thiserror::Error)]
pub enum DenoiseError {
    /// The library is not found, or has another version.
    #[error(
        "Open Image Denoise 2 cannot be loaded from {}: {reason}. Install it, or name its library",
        path.display()
    )]
    Load {
        /// The file or name that was tried.
        path: PathBuf,
        /// The system's message.
        reason: String,
    },
    /// The library reports a failure.
    #[error("Open Image Denoise: {0}")]
    Library(String),
    /// The caller has ended the work.
    #[error("denoising was ended early")]
    Ended,
    /// The number of pixels does not match the size.
    #[error("{found} pixels of {what} for a picture of {width} x {height}")]
    Size {
        /// Name of the picture.
        what: &'static str,
        /// Pixels given.
        found: usize,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
}

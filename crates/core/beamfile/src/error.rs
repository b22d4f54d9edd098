//! The one error type of the crate.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use holo_section::BeamKey;

/// An error of a holodeck file.
///
/// Damage inside a file is no error. Damaged parts are left out and listed ([`crate::Damage`]).
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused.
    #[error("{path}: {doing}: {source}")]
    Io {
        /// The holodeck file.
        path: PathBuf,
        /// The operation that failed.
        doing: &'static str,
        /// The system's reason.
        source: io::Error,
    },
    /// Another process writes this file.
    #[error("{path}: another process writes this holodeck; end it, or open the file read-only")]
    Locked {
        /// The holodeck file.
        path: PathBuf,
    },
    /// No intact header: the file is no holodeck, or both copies of its header are damaged.
    #[error(
        "{path}: no holodeck file, or both copies of its header are damaged ({bytes} bytes long); \
         `holodeck check` reports on a model, and `holodeck fill` makes a holodeck of it"
    )]
    NoHeader {
        /// The file.
        path: PathBuf,
        /// Its length, bytes.
        bytes: u64,
    },
    /// A holodeck of a format that this program does not know.
    #[error("{path}: holodeck format {found}, but this program reads format {known}")]
    Version {
        /// The file.
        path: PathBuf,
        /// Its format.
        found: u32,
        /// The format that this program reads.
        known: u32,
    },
    /// The file was made for other sections than the caller has.
    #[error("{path}: made for sections of {found:?} beams, but {wanted:?} were expected")]
    Layout {
        /// The file.
        path: PathBuf,
        /// Beam counts in the file.
        found: Vec<u64>,
        /// Beam counts that the caller gave.
        wanted: Vec<u64>,
    },
    /// A file needs between one section and [`crate::format::MAX_SECTIONS`].
    #[error("a holodeck has 1 to {max} sections, not {0}", max = crate::format::MAX_SECTIONS)]
    SectionCount(usize),
    /// The holodeck has no such beam.
    #[error("there is no {0}")]
    NoSuchBeam(BeamKey),
    /// Sample numbers end at 2³² - 1.
    #[error("{count} sample numbers from {first} on do not fit in 32 bits")]
    SampleNumbers {
        /// First sample number.
        first: u32,
        /// Number of samples.
        count: usize,
    },
    /// The file was opened read-only.
    #[error("{path}: opened read-only")]
    ReadOnly {
        /// The holodeck file.
        path: PathBuf,
    },
    /// Samples could not be written. They stay in memory, and writing will be tried again.
    #[error("{path}: {pending} bytes of samples wait in memory, because writing fails: {reason}")]
    NotWritten {
        /// The holodeck file.
        path: PathBuf,
        /// Bytes waiting.
        pending: u64,
        /// The reason why the last attempt failed.
        reason: String,
    },
    /// Written data no longer reaches the file at the path. This handle can write no more.
    #[error("{path}: {how}; samples added since then may be lost")]
    Lost {
        /// The holodeck file.
        path: PathBuf,
        /// The kind of loss.
        how: FileLoss,
    },
    /// The writer's thread is gone. This handle can write no more.
    #[error("{path}: the thread that writes the file has stopped")]
    WriterStopped {
        /// The holodeck file.
        path: PathBuf,
    },
    /// A blob is longer than [`crate::format::MAX_BLOB_BYTES`].
    #[error(
        "blob `{name}` has {bytes} bytes, more than {max}",
        max = crate::format::MAX_BLOB_BYTES
    )]
    BlobSize {
        /// The blob's name.
        name: String,
        /// Its length, bytes.
        bytes: u64,
    },
    /// A blob's name has 1 to [`crate::format::MAX_BLOB_NAME`] bytes.
    #[error("a blob's name has 1 to {max} bytes, not {0}", max = crate::format::MAX_BLOB_NAME)]
    BlobName(usize),
    /// A chunk of a blob does not match its checksum in any copy.
    #[error("{path}: blob `{name}` is damaged at byte {offset} of the file")]
    BlobDamaged {
        /// The holodeck file.
        path: PathBuf,
        /// The blob's name.
        name: String,
        /// Offset of the chunk in the oldest copy.
        offset: u64,
    },
    /// The directory holds 2³² - 1 extents or blocks at most.
    #[error("the holodeck has as many extents as its directory can hold; fill another file")]
    DirectoryFull,
}

/// Returns a function from the system's errors to [`Error::Io`].
pub(crate) fn io_error(path: &Path, doing: &'static str) -> impl Fn(io::Error) -> Error {
    move |source| Error::Io { path: path.to_owned(), doing, source }
}

/// A change that another program made to a file while it was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileLoss {
    /// The path names no file any more, or another one.
    NotAtPath,
    /// The file ends before its last block.
    Shortened {
        /// Its length, bytes.
        bytes: u64,
        /// The length that was written, bytes.
        written: u64,
    },
}

impl fmt::Display for FileLoss {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            FileLoss::NotAtPath => {
                write!(f, "the file was deleted, moved or replaced while samples were added to it")
            }
            FileLoss::Shortened { bytes, written } => write!(
                f,
                "the file was cut off at {bytes} of {written} bytes while samples were added to it"
            ),
        }
    }
}

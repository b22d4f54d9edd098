//! Reasons why splats cannot be read, written or made.

use std::{io, path::PathBuf};

/// The reason why splats cannot be read, written or made.
#[derive(Debug, thiserror::Error)]
pub enum SplatError {
    /// The system refused.
    #[error("{action} {path}: {error}", path = path.display())]
    Io {
        /// What was tried, such as `reading`.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's reason.
        error: io::Error,
    },
    /// The file does not begin as splats do.
    #[error("these are no splats: make them with `holodeck splats`")]
    Foreign,
    /// Another version wrote the file.
    #[error("these are splats of version {0}; this program reads version {version}: make them again with `holodeck splats`", version = crate::VERSION)]
    Version(u32),
    /// The file is shorter or longer than its header says.
    #[error(
        "the splats have {found} bytes where {expected} belong: the file was cut off or changed"
    )]
    Length {
        /// Bytes of the file.
        found: u64,
        /// Bytes by the header.
        expected: u64,
    },
    /// Bytes do not have the hash that they had when they were written.
    #[error("the splats are damaged: {0} does not have its hash")]
    Hash(DamagedPart),
    /// A value that no writer writes.
    #[error("the splats cannot be used: {0}")]
    Value(&'static str),
    /// There is nothing to make splats of.
    #[error("no sample lies on a surface, so there is nothing to make splats of")]
    Empty,
    /// More surfels than a hierarchy can have.
    #[error("{0} surfels are too many: choose a larger spacing")]
    TooMany(usize),
}

/// A part of a file with a hash of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DamagedPart {
    /// The header.
    Header,
    /// The table of chunks.
    Table,
    /// The chunk of this number.
    Chunk(usize),
}

impl std::fmt::Display for DamagedPart {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            DamagedPart::Header => f.write_str("the header"),
            DamagedPart::Table => f.write_str("the table of chunks"),
            DamagedPart::Chunk(number) => write!(f, "chunk {number}"),
        }
    }
}

//! The holodeck file: every view ray that was ever computed, on disk, and the least-recently-used cache of beams in
//! front of it (Larson & Simmons 1999, §2.1 and §2.2).
//!
//! The file is a log. Samples are appended to memory, and a thread of the file's own writes them as one checksummed
//! *block* about every half second, each a run of extents sorted by (section, beam). The directory of all extents is
//! kept in memory and rebuilt when the file is opened, from block headers and extent tables alone. The layout is in
//! [`mod@format`], byte by byte.
//!
//! What always holds:
//!
//! * A block is written once and never changed. Its header is written after its body, so a header that is there means
//!   a block that is whole.
//! * What was appended before a [`BeamFile::flush`] that returned `Ok` survives a killed process and a power failure;
//!   anything else is on disk within a second.
//! * Samples reach a caller only after their checksum was compared. What is damaged is named and left out; nothing
//!   else is lost with it.
//! * One writer at a time (a lock on the file), any number of readers beside it.
//! * This crate never looks inside a radiance: a sample is ten bytes.

pub mod format;

mod batch;
mod blobs;
mod cache;
mod directory;
mod error;
mod file;
mod hash;
mod load;
mod open;
mod scan;
mod snapshot;
mod storage;
mod types;
mod verify;
mod visible;
mod writer;

pub use error::{Error, FileLoss};
pub use file::BeamFile;
pub use storage::{DiskStorage, Storage};
pub use types::{
    BeamSamples, Counts, Damage, DamageKind, OpenReport, Options, SectionStats, Stats,
};

/// What this crate's functions return.
pub type Result<T> = std::result::Result<T, Error>;

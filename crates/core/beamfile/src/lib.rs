//! The holodeck file: view rays on disk, and a least-recently-used cache of beams in front of it
//! (Larson & Simmons 1999, §2.1 and §2.2).
//!
//! The file is a log of checksummed *blocks*. Appended samples wait in memory, and the file's own
//! thread writes them as one block about every half second. A block is a run of *extents*, beam by
//! beam. An extent is consecutive samples of one beam. The directory of all extents
//! is kept in memory. Opening the file rebuilds it from the index, and from the headers and tables
//! of blocks that the index lacks, without reading samples. `proto/SPEC.md`, section 8, draws the
//! bytes.
//!
//! Invariants:
//!
//! - A block is written once and never changed. Its header is written after its body, so a block
//!   with a header is complete.
//! - Samples appended before a [`BeamFile::flush`] that returned `Ok` survive a killed process and
//!   a power failure. Others are on disk within a second.
//! - Samples reach a caller only after their checksum was compared. Damaged parts are listed and
//!   left out; nothing else is lost with them.
//! - One process writes the file, ensured by a lock on it. Any number of processes read it
//!   meanwhile.
//! - The index only repeats what block headers and tables say. Without it, opening takes longer,
//!   and finds the same.
//! - Blocks of unknown kinds are checked and skipped, so that a program reads files of later ones.
//! - Samples of an earlier generation are never taken for those of the present one, and never lost.
//! - This crate never interprets a radiance. For it, a sample is ten bytes.

mod append;
mod appender;
mod batch;
mod blob_list;
mod blobs;
mod block_table;
mod cache;
mod checksums;
mod copy;
mod copy_shares;
mod directory;
mod error;
mod file;
pub mod format;
mod gaps;
mod hash;
mod index;
mod index_range;
mod index_read;
mod index_write;
mod indexed;
mod load;
mod open;
mod plan;
mod read;
mod refresh;
mod scan;
mod shared;
mod shares;
mod state;
mod storage;
mod types;
mod verify;
mod visible;
mod writer;

pub use copy::Copied;
pub use error::{Error, FileLoss};
pub use file::BeamFile;
pub use read::Caching;
pub use storage::{DiskStorage, Storage};
pub use types::{
    BeamSamples, Damage, DamageKind, Maker, Mark, NextNumbers, OpenReport, Options, SectionStats,
    Skipped, Stats,
};

/// The result type of this crate's functions.
pub type Result<T> = std::result::Result<T, Error>;

//! Files that are mapped into memory, and arrays that lie in them.
//!
//! A mapped file is not copied: the system reads the pages that are touched. All processes that map
//! a file share these pages, and the system drops them when memory is short.
//!
//! Only files that this program alone writes are mapped. It writes a file once, under another name,
//! renames it into place, and never changes it again. So a file does not change or shrink while it
//! is mapped. If it is deleted meanwhile, its pages stay until the last mapping ends.
//!
//! Invariants:
//! - No array of a [`SealedFile`] is used before the hash of all arrays was compared.
//! - An array in a file is aligned for its type, lies within the file, and keeps the file mapped.

mod array;
mod map;
mod sealed;

pub use array::Array;
pub use map::FileBytes;
pub use sealed::{FileKind, SealError, SealedFile, write_sealed};

//! The operations on a disk that the file needs, as a trait, so that tests can fill the disk up.

use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{FileExt, MetadataExt};
use std::path::{Path, PathBuf};

/// Positioned input and output on one file. Reads may run beside writes.
pub trait Storage: Send + Sync {
    /// Fills `bytes` from `offset`.
    ///
    /// # Errors
    /// The system's; `UnexpectedEof` if the file ends too early.
    fn read_exact_at(&self, bytes: &mut [u8], offset: u64) -> io::Result<()>;

    /// Writes all of `bytes` at `offset`, and makes the file longer if necessary.
    ///
    /// # Errors
    /// The system's. A part of the bytes may have been written.
    fn write_all_at(&self, bytes: &[u8], offset: u64) -> io::Result<()>;

    /// Returns once everything written is on the disk itself.
    ///
    /// # Errors
    /// The system's.
    fn sync_data(&self) -> io::Result<()>;

    /// Returns the length in bytes.
    ///
    /// # Errors
    /// The system's.
    fn length(&self) -> io::Result<u64>;

    /// Cuts the file off, or extends it by zeros.
    ///
    /// # Errors
    /// The system's.
    fn set_len(&self, bytes: u64) -> io::Result<()>;

    /// Returns true if the path still names this file; false once the file was deleted, moved or
    /// replaced.
    fn is_at_its_path(&self) -> bool {
        true
    }
}

/// An ordinary file.
///
/// It is never mapped into memory. Another process may truncate it, and a process that reads a map
/// beyond the file's end is killed.
#[derive(Debug)]
pub struct DiskStorage {
    file: File,
    path: PathBuf,
}

impl DiskStorage {
    /// Returns the storage of an open file. `path` is the path with which the file was opened.
    pub fn new(file: File, path: impl AsRef<Path>) -> DiskStorage {
        DiskStorage { file, path: path.as_ref().to_owned() }
    }
}

impl Drop for DiskStorage {
    /// Releases the lock. Closing the file is not enough, because a child process may still have it
    /// open.
    fn drop(&mut self) {
        // Without a lock this fails harmlessly.
        let _ = self.file.unlock();
    }
}

impl Storage for DiskStorage {
    fn read_exact_at(&self, bytes: &mut [u8], offset: u64) -> io::Result<()> {
        self.file.read_exact_at(bytes, offset)
    }

    fn write_all_at(&self, bytes: &[u8], offset: u64) -> io::Result<()> {
        self.file.write_all_at(bytes, offset)
    }

    fn sync_data(&self) -> io::Result<()> {
        self.file.sync_data()
    }

    fn length(&self) -> io::Result<u64> {
        Ok(self.file.metadata()?.len())
    }

    fn set_len(&self, bytes: u64) -> io::Result<()> {
        self.file.set_len(bytes)
    }

    fn is_at_its_path(&self) -> bool {
        match (self.file.metadata(), fs::metadata(&self.path)) {
            (Ok(open), Ok(named)) => (open.dev(), open.ino()) == (named.dev(), named.ino()),
            (Ok(_), Err(error)) => {
                !matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory)
            }
            // A disk that does not answer has lost nothing yet. A write will report its error.
            (Err(_), _) => true,
        }
    }
}

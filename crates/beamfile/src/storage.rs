//! What the file needs of a disk: positioned reads and writes. A trait, so that tests can fill the disk up.

use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;

/// Positioned input and output on one file. Reads may run beside writes.
pub trait Storage: Send + Sync {
    /// Fills `bytes` from `offset`; `UnexpectedEof` where the file ends before.
    fn read_exact_at(&self, bytes: &mut [u8], offset: u64) -> io::Result<()>;
    /// Writes all of `bytes` at `offset`, making the file longer where needed. May have written a part on error.
    fn write_all_at(&self, bytes: &[u8], offset: u64) -> io::Result<()>;
    /// Returns once everything written is on the disk itself.
    fn sync_data(&self) -> io::Result<()>;
    /// Length in bytes.
    fn length(&self) -> io::Result<u64>;
    /// Cuts the file off, or extends it by zeros.
    fn set_len(&self, bytes: u64) -> io::Result<()>;
}

/// An ordinary file. Never mapped into memory: it changes, and a truncated map would kill the process.
#[derive(Debug)]
pub struct DiskStorage(pub File);

impl Drop for DiskStorage {
    /// Closing alone would keep the lock for as long as a child process that is just being started has the file too.
    fn drop(&mut self) {
        // Without a lock there is nothing to give back.
        let _ = self.0.unlock();
    }
}

impl Storage for DiskStorage {
    fn read_exact_at(&self, bytes: &mut [u8], offset: u64) -> io::Result<()> {
        self.0.read_exact_at(bytes, offset)
    }

    fn write_all_at(&self, bytes: &[u8], offset: u64) -> io::Result<()> {
        self.0.write_all_at(bytes, offset)
    }

    fn sync_data(&self) -> io::Result<()> {
        self.0.sync_data()
    }

    fn length(&self) -> io::Result<u64> {
        Ok(self.0.metadata()?.len())
    }

    fn set_len(&self, bytes: u64) -> io::Result<()> {
        self.0.set_len(bytes)
    }
}

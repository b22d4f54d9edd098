//! The bytes of a file, mapped into memory, and slices of them. This is the only module with
//! `unsafe` for maps.

use std::{fs::File, io, ops::Deref, ops::Range, sync::Arc};

use bytemuck::Pod;

/// The bytes of a file.
pub enum FileBytes {
    /// Read when they are touched, and dropped by the system when memory is short.
    Mapped(memmap2::Mmap),
    /// In memory.
    Owned(Vec<u8>),
}

impl FileBytes {
    /// Maps a file that is not empty.
    ///
    /// # Errors
    /// If the system cannot map it.
    #[allow(unsafe_code)]
    pub fn map(file: &File) -> io::Result<FileBytes> {
        // SAFETY: a mapping must not change while it is read. This program never changes a file
        // that it maps. It writes a new file under another name and renames it into place, so the
        // new file has other pages. If another program changes the bytes in place all the same,
        // they are read as numbers, of which every value is valid. An index among them is compared
        // with the length of its array at each use. If another program cuts the file off, a touch
        // of the missing pages ends the process by SIGBUS, and reads nothing wrong.
        Ok(FileBytes::Mapped(unsafe { memmap2::Mmap::map(file)? }))
    }
}

impl Deref for FileBytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            FileBytes::Mapped(map) => map,
            FileBytes::Owned(bytes) => bytes,
        }
    }
}

/// Values that lie in the bytes of a file. Alignment and length were checked once.
pub(crate) struct FileSlice<T> {
    values: *const [T],
    /// Owns the memory of `values`.
    bytes: Arc<FileBytes>,
}

impl<T: Pod> FileSlice<T> {
    /// Returns the values in a range of bytes. `None` if the range ends beyond the file, is not
    /// aligned for the type, or has a part of a value at its end.
    pub fn new(bytes: &Arc<FileBytes>, range: Range<usize>) -> Option<FileSlice<T>> {
        let values: &[T] = bytemuck::try_cast_slice(bytes.get(range)?).ok()?;
        Some(FileSlice { values, bytes: Arc::clone(bytes) })
    }
}

impl<T> Clone for FileSlice<T> {
    fn clone(&self) -> FileSlice<T> {
        FileSlice { values: self.values, bytes: Arc::clone(&self.bytes) }
    }
}

impl<T> Deref for FileSlice<T> {
    type Target = [T];

    #[inline(always)]
    #[allow(unsafe_code)]
    fn deref(&self) -> &[T] {
        // SAFETY: `new` made the pointer of a valid slice in `bytes`. These neither move nor end
        // while `self` has its share of them, and nothing returns them for writing.
        unsafe { &*self.values }
    }
}

// SAFETY: this is a shared slice together with the owner of its memory, and both may be sent.
#[allow(unsafe_code)]
unsafe impl<T: Send + Sync> Send for FileSlice<T> {}
// SAFETY: as for `Send`.
#[allow(unsafe_code)]
unsafe impl<T: Send + Sync> Sync for FileSlice<T> {}

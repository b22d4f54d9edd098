//! The bytes of a file, mapped into memory: the system reads the pages that are touched.

use std::{fs::File, io, ops::Deref};

/// The bytes of a file.
pub(crate) enum FileBytes {
    /// Read when they are touched, and dropped by the system when memory is short.
    Mapped(memmap2::Mmap),
    /// In memory.
    Owned(Vec<u8>),
}

impl FileBytes {
    /// Maps a file.
    #[allow(unsafe_code)]
    pub fn map(file: &File) -> io::Result<FileBytes> {
        // SAFETY: a mapping must not change while it is read. This program never changes splats:
        // it writes them under another name and renames them into place, so a new file has other
        // pages. If another program changes the bytes in place all the same, nothing here relies
        // on them twice: they are read as `u8`, of which every value is valid, copied, and each
        // number that they give is compared with its bounds after it was copied. If another
        // program cuts the file off, a touch of the missing pages ends the process by SIGBUS, and
        // reads nothing wrong.
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

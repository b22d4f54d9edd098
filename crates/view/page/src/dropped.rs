//! Files that a client drops on the page: a model, with what it refers to. They are stored in a
//! folder of their own until the session ends, and the viewer reads the model from there.
//!
//! Invariants:
//! - A file's name has no folder, so every file is in the folder of its drop.
//! - A session has at most [`MOST_FILES`], which together have at most [`MOST_BYTES`].

use std::{
    fs::{self, File},
    io,
    path::{Path, PathBuf},
    sync::atomic::{AtomicU32, AtomicU64, Ordering},
};

use parking_lot::Mutex;
use tempfile::TempDir;

/// Most bytes of all files that are dropped in a session.
pub const MOST_BYTES: u64 = 1 << 30;

/// Most files that are dropped in a session, each once or again. A model names some dozens.
const MOST_FILES: u32 = 4096;

/// Most bytes of a file's name: most file systems take no more.
const MOST_NAME: usize = 255;

/// The files that were dropped in a session.
#[derive(Default)]
pub struct DroppedFiles {
    /// Made with the first file, and deleted with the session.
    folder: Mutex<Option<TempDir>>,
    files: AtomicU32,
    bytes: AtomicU64,
}

impl DroppedFiles {
    /// Returns the path of a file of a client's drop, whether it is there or not. `None` if the
    /// name has a folder or is hidden, or if nothing was dropped.
    pub fn path(&self, client: u32, drop: u32, name: &str) -> Option<PathBuf> {
        let is_plain = Path::new(name).file_name().is_some_and(|file| file == name);
        let is_usable = is_plain && !name.starts_with('.') && name.len() <= MOST_NAME;
        let folder = self.folder.lock();
        let folder = folder.as_ref().filter(|_| is_usable)?;
        Some(folder.path().join(format!("{client}-{drop}")).join(name))
    }

    /// Creates a file of a client's drop, and returns its path, too.
    ///
    /// # Errors
    /// If its name cannot be used, if there are too many files, or if the system creates none.
    pub fn create(&self, client: u32, drop: u32, name: &str) -> io::Result<(PathBuf, File)> {
        {
            let mut folder = self.folder.lock();
            if folder.is_none() {
                *folder = Some(tempfile::Builder::new().prefix("holodeck-").tempdir()?);
            }
        }
        if self.files.fetch_add(1, Ordering::Relaxed) >= MOST_FILES {
            return Err(io::Error::other(format!(
                "{MOST_FILES} files were dropped, which is the most"
            )));
        }
        let unusable = || io::Error::other("its name cannot be used");
        let path = self.path(client, drop, name).ok_or_else(unusable)?;
        path.parent().map_or(Ok(()), fs::create_dir_all)?;
        let file = File::create(&path)?;
        Ok((path, file))
    }

    /// Counts further bytes; false if there are too many.
    pub fn takes(&self, bytes: usize) -> bool {
        let before = self.bytes.fetch_add(bytes as u64, Ordering::Relaxed);
        before.saturating_add(bytes as u64) <= MOST_BYTES
    }

    /// Counts bytes no more, because their file is deleted.
    pub fn gives_back(&self, bytes: u64) {
        self.bytes.fetch_sub(bytes, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dropped_file_stays_in_its_folder_whatever_its_name_is() {
        let dropped = DroppedFiles::default();
        assert_eq!(dropped.path(1, 1, "chair.glb"), None, "nothing was dropped");
        let (path, _) = dropped.create(1, 7, "chair.glb").unwrap();
        assert!(path.ends_with("1-7/chair.glb") && path.exists());
        for name in ["", "..", ".", "../chair.glb", "/chair.glb", "a/b.glb", ".hidden"] {
            assert!(dropped.create(1, 7, name).is_err(), "{name}");
        }
        assert!(dropped.create(1, 7, &"a".repeat(MOST_NAME + 1)).is_err());
        drop(dropped);
        assert!(!path.exists(), "files go with the session");
    }

    #[test]
    fn the_files_of_a_session_are_bounded_together() {
        let dropped = DroppedFiles::default();
        assert!(dropped.takes(MOST_BYTES as usize / 2) && dropped.takes(MOST_BYTES as usize / 2));
        assert!(!dropped.takes(1));
        dropped.gives_back(2);
        assert!(dropped.takes(1), "a file that is refused takes no room");
        for number in 0..MOST_FILES {
            dropped.create(1, number % 3, "chair.glb").unwrap();
        }
        assert!(dropped.create(1, 0, "chair.glb").is_err());
    }
}

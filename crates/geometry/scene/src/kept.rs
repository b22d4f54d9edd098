//! Files that are kept from one run to the next, each under a hash of what it belongs to.
//!
//! They save time and nothing else. So if one cannot be written or read, the program continues
//! without it.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Files of one kind that are kept: a user works on a few scenes. Older ones are made again when
/// needed.
const MAX_FILES: usize = 8;

/// Most bytes of the files of one kind, if there is more than one. Those of 10 million triangles
/// have 1.7 GB.
const MAX_BYTES: u64 = 6 << 30;

/// The files of one kind in a folder.
#[derive(Clone, Debug)]
pub struct KeptFiles {
    folder: Option<PathBuf>,
    extension: &'static str,
    most_bytes: u64,
}

impl KeptFiles {
    /// Returns the files with this ending in the folder given, or in the user's cache folder.
    /// Without either, nothing is kept.
    #[must_use]
    pub fn new(folder: Option<PathBuf>, extension: &'static str) -> KeptFiles {
        let absolute = |name: &str| {
            std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute())
        };
        let users =
            || absolute("XDG_CACHE_HOME").or_else(|| Some(absolute("HOME")?.join(".cache")));
        let folder = folder.or_else(|| Some(users()?.join("holodeck/scenes")));
        KeptFiles { folder, extension, most_bytes: MAX_BYTES }
    }

    /// Returns where the file of a hash is, or would be. `None` if nothing is kept.
    #[must_use]
    pub fn path(&self, hash: &[u8; 32]) -> Option<PathBuf> {
        let name: String = hash.iter().map(|byte| format!("{byte:02x}")).collect();
        Some(self.folder.as_ref()?.join(name).with_extension(self.extension))
    }

    /// Opens the file of a hash, if it is there. Returns its length in bytes, too.
    ///
    /// It may be mapped. [`put`](Self::put) writes a file under another name and renames it, so no
    /// file changes or shrinks later. The pages of a file that is deleted stay while it is mapped.
    #[must_use]
    pub fn open(&self, hash: &[u8; 32]) -> Option<(File, u64)> {
        let file = File::open(self.path(hash)?).ok()?;
        let bytes = file.metadata().ok()?.len();
        Some((file, bytes))
    }

    /// Keeps what `write` writes as the file of a hash. If the disk is full or read-only, nothing
    /// is kept.
    pub fn put(&self, hash: &[u8; 32], write: impl FnOnce(&mut dyn Write) -> io::Result<()>) {
        if let Some(path) = self.path(hash) {
            let _ = self.replace(&path, write);
        }
    }

    fn replace(
        &self,
        path: &Path,
        write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> io::Result<()> {
        let Some(folder) = path.parent() else { return Ok(()) };
        fs::create_dir_all(folder)?;
        // Another process may write the same file. Each writes one of its own and renames it, which
        // is atomic.
        let ending = format!("{}.{}.part", self.extension, std::process::id());
        let temporary = path.with_extension(ending);
        let written = File::create(&temporary).and_then(|file| {
            let mut file = BufWriter::new(file);
            write(&mut file)?;
            file.flush()
        });
        if let Err(error) = written.and_then(|()| fs::rename(&temporary, path)) {
            let _ = fs::remove_file(&temporary);
            return Err(error);
        }
        self.prune(folder)
    }

    /// Deletes all but the newest files of this kind: [`MAX_FILES`], of [`MAX_BYTES`] together.
    fn prune(&self, folder: &Path) -> io::Result<()> {
        let about = |entry: fs::DirEntry| {
            let about = entry.metadata().ok()?;
            Some((about.modified().ok()?, entry.path(), about.len()))
        };
        let mut files: Vec<_> = fs::read_dir(folder)?
            .filter_map(|entry| entry.ok())
            .filter(|entry| entry.path().extension().is_some_and(|found| found == self.extension))
            .filter_map(about)
            .collect();
        files.sort();
        let mut total = 0;
        for (newer, (_, path, bytes)) in files.iter().rev().enumerate() {
            total += bytes;
            if newer >= MAX_FILES || newer > 0 && total > self.most_bytes {
                fs::remove_file(path)?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_newest_files_of_a_kind_are_kept() {
        let folder = tempfile::tempdir().unwrap();
        let kept = |extension| KeptFiles::new(Some(folder.path().to_owned()), extension);
        kept("other").put(&[0; 32], |file| file.write_all(b"stays"));
        for index in 0..MAX_FILES as u8 + 3 {
            kept("scene").put(&[index; 32], |file| file.write_all(&[index]));
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), MAX_FILES + 1);
        assert_eq!(kept("other").open(&[0; 32]).unwrap().1, 5);
    }

    #[test]
    fn older_files_make_room_for_large_ones_but_the_newest_stays_whatever_its_size() {
        let folder = tempfile::tempdir().unwrap();
        let files = KeptFiles::new(Some(folder.path().to_owned()), "scene");
        let files = KeptFiles { most_bytes: 1000, ..files };
        let kept = |index: u8| files.open(&[index; 32]).is_some();
        files.put(&[0; 32], |file| file.write_all(&[0; 600]));
        files.put(&[1; 32], |file| file.write_all(&[0; 400]));
        assert!(kept(0) && kept(1));
        files.put(&[2; 32], |file| file.write_all(&[0; 500]));
        assert!(!kept(0) && kept(1) && kept(2));
        files.put(&[3; 32], |file| file.write_all(&[0; 5000]));
        assert!(!kept(1) && !kept(2) && kept(3));
    }

    #[test]
    fn a_file_that_could_not_be_written_whole_is_not_kept() {
        let folder = tempfile::tempdir().unwrap();
        let kept = KeptFiles::new(Some(folder.path().to_owned()), "scene");
        kept.put(&[1; 32], |file| {
            file.write_all(b"half of i")?;
            Err(io::Error::other("the disk is full"))
        });
        assert!(kept.open(&[1; 32]).is_none());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}

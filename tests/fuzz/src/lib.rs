//! What the fuzz targets share: a disk in memory, and model files in a folder.

use std::{
    fs, io,
    path::PathBuf,
    sync::{Mutex, PoisonError},
};

use holo_beamfile::{
    Storage,
    format::{HEADER_COPY_BYTES, POINTER_BYTES, POINTER_OFFSET},
};
use holo_scene::{LoadOptions, Scene, load};
use tempfile::TempDir;

/// A disk in memory.
pub struct Memory(pub Mutex<Vec<u8>>);

impl Memory {
    fn with<T>(&self, action: impl FnOnce(&mut Vec<u8>) -> T) -> T {
        action(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Storage for Memory {
    fn read_exact_at(&self, bytes: &mut [u8], offset: u64) -> io::Result<()> {
        self.with(|disk| {
            let begin = usize::try_from(offset).unwrap_or(usize::MAX);
            let found = begin.checked_add(bytes.len()).and_then(|end| disk.get(begin..end));
            bytes.copy_from_slice(found.ok_or(io::ErrorKind::UnexpectedEof)?);
            Ok(())
        })
    }

    fn write_all_at(&self, bytes: &[u8], offset: u64) -> io::Result<()> {
        self.with(|disk| {
            let begin = offset as usize;
            disk.resize(disk.len().max(begin + bytes.len()), 0);
            disk[begin..begin + bytes.len()].copy_from_slice(bytes);
            Ok(())
        })
    }

    fn sync_data(&self) -> io::Result<()> {
        Ok(())
    }

    fn length(&self) -> io::Result<u64> {
        Ok(self.with(|disk| disk.len() as u64))
    }

    fn set_len(&self, bytes: u64) -> io::Result<()> {
        self.with(|disk| disk.resize(bytes as usize, 0));
        Ok(())
    }
}

/// Returns a holodeck file without what its header repeats: the place of the index, the length of a
/// copy, the copy without the zeros at its end, and the blocks.
pub fn short(file: &[u8]) -> Vec<u8> {
    let (copies, blocks) = file.split_at(2 * HEADER_COPY_BYTES);
    let (copy, pointer) = copies[..HEADER_COPY_BYTES].split_at(POINTER_OFFSET);
    let used = copy.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1);
    [pointer, &(used as u16).to_le_bytes(), &copy[..used], blocks].concat()
}

/// Undoes [`short`]. `None` if the bytes end too soon.
pub fn long(short: &[u8]) -> Option<Vec<u8>> {
    let (pointer, rest) = short.split_first_chunk::<POINTER_BYTES>()?;
    let (used, rest) = rest.split_first_chunk()?;
    let (copy, blocks) = rest.split_at_checked(usize::from(u16::from_le_bytes(*used)))?;
    let mut copy = copy.to_vec();
    copy.resize(POINTER_OFFSET, 0);
    copy.extend_from_slice(pointer);
    Some([&copy, &copy, blocks].concat())
}

/// A folder for model files.
pub struct Folder(TempDir);

impl Default for Folder {
    fn default() -> Folder {
        Folder(tempfile::tempdir().expect("a temporary folder can be made"))
    }
}

impl Folder {
    /// Writes a file. Returns its path.
    pub fn write(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join(name);
        fs::write(&path, bytes).expect("a file can be written");
        path
    }

    /// Loads a model file. A scene that comes of it must survive its packing.
    pub fn load(&self, name: &str, bytes: &[u8]) {
        let path = self.write(name, bytes);
        if let Ok(loaded) = load(&path, &LoadOptions::default()) {
            survives(&loaded.scene);
        }
    }
}

/// Checks that a scene can be packed, and that what comes back has the same packing.
pub fn survives(scene: &Scene) {
    let packed = scene.pack();
    let again = Scene::unpack(&packed).expect("a scene can be read back");
    assert!(again.pack() == packed, "its packing is another");
}

//! Files that a model names: found in the model's folder, whatever the exporter wrote.
//!
//! Invariant: a file outside the model's folder is never read. A model from elsewhere must not
//! choose which files of this machine are opened.

use std::fs::File;
use std::io::Read;
use std::path::{Component, Path, PathBuf};

use unicode_normalization::UnicodeNormalization as _;

use crate::SceneError;

/// Returns the file that a model in `folder` names.
///
/// These are tried in order: the path as written; without spaces around it; with the separators of
/// Windows; with folders and name in other letter case or another normal form of Unicode; with the
/// ending `usual` in place of its own; the bare name in the folder. If none of them exists, the
/// result is the path as written, within the folder.
pub(crate) fn beside(folder: &Path, name: &str, usual: &str) -> PathBuf {
    let spaced = within(name);
    let name = name.trim();
    let path = within(name).or_else(|| within(&name.replace('\\', "/")));
    let slashed = name.replace('\\', "/");
    let bare = slashed.rsplit('/').next().and_then(within).unwrap_or_default();
    let candidates = [
        spaced,
        path.clone(),
        within(&slashed),
        within(&slashed).map(|path| path.with_extension(usual)),
        Some(bare.clone()),
        Some(bare.with_extension(usual)),
    ];
    for candidate in candidates.into_iter().flatten().filter(|path| path.file_name().is_some()) {
        let file = folder.join(&candidate);
        if file.is_file() {
            return file;
        }
        if let Some(file) = in_other_case(folder, &candidate) {
            return file;
        }
    }
    folder.join(path.unwrap_or(bare))
}

/// Reads a file of at most `limit` bytes.
pub(crate) fn read_file(path: &Path, limit: u64) -> Result<Vec<u8>, SceneError> {
    let io = |source| SceneError::Io { path: path.to_owned(), source };
    let file = File::open(path).map_err(io)?;
    let announced = file.metadata().map_err(io)?.len();
    let mut bytes = Vec::with_capacity(announced.min(limit) as usize + 1);
    file.take(limit + 1).read_to_end(&mut bytes).map_err(io)?;
    if bytes.len() as u64 > limit {
        return Err(SceneError::FileTooLarge { path: path.to_owned(), limit });
    }
    Ok(bytes)
}

/// Returns a relative path that does not leave the folder it is relative to.
fn within(name: &str) -> Option<PathBuf> {
    let path = Path::new(name);
    let mut depth = 0i32;
    for component in path.components() {
        match component {
            Component::Normal(_) => depth += 1,
            Component::CurDir => {}
            Component::ParentDir if depth > 0 => depth -= 1,
            _ => return None,
        }
    }
    (depth > 0).then(|| path.to_owned())
}

/// Returns a file within a folder whose path differs only in letter case, or in the normal form of
/// Unicode, in which systems write the same letter as one code or as two.
fn in_other_case(folder: &Path, path: &Path) -> Option<PathBuf> {
    let mut found = folder.to_owned();
    for component in path.components() {
        let next = found.join(component);
        let Component::Normal(name) = component else {
            found = next;
            continue;
        };
        found = if next.exists() { next } else { similar(&found, name.to_str()?)? };
    }
    found.is_file().then_some(found)
}

/// Returns the entry of a folder whose name differs only in letter case or normal form.
fn similar(folder: &Path, name: &str) -> Option<PathBuf> {
    let wanted = folded(name);
    let same = |entry: &std::fs::DirEntry| {
        entry.file_name().to_str().is_some_and(|name| folded(name) == wanted)
    };
    let is_here = folder.as_os_str().is_empty();
    let entries = std::fs::read_dir(if is_here { Path::new(".") } else { folder }).ok()?;
    // The least, so that the choice does not depend on the file system.
    let found = entries.filter_map(Result::ok).filter(same).map(|entry| entry.file_name()).min()?;
    Some(folder.join(found))
}

/// Returns a name in one normal form and letter case.
fn folded(name: &str) -> String {
    name.nfc().collect::<String>().to_lowercase()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn files_are_found_as_exporters_name_them() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        std::fs::create_dir(folder.join("maps")).unwrap();
        for file in ["room.mtl", "maps/Wood.PNG", " a  map.png", "B\u{f6}den.png"] {
            std::fs::write(folder.join(file), "").unwrap();
        }
        for (name, file) in [
            ("room.mtl", "room.mtl"),
            ("ROOM.MTL", "room.mtl"),
            ("room.mat", "room.mtl"),
            ("./room.mtl", "./room.mtl"),
            (r"C:\Users\me\models\room.mtl", "room.mtl"),
            ("/home/me/room.mtl", "room.mtl"),
            (r"maps\Wood.PNG", "maps/Wood.PNG"),
            ("maps/wood.png", "maps/Wood.PNG"),
            (r"Maps\WOOD.png", "maps/Wood.PNG"),
            ("./MAPS/wood.png", "./maps/Wood.PNG"),
            ("Bo\u{308}den.png", "B\u{f6}den.png"),
            (" a  map.png", " a  map.png"),
            (" room.mtl ", "room.mtl"),
        ] {
            assert_eq!(beside(folder, name, "mtl"), folder.join(file), "{name}");
        }
    }

    #[test]
    fn nothing_outside_the_folder_is_named() {
        let outer = tempfile::tempdir().unwrap();
        let folder = outer.path().join("model");
        std::fs::create_dir(&folder).unwrap();
        std::fs::write(outer.path().join("secret.mtl"), "").unwrap();
        let absolute = outer.path().join("secret.mtl");
        for name in ["../secret.mtl", "a/../../secret.mtl", absolute.to_str().unwrap(), "..", ""] {
            let found = beside(&folder, name, "mtl");
            assert!(found.starts_with(&folder) && !found.is_file(), "{name}: {found:?}");
            assert!(!found.components().any(|c| c == Component::ParentDir), "{name}: {found:?}");
        }
    }
}

//! Where Open Image Denoise may be installed: the system's library folders, packages of Python, and
//! Blender.
//!
//! Folders are only listed, to a fixed depth, and nothing is loaded from the working folder.

use std::env;
use std::path::{Path, PathBuf};

/// File name of the library in an installed package.
pub(crate) const NAME: &str = if cfg!(target_os = "macos") {
    "libOpenImageDenoise.2.dylib"
} else if cfg!(windows) {
    "OpenImageDenoise.dll"
} else {
    "libOpenImageDenoise.so.2"
};

/// Most entries of a folder that are looked at.
const MOST_ENTRIES: usize = 4096;

/// A folder that has the library below it, as parts of a path. `*` ends the name of any entry.
type Pattern = &'static [&'static str];

/// Below the prefix of a Python: the packages `pyoidn` and `oidn`, and conda's own libraries.
const OF_PYTHON: [Pattern; 6] = [
    &["lib", "python3*", "site-packages", "pyoidn", "oidn", "lib"],
    &["lib", "python3*", "dist-packages", "pyoidn", "oidn", "lib"],
    &["lib", "python3*", "site-packages", "oidn", "lib*"],
    &["Lib", "site-packages", "pyoidn", "oidn", "bin"],
    &["lib"],
    &["Library", "bin"],
];

/// Below a folder in which programs are installed: Blender.
const OF_BLENDER: [Pattern; 5] = [
    &["blender*", "lib"],
    &["Blender*", "lib"],
    &["Blender.app", "Contents", "Resources", "lib"],
    &["Blender Foundation", "Blender*", "blender.shared"],
    &["blender", "current", "lib"],
];

/// Returns files with the library's name, the likeliest first. The system's own library is not
/// among them, because the system finds it by its name.
pub(crate) fn candidates() -> Vec<PathBuf> {
    let home = env::home_dir();
    let variable = |name: &str| env::var_os(name).map(PathBuf::from);
    let mut prefixes: Vec<PathBuf> = Vec::new();
    prefixes.extend(variable("VIRTUAL_ENV"));
    prefixes.extend(variable("CONDA_PREFIX"));
    // A Python on the search path lies in `PREFIX/bin`.
    let path = variable("PATH").unwrap_or_default();
    let folders = env::split_paths(&path).filter(|folder| folder.is_absolute());
    prefixes.extend(folders.filter_map(|folder| folder.parent().map(Path::to_owned)));
    if let Some(home) = &home {
        prefixes.push(home.join(".local"));
        let pyenv = variable("PYENV_ROOT").unwrap_or_else(|| home.join(".pyenv"));
        prefixes.extend(matching(&pyenv.join("versions"), "*"));
    }
    prefixes.push("/usr/local".into());
    prefixes.push("/usr".into());
    let mut programs: Vec<PathBuf> =
        ["/opt", "/usr/share", "/snap", "/Applications"].map(PathBuf::from).into();
    programs.extend(home);
    programs.extend(variable("ProgramFiles"));
    let mut found: Vec<PathBuf> = Vec::new();
    let roots = prefixes.iter().map(|prefix| (prefix, &OF_PYTHON[..]));
    for (root, patterns) in roots.chain(programs.iter().map(|root| (root, &OF_BLENDER[..]))) {
        for pattern in patterns {
            let file = below(root, pattern).into_iter().map(|folder| folder.join(NAME));
            found.extend(file.filter(|file| file.is_file()));
        }
    }
    let mut seen = std::collections::HashSet::new();
    found.retain(|file| seen.insert(file.clone()));
    found
}

/// Returns the folders below `root` that a pattern names.
fn below(root: &Path, pattern: Pattern) -> Vec<PathBuf> {
    pattern.iter().fold(vec![root.to_owned()], |folders, part| {
        folders
            .iter()
            .flat_map(|folder| match part.strip_suffix('*') {
                Some(_) => matching(folder, part),
                None => vec![folder.join(part)],
            })
            .collect()
    })
}

/// Returns the entries of a folder whose names begin as `part` does before its `*`, the last by
/// name first: newer versions come before older ones.
fn matching(folder: &Path, part: &str) -> Vec<PathBuf> {
    let beginning = part.trim_end_matches('*');
    let Ok(entries) = folder.read_dir() else { return Vec::new() };
    let mut found: Vec<PathBuf> = entries
        .take(MOST_ENTRIES)
        .flatten()
        .filter(|entry| entry.file_name().to_string_lossy().starts_with(beginning))
        .map(|entry| entry.path())
        .collect();
    found.sort_unstable_by(|a, b| b.cmp(a));
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Makes a file with the library's name in a folder below `root`.
    fn install(root: &Path, folder: &str) -> PathBuf {
        let folder = root.join(folder);
        std::fs::create_dir_all(&folder).unwrap();
        let file = folder.join(NAME);
        std::fs::write(&file, b"").unwrap();
        file
    }

    #[test]
    fn packages_of_python_and_blender_are_found_newest_first() {
        let root = tempfile::tempdir().unwrap();
        let pip = install(root.path(), "lib/python3.11/site-packages/pyoidn/oidn/lib");
        let newer = install(root.path(), "lib/python3.12/site-packages/pyoidn/oidn/lib");
        let blender = install(root.path(), "blender-4.2.1-linux-x64/lib");
        let files = |patterns: &[Pattern]| -> Vec<PathBuf> {
            let folders = patterns.iter().flat_map(|pattern| below(root.path(), pattern));
            folders.map(|folder| folder.join(NAME)).filter(|file| file.is_file()).collect()
        };
        assert_eq!(files(&OF_PYTHON), [newer, pip]);
        assert_eq!(files(&OF_BLENDER), [blender]);
    }

    #[test]
    fn folders_that_do_not_exist_have_no_library() {
        assert!(below(Path::new("/nowhere"), &["lib", "python3*"]).is_empty());
    }
}

//! Saves pictures to files: as seen, or as radiance.

use std::{
    fs::OpenOptions,
    io::{ErrorKind, Write},
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, bail};
use holo_picture::{Format, Image};

use super::seen::DisplayedFrame;

/// A way to save a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SaveFormat {
    /// Display colours with the legend, as `.png`.
    Seen,
    /// Radiance, as `.exr`.
    Radiance,
}

/// Most files of one kind in a folder.
const MOST_FILES: u32 = 100_000;

/// Writes a frame to a new file, such as `holodeck-1.png`. Returns the file.
///
/// # Errors
/// If the picture cannot be encoded or the file cannot be written.
pub fn save(seen: &DisplayedFrame, kind: SaveFormat, folder: &Path) -> Result<PathBuf> {
    let (end, bytes) = match kind {
        SaveFormat::Seen => ("png", Image::clone(&seen.image).with_legend().png()?),
        SaveFormat::Radiance => ("exr", seen.shown.frame.picture.encode(Format::Exr)?),
    };
    for number in 1..=MOST_FILES {
        let path = folder.join(format!("holodeck-{number}.{end}"));
        let mut file = match OpenOptions::new().write(true).create_new(true).open(&path) {
            Err(error) if error.kind() == ErrorKind::AlreadyExists => continue,
            file => file.with_context(|| format!("creating {}", path.display()))?,
        };
        file.write_all(&bytes).with_context(|| format!("writing {}", path.display()))?;
        return Ok(path);
    }
    bail!("{} has {MOST_FILES} saved pictures already", folder.display())
}

#[cfg(test)]
mod tests {
    use holo_picture::{Look, Picture};

    use super::{super::tests::seen, *};

    #[test]
    fn pictures_are_saved_as_seen_and_in_radiance_and_none_is_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let seen = seen((70, 80), [0.25, 0.5, 1.0], &Look { contours: true, ..Look::default() });
        let first = save(&seen, SaveFormat::Seen, folder.path()).unwrap();
        let second = save(&seen, SaveFormat::Seen, folder.path()).unwrap();
        assert_eq!(first.file_name().unwrap(), "holodeck-1.png");
        assert_eq!(second.file_name().unwrap(), "holodeck-2.png");
        let decoder =
            png::Decoder::new(std::io::BufReader::new(std::fs::File::open(first).unwrap()));
        let width = decoder.read_info().unwrap().info().width;
        assert!(width > 70, "the legend is beside the picture");
        let exr = save(&seen, SaveFormat::Radiance, folder.path()).unwrap();
        assert_eq!(Picture::read(exr).unwrap().get(3, 3), Some([0.25, 0.5, 1.0]));
        assert!(save(&seen, SaveFormat::Seen, &folder.path().join("none")).is_err());
    }
}

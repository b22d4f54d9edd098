//! The list of captured pictures: a file that names several, with where each was taken.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use serde::Deserialize;

use crate::{
    config::{SectionTable, Unit, Up},
    import::{
        camera::{DepthAlong, Projection},
        panorama::{DepthMeaning, PanoramaSource},
    },
};

/// Most pictures of a file. Each is a maker of samples, of which files have room for 4096.
pub const MAX_PANORAMAS: usize = 1024;

/// Most bytes of a list.
const MAX_LIST_BYTES: u64 = 4 << 20;

/// Captured pictures, and what holds for all of them. An unknown key is an error.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ImportList {
    /// The pictures.
    pub panorama: Vec<PanoramaSource>,
    /// The sections of the file. None: one that suits the pictures.
    pub section: Vec<SectionTable>,
    /// The up axis. `None`: z.
    pub up: Option<Up>,
    /// The unit of positions. `None`: metres.
    pub unit: Option<Unit>,
    /// How all pictures show directions that do not state it.
    pub projection: Option<Projection>,
    /// What depths are measured along.
    pub depth_along: Option<DepthAlong>,
    /// Scene units in a unit of depth.
    pub depth_scale: Option<f64>,
    /// The depth from which on a pixel shows the sky, in units of depth.
    pub sky_beyond: Option<f64>,
}

impl ImportList {
    /// Reads a list. Paths in it are relative to its folder.
    ///
    /// # Errors
    /// If the file cannot be read, or a key is unknown or has a wrong value. The error names the
    /// file and the line.
    pub fn read(path: &Path) -> Result<ImportList> {
        let name = || path.display().to_string();
        let bytes = std::fs::metadata(path).with_context(name)?.len();
        ensure!(
            bytes <= MAX_LIST_BYTES,
            "{}: {bytes} bytes are more than a list of pictures has",
            name()
        );
        let text = std::fs::read_to_string(path).with_context(name)?;
        let mut list: ImportList = toml::from_str(&text).with_context(name)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        for PanoramaSource { colour, depth, .. } in &mut list.panorama {
            for file in [colour, depth] {
                *file = folder.join(std::mem::take::<PathBuf>(file));
            }
        }
        ensure!(!list.panorama.is_empty(), "{} names no picture ([[panorama]])", name());
        Ok(list)
    }

    /// Checks what can be checked before a picture is read.
    ///
    /// # Errors
    /// If there are too many pictures, or a number makes no sense.
    pub fn check(&self) -> Result<()> {
        let count = self.panorama.len();
        ensure!(count > 0, "there is no picture to import");
        ensure!(count <= MAX_PANORAMAS, "{count} pictures are more than {MAX_PANORAMAS}");
        for (name, value) in [("depth_scale", self.depth_scale), ("sky_beyond", self.sky_beyond)] {
            let is_length = value.is_none_or(|value| value.is_finite() && value > 0.0);
            ensure!(is_length, "{name} must be a positive number");
        }
        let is_plain =
            |section: &SectionTable| section.geometry.is_none() && section.portals.is_none();
        ensure!(
            self.section.iter().all(is_plain),
            "captured rays have no scene, so their sections have no `geometry` and no `portals`"
        );
        Ok(())
    }

    /// Returns the meaning of depths.
    pub fn meaning(&self) -> DepthMeaning {
        let usual = DepthMeaning::default();
        DepthMeaning {
            along: self.depth_along.unwrap_or(usual.along),
            scale: self.depth_scale.unwrap_or(usual.scale),
            sky: self.sky_beyond.unwrap_or(usual.sky),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_names_pictures_beside_it_and_a_fault_is_said_with_its_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("walk.toml");
        let picture = "[[panorama]]\ncolour = \"a.exr\"\ndepth = \"sub/a.pfm\"\nvp = [1, 2, 3]\n\
                       vd = [0, 1, 0]\n";
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            ImportList::read(&path).and_then(|list| list.check().map(|()| list))
        };
        let all = format!(
            "up = \"y\"\nunit = \"cm\"\nprojection = \"cube\"\ndepth_along = \"axis\"\n\
             depth_scale = 0.1\nsky_beyond = 6e4\n{picture}"
        );
        let list = read(&all).unwrap();
        let first = &list.panorama[0];
        assert_eq!(first.colour, folder.path().join("a.exr"));
        assert_eq!(first.depth, folder.path().join("sub/a.pfm"));
        assert_eq!(first.vp, Some([1.0, 2.0, 3.0]));
        assert_eq!(list.projection, Some(Projection::Cube));
        let meaning = DepthMeaning { along: DepthAlong::Axis, scale: 0.1, sky: 6e4 };
        assert_eq!(list.meaning(), meaning);
        for (text, words) in [
            ("", "names no picture"),
            ("panoramas = 3\n", "line 1"),
            ("depth_scale = 0\n", "depth_scale"),
            ("sky_beyond = nan\n", "sky_beyond"),
            ("depth_along = \"wall\"\n", "wall"),
            ("unit = -1\n", "positive"),
        ] {
            let text = if text.is_empty() { String::new() } else { format!("{text}{picture}") };
            let said = format!("{:#}", read(&text).unwrap_err());
            assert!(said.contains(words), "{text}: {said}");
        }
        let no_depth = format!("{picture}[[panorama]]\ncolour = \"b.exr\"\n");
        let said = format!("{:#}", read(&no_depth).unwrap_err());
        assert!(said.contains("walk.toml") && said.contains("line 6"), "{said}");
        assert!(said.contains("depth"), "{said}");
    }
}

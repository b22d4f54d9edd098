//! Stand-ins: simpler scenes that displays use in place of a holodeck's scene. The file keeps them
//! in one blob, and its description says where they came from.

use std::sync::Arc;

use anyhow::{Context, Result, bail, ensure};
use holo_proto::{
    control::SceneInfo,
    stand_ins::{self, StandInKind, StandInRecord},
};
use holo_scene::Scene;

use crate::{about::AboutStandIns, holodeck::Holodeck};

/// Name of the blob that holds the stand-ins.
const STAND_INS: &str = "stand-ins";

impl Holodeck {
    /// Replaces the stand-ins for the scene. Each comes with a text that says where it is from.
    ///
    /// # Errors
    /// If one is for a section that does not exist, or they cannot be written.
    pub fn set_stand_ins(&mut self, parts: &[(StandInRecord, String)]) -> Result<()> {
        let known = |section: u16| usize::from(section) < self.sections.len();
        if let Some((part, source)) = parts.iter().find(|(part, _)| !known(part.section)) {
            bail!(
                "{source} is for section {}, but there are only {} (the first is 0)",
                part.section,
                self.sections.len()
            );
        }
        let source = |(part, source): &(StandInRecord, String)| {
            let kind = match part.kind {
                StandInKind::Geometry => "geometry",
                StandInKind::Portals => "portals",
            };
            (part.section, kind.to_owned(), source.clone())
        };
        let sources = parts.iter().map(source).collect();
        let bytes =
            stand_ins::encode(&parts.iter().map(|(part, _)| part.clone()).collect::<Vec<_>>());
        let blob = SceneInfo { hash: Scene::content_hash(&bytes), bytes: bytes.len() as u64 };
        let about = Some(AboutStandIns { blob, sources });
        if self.about.stand_ins != about {
            self.file.put_blob(STAND_INS, &bytes)?;
            self.about.stand_ins = about;
            self.about.write(&self.file)?;
        }
        Ok(())
    }

    /// Returns the blob of the stand-ins, if some exist.
    ///
    /// # Errors
    /// If it is damaged on disk.
    pub fn stand_ins(&self) -> Result<Option<Arc<[u8]>>> {
        let Some(about) = &self.about.stand_ins else { return Ok(None) };
        let name = self.path().display();
        let bytes = self
            .file
            .blob(STAND_INS)?
            .with_context(|| format!("{name}: the stand-ins for the scene are missing"))?;
        ensure!(
            Scene::content_hash(&bytes) == about.blob.hash,
            "{name}: the stand-ins for the scene are damaged"
        );
        Ok(Some(bytes.into()))
    }

    /// Copies the stand-ins into a holodeck that has the same description.
    ///
    /// # Errors
    /// If they are damaged on disk, or cannot be written.
    pub(crate) fn copy_stand_ins(&self, to: &Holodeck) -> Result<()> {
        if let Some(stand_ins) = self.stand_ins()? {
            to.file.put_blob(STAND_INS, &stand_ins)?;
        }
        Ok(())
    }
}

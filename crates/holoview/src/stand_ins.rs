//! What displays take instead of the scene for views of a section: simpler geometry, and portals beyond which it tells nothing (Larson
//! & Simmons 1999, §2.4.4).
//!
//! Invariant: they are used only if their bytes have the announced hash.

use std::{collections::BTreeMap, sync::Arc};

use anyhow::{Context, Result, ensure};
use holo_display::section_of;
use holo_picture::View;
use holo_proto::stand_ins::{StandInKind, decode};
use holo_raycast::Raycaster;
use holo_scene::Scene;
use holo_section::Section;

/// Geometry and portals of a section.
type OfSection = (Option<Arc<Raycaster>>, Option<Arc<Raycaster>>);

/// Stand-ins by section.
#[derive(Default)]
pub struct StandIns(BTreeMap<u16, OfSection>);

impl StandIns {
    /// Those of a blob.
    ///
    /// # Errors
    /// If it is not the one announced, or what it holds cannot be used.
    pub fn build(blob: &[u8], hash: [u8; 32]) -> Result<StandIns> {
        ensure!(
            Scene::content_hash(blob) == hash,
            "the stand-ins' bytes do not have the announced hash"
        );
        let mut stand_ins = StandIns::default();
        for part in decode(blob).context("reading the server's stand-ins")? {
            let build = || {
                Raycaster::build(Arc::new(Scene::unpack(&part.packed)?))
                    .map_err(anyhow::Error::from)
            };
            let raycaster = build()
                .with_context(|| format!("preparing a stand-in of section {}", part.section))?;
            let (geometry, portals) = stand_ins.0.entry(part.section).or_default();
            *match part.kind {
                StandInKind::Geometry => geometry,
                StandInKind::Portals => portals,
            } = Some(Arc::new(raycaster));
        }
        Ok(stand_ins)
    }

    /// Geometry and portals for a view.
    pub fn of(&self, sections: &[Section], view: &View) -> OfSection {
        section_of(sections, view)
            .and_then(|section| self.0.get(&section))
            .cloned()
            .unwrap_or_default()
    }
}

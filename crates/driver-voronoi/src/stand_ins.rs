//! What the driver casts instead of the scene for views of a section: simpler geometry, and portals
//! (Larson & Simmons 1999, §2.4.4).

use holo_display::section_of;
use holo_picture::View;
use holo_raycast::Raycaster;
use holo_section::Section;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The stand-in of one section.
#[derive(Clone, Default)]
pub struct StandIn {
    /// Simpler geometry, cast instead of the scene.
    pub geometry: Option<Arc<Raycaster>>,
    /// Invisible surfaces beyond which the geometry says nothing.
    pub portals: Option<Arc<Raycaster>>,
}

/// Stand-ins by section number.
#[derive(Clone, Default)]
pub struct StandIns(pub BTreeMap<u16, StandIn>);

impl StandIns {
    /// Returns the stand-in for a view: that of the section that the view looks out of or into.
    pub fn of(&self, sections: &[Section], view: &View) -> StandIn {
        section_of(sections, view)
            .and_then(|section| self.0.get(&section))
            .cloned()
            .unwrap_or_default()
    }
}

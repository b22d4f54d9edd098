//! The scene as the surroundings of an eye.

use std::sync::Arc;

use glam::DVec3;
use holo_raycast::Raycaster;
use holo_section::SectionSpec;
use holo_walk::{Surface, Surroundings};

/// Distance from the box around all sections within which an eye is still in the house, metres.
/// Sections may leave a gap to the walls.
const GAP: f64 = 0.6;

/// The surfaces of a scene, and the house: the box around all sections.
#[derive(Debug)]
pub struct World {
    scene: WorldScene,
    low: DVec3,
    high: DVec3,
}

struct WorldScene(Arc<Raycaster>);

impl std::fmt::Debug for WorldScene {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Scene")
    }
}

impl World {
    /// Returns the surroundings in a scene with `metre` units to a metre.
    pub fn new(scene: Arc<Raycaster>, sections: &[SectionSpec], metre: f64) -> World {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for SectionSpec { origin, axes, .. } in sections {
            let [a, b, c] = axes.map(DVec3::from_array);
            for corner in 0..8 {
                let share = |bit: u32| f64::from(corner >> bit & 1);
                let point = DVec3::from_array(*origin) + a * share(0) + b * share(1) + c * share(2);
                (low, high) = (low.min(point), high.max(point));
            }
        }
        let gap = DVec3::splat(GAP * metre);
        World { scene: WorldScene(scene), low: low - gap, high: high + gap }
    }
}

impl Surroundings for World {
    fn surface(&self, from: DVec3, towards: DVec3) -> Option<Surface> {
        let (ray, skipped) = self.scene.0.localize(from, towards)?;
        let hit = self.scene.0.nearest(&ray)?;
        let normal = self.scene.0.geometric_normal(hit.triangle).as_dvec3().normalize_or_zero();
        let normal = if normal.dot(towards) > 0.0 { -normal } else { normal };
        Some(Surface { distance: skipped + f64::from(hit.t), normal })
    }

    fn is_in_house(&self, point: DVec3) -> bool {
        point.cmpge(self.low).all() && point.cmple(self.high).all()
    }
}

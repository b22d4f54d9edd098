//! Changes of a scene besides those of its file: of its light, and of the objects that are part of
//! it.

use std::{fmt, sync::Arc};

use holo_scene::Scene;

use super::light_change::LightChange;

/// A model at its place in a scene.
#[derive(Clone)]
pub struct PlacedModel {
    /// The object's name.
    pub name: String,
    /// The rows of the map from the model's world coordinates to the scene's.
    pub place: [[f64; 4]; 3],
    /// The model.
    pub model: Arc<Scene>,
}

impl fmt::Debug for PlacedModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let PlacedModel { name, place, .. } = self;
        f.debug_struct("PlacedModel").field("name", name).field("place", place).finish()
    }
}

/// A change of a scene.
#[derive(Clone, Debug, Default)]
pub struct SceneChange {
    /// A change of its light.
    pub light: LightChange,
    /// Objects that become part of it.
    pub baked: Vec<PlacedModel>,
    /// Names of objects that are no longer part of it.
    pub taken_out: Vec<String>,
}

impl From<LightChange> for SceneChange {
    fn from(light: LightChange) -> SceneChange {
        SceneChange { light, ..SceneChange::default() }
    }
}

impl SceneChange {
    /// Returns whether it changes nothing.
    pub fn is_empty(&self) -> bool {
        self.light.is_empty() && self.baked.is_empty() && self.taken_out.is_empty()
    }

    /// Adds a later change. It counts where both state the same.
    pub fn add(&mut self, later: SceneChange) {
        self.light.add(later.light);
        self.baked.retain(|before| later.baked.iter().all(|now| now.name != before.name));
        self.baked.extend(later.baked);
        self.taken_out.retain(|before| !later.taken_out.contains(before));
        self.taken_out.extend(later.taken_out);
    }
}

//! Changes of a scene besides those of its file: of its light, and of the objects that are part of
//! it.

use std::{fmt, sync::Arc};

use glam::{DAffine3, DQuat, DVec3};
use holo_local_objects::{ObjectError, ObjectPose};
use holo_scene::Scene;

use super::{light_change::LightChange, objects::order::PoseChange};

/// A model at its place in a scene.
#[derive(Clone)]
pub struct PlacedModel {
    /// The object's name.
    pub name: String,
    /// The rows of the map from the model's world coordinates to the scene's.
    pub place: [[f64; 4]; 3],
    /// The same as a person states it.
    pub pose: ObjectPose,
    /// The model.
    pub model: Arc<Scene>,
}

impl fmt::Debug for PlacedModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let PlacedModel { name, pose, .. } = self;
        f.debug_struct("PlacedModel").field("name", name).field("pose", pose).finish()
    }
}

impl PlacedModel {
    /// Returns the model at another pose, in a scene with this up axis.
    ///
    /// # Errors
    /// If the pose is not possible.
    pub fn changed(&self, change: PoseChange, up: DVec3) -> Result<PlacedModel, ObjectError> {
        let (before, now) = (self.pose, change.of(self.pose));
        now.check()?;
        let up = up.try_normalize().ok_or(ObjectError::Axes)?;
        let turn = DQuat::from_axis_angle(up, (now.turn - before.turn).to_radians());
        let size = DVec3::splat(now.scale / before.scale);
        let about_base = DAffine3::from_scale_rotation_translation(size, turn, now.at)
            * DAffine3::from_translation(-before.at);
        let place = rows_of(&(about_base * map_of(&self.place)));
        Ok(PlacedModel { place, pose: now, ..self.clone() })
    }
}

/// Returns the map that these rows describe.
pub(super) fn map_of(rows: &[[f64; 4]; 3]) -> DAffine3 {
    let column = |column: usize| DVec3::new(rows[0][column], rows[1][column], rows[2][column]);
    DAffine3::from_cols(column(0), column(1), column(2), column(3))
}

fn rows_of(map: &DAffine3) -> [[f64; 4]; 3] {
    let (matrix, sum) = (map.matrix3, map.translation);
    [0, 1, 2].map(|axis| matrix.row(axis).extend(sum[axis]).to_array())
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
    /// Changes of poses of objects that are part of it, in the order of time.
    pub moved: Vec<(String, PoseChange)>,
}

impl From<LightChange> for SceneChange {
    fn from(light: LightChange) -> SceneChange {
        SceneChange { light, ..SceneChange::default() }
    }
}

impl SceneChange {
    /// Returns whether it changes nothing.
    pub fn is_empty(&self) -> bool {
        let SceneChange { light, baked, taken_out, moved } = self;
        light.is_empty() && baked.is_empty() && taken_out.is_empty() && moved.is_empty()
    }

    /// Adds a later change. It counts where both state the same.
    pub fn add(&mut self, later: SceneChange) {
        self.light.add(later.light);
        self.baked.retain(|before| later.baked.iter().all(|now| now.name != before.name));
        self.baked.extend(later.baked);
        self.taken_out.retain(|before| !later.taken_out.contains(before));
        self.taken_out.extend(later.taken_out);
        self.moved.extend(later.moved);
    }
}

#[cfg(test)]
mod tests {
    use holo_scene::{Material, Sky};

    use super::*;

    fn placed() -> PlacedModel {
        let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let material = vec![Material::grey("grey")];
        let sky = Sky::from([0.0; 3]);
        let model = Scene::new(DVec3::ZERO, corners, vec![[0, 1, 2]], vec![0], material, sky);
        // Of double size and turned by 90 degrees, with its base at 1, 2, 3.
        let place = [[0.0, -2.0, 0.0, 1.0], [2.0, 0.0, 0.0, 2.0], [0.0, 0.0, 2.0, 3.0]];
        let pose = ObjectPose { at: DVec3::new(1.0, 2.0, 3.0), turn: 90.0, scale: 2.0 };
        PlacedModel { name: "a".into(), place, pose, model: Arc::new(model.unwrap()) }
    }

    #[test]
    fn a_placed_model_is_moved_turned_and_scaled_about_the_middle_of_its_base() {
        let point = DVec3::new(1.0, 0.0, 0.5);
        let at = |placed: &PlacedModel| map_of(&placed.place).transform_point3(point);
        assert_eq!(at(&placed()), DVec3::new(1.0, 4.0, 4.0));
        for (change, now) in [
            (PoseChange::MoveBy(DVec3::X), DVec3::new(2.0, 4.0, 4.0)),
            (PoseChange::MoveTo(DVec3::ZERO), DVec3::new(0.0, 2.0, 1.0)),
            (PoseChange::TurnTo(0.0), DVec3::new(3.0, 2.0, 4.0)),
            (PoseChange::TurnBy(90.0), DVec3::new(-1.0, 2.0, 4.0)),
            (PoseChange::ScaleTo(1.0), DVec3::new(1.0, 3.0, 3.5)),
            (PoseChange::ScaleBy(2.0), DVec3::new(1.0, 6.0, 5.0)),
        ] {
            let changed = placed().changed(change, DVec3::Z).unwrap();
            assert!((at(&changed) - now).length() < 1e-12, "{change:?}: {}", at(&changed));
            assert_eq!(changed.pose, change.of(placed().pose));
        }
        assert!(placed().changed(PoseChange::ScaleTo(0.0), DVec3::Z).is_err());
        assert!(placed().changed(PoseChange::MoveTo(DVec3::NAN), DVec3::Z).is_err());
    }
}

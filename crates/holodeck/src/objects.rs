//! Objects that were carried into a scene and are part of it.
//!
//! Invariant: a file's scene is its model with these objects. Whoever reads the model again adds
//! them.

use std::sync::Arc;

use anyhow::{Context, Result};
use glam::DVec3;
use holo_scene::Scene;
use holo_server::{BakedObject, BakedPose, Holodeck};
use holo_view::{MovedObject, ObjectPose, PlacedModel, SceneChange};

/// Beginning of the choices that are about objects.
pub const OBJECT: &str = "object: ";

/// The objects of a scene, each with its packed model.
#[derive(Clone, Debug, Default)]
pub struct SceneObjects(Vec<(BakedObject, Arc<[u8]>)>);

impl SceneObjects {
    /// Returns those of a file's scene.
    ///
    /// # Errors
    /// If a model is damaged.
    pub fn of(file: &Holodeck) -> Result<SceneObjects> {
        let objects = file.baked_objects();
        objects.map(SceneObjects).context("the scene cannot be read again without its objects")
    }

    /// Returns them after a change of a scene with this up axis. An object whose name is taken gets
    /// a number.
    ///
    /// # Errors
    /// If an object that is to be taken out or moved is none of them, or cannot be where it is
    /// moved to.
    pub fn changed(mut self, change: &SceneChange, up: DVec3) -> Result<SceneObjects> {
        for name in &change.taken_out {
            let at = self.find(name)?;
            self.0.remove(at);
        }
        for (name, pose) in &change.moved {
            let at = self.find(name)?;
            let (object, packed) = &mut self.0[at];
            let moved = placed(object, packed)?.changed(*pose, up)?;
            (object.place, object.pose) = (moved.place, Some(described(moved.pose)));
        }
        for PlacedModel { name, place, pose, model } in &change.baked {
            let is_free = |name: &String| self.0.iter().all(|(object, _)| object.name != *name);
            let numbered = (2..).map(|number: u32| format!("{name} {number}"));
            let name = std::iter::once(name.clone()).chain(numbered).find(is_free);
            let packed = model.pack();
            let name = name.unwrap_or_default();
            let object = BakedObject::new(name, &packed, *place, described(*pose));
            self.0.push((object, packed.into()));
        }
        Ok(self)
    }

    fn find(&self, name: &str) -> Result<usize> {
        let found = self.0.iter().position(|(object, _)| object.name == name);
        found.with_context(|| {
            let names = self.names();
            let others = if names.is_empty() { "none".into() } else { names.join(", ") };
            format!("no object `{name}` is part of the scene; there are {others}")
        })
    }

    /// Returns those that are elsewhere `now`, or gone.
    ///
    /// # Errors
    /// If a model is damaged.
    pub fn moved(&self, now: &SceneObjects) -> Result<Vec<MovedObject>> {
        let mut moved = Vec::new();
        for (object, packed) in &self.0 {
            let same = |(other, _): &&(BakedObject, _)| other.name == object.name;
            let place = now.0.iter().find(same).map(|(other, _)| other.place);
            // One of an earlier version has no pose, which does not matter here.
            if place != Some(object.place) {
                let pose = object.pose.unwrap_or(described(ObjectPose::at(DVec3::ZERO)));
                let object = BakedObject { pose: Some(pose), ..object.clone() };
                moved.push(MovedObject { before: placed(&object, packed)?, now: place });
            }
        }
        Ok(moved)
    }

    /// Returns their names.
    pub fn names(&self) -> Vec<String> {
        self.0.iter().map(|(object, _)| object.name.clone()).collect()
    }

    /// Returns what the description of a file says of them.
    pub fn described(&self) -> Vec<BakedObject> {
        self.0.iter().map(|(object, _)| object.clone()).collect()
    }

    /// Returns them with their packed models.
    pub fn packed(&self) -> &[(BakedObject, Arc<[u8]>)] {
        &self.0
    }

    /// Adds them to a scene. Returns what was added, for people.
    ///
    /// # Errors
    /// If one cannot be part of it.
    pub fn join(&self, mut scene: Scene) -> Result<(Scene, Vec<String>)> {
        let mut said = Vec::with_capacity(self.0.len());
        for (BakedObject { name, place, .. }, packed) in &self.0 {
            let joined = Scene::unpack(packed)
                .and_then(|model| scene.with_object(name, &model, place))
                .with_context(|| format!("adding the object `{name}` to the scene"))?;
            scene = joined;
            said.push(format!("{OBJECT}{name} was carried in and is part of the scene"));
        }
        Ok((scene, said))
    }
}

/// Returns an object at its place.
///
/// # Errors
/// If its model is damaged, or its pose is not known.
fn placed(object: &BakedObject, packed: &[u8]) -> Result<PlacedModel> {
    let name = object.name.clone();
    let pose = object.pose.with_context(|| {
        format!(
            "an earlier version made `{name}` part of the scene, so its pose is not known: take it \
             out, add it again and bake it"
        )
    })?;
    let model = Scene::unpack(packed).with_context(|| format!("the model of `{name}`"))?;
    let BakedPose { at, turn, scale } = pose;
    let pose = ObjectPose { at: DVec3::from_array(at), turn, scale };
    Ok(PlacedModel { name, place: object.place, pose, model: Arc::new(model) })
}

/// Returns a pose as a description has it.
fn described(pose: ObjectPose) -> BakedPose {
    BakedPose { at: pose.at.to_array(), turn: pose.turn, scale: pose.scale }
}

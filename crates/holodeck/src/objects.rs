//! Objects that were carried into a scene and are part of it.
//!
//! Invariant: a file's scene is its model with these objects. Whoever reads the model again adds
//! them.

use std::sync::Arc;

use anyhow::{Context, Result, bail};
use holo_scene::Scene;
use holo_server::{BakedObject, Holodeck};
use holo_view::{PlacedModel, SceneChange};

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

    /// Returns them after a change of the scene. An object whose name is taken gets a number.
    ///
    /// # Errors
    /// If an object that is to be taken out is none of them.
    pub fn changed(mut self, change: &SceneChange) -> Result<SceneObjects> {
        for name in &change.taken_out {
            let before = self.0.len();
            self.0.retain(|(object, _)| object.name != *name);
            if self.0.len() == before {
                let names = self.names();
                let others = if names.is_empty() { "none".into() } else { names.join(", ") };
                bail!("no object `{name}` is part of the scene; there are {others}");
            }
        }
        for PlacedModel { name, place, model } in &change.baked {
            let is_free = |name: &String| self.0.iter().all(|(object, _)| object.name != *name);
            let numbered = (2..).map(|number: u32| format!("{name} {number}"));
            let name = std::iter::once(name.clone()).chain(numbered).find(is_free);
            let packed = model.pack();
            let object = BakedObject::new(name.unwrap_or_default(), &packed, *place);
            self.0.push((object, packed.into()));
        }
        Ok(self)
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

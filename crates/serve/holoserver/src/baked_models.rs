//! The models of objects that are part of the scene. The scene has their triangles; the file keeps
//! the models beside it, so that the scene can be read again with them.

use std::sync::Arc;

use anyhow::{Context, Result, ensure};
use holo_scene::Scene;

use crate::{baked::BakedObject, holodeck::Holodeck};

impl Holodeck {
    /// Returns the objects that are part of the scene, with their packed models.
    ///
    /// # Errors
    /// If a model is missing or damaged on disk.
    pub fn baked_objects(&self) -> Result<Vec<(BakedObject, Arc<[u8]>)>> {
        let objects = self.about.reading.iter().flat_map(|reading| &reading.objects);
        objects.map(|object| Ok((object.clone(), self.model(object)?))).collect()
    }

    fn model(&self, object: &BakedObject) -> Result<Arc<[u8]>> {
        let BakedObject { name, model, .. } = object;
        let file = self.path().display();
        let packed = self.file.blob(&object.blob())?;
        let packed = packed.with_context(|| format!("{file}: the model of `{name}` is missing"))?;
        ensure!(
            Scene::content_hash(&packed) == model.hash,
            "{file}: the model of `{name}` is damaged"
        );
        Ok(packed.into())
    }

    /// Copies the models of objects into a holodeck that has the same description. Those that are
    /// damaged stay out: the scene can be shown and traced without them.
    pub(crate) fn copy_models(&self, to: &Holodeck) -> Result<()> {
        for object in self.about.reading.iter().flat_map(|reading| &reading.objects) {
            if let Ok(packed) = self.model(object) {
                object.write_model(&to.file, &packed)?;
            }
        }
        Ok(())
    }
}

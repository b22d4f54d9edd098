//! Local objects of a session: models that a person carries into the scene (Larson & Simmons 1999,
//! §2.4.6).
//!
//! Any driver's frame is drawn first, and the objects over it (`holo_local_objects`). Their light
//! is what that driver shows of stored samples around them, in six small views.
//!
//! Invariants:
//! - A session without objects does nothing here.
//! - Models are read on threads of their own, except kept ones before the session begins. An object
//!   that cannot be used changes nothing.
//! - Objects outlive the connection: a session that begins again has the same ones.

mod carrying;
mod cells;
mod drawing;
mod kept;
mod lighting;
pub(super) mod order;

use std::{
    path::PathBuf,
    sync::Arc,
    time::{Duration, Instant},
};

use anyhow::{Context, Result};
use glam::DVec3;
use holo_display::{Frame, FrameRequest};
use holo_local_objects::{LitObject, LocalObject, ObjectLayer, ObjectModel, ObjectPose};
use parking_lot::{Mutex, MutexGuard};

use super::scene_change::{PlacedModel, SceneChange};
pub use kept::ObjectFolder;
pub use order::{ObjectOrder, PoseChange};

use cells::CellSides;
use kept::{no_object, placed};
use lighting::Lightings;

/// Time after a change during which an object is drawn quickly, because the next change may follow.
const SETTLES_AFTER: Duration = Duration::from_millis(250);

/// A local object, as people know it.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectState {
    /// Its name.
    pub name: String,
    /// The model's file.
    pub path: PathBuf,
    /// Where it is.
    pub pose: ObjectPose,
}

/// An object that is carried.
#[derive(Clone)]
struct CarriedObject {
    name: String,
    path: PathBuf,
    object: LocalObject,
    /// The hash of the model, if it is kept.
    kept: Option<String>,
}

/// The objects of a session and of those that follow it.
#[derive(Clone, Default)]
pub struct CarriedObjects(Arc<Mutex<Vec<CarriedObject>>>);

impl CarriedObjects {
    fn list(&self) -> MutexGuard<'_, Vec<CarriedObject>> {
        // Every change leaves the list consistent.
        self.0.lock()
    }

    /// Returns the change of the scene that an order asks for; `None` if it concerns carried
    /// objects alone. `of_scene` are the names of the objects that are part of the scene.
    ///
    /// # Errors
    /// If there is no object to be baked of this name.
    pub fn scene_change(
        &self,
        order: &ObjectOrder,
        of_scene: &[String],
    ) -> Result<Option<SceneChange>> {
        let is_carried = |name: &String| self.list().iter().any(|carried| carried.name == *name);
        let change = match order {
            ObjectOrder::Bake(name) => {
                let baked = vec![self.placed(name)?];
                SceneChange { baked, ..SceneChange::default() }
            }
            ObjectOrder::Remove(name) if !is_carried(name) && of_scene.contains(name) => {
                SceneChange { taken_out: vec![name.clone()], ..SceneChange::default() }
            }
            ObjectOrder::Change(name, change) if !is_carried(name) && of_scene.contains(name) => {
                SceneChange { moved: vec![(name.clone(), *change)], ..SceneChange::default() }
            }
            _ => return Ok(None),
        };
        Ok(Some(change))
    }

    /// Returns a change of the scene with its objects where they are now, without those that were
    /// removed since; `None` if all of them are where they were.
    #[must_use]
    pub fn moved_since(&self, change: &SceneChange) -> Option<SceneChange> {
        let now = change.baked.iter().filter_map(|before| self.placed(&before.name).ok());
        let baked: Vec<PlacedModel> = now.collect();
        let stays = |(before, now): (&PlacedModel, &PlacedModel)| before.place == now.place;
        let all_stay =
            baked.len() == change.baked.len() && change.baked.iter().zip(&baked).all(stays);
        (!all_stay).then(|| SceneChange { baked, ..change.clone() })
    }

    fn placed(&self, name: &str) -> Result<PlacedModel> {
        Ok(placed(name, &find(&mut self.list(), name)?.object))
    }

    /// Removes those that are part of the scene from now on.
    pub(super) fn remove(&self, baked: &[String]) {
        self.list().retain(|carried| !baked.contains(&carried.name));
    }
}

/// A model that was read for an order.
pub struct LoadedObject {
    name: Option<String>,
    path: PathBuf,
    pose: ObjectPose,
    model: Result<ReadModel>,
}

/// A model that was read, and its hash if it is kept.
type ReadModel = (ObjectModel, Option<String>);

/// What a session knows of its objects.
#[derive(Default)]
pub struct SessionObjects {
    carried: CarriedObjects,
    /// Where objects are kept.
    folder: Option<ObjectFolder>,
    /// True if the list that is kept is not the present one.
    is_unkept: bool,
    /// Number of models that are being read.
    loading: usize,
    /// True if a model has arrived that no frame shows yet.
    has_arrived: bool,
    /// When an object last changed.
    changed: Option<Instant>,
    lightings: Lightings,
    sides: CellSides,
    shown: Option<ShownObjects>,
    /// The objects of the last part of a picture.
    of_parts: Vec<LitObject>,
    /// The object that a person holds, and its place relative to the point that is held.
    held: Option<(String, DVec3)>,
}

/// The objects in a frame.
struct ShownObjects {
    look: FrameRequest,
    /// The frame without objects.
    base: Arc<Frame>,
    objects: Vec<LitObject>,
    is_quick: bool,
    layer: ObjectLayer,
}

impl SessionObjects {
    /// Returns a session's objects: those of the session before.
    pub fn new(carried: CarriedObjects, folder: Option<ObjectFolder>) -> SessionObjects {
        SessionObjects { carried, folder, ..SessionObjects::default() }
    }

    /// Returns whether there is no object.
    pub fn is_empty(&self) -> bool {
        self.carried.list().is_empty()
    }

    /// Notes that so many samples have arrived.
    pub fn note_samples(&mut self, count: usize) {
        self.lightings.note_samples(count as u64);
    }

    /// Notes that the driver is another one, which draws other frames.
    pub fn note_driver(&mut self) {
        self.lightings.note_driver();
        self.shown = None;
    }

    /// Returns whether no object has changed just now.
    fn settles(&self) -> bool {
        self.changed.is_none_or(|changed| changed.elapsed() >= SETTLES_AFTER)
    }

    /// Notes that all samples that were requested have arrived.
    pub fn note_settled(&mut self) {
        self.lightings.note_settled();
    }

    fn note_change(&mut self) {
        self.changed = Some(Instant::now());
        self.is_unkept = self.folder.as_ref().is_some_and(|folder| folder.is_writable);
    }
}

fn find<'a>(list: &'a mut [CarriedObject], name: &str) -> Result<&'a mut CarriedObject> {
    let unknown = no_object(name, list.iter().map(|carried| carried.name.as_str()));
    list.iter_mut().find(|carried| carried.name == name).context(unknown)
}

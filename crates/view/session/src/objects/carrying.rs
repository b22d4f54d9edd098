//! Orders about local objects: models are read, carried, kept and recalled.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail, ensure};
use glam::DVec3;
use holo_local_objects::{LocalObject, ObjectModel, ObjectPose};
use holo_scene::{LoadOptions, load};

use super::{
    CarriedObject, LoadedObject, ObjectFolder, ObjectOrder, ObjectState, PoseChange, ReadModel,
    SETTLES_AFTER, find, kept::KeptObject,
};
use crate::{Session, Waited, incoming::Incoming, waker::Waker};

/// Most local objects of a session.
const MOST_OBJECTS: usize = 64;

/// Longest time for which a script waits for a model.
const LOADING_PATIENCE: Duration = Duration::from_secs(600);

/// Longest time for which a script waits for the samples around an object, and how often it looks.
const LIGHT_PATIENCE: Duration = Duration::from_secs(10);
const LIGHT_TICK: Duration = Duration::from_millis(20);

impl Session {
    /// Returns the local objects.
    pub fn objects(&self) -> Vec<ObjectState> {
        let state = |carried: &CarriedObject| ObjectState {
            name: carried.name.clone(),
            path: carried.path.clone(),
            pose: carried.object.pose(),
        };
        self.objects.carried.list().iter().map(state).collect()
    }

    /// Follows an order about local objects. Returns what a person may want to know. A model is
    /// read on another thread, and appears once it is there; if it cannot be used,
    /// [`take_refusal`](Self::take_refusal) returns the reason.
    ///
    /// # Errors
    /// If there is no such object, or it cannot be changed so. Nothing has changed then.
    pub fn object(&mut self, order: ObjectOrder) -> Result<Option<String>> {
        match order {
            ObjectOrder::Add { path, name, pose } => self.add_object(path, name, pose)?,
            ObjectOrder::Change(name, change) => {
                let up = self.up();
                let sections = Arc::clone(&self.sections);
                let mut list = self.objects.carried.list();
                let carried = find(&mut list, &name)?;
                let pose = change.of(carried.object.pose());
                let moved = LocalObject::new(Arc::clone(carried.object.model()), pose, up)?;
                ensure_lit(&sections, &moved)?;
                carried.object = moved;
                drop(list);
                self.objects.note_change();
            }
            ObjectOrder::Remove(name) => {
                let mut list = self.objects.carried.list();
                find(&mut list, &name)?;
                list.retain(|carried| carried.name != name);
                drop(list);
                self.objects.note_change();
            }
            ObjectOrder::Bake(_) if self.traces() => bail!(
                "this program has not started the server, so it cannot change the scene: whoever \
                 has can"
            ),
            ObjectOrder::Bake(name) => bail!(
                "a replay only reads the holodeck: `holodeck bake FILE.holo \"{name}\"` makes a \
                 kept object part of its scene, and so does `holodeck view FILE.holo`"
            ),
            ObjectOrder::List => return Ok(Some(self.listed())),
            ObjectOrder::Grab(at) => self.grab(at),
            ObjectOrder::DragTo(at) => self.drag_to(at)?,
            ObjectOrder::Spin(at, degrees) => {
                if let Some(name) = self.object_at(at) {
                    self.object(ObjectOrder::Change(name, PoseChange::TurnBy(degrees)))?;
                }
            }
        }
        Ok(None)
    }

    fn listed(&self) -> String {
        let words = |object: ObjectState| {
            let ObjectPose { at, turn, scale } = object.pose;
            let (name, path) = (object.name, object.path.display());
            format!("{name}: {path} at {} {} {} turn {turn} scale {scale}", at.x, at.y, at.z)
        };
        let lines: Vec<String> = self.objects().into_iter().map(words).collect();
        if lines.is_empty() { "there are no objects".to_owned() } else { lines.join("\n") }
    }

    /// Reads a model on a thread of its own.
    fn add_object(&mut self, path: PathBuf, name: Option<String>, pose: ObjectPose) -> Result<()> {
        if self.objects.carried.list().len() + self.objects.loading >= MOST_OBJECTS {
            bail!("there are {MOST_OBJECTS} objects, which is the most: remove one");
        }
        pose.check()?;
        let (up, unit) = (self.up(), self.unit());
        let Waker(messages) = self.waker.clone();
        let folder = self.objects.folder.clone().filter(|folder| folder.is_writable);
        let read = move || {
            let model = read(&path, up, unit, folder.as_ref());
            // If the session is over, the model has no use.
            let loaded = LoadedObject { name, path, pose, model };
            let _ = messages.send(Incoming::Object(Box::new(loaded)));
        };
        thread::Builder::new().name("object".into()).spawn(read).context("reading a model")?;
        self.objects.loading += 1;
        Ok(())
    }

    /// Takes a model that was read.
    pub(crate) fn take_object(&mut self, loaded: LoadedObject) {
        self.objects.loading = self.objects.loading.saturating_sub(1);
        if let Err(error) = self.carry(loaded) {
            self.refusal = Some(holo_progress::said_once(error.as_ref()));
        }
    }

    fn carry(&mut self, loaded: LoadedObject) -> Result<()> {
        let LoadedObject { name, path, pose, model } = loaded;
        let (model, kept) = model?;
        let of_file = || path.display().to_string();
        let object = LocalObject::new(Arc::new(model), pose, self.up()).with_context(of_file)?;
        ensure_lit(&self.sections, &object).with_context(of_file)?;
        let stem = path.file_stem().map_or_else(|| "object".into(), |stem| stem.to_string_lossy());
        let wanted = name.unwrap_or_else(|| stem.into_owned());
        let mut list = self.objects.carried.list();
        let is_free = |name: &String| list.iter().all(|carried| carried.name != *name);
        let names = std::iter::once(wanted.clone());
        let mut names = names.chain((2..).map(|number| format!("{wanted} {number}")));
        let name = names.find(is_free).unwrap_or(wanted);
        list.push(CarriedObject { name, path, object, kept });
        drop(list);
        self.objects.has_arrived = true;
        self.objects.note_change();
        Ok(())
    }

    /// Brings the kept objects back. Those that cannot be used are named.
    pub(crate) fn recall_objects(&mut self) {
        let Some(folder) = self.objects.folder.clone() else { return };
        let kept = folder.list().unwrap_or_else(|error| {
            eprintln!("objects are left out: {error:#}");
            Vec::new()
        });
        for object in kept.into_iter().take(MOST_OBJECTS) {
            let model = folder.model(&object).and_then(|scene| {
                let model = ObjectModel::new(scene, object.up, object.unit)?;
                Ok((model, Some(object.model.clone())))
            });
            let (name, path, pose) =
                (Some(object.name.clone()), object.path.clone(), object.pose());
            if let Err(error) = self.carry(LoadedObject { name, path, pose, model }) {
                eprintln!("object {} is left out: {error:#}", object.name);
            }
        }
        self.objects.is_unkept = false;
    }

    /// Keeps the list of objects, once a person has moved one to its place.
    pub(crate) fn keep_objects_if_due(&mut self) {
        if self.objects.is_unkept && self.objects.settles() {
            self.keep_objects();
        }
    }

    /// Keeps the list of objects, if it has changed.
    pub(crate) fn keep_objects(&mut self) {
        let is_unkept = std::mem::take(&mut self.objects.is_unkept);
        let Some(folder) = self.objects.folder.as_ref().filter(|_| is_unkept) else { return };
        let kept = |carried: &CarriedObject| {
            let ObjectPose { at, turn, scale } = carried.object.pose();
            let model = carried.object.model();
            Some(KeptObject {
                name: carried.name.clone(),
                path: carried.path.clone(),
                at,
                turn,
                scale,
                model: carried.kept.clone()?,
                up: model.up(),
                unit: model.unit(),
            })
        };
        let list: Vec<KeptObject> = self.objects.carried.list().iter().filter_map(kept).collect();
        if let Err(error) = folder.put_list(&list) {
            self.refusal = Some(format!("the objects are not kept: {error:#}"));
        }
    }

    /// Waits until all models are read, and for a while until the samples around them have arrived.
    ///
    /// # Errors
    /// If a model cannot be used, or the server is lost.
    pub fn wait_for_objects(&mut self) -> Result<()> {
        let end = Instant::now() + LOADING_PATIENCE;
        while self.objects.loading > 0 {
            let waited = self.wait(end.min(Instant::now() + SETTLES_AFTER))?;
            if waited == Waited::Stop || Instant::now() >= end {
                break;
            }
        }
        if let Some(reason) = self.refusal.take() {
            bail!(reason);
        }
        let end = Instant::now() + LIGHT_PATIENCE;
        while self.awaits_light() && Instant::now() < end {
            if self.wait(end.min(Instant::now() + LIGHT_TICK))? == Waited::Stop {
                break;
            }
        }
        Ok(())
    }

    /// Returns the name of the object that is seen at a place of the picture, in shares from its
    /// left and top.
    pub fn object_at(&self, at: [f64; 2]) -> Option<String> {
        let shown = self.objects.shown.as_ref()?;
        let (origin, direction, _) = shown.look.view.clipped_ray(at[0], 1.0 - at[1])?;
        let list = self.objects.carried.list();
        let seen = list.iter().filter_map(|carried| {
            Some((carried.object.distance(origin, direction)?, &carried.name))
        });
        seen.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, name)| name.clone())
    }

    /// Takes hold of the object at a place of the picture.
    fn grab(&mut self, at: [f64; 2]) {
        self.objects.held = self.object_at(at).and_then(|name| {
            let pose = self.objects().into_iter().find(|object| object.name == name)?.pose;
            Some((name, pose.at - self.on_base(&pose, at)?))
        });
    }

    /// Moves the object that is held to a place of the picture.
    fn drag_to(&mut self, at: [f64; 2]) -> Result<()> {
        let Some((name, offset)) = self.objects.held.clone() else { return Ok(()) };
        let object = self.objects().into_iter().find(|object| object.name == name);
        let Some(ObjectState { pose, .. }) = object else { return Ok(()) };
        match self.on_base(&pose, at) {
            Some(point) => {
                let change = PoseChange::MoveTo(point + offset);
                self.object(ObjectOrder::Change(name, change)).map(drop)
            }
            None => Ok(()),
        }
    }

    /// Returns the point of the plane of an object's base that a place of the picture shows.
    fn on_base(&self, pose: &ObjectPose, at: [f64; 2]) -> Option<DVec3> {
        let view = self.objects.shown.as_ref()?.look.view;
        let up = self.up();
        let (origin, direction, _) = view.clipped_ray(at[0], 1.0 - at[1])?;
        let far = (pose.at - origin).dot(up) / direction.dot(up);
        (far > 0.0 && far.is_finite()).then(|| origin + direction * far)
    }
}

/// Checks that light is stored around an object: it must be in a section, or near one.
fn ensure_lit(sections: &[holo_section::Section], object: &LocalObject) -> Result<()> {
    let (centre, reach) = (object.centre(), object.radius());
    let is_near = sections.iter().any(|section| {
        let local = section.world_to_local(centre).clamp(DVec3::ZERO, DVec3::ONE);
        let nearest = section.local_to_world(local);
        // Furniture stands below the sections of a room, which leave its floor free.
        nearest.distance(centre) <= reach + 0.25 * section.diagonal()
    });
    ensure!(
        is_near,
        "the object would be at {:.3} {:.3} {:.3}, outside every section of the holodeck: no light \
         is stored there",
        centre.x,
        centre.y,
        centre.z
    );
    Ok(())
}

/// Reads a model, and keeps it in a folder. Its up axis and its unit are those that the file
/// states, or else those of the scene.
fn read(path: &Path, up: DVec3, unit: f64, folder: Option<&ObjectFolder>) -> Result<ReadModel> {
    let loaded = load(path, &LoadOptions::default())?;
    for warning in &loaded.warnings {
        eprintln!("{warning}");
    }
    let about = loaded.about;
    let stated_up = about.up.or(about.usual_up).map(|stated| DVec3::from_array(stated.value));
    let stated_unit = about.unit.or(about.usual_unit).map(|stated| stated.value / unit);
    let (up, unit) = (stated_up.unwrap_or(up), stated_unit.unwrap_or(1.0));
    let model =
        ObjectModel::new(loaded.scene, up, unit).with_context(|| path.display().to_string())?;
    let kept = match folder.map(|folder| folder.put_model(model.scene())) {
        Some(Err(error)) => {
            eprintln!("the object is not kept: {error:#}");
            None
        }
        kept => kept.transpose()?,
    };
    Ok((model, kept))
}

#[cfg(test)]
mod tests {
    use holo_scene::{Material, Scene};

    use super::*;
    use crate::tests::in_session;

    #[tokio::test(flavor = "multi_thread")]
    async fn a_model_that_has_arrived_is_a_reason_for_a_frame_although_no_sample_comes() {
        in_session(|session| {
            assert!(!session.refines_objects());
            let corners = [DVec3::ZERO, DVec3::X, DVec3::Z];
            let materials = vec![Material::grey("paint")];
            let made = Scene::from_world(&corners, &[[0, 1, 2]], &[0], materials, [0.0; 3]);
            let model = ObjectModel::new(made.unwrap().0, DVec3::Z, 1.0).unwrap();
            let (path, pose) = ("chair.glb".into(), ObjectPose::at(DVec3::splat(2.5)));
            session
                .carry(LoadedObject { name: None, path, pose, model: Ok((model, None)) })
                .unwrap();
            assert!(session.refines_objects());
            session.redraw_objects();
            assert!(!session.refines_objects(), "the driver's next frame shows it");
        })
        .await;
    }
}

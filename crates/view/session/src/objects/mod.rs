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

mod cells;
mod kept;
mod lighting;
pub(super) mod order;

use std::{
    path::{Path, PathBuf},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    thread,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail, ensure};
use glam::DVec3;
use holo_display::{Frame, FramePhase, FrameRequest, Interrupt};
use holo_local_objects::{
    LayerDetail, LitObject, LocalObject, ObjectLayer, ObjectLighting, ObjectModel, ObjectPose, Room,
};
use holo_picture::View;
use holo_scene::{LoadOptions, load};

use super::{
    Session, Waited, Waker,
    incoming::Incoming,
    scene_change::{PlacedModel, SceneChange},
};
pub use kept::ObjectFolder;
pub use order::{ObjectOrder, PoseChange};

use cells::CellSides;
use kept::{KeptObject, no_object, placed};
use lighting::Lightings;

/// Most local objects of a session.
const MOST_OBJECTS: usize = 64;

/// Time after a change during which an object is drawn quickly, because the next change may follow.
const SETTLES_AFTER: Duration = Duration::from_millis(250);

/// Passes of objects at rest and in files: noise of 2.5 % falls below a third of that.
const PASSES: u32 = 32;

/// Passes by which the light around objects at rest is found, on screens and in files. Those of
/// screens take a few tenths of a second.
const LIGHT_PASSES: u32 = 4;
const LIGHT_PASSES_OF_FILE: u32 = 16;

/// Passes in each frame at rest.
const PASSES_OF_FRAME: u32 = 2;

/// Longest time for which a script waits for a model.
const LOADING_PATIENCE: Duration = Duration::from_secs(600);

/// Longest time for which a script waits for the samples around an object, and how often it looks.
const LIGHT_PATIENCE: Duration = Duration::from_secs(10);
const LIGHT_TICK: Duration = Duration::from_millis(20);

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
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
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
    pub(super) fn take_object(&mut self, loaded: LoadedObject) {
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
        self.objects.note_change();
        Ok(())
    }

    /// Brings the kept objects back. Those that cannot be used are named.
    pub(super) fn recall_objects(&mut self) {
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
    pub(super) fn keep_objects_if_due(&mut self) {
        if self.objects.is_unkept && self.objects.settles() {
            self.keep_objects();
        }
    }

    /// Keeps the list of objects, if it has changed.
    pub(super) fn keep_objects(&mut self) {
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

    /// Returns whether a frame of the objects would be better than the one that is shown.
    pub fn refines_objects(&self) -> bool {
        let objects = &self.objects;
        if objects.is_empty() {
            return false;
        }
        let settles = objects.settles();
        objects.shown.as_ref().is_some_and(|shown| {
            let is_moving = shown.look.is_moving;
            let is_rough = shown.is_quick
                || shown.layer.is_unfinished()
                || self.has_probe()
                || objects.lightings.are_unfinished();
            !is_moving && settles && is_rough
        })
    }

    /// Draws the objects again over the last frame of the driver. `None` if it is of another view,
    /// or there is none.
    pub fn redraw_objects(&mut self) -> Option<Frame> {
        let shown = self.objects.shown.take()?;
        let current_look = self.current.as_ref()?.look;
        if current_look != shown.look {
            return None;
        }
        let phase = if shown.look.is_moving { FramePhase::Moving } else { FramePhase::Rest };
        let base = Arc::clone(&shown.base);
        self.objects.shown = Some(shown);
        Some(self.over(base, current_look, phase))
    }

    /// Draws the objects over a frame of the driver, of the current view.
    pub(super) fn with_objects(&mut self, frame: Frame, phase: FramePhase) -> Frame {
        let Some(current) = self.current.as_ref().filter(|_| !frame.is_stereo) else {
            return frame;
        };
        let look = current.look;
        if self.objects.is_empty() {
            self.objects.shown = None;
            return frame;
        }
        self.over(Arc::new(frame), look, phase)
    }

    /// Draws the objects over a frame of the driver, of this view.
    fn over(&mut self, base: Arc<Frame>, look: FrameRequest, phase: FramePhase) -> Frame {
        let is_file = phase == FramePhase::File;
        let mut is_quick = !is_file && (phase == FramePhase::Moving || !self.objects.settles());
        let room = self.room();
        let passes = match (is_quick, is_file) {
            (true, _) => 0,
            (_, true) => LIGHT_PASSES_OF_FILE,
            _ => LIGHT_PASSES,
        };
        let objects = self.lit_objects(is_quick, is_file, passes, room.as_ref());
        let before = self.objects.shown.take();
        let stays = |shown: &ShownObjects| {
            let is_same = shown.look == look
                && shown.is_quick == is_quick
                && shown.objects.len() == objects.len()
                && shown.objects.iter().zip(&objects).all(|(before, now)| before.is_same(now));
            is_same && (room.is_some() || shown.base.depth == base.depth)
        };
        let (side, begin) = (self.objects.sides.side(), Instant::now());
        let detail = if is_quick { LayerDetail::Quick(side) } else { LayerDetail::Exact(PASSES) };
        let never = Interrupt::default();
        let interrupt = if is_file || is_quick { &never } else { &self.interrupt };
        let after = |before: Option<&ShownObjects>, detail: LayerDetail, interrupt: &Interrupt| {
            let before = before.map(|before| &before.layer);
            let (view, room) = (&look.view, room.as_ref());
            ObjectLayer::after(before, &base, view, &objects, room, detail, interrupt)
        };
        let most = if is_file { PASSES } else { PASSES_OF_FRAME };
        let draw = |layer: &mut ObjectLayer, most: u32, interrupt: &Interrupt| {
            let has_work = layer.is_unfinished();
            layer.draw(&base, &objects, room.as_ref(), most, interrupt);
            has_work
        };
        let (mut layer, before) = match before {
            Some(shown) if stays(&shown) => (Some(shown.layer), None),
            before => (after(before.as_ref(), detail, interrupt), before),
        };
        let has_work = layer.as_mut().is_some_and(|layer| draw(layer, most, interrupt));
        if layer.as_ref().is_none_or(|layer| !layer.is_drawn() && layer.is_unfinished()) {
            // Whoever has interrupted it wants a frame soon.
            is_quick = true;
            layer = after(before.as_ref(), LayerDetail::Quick(side), &never);
            if let Some(layer) = &mut layer {
                draw(layer, 1, &never);
            }
        } else if is_quick && has_work {
            self.objects.sides.note(side, begin.elapsed().as_secs_f64());
        }
        let mut frame = Frame::clone(&base);
        if let Some(layer) = layer {
            layer.compose(&mut frame);
            self.objects.shown = Some(ShownObjects { look, base, objects, is_quick, layer });
        }
        frame
    }

    /// Draws the objects over a part of a picture. `view` is that of the part.
    pub(super) fn with_objects_in_part(
        &mut self,
        picture: holo_picture::Picture,
        view: &View,
    ) -> holo_picture::Picture {
        let Some(room) = self.room().filter(|_| !self.objects.is_empty()) else { return picture };
        let objects = self.lit_objects(false, false, LIGHT_PASSES_OF_FILE, Some(&room));
        self.objects.of_parts.clone_from(&objects);
        let mut frame = Frame::black(picture.size());
        frame.depth = room.depth(view, picture.size());
        frame.picture = picture;
        let mut layer =
            ObjectLayer::new(&frame, view, &objects, Some(&room), LayerDetail::Exact(PASSES));
        layer.draw(&frame, &objects, Some(&room), PASSES, &Interrupt::default());
        layer.compose(&mut frame);
        frame.picture
    }

    /// Returns the model of the scene, if it is here.
    fn room(&self) -> Option<Room> {
        self.scene.as_ref().map(|scene| Room::new(Arc::clone(&scene.raycaster)))
    }

    /// Returns an object with its light: that of the frame before, if both are the same.
    fn lit(
        &self,
        object: LocalObject,
        lighting: Arc<ObjectLighting>,
        passes: u32,
        room: Option<&Room>,
    ) -> LitObject {
        let shown = self.objects.shown.iter().flat_map(|shown| &shown.objects);
        let before = shown.chain(&self.objects.of_parts);
        let before = before.filter(|lit| lit.is_of(&object, &lighting));
        let lit = match before.max_by_key(|lit| lit.passes()) {
            Some(lit) => lit.clone(),
            None => LitObject::new(object, lighting),
        };
        if lit.passes() >= passes {
            return lit;
        }
        let never = Interrupt::default();
        let interrupt = if passes == LIGHT_PASSES_OF_FILE { &never } else { &self.interrupt };
        lit.at_rest(room, passes, interrupt).unwrap_or(lit)
    }

    fn carried(&self) -> Vec<LocalObject> {
        self.objects.carried.list().iter().map(|carried| carried.object.clone()).collect()
    }

    /// Returns the objects with their light, found by this many passes. Quick frames use light that
    /// is known already.
    fn lit_objects(
        &mut self,
        is_quick: bool,
        is_file: bool,
        passes: u32,
        room: Option<&Room>,
    ) -> Vec<LitObject> {
        let objects = self.carried();
        self.objects.lightings.forget_others(&objects);
        let mut lit = Vec::with_capacity(objects.len());
        for object in objects {
            let lighting = self.lighting(&object, is_quick, is_file, room);
            lit.extend(lighting.map(|lighting| self.lit(object, lighting, passes, room)));
        }
        lit
    }
}

fn find<'a>(list: &'a mut [CarriedObject], name: &str) -> Result<&'a mut CarriedObject> {
    let unknown = no_object(name, list.iter().map(|carried| carried.name.as_str()));
    list.iter_mut().find(|carried| carried.name == name).context(unknown)
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

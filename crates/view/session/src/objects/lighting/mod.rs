//! The light around local objects, by place.
//!
//! The driver draws six small views from the middle of an object. Drivers that store light draw
//! them at once, face by face, so that an input ends it. For others, a probe waits until the stored
//! samples of its views have arrived.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use anyhow::Result;
use glam::DVec3;
use holo_display::{Frame, FramePhase, FrameRequest, Interrupt, Renderer};
use holo_local_objects::{
    LightProbe, LocalObject, ObjectLighting, ProbeError, Room, probe_views, side_places,
};

mod probing;

/// Side of a probe's faces for objects that only scatter light, and for those that reflect it as
/// mirrors do, pixels.
const SIDE: u32 = 64;
const SHINY_SIDE: u32 = 256;

/// The same for places that an object passes, and for the first light of an object.
const PASSED_SIDE: u32 = 64;

/// Most further probes for what the mirrors of an object show and its middle does not see, and the
/// side of their faces, pixels: three of them cost three quarters of the probe of the middle.
const MOST_SIDES: usize = 3;
const SIDE_OF_SIDES: u32 = 128;

/// Most places whose light is stored.
const MOST_PLACES: usize = 16;

/// Share of its radius by which an object may move before its light is that of another place.
const SAME_PLACE: f64 = 0.25;

/// The same while it moves: where it has moved on, some frames find a sixth of the light there.
const PASSED: f64 = 0.5;

/// Least time between two such frames. They take up to 0.1 s longer than others: one of twelve may,
/// at the pace of a hand.
const PASSED_PAUSE: Duration = Duration::from_millis(400);

/// Growth of the samples after which the light of a place is found again, while nobody waits for a
/// file.
const GROWTH: f64 = 1.25;

/// The light of places.
#[derive(Default)]
pub(super) struct Lightings {
    places: Vec<LitPlace>,
    /// Probes whose samples are under way.
    waiting: Vec<WaitingProbe>,
    /// What an input has interrupted.
    unfinished: Option<UnfinishedProbe>,
    /// The light of a place that an object passes.
    passed: Option<UnfinishedProbe>,
    /// When a part of that was last found.
    passed_at: Option<Instant>,
    /// Samples that have arrived.
    samples: u64,
    /// Whether all samples that were requested for the waiting probes are here.
    is_settled: bool,
}

struct LitPlace {
    centre: DVec3,
    side: u32,
    /// `None` if the driver shows no light there.
    lighting: Option<Arc<ObjectLighting>>,
    /// Samples that had arrived when it was found.
    samples: u64,
    /// True if the driver has changed since.
    is_old: bool,
}

/// Light that a driver with a store of all light draws, face by face.
struct UnfinishedProbe {
    centre: DVec3,
    side: u32,
    renderer: Box<dyn Renderer>,
    /// Samples that had arrived when it was begun.
    samples: u64,
    /// Faces of the probe of the middle, and of the last place beside it.
    faces: Vec<Frame>,
    middle: Option<LightProbe>,
    /// Places for further probes, the first one last; `None` until the middle is known.
    places: Option<Vec<DVec3>>,
    sides: Vec<LightProbe>,
}

/// Light that was found.
struct FoundLight {
    lighting: Option<ObjectLighting>,
    /// Side of the probe's faces, pixels.
    side: u32,
    /// Samples that had arrived when it was begun.
    samples: u64,
    /// Whether it is as sharp as the object needs, with the light beside the object's middle.
    is_whole: bool,
}

impl UnfinishedProbe {
    fn new(centre: DVec3, side: u32, renderer: Box<dyn Renderer>, samples: u64) -> UnfinishedProbe {
        let (faces, middle, places, sides) = (Vec::new(), None, None, Vec::new());
        UnfinishedProbe { centre, side, renderer, samples, faces, middle, places, sides }
    }

    fn is_of(&self, object: &LocalObject) -> bool {
        let is_of_size = self.side == side(object) || self.side == PASSED_SIDE;
        is_of_size && is_same_place(self.centre, object.centre(), object.radius())
    }

    /// Draws a face. Returns whether all are drawn.
    fn advance(&mut self, object: &LocalObject, room: Option<&Room>) -> Result<bool, ProbeError> {
        let is_middle = self.middle.is_none();
        let place = match (&self.places, is_middle) {
            (_, true) => Some(self.centre),
            (Some(places), false) => places.last().copied(),
            (None, false) => {
                let room = room.filter(|_| object.is_shiny());
                let places = room.map(|room| side_places(object, room, MOST_SIDES));
                self.places = Some(places.unwrap_or_default().into_iter().rev().collect());
                return Ok(false);
            }
        };
        let Some(place) = place else { return Ok(true) };
        let side = if is_middle { self.side } else { SIDE_OF_SIDES };
        let looks = looks(place, side).ok_or(ProbeError::Frames)?;
        let look = looks.get(self.faces.len()).ok_or(ProbeError::Frames)?;
        let face = frame(self.renderer.as_mut(), look).ok_or(ProbeError::Frames)?;
        self.faces.push(face);
        if self.faces.len() == looks.len() {
            let found = probe_of(place, std::mem::take(&mut self.faces));
            if is_middle {
                self.middle = Some(found?);
            } else {
                self.sides.extend(found);
                self.places.iter_mut().for_each(|places| _ = places.pop());
            }
        }
        Ok(false)
    }
}

struct WaitingProbe {
    centre: DVec3,
    side: u32,
    renderers: Vec<Box<dyn Renderer>>,
    /// The number of the first request of the view with which its samples were requested.
    view: u32,
}

impl WaitingProbe {
    fn is_of(&self, object: &LocalObject) -> bool {
        is_light_of(object, self.centre, self.side)
    }
}

impl Lightings {
    pub(super) fn note_samples(&mut self, count: u64) {
        self.samples += count;
    }

    pub(super) fn note_driver(&mut self) {
        self.waiting.clear();
        (self.unfinished, self.passed) = (None, None);
        self.places.iter_mut().for_each(|place| place.is_old = true);
    }

    /// Returns whether light is being found.
    pub(super) fn are_unfinished(&self) -> bool {
        self.unfinished.is_some()
    }

    /// Forgets what was begun for objects that are elsewhere now.
    pub(super) fn forget_others(&mut self, objects: &[LocalObject]) {
        self.unfinished.take_if(|probe| !objects.iter().any(|object| probe.is_of(object)));
    }

    /// Notes that all samples that were requested have arrived.
    pub(super) fn note_settled(&mut self) {
        self.is_settled = true;
    }

    /// Returns an object's place, if its light was looked for there. `is_file` refuses light of
    /// fewer samples than there are.
    fn here(&self, object: &LocalObject, is_file: bool) -> Option<&LitPlace> {
        self.places.iter().find(|place| {
            let has_grown = match is_file {
                true => self.samples != place.samples,
                false => self.samples as f64 > GROWTH * place.samples as f64,
            };
            !has_grown && !place.is_old && is_light_of(object, place.centre, place.side)
        })
    }

    /// Returns the nearest place whose light is known. Of those where the object has not moved on,
    /// it is the one whose light is known best.
    fn nearest_place(&self, object: &LocalObject) -> Option<&LitPlace> {
        let least = SAME_PLACE * object.radius();
        let apart = |place: &LitPlace| place.centre.distance(object.centre()).max(least);
        let lit = self.places.iter().filter(|place| place.lighting.is_some());
        lit.min_by(|a, b| apart(a).total_cmp(&apart(b)).then(b.side.cmp(&a.side)))
    }

    /// Returns the light of that place.
    fn nearest(&self, object: &LocalObject) -> Option<Arc<ObjectLighting>> {
        self.nearest_place(object)?.lighting.clone()
    }

    /// Returns whether a frame of a moving object may find a part of the light that it passes.
    fn may_pass(&self) -> bool {
        self.passed_at.is_none_or(|at| at.elapsed() >= PASSED_PAUSE)
    }

    /// Returns whether an object has moved on from all places whose light is known.
    fn passes(&self, object: &LocalObject) -> bool {
        self.nearest_place(object)
            .is_some_and(|place| place.centre.distance(object.centre()) > PASSED * object.radius())
    }

    fn put(&mut self, place: LitPlace, radius: f64) {
        let is_same = |other: &LitPlace| {
            other.side <= place.side && is_same_place(other.centre, place.centre, radius)
        };
        self.places.retain(|other| !is_same(other));
        if self.places.len() >= MOST_PLACES {
            // Places that were only passed go first.
            let passed = self.places.iter().position(|place| place.is_old);
            self.places.remove(passed.unwrap_or(0));
        }
        self.places.push(place);
    }
}

fn is_same_place(a: DVec3, b: DVec3, radius: f64) -> bool {
    a.distance(b) <= SAME_PLACE * radius
}

/// Returns whether light of this place, by a probe of this side, is that of an object.
fn is_light_of(object: &LocalObject, centre: DVec3, of_side: u32) -> bool {
    of_side == side(object) && is_same_place(centre, object.centre(), object.radius())
}

/// Returns the side of the probe of an object.
fn side(object: &LocalObject) -> u32 {
    if object.is_shiny() { SHINY_SIDE } else { SIDE }
}

/// Returns what is to be shown to a driver for a probe.
fn looks(centre: DVec3, side: u32) -> Option<[FrameRequest; 6]> {
    let look = |view| FrameRequest { view, size: (side, side), is_moving: false };
    probe_views(centre).map(|views| views.map(look))
}

fn frame(renderer: &mut dyn Renderer, look: &FrameRequest) -> Option<Frame> {
    renderer.look(look).ok()?;
    renderer.draw(FramePhase::File, &Interrupt::default(), &mut |_| {})
}

fn probe_of(centre: DVec3, frames: Vec<Frame>) -> Result<LightProbe, ProbeError> {
    let frames: [Frame; 6] = frames.try_into().map_err(|_| ProbeError::Frames)?;
    LightProbe::new(centre, &frames)
}

#[cfg(test)]
mod tests {
    use holo_local_objects::{LIGHTS, ObjectModel, ObjectPose};
    use holo_scene::{Material, Scene};

    use super::*;
    use crate::{Session, tests::in_session};

    /// A triangle in the middle of the room.
    fn object() -> LocalObject {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Z];
        let materials = vec![Material::grey("paint")];
        let made = Scene::from_world(&corners, &[[0, 1, 2]], &[0], materials, [0.0; 3]);
        let model = ObjectModel::new(made.unwrap().0, DVec3::Z, 1.0).unwrap();
        LocalObject::new(Arc::new(model), ObjectPose::at(DVec3::splat(2.5)), DVec3::Z).unwrap()
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn an_input_ends_the_search_for_light_and_later_frames_go_on_with_it() {
        in_session(|session| {
            let object = object();
            let faces = |session: &Session| {
                session.objects.lightings.unfinished.as_ref().map(|probe| probe.faces.len())
            };
            session.interrupt().set();
            assert!(session.light_of_store(&object, false, false, None).is_none());
            assert_eq!(faces(session), Some(0));
            // A frame of a motion draws one face, whatever comes.
            for number in 1..4 {
                assert!(session.light_of_store(&object, true, false, None).is_none());
                assert_eq!(faces(session), Some(number));
            }
            session.interrupt().clear();
            assert!(session.light_of_store(&object, false, false, None).is_some());
            // Whoever waits for a file is not interrupted.
            session.interrupt().set();
            assert!(session.light_of_store(&object, false, true, None).is_some());
        })
        .await;
    }

    /// Returns an object that is so many radii beside another one.
    fn beside(object: &LocalObject, radii: f64) -> LocalObject {
        let at = object.pose().at + DVec3::X * (radii * object.radius());
        LocalObject::new(Arc::clone(object.model()), ObjectPose::at(at), DVec3::Z).unwrap()
    }

    /// Returns light that is known at the place of an object.
    fn lit_place(object: &LocalObject, side: u32, is_old: bool) -> LitPlace {
        let faces: [Frame; 6] = std::array::from_fn(|_| {
            let mut face = Frame::black((8, 8));
            face.picture.pixels.fill([1.0; 3]);
            face.depth.fill(2.0);
            face
        });
        let probe = LightProbe::new(object.centre(), &faces).unwrap();
        let lighting = Some(Arc::new(ObjectLighting::new(probe, LIGHTS, None)));
        LitPlace { centre: object.centre(), side, lighting, samples: 0, is_old }
    }

    #[test]
    fn the_best_known_light_of_a_place_counts_and_places_that_were_only_passed_go_first() {
        let object = object();
        let radius = object.radius();
        let mut lightings = Lightings::default();
        lightings.put(lit_place(&object, SIDE, false), radius);
        lightings.put(lit_place(&beside(&object, 0.2), PASSED_SIDE / 2, true), radius);
        let side = |lightings: &Lightings, radii: f64| {
            lightings.nearest_place(&beside(&object, radii)).map(|place| place.side)
        };
        assert_eq!(side(&lightings, 0.2), Some(SIDE), "both are near enough");
        assert_eq!(side(&lightings, 3.0), Some(PASSED_SIDE / 2));
        assert!(
            !lightings.passes(&beside(&object, 0.6)) && lightings.passes(&beside(&object, 0.8))
        );
        for number in 0..2 * MOST_PLACES {
            let place = beside(&object, 2.0 + number as f64);
            lightings.put(lit_place(&place, PASSED_SIDE, true), radius);
        }
        assert_eq!(lightings.places.len(), MOST_PLACES);
        assert_eq!(side(&lightings, 0.0), Some(SIDE), "the place where it rested stays");
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn six_frames_of_a_moving_object_find_the_light_of_a_place_that_it_passes() {
        in_session(|session| {
            let object = object();
            session.objects.lightings.put(lit_place(&object, SIDE, false), object.radius());
            for (radii, faces) in
                [(0.4, None), (1.0, Some(1)), (1.1, Some(2)), (1.2, Some(3)), (3.0, Some(4))]
            {
                let place = beside(&object, radii);
                session.light_of_passed(&place, None);
                session.objects.lightings.passed_at = Some(Instant::now());
                let light = session.lighting(&place, true, false, None);
                assert_eq!(light.map(|light| light.centre()), Some(object.centre()));
                let passed = session.objects.lightings.passed.as_ref();
                assert_eq!(passed.map(|probe| probe.faces.len()), faces, "{radii}");
            }
            assert!(!session.objects.lightings.may_pass(), "not so soon");
            session.light_of_passed(&beside(&object, 3.1), None);
            session.light_of_passed(&beside(&object, 3.2), None);
            assert!(session.objects.lightings.passed.is_none(), "six faces are a probe");
        })
        .await;
    }
}

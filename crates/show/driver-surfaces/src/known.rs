//! Light that earlier pictures found, stored by place, so that a moving eye gets it by a look-up.
//!
//! The best picture of a view never reads it.
//!
//! Invariants:
//! - A place has the light that was found last for it, also if that was found for a part of it.
//! - At most twice [`MOST_PLACES`] places are stored. Those found longest ago go first.

use crate::estimate::Estimate;
use crate::light_store::{
    FaceClass, Finish, MaterialClass, Reflections, RoughMetal, TrailEnd, luminance,
};
use crate::squares::Squares;
use crate::view::SurfaceView;
use crate::visible::VisiblePoint;
use glam::{IVec3, Vec3};
use holo_display::split_mix;
use rayon::prelude::*;
use rustc_hash::FxHashMap;

/// Places of one generation. Each takes 32 bytes.
const MOST_PLACES: usize = 1 << 20;

/// Least width of a place, pixels. Frames of known light have few pixels, and a mean over several
/// pixels is less noisy.
const LEAST_SIDE: usize = 2;

/// Number of levels above that of a square that get its light too. Frames in motion have wider
/// squares than pictures at rest, and would otherwise show the light of an older picture.
const WIDER_LEVELS: usize = 2;

/// Expected relative error of light from a reflection cube.
const DOUBT: f32 = 0.2;

/// Light found by earlier pictures.
#[derive(Debug, Default)]
pub(crate) struct LightMemory {
    young: FxHashMap<u64, Estimate>,
    old: FxHashMap<u64, Estimate>,
}

/// The light that a picture found at one place.
#[derive(Clone, Copy)]
struct RecalledLight {
    place: IVec3,
    level: i32,
    face: FaceClass,
    /// Sum over `count` squares.
    sum: Estimate,
    count: f32,
}

/// Returns the level of places about as wide as a square. Places of a level are 2 to this power
/// wide.
fn level_of(width: f32) -> i32 {
    width.max(f32::MIN_POSITIVE).log2().round() as i32
}

/// Returns the face by which light is stored. The face of a coat has no direction: the eye moves
/// through many ranges of directions, and most of a coat's light is diffuse.
fn face_of(view: &SurfaceView, seen: &VisiblePoint) -> FaceClass {
    match view.follower().finish(seen.material).is_coated {
        true => FaceClass::new(seen.normal, seen.material, None),
        false => view.face(seen),
    }
}

/// Returns the number of a place of this level, on this face.
fn number(place: IVec3, level: i32, face: FaceClass) -> u64 {
    let [x, y, z] = place.to_array().map(|c| u64::from(c as u32));
    let at = split_mix(split_mix(x << 32 | y) ^ z << 32 ^ u64::from(level as u32));
    split_mix(at ^ face.number())
}

/// Adds light to that of the same place.
fn add(all: &mut FxHashMap<u64, RecalledLight>, more: RecalledLight) {
    let number = number(more.place, more.level, more.face);
    let found =
        all.entry(number).or_insert(RecalledLight { sum: Estimate::default(), count: 0.0, ..more });
    found.sum.add(1.0, &more.sum);
    found.count += more.count;
}

/// Returns the light of rough metal from the reflection cube of its object.
fn blurred(view: &SurfaceView, seen: &VisiblePoint, reflections: &Reflections) -> Option<Estimate> {
    let way = view.way(seen);
    let (object, normal) = way.mirrors?;
    let alpha = view.follower().finish(seen.material).rough?;
    let metal = RoughMetal { point: seen.point, normal, eye: -way.direction, alpha };
    let light = metal.light(reflections.filled(object)?)? / view.unit();
    let bright = luminance(light.to_array());
    Some(Estimate { light, error: DOUBT * bright, variance: bright * bright })
}

impl RecalledLight {
    /// Returns the same for the place of the next level that contains this one.
    fn in_wider_place(&self) -> RecalledLight {
        RecalledLight { place: self.place >> 1, level: self.level + 1, ..*self }
    }
}

impl LightMemory {
    /// Stores the light that a picture found.
    pub fn learn(&mut self, view: &SurfaceView, squares: &Squares, lights: &[Estimate]) {
        let mut all = FxHashMap::default();
        for (seen, &light) in squares.seen.iter().zip(lights) {
            if !seen.is_surface() || light.error.is_infinite() {
                continue;
            }
            let width = seen.width * squares.step.max(LEAST_SIDE) as f32;
            let level = level_of(width);
            let place = (seen.point / (level as f32).exp2()).floor().as_ivec3();
            let face = face_of(view, seen);
            add(&mut all, RecalledLight { place, level, face, sum: light, count: 1.0 });
        }
        let mut level = FxHashMap::default();
        for number in 0..WIDER_LEVELS {
            let mut wider = FxHashMap::default();
            let below = if number == 0 { &all } else { &level };
            below.values().for_each(|found| add(&mut wider, found.in_wider_place()));
            level = wider;
            level.values().for_each(|&found| add(&mut all, found));
        }
        if self.young.len() + all.len() > MOST_PLACES {
            self.old = std::mem::take(&mut self.young);
        }
        let light =
            |(number, found): (u64, RecalledLight)| (number, found.sum.divided(found.count));
        self.young.extend(all.into_iter().map(light));
    }

    /// Returns the light of all squares: of rough metal from `reflections`, if they know it. `None`
    /// if more than the share `unknown` of the squares is unknown.
    pub fn lights(
        &self,
        view: &SurfaceView,
        squares: &Squares,
        reflections: Option<&Reflections>,
        unknown: f32,
    ) -> Option<Vec<Estimate>> {
        let light = |seen: &VisiblePoint| {
            if !seen.is_surface() {
                return Estimate::UNKNOWN;
            }
            let blurred = || blurred(view, seen, reflections?);
            let width = seen.width * squares.step as f32;
            let found = blurred().or_else(|| self.near(seen.point, width, face_of(view, seen)));
            found.unwrap_or(Estimate::UNKNOWN)
        };
        let lights: Vec<Estimate> = squares.seen.par_iter().map(light).collect();
        let surfaces = squares.seen.iter().filter(|seen| seen.is_surface()).count();
        let known = lights.iter().filter(|light| light.error.is_finite()).count();
        (known as f32 >= (1.0 - unknown) * surfaces as f32).then_some(lights)
    }

    /// Returns the light on a surface at the end of a way, as a mean over a place of about this
    /// width, fixed-point steps.
    pub fn on(&self, finish: &Finish, end: &TrailEnd, width: f32) -> Option<Vec3> {
        let has_direction = finish.kind == MaterialClass::Glossy && !finish.is_coated;
        let face = FaceClass::new(end.normal, end.material, has_direction.then_some(end.direction));
        self.near(end.point, width, face).map(|found| found.light)
    }

    /// Returns the light at a point from places of about this width.
    fn near(&self, point: Vec3, width: f32, face: FaceClass) -> Option<Estimate> {
        let level = level_of(width);
        let levels = [level, level + 1, level - 1, level + 2];
        levels.into_iter().find_map(|level| self.around(point, level, face))
    }

    /// Returns the light at a point, interpolated between the places around it.
    fn around(&self, point: Vec3, level: i32, face: FaceClass) -> Option<Estimate> {
        let at = point / (level as f32).exp2() - 0.5;
        let (low, share) = (at.floor().as_ivec3(), at - at.floor());
        let (mut sum, mut total) = (Estimate::default(), 0.0);
        for corner in 0..8 {
            let side = IVec3::new(corner & 1, corner >> 1 & 1, corner >> 2);
            let near = Vec3::select(side.cmpeq(IVec3::ONE), share, 1.0 - share);
            let weight = near.element_product();
            let number = number(low + side, level, face);
            if let Some(light) = self.young.get(&number).or_else(|| self.old.get(&number)) {
                sum.add(weight, light);
                total += weight;
            }
        }
        // A place whose middle is far away proves little.
        (total > 0.05).then(|| sum.divided(total))
    }
}

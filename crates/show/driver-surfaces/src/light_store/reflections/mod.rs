//! Reflection cubes of shiny objects. While the eye moves, rays that leave such an object end in
//! its cube, and rough metal shows the cube's blurred light.
//!
//! Cubes are filled between frames, from stored light alone. Frames at rest never read them, except
//! that the first one shows rough metal by them.
//!
//! Invariants:
//! - A scene without shiny objects has no [`Reflections`].
//! - All cubes together take at most [`MOST_BYTES`]. The objects that views showed longest ago lose
//!   theirs first.
//! - Rays of an object that meets itself are never answered.

mod filling;
mod rough;

pub(crate) use rough::RoughMetal;

use holo_display::split_mix;
use holo_raycast::{Ray, Raycaster, spawn};
use holo_reflection_cube::{CubeAnswer, ReflectionCube, bytes_of, resolution};
use holo_scene::{Rgb, ShinyObjects};
use std::collections::BTreeMap;

/// Most bytes of all cubes.
const MOST_BYTES: usize = 64 << 20;

/// Most texels along a side of a face. A cube of these takes 2.7 MB, and about 0.1 s of two cores
/// to fill.
const MOST_TEXELS: u32 = 128;

/// Fewest pixels of an object that gets a cube.
const LEAST_PIXELS: usize = 64;

/// Rays from an object that decide whether it meets itself.
const SELF_RAYS: u64 = 512;

/// Greatest share of these that meets the object, if its rays are to be answered.
const MOST_SELF_HITS: u64 = SELF_RAYS / 64;

/// Widest angle that stands in for an unknown texel of a sharp reflection, radians.
const STAND_IN: f32 = 0.1;

/// The cubes of a scene's shiny objects.
#[derive(Debug)]
pub(crate) struct Reflections {
    objects: ShinyObjects,
    cubes: BTreeMap<u32, ObjectCube>,
    /// Number of the last view.
    views: u64,
}

/// The cube of an object, and how far it is filled.
#[derive(Debug)]
struct ObjectCube {
    cube: ReflectionCube,
    /// Whether rays from the object rarely meet the object, once that is determined.
    is_open: Option<bool>,
    /// The next texel to fill in this round.
    next: usize,
    /// Number of the round. Its light replaces that of earlier ones.
    round: u16,
    /// Samples in the store when the round began.
    samples: u64,
    /// The last view that showed the object.
    view: u64,
}

impl Reflections {
    /// Finds the shiny objects of a scene. `None` if there are none.
    pub fn find(raycaster: &Raycaster) -> Option<Reflections> {
        let objects = ShinyObjects::find(raycaster.scene())?;
        Some(Reflections { objects, cubes: BTreeMap::new(), views: 0 })
    }

    /// Returns the number of the object that a triangle belongs to.
    #[inline]
    pub fn object(&self, triangle: u32) -> Option<u32> {
        self.objects.of(triangle)
    }

    /// Begins a view that shows these objects, each in so many pixels. Those that have no cube of
    /// their size get one, as far as there is room.
    pub fn show(&mut self, seen: &BTreeMap<u32, usize>) {
        self.views += 1;
        let mut by_size: Vec<(usize, u32)> = seen
            .iter()
            .filter(|(_, pixels)| **pixels >= LEAST_PIXELS)
            .map(|(&object, &pixels)| (pixels, object))
            .collect();
        by_size.sort_unstable_by_key(|&(pixels, object)| (std::cmp::Reverse(pixels), object));
        let mut bytes = 0;
        for (pixels, object) in by_size {
            // The diameter of a disc of so many pixels is 1.13 times their root.
            let wanted = resolution(1.13 * (pixels as f32).sqrt()).min(MOST_TEXELS);
            bytes += bytes_of(wanted.max(self.texels(object)));
            if bytes > MOST_BYTES {
                break;
            }
            self.give(object, wanted);
        }
        self.make_room();
    }

    /// Returns the texels along a side of an object's cube; 0 without a cube.
    fn texels(&self, object: u32) -> u32 {
        self.cubes.get(&object).map_or(0, |filled| filled.cube.grid().resolution())
    }

    /// Gives an object a cube of at least this many texels along a side.
    fn give(&mut self, object: u32, texels: u32) {
        let view = self.views;
        if let Some(filled) = self.cubes.get_mut(&object) {
            filled.view = view;
            if filled.cube.grid().resolution() < texels {
                filled.cube = filled.cube.resized(texels);
                filled.begin_round(0);
            }
            return;
        }
        let Some(&centre) = self.objects.centres().get(object as usize) else { return };
        let filled = ObjectCube {
            cube: ReflectionCube::new(centre, texels),
            is_open: None,
            next: 0,
            round: 1,
            samples: 0,
            view,
        };
        self.cubes.insert(object, filled);
    }

    /// Removes the cubes of objects that views showed longest ago, until the others fit.
    fn make_room(&mut self) {
        let bytes = |filled: &ObjectCube| bytes_of(filled.cube.grid().resolution());
        let mut total: usize = self.cubes.values().map(bytes).sum();
        while total > MOST_BYTES {
            let oldest = self.cubes.iter().min_by_key(|(object, filled)| (filled.view, **object));
            let Some((&object, filled)) = oldest else { break };
            total -= bytes(filled);
            self.cubes.remove(&object);
        }
    }

    /// Forgets all light, because it is no longer right.
    pub fn forget(&mut self) {
        self.cubes.clear();
    }

    /// Returns the light along a ray that leaves an object, and the distance to what it shows.
    #[inline]
    pub fn along(&self, object: u32, ray: &Ray) -> Option<(Rgb, f32)> {
        let filled = self.cubes.get(&object).filter(|filled| filled.is_open == Some(true))?;
        match filled.cube.look_up(ray.origin, ray.direction, 0.0..=STAND_IN) {
            CubeAnswer::Light(light) => Some((light.radiance, light.distance)),
            CubeAnswer::Unknown | CubeAnswer::MustTrace => None,
        }
    }

    /// Returns the cube of an object that was filled at least once.
    pub fn filled(&self, object: u32) -> Option<&ReflectionCube> {
        let filled = self.cubes.get(&object).filter(|filled| filled.round > 1)?;
        Some(&filled.cube)
    }
}

impl ObjectCube {
    /// Begins to fill all texels again, from so many samples.
    fn begin_round(&mut self, samples: u64) {
        self.cube.refresh_levels();
        (self.next, self.samples) = (0, samples);
        self.round = self.round.saturating_add(1);
    }
}

/// Returns whether rays that leave an object rarely meet it again: those of a ball never do.
fn is_open(objects: &ShinyObjects, object: u32, raycaster: &Raycaster) -> bool {
    let scene = raycaster.scene();
    let own = objects.triangles_of(object);
    let meets = |number: &u64| {
        let random = split_mix(*number);
        let Some(&(_, triangle)) = own.get((random % own.len().max(1) as u64) as usize) else {
            return false;
        };
        let part = |shift: u32| (random >> shift & 0xffff) as f32 / 65535.0;
        let normal = scene.normal(triangle);
        let (height, turn) = (part(16), std::f32::consts::TAU * part(32));
        let (across, along) = normal.any_orthonormal_pair();
        let flat = (1.0 - height * height).sqrt();
        let direction = height * normal + flat * (turn.cos() * across + turn.sin() * along);
        let point = raycaster.surface(triangle, 1.0 / 3.0, 1.0 / 3.0);
        let ray = Ray::new(spawn(point.point, point.error, point.normal, direction), direction);
        let hit = raycaster.nearest_from(&ray, triangle);
        hit.is_some_and(|hit| objects.of(hit.triangle) == Some(object))
    };
    (0..SELF_RAYS).filter(meets).count() as u64 <= MOST_SELF_HITS
}

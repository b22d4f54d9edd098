//! Places beside an object's middle that see what its mirrors show and the middle does not, such as
//! the floor behind the edge of the table that it stands on.

use glam::{DVec3, Vec3};
use holo_optics::reflect;

use crate::numbers::{PassNumbers, in_cone};
use crate::object::LocalObject;
use crate::room::Room;
use crate::surface::Gloss;

/// Rays towards the object whose reflections are looked at.
const RAYS: u32 = 4096;

/// Roughness up to which a surface shows places.
const SHARP: f32 = 0.05;

/// Most points of the object that are tried.
const MOST_TRIED: usize = 48;

/// Least share of the reflections for which a place is worth its light.
const LEAST_GAIN: f64 = 0.01;

/// Distance of a place from the surface, in radii of the object.
const APART: f64 = 0.02;

/// A reflection of the room whose place the middle does not see.
struct HiddenReflection {
    /// Near the point of the object that reflects.
    from: DVec3,
    /// What the reflection shows.
    place: DVec3,
}

/// Returns the places, at most so many, the most useful first. Eyes may be on all sides.
#[must_use]
pub fn side_places(object: &LocalObject, room: &Room, most: usize) -> Vec<DVec3> {
    let (mut all, mut hidden) = (0_u32, Vec::new());
    for number in 0..RAYS {
        let Some((from, direction)) = reflection(object, number) else { continue };
        all += 1;
        let Some((_, distance)) = room.nearest(from, direction) else { continue };
        let place = from + direction * distance;
        if !room.sees(object.centre(), place) {
            hidden.push(HiddenReflection { from, place });
        }
    }
    let mut places = Vec::new();
    while places.len() < most {
        let step = hidden.len().div_ceil(MOST_TRIED).max(1);
        let tried = hidden.iter().step_by(step).map(|reflection| reflection.from);
        let gain = |&from: &DVec3| {
            hidden.iter().filter(|reflection| room.sees(from, reflection.place)).count()
        };
        let best = tried.map(|from| (gain(&from), from)).max_by_key(|(gain, _)| *gain);
        let Some((gain, from)) = best else { break };
        if (gain as f64) < LEAST_GAIN * f64::from(all) {
            break;
        }
        hidden.retain(|reflection| !room.sees(from, reflection.place));
        places.push(from);
    }
    places
}

/// Returns a ray that a mirror of the object sends into the room, by rays from all sides. It begins
/// a little above the surface.
fn reflection(object: &LocalObject, number: u32) -> Option<(DVec3, DVec3)> {
    let mut numbers = PassNumbers::new(2, number);
    let towards = in_cone(Vec3::Z, -1.0, numbers.two());
    let (right, ahead) = towards.any_orthonormal_pair();
    let (share, turn) = numbers.two();
    let (beside, turn) = (share.sqrt(), std::f32::consts::TAU * turn);
    let beside = right * (beside * turn.cos()) + ahead * (beside * turn.sin());
    let origin = object.centre() + (beside - towards * 2.0).as_dvec3() * object.radius();
    let hit = object.nearest(origin, towards.as_dvec3())?;
    let surface = object.surface(origin, towards, &hit, 0.0);
    let finish = surface.finish(object.raycaster().scene(), -towards);
    let is_sharp = match finish.gloss {
        Gloss::Metal { alpha, .. } => alpha <= SHARP,
        Gloss::Matt | Gloss::Coat { .. } | Gloss::Pane { .. } | Gloss::Solid { .. } => false,
    };
    let mirrored = reflect(-towards, surface.normal);
    if !is_sharp || object.nearest_from(&surface, mirrored).is_some() {
        return None;
    }
    let from = surface.place + surface.normal.as_dvec3() * (APART * object.radius());
    Some((from, mirrored.as_dvec3().normalize()))
}

//! The light of an object at rest, with the object's shadow on what is around it.

use std::sync::Arc;

use glam::Vec3;
use holo_display::Interrupt;

use crate::darkening::{Darkening, portion};
use crate::lighting::FINE_SIDE;
use crate::lit::LitObject;
use crate::numbers::PassNumbers;
use crate::room::Room;
use crate::shading::LightDetail;
use crate::shadow::Shadowed;

/// Greatest factor by which light from an object makes a surface brighter.
const MOST_LEFT: f32 = 3.0;

impl LitObject {
    /// Returns the object with its light at rest: its shadow on what the probe shows is computed by
    /// this many passes of rays. `room` is the model of the scene, if it is known. `None` if it was
    /// interrupted.
    #[must_use]
    pub fn at_rest(
        &self,
        room: Option<&Room>,
        passes: u32,
        interrupt: &Interrupt,
    ) -> Option<LitObject> {
        let darkening = by_rays(self, room, passes, interrupt)?;
        let lights = self.lighting.lights.iter();
        let lights = lights.map(|light| light.weighed(|direction| darkening.left(direction)));
        let lights = Some((lights.collect(), passes));
        let (object, lighting) = (self.object.clone(), Arc::clone(&self.lighting));
        Some(LitObject::with(object, lighting, darkening, lights))
    }
}

/// Returns the shares by passes of rays, in the light that `lit` has so far. `None` if it was
/// interrupted.
fn by_rays(
    lit: &LitObject,
    room: Option<&Room>,
    passes: u32,
    interrupt: &Interrupt,
) -> Option<Darkening> {
    let probe = &lit.lighting.probe;
    let darkening = Darkening::of(&lit.object, &lit.lighting, FINE_SIDE, |number, texel, place| {
        if interrupt.is_set() {
            return Vec3::ONE;
        }
        let direction = place.normalize_or_zero();
        let mut known = None;
        if let Some(room) = room {
            let hit = room.nearest(probe.centre(), direction.as_dvec3());
            let Some((hit, _)) = hit else { return Vec3::ONE };
            let Some(surface) = room.surface(&hit, direction, 0.0) else {
                return Vec3::ONE;
            };
            known = Some((room, surface, probe.radiance(texel)));
        }
        let shadowed = match &known {
            Some((room, surface, radiance)) => Shadowed {
                place: surface.place,
                normal: surface.normal,
                known: Some((room, surface, *radiance)),
            },
            None => Shadowed {
                place: probe.centre() + place.as_dvec3(),
                normal: probe.normal(texel),
                known: None,
            },
        };
        let (mut hidden, mut all) = (Vec3::ZERO, Vec3::ZERO);
        for pass in 0..passes {
            let mut numbers = PassNumbers::new(number, pass);
            let sums = shadowed.hidden_and_all(lit, LightDetail::Exact, &mut numbers);
            (hidden, all) = (hidden + sums.0, all + sums.1);
        }
        (Vec3::ONE - portion(hidden, all)).clamp(Vec3::ZERO, Vec3::splat(MOST_LEFT))
    });
    (!interrupt.is_set()).then_some(darkening)
}

//! The light of an object: a few lights that cast shadows, and the rest.

use glam::{DVec3, Vec3};
use holo_scene::PunctualBeam;

use crate::environment::Environment;
use crate::harmonics::Harmonics;
use crate::lights::{ProbeLight, brightest};
use crate::probe::LightProbe;
use crate::room::Room;

/// Number of lights that a probe is divided into (Larson & Simmons 1999, §2.4.6).
pub const LIGHTS: usize = 8;

/// Angle around a sun within which a probe may show its disc, which is one of the lights already:
/// two texels of the smallest probes, as a cosine.
const SUN_CORONA: f32 = 0.998;

/// Most texels on a side from which harmonics are made: they are smoother than that.
const MOST_HARMONIC_SIDE: usize = 64;

/// The light that arrives at a place, divided.
pub struct ObjectLighting {
    pub(crate) probe: LightProbe,
    pub(crate) lights: Vec<ProbeLight>,
    /// For each texel, whether it is in one of the lights.
    pub(crate) is_bright: Vec<bool>,
    /// All light, also blurred.
    pub(crate) environment: Environment,
    /// The light of the texels that are in no light.
    pub(crate) dim: Environment,
    pub(crate) rest: Harmonics,
}

impl ObjectLighting {
    /// Divides a probe's light into at most `lights` lights and the rest. Suns and punctual lights
    /// of the room are added, because no driver shows them.
    #[must_use]
    pub fn new(mut probe: LightProbe, lights: usize, room: Option<&Room>) -> ObjectLighting {
        let unseen = room.map_or_else(Vec::new, |room| unseen_lights(&mut probe, room));
        let (mut lights, is_bright) = brightest(&probe, lights, room);
        lights.extend(unseen);
        let environment = Environment::new(probe.cube, probe.radiance.clone());
        let dim = |(radiance, is_bright): (&Vec3, &bool)| match is_bright {
            true => Vec3::ZERO,
            false => *radiance,
        };
        let dim = probe.radiance.iter().zip(&is_bright).map(dim).collect();
        let dim = Environment::new(probe.cube, dim);
        let (cube, texels) = dim.level(MOST_HARMONIC_SIDE);
        let rest = Harmonics::of(cube, |texel| texels[texel]);
        ObjectLighting { probe, lights, is_bright, environment, dim, rest }
    }

    /// Returns the place that it is the light of.
    #[must_use]
    pub fn centre(&self) -> DVec3 {
        self.probe.centre()
    }

    /// Returns the side of the probe's faces, texels.
    #[must_use]
    pub fn side(&self) -> usize {
        self.probe.cube.side
    }
}

/// Returns the suns and punctual lights of a room, and takes the discs of suns out of a probe.
fn unseen_lights(probe: &mut LightProbe, room: &Room) -> Vec<ProbeLight> {
    let scene = room.raycaster().scene();
    let mut lights = Vec::new();
    for sun in scene.all_suns() {
        let towards = Vec3::from(sun.towards);
        lights.push(ProbeLight::unseen(towards, None, sun.irradiance.into()));
        for texel in 0..probe.cube.texels() {
            let direction = probe.cube.direction(texel);
            if probe.distance[texel].is_infinite() && direction.dot(towards) > SUN_CORONA {
                // The sky's radiance does not include its sun.
                probe.radiance[texel] = scene.sky.radiance(direction.as_dvec3()).into();
            }
        }
    }
    let centre = probe.centre();
    for light in &scene.punctual_lights {
        let place = scene.origin + Vec3::from(light.position).as_dvec3() - centre;
        let place = place.as_vec3();
        let Some(direction) = place.try_normalize() else { continue };
        let share = match light.beam {
            PunctualBeam::Everywhere => 1.0,
            PunctualBeam::Cone { .. } => light.beam.share(-direction),
        };
        let irradiance = Vec3::from(light.intensity) * (share / place.length_squared());
        if irradiance.is_finite() && irradiance.max_element() > 0.0 {
            lights.push(ProbeLight::unseen(direction, Some(place), irradiance));
        }
    }
    lights
}

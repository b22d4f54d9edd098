//! The light of an object: a few lights that cast shadows, and the rest.

use glam::{DVec3, Vec3};
use holo_reflection_cube::CubeGrid;
use holo_scene::PunctualBeam;

use crate::harmonics::Harmonics;
use crate::lights::{ProbeLight, brightest};
use crate::probe::LightProbe;
use crate::room::Room;

/// Number of lights that a probe is divided into (Larson & Simmons 1999, §2.4.6).
pub const LIGHTS: usize = 8;

/// Angle around a sun within which a probe may show its disc, which is one of the lights already:
/// two texels of the smallest probes, as a cosine.
const SUN_CORONA: f32 = 0.998;

/// Most texels on a side of the light that is in no light, while an object moves and at rest.
pub(crate) const ROUGH_SIDE: u32 = 16;
pub(crate) const FINE_SIDE: u32 = 64;

/// Light that is in no light, by few directions.
pub(crate) struct DimLight {
    /// Whose texels it is given for.
    pub grid: CubeGrid,
    /// Radiance times solid angle.
    pub light: Vec<Vec3>,
}

impl DimLight {
    fn new(probe: &LightProbe, is_bright: &[bool], most_side: u32) -> DimLight {
        let grid = CubeGrid::new(probe.cube.grid().resolution().min(most_side));
        let mut light = vec![Vec3::ZERO; grid.len()];
        for texel in (0..probe.cube.grid().len()).filter(|&texel| !is_bright[texel]) {
            let around = grid.texel_of(probe.cube.grid().direction_of(texel));
            light[around] += probe.radiance(texel) * probe.cube.grid().solid_angle_of(texel);
        }
        DimLight { grid, light }
    }
}

/// The light that arrives at a place, divided.
pub struct ObjectLighting {
    pub(crate) probe: LightProbe,
    pub(crate) lights: Vec<ProbeLight>,
    /// For each texel, whether it is in one of the lights.
    pub(crate) is_bright: Vec<bool>,
    /// The light of the texels that are in no light, roughly and finely, and smoothed.
    pub(crate) dim: [DimLight; 2],
    pub(crate) rest: Harmonics,
    /// The light at other places, which see what the probe's centre does not.
    pub(crate) sides: Vec<LightProbe>,
}

impl ObjectLighting {
    /// Divides a probe's light into at most `lights` lights and the rest. Suns and punctual lights
    /// of the room are added, because no driver shows them.
    #[must_use]
    pub fn new(mut probe: LightProbe, lights: usize, room: Option<&Room>) -> ObjectLighting {
        let unseen = room.map_or_else(Vec::new, |room| unseen_lights(&mut probe, room));
        let (mut lights, is_bright) = brightest(&probe, lights, room);
        lights.extend(unseen);
        let dim = [ROUGH_SIDE, FINE_SIDE].map(|side| DimLight::new(&probe, &is_bright, side));
        let rest = Harmonics::of(dim[1].grid, |texel| dim[1].light[texel]);
        ObjectLighting { probe, lights, is_bright, dim, rest, sides: Vec::new() }
    }

    /// Adds the light at [`side_places`](crate::side_places), for what mirrors show.
    #[must_use]
    pub fn with_sides(self, sides: Vec<LightProbe>) -> ObjectLighting {
        ObjectLighting { sides, ..self }
    }

    /// Returns the radiance of a texel of the probe, without the lights.
    #[inline]
    pub(crate) fn dim_radiance(&self, texel: usize) -> Vec3 {
        if self.is_bright[texel] { Vec3::ZERO } else { self.probe.radiance(texel) }
    }

    /// Returns the place that it is the light of.
    #[must_use]
    pub fn centre(&self) -> DVec3 {
        self.probe.centre()
    }
}

/// Returns the suns and punctual lights of a room, and takes the discs of suns out of a probe.
fn unseen_lights(probe: &mut LightProbe, room: &Room) -> Vec<ProbeLight> {
    let scene = room.raycaster().scene();
    let mut lights = Vec::new();
    for sun in scene.all_suns() {
        let towards = Vec3::from(sun.towards);
        lights.push(ProbeLight::unseen(towards, None, sun.irradiance.into()));
        for texel in 0..probe.cube.grid().len() {
            let direction = probe.cube.grid().direction_of(texel);
            if probe.place(texel).is_none() && direction.dot(towards) > SUN_CORONA {
                // The sky's radiance does not include its sun.
                probe.cube.set_radiance(texel, scene.sky.radiance(direction.as_dvec3()));
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

//! How much light an object takes from the surfaces that its probe shows.

use glam::Vec3;
use holo_reflection_cube::CubeGrid;
use rayon::prelude::*;

use crate::harmonics::Harmonics;
use crate::lighting::{ObjectLighting, ROUGH_SIDE};
use crate::object::LocalObject;

/// A distance from the object's centre, in radii, beyond which it is too far from what a probe
/// shows to darken it.
const NEAR: f32 = 6.0;

/// The share of light that an object leaves to what its probe shows, by direction.
pub(crate) struct Darkening {
    grid: CubeGrid,
    left: Vec<Vec3>,
}

impl Darkening {
    /// Returns about the shares, without noise.
    pub(crate) fn roughly(object: &LocalObject, lighting: &ObjectLighting) -> Darkening {
        Darkening::of(object, lighting, ROUGH_SIDE, |_, texel, place| {
            if lighting.is_bright[texel] {
                return Vec3::ONE;
            }
            let normal = lighting.probe.normal(texel);
            Vec3::ONE - taken_roughly(object, lighting, place, normal)
        })
    }

    /// Returns the shares by a function of a number, of a texel of the probe and of its place
    /// relative to the probe's centre.
    pub(crate) fn of(
        object: &LocalObject,
        lighting: &ObjectLighting,
        most_side: u32,
        left: impl Fn(u32, usize, Vec3) -> Vec3 + Sync,
    ) -> Darkening {
        let probe = &lighting.probe;
        let grid = CubeGrid::new(probe.cube.grid().resolution().min(most_side));
        let centre = (object.centre() - probe.centre()).as_vec3();
        let reach = NEAR * object.radius() as f32;
        let of = |number: u32| {
            let texel = probe.cube.grid().texel_of(grid.direction_of(number as usize));
            let place = probe.place(texel).filter(|place| place.distance(centre) < reach);
            place.map_or(Vec3::ONE, |place| left(number, texel, place))
        };
        let left = (0..grid.len() as u32).into_par_iter().map(of).collect();
        Darkening { grid, left }
    }

    /// Returns the share that is left to what is seen in a direction from the probe's centre.
    #[inline]
    pub(crate) fn left(&self, direction: Vec3) -> Vec3 {
        let around = self.grid.texels_around(direction);
        around.into_iter().map(|(texel, weight)| weight * self.left[texel]).sum()
    }

    /// Returns the light that is in no light, while the object takes its share.
    pub(crate) fn rest(&self, lighting: &ObjectLighting) -> Harmonics {
        let dim = &lighting.dim[usize::from(self.grid != lighting.dim[0].grid)];
        Harmonics::of(dim.grid, |texel| dim.light[texel] * self.left[texel])
    }
}

/// Returns about the share of light that an object takes from a surface of its probe, by channel.
/// `point` is relative to the probe's centre.
pub(crate) fn taken_roughly(
    object: &LocalObject,
    lighting: &ObjectLighting,
    point: Vec3,
    normal: Vec3,
) -> Vec3 {
    let place = lighting.centre() + point.as_dvec3();
    let centre = (object.centre() - lighting.centre()).as_vec3();
    let (mut hidden, mut all) = (Vec3::ZERO, lighting.rest.irradiance(normal));
    hidden += all * hidden_part(object, centre - point, normal);
    for light in &lighting.lights {
        let arriving = light.middle.arriving(point);
        let irradiance = arriving.irradiance * normal.dot(arriving.direction).max(0.0);
        all += irradiance;
        if irradiance != Vec3::ZERO
            && object.hides(place, arriving.direction.as_dvec3(), arriving.distance)
        {
            hidden += irradiance;
        }
    }
    portion(hidden, all).clamp(Vec3::ZERO, Vec3::ONE)
}

/// Returns the share of a surface's light from all sides that an object takes, whose centre is
/// `to_centre` away.
pub(crate) fn hidden_part(object: &LocalObject, to_centre: Vec3, normal: Vec3) -> f32 {
    let radius = object.radius() as f32;
    let distance = to_centre.length().max(radius);
    // A sphere above the horizon hides (r / d)² times the cosine. One that the horizon cuts hides
    // about the part above it.
    let height = to_centre.dot(normal) / distance;
    let sine = radius / distance;
    let above = ((height + sine) / (2.0 * sine)).clamp(0.0, 1.0);
    let cosine = if above < 1.0 { height.max(0.5 * sine * above) } else { height };
    object.darkness() * sine * sine * cosine.clamp(0.0, 1.0) * above
}

/// Returns the part that is hidden, by channel.
pub(crate) fn portion(hidden: Vec3, all: Vec3) -> Vec3 {
    hidden / all.max(Vec3::splat(f32::MIN_POSITIVE))
}

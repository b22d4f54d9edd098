//! About how much light an object takes from the surfaces around it, without noise.

use glam::Vec3;

use crate::lighting::ObjectLighting;
use crate::object::LocalObject;

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
    share(hidden, all)
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

/// Returns the share of what is hidden, by channel, from 0 to 1.
pub(crate) fn share(hidden: Vec3, all: Vec3) -> Vec3 {
    (hidden / all.max(Vec3::splat(f32::MIN_POSITIVE))).clamp(Vec3::ZERO, Vec3::ONE)
}

//! The light that arrives at a place, from all directions, with distances.

use glam::{DVec3, Vec3};
use holo_display::Frame;
use holo_picture::View;

use crate::environment::{Cube, FACES};

/// Why there is no probe of a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ProbeError {
    /// The frames are not those of [`probe_views`], all of one size.
    #[error("the frames of a light probe are not squares of one size")]
    Frames,
    /// No light is stored around the place.
    #[error("no light is stored around the object; it is black until some is")]
    NoLight,
}

/// Returns the six views from a place, each of a right angle, whose frames make a [`LightProbe`].
///
/// `None` if the place is not finite.
#[must_use]
pub fn probe_views(centre: DVec3) -> Option<[View; 6]> {
    let mut views = Vec::with_capacity(FACES.len());
    for (forward, up) in FACES {
        let (forward, up) = (forward.as_dvec3(), up.as_dvec3());
        views.push(View::new(centre, forward, up, Some(90.0), Some(90.0), (1, 1)).ok()?);
    }
    views.try_into().ok()
}

/// The light that arrives at a place from all directions.
#[derive(Clone, Debug)]
pub struct LightProbe {
    centre: DVec3,
    pub(crate) cube: Cube,
    /// Of each texel, W·sr⁻¹·m⁻².
    pub(crate) radiance: Vec<Vec3>,
    /// Distance to what each texel shows, scene units; infinite for the sky.
    pub(crate) distance: Vec<f32>,
}

impl LightProbe {
    /// Returns the light around `centre`, from the frames of its [`probe_views`]. Pixels about which
    /// nothing is known have the mean radiance of the others, infinitely far away.
    ///
    /// # Errors
    /// If the frames are not squares of one size, or show no light.
    pub fn new(centre: DVec3, frames: &[Frame; 6]) -> Result<LightProbe, ProbeError> {
        let side = frames[0].picture.width;
        let pixels = side as usize * side as usize;
        let fits = |frame: &Frame| {
            frame.picture.size() == (side, side)
                && frame.picture.pixels.len() == pixels
                && frame.depth.len() == pixels
        };
        if pixels == 0 || !frames.iter().all(fits) {
            return Err(ProbeError::Frames);
        }
        let cube = Cube { side: side as usize };
        let all = frames.iter().flat_map(|frame| frame.picture.pixels.iter().zip(&frame.depth));
        let sound = |radiance: &[f32; 3]| {
            let radiance = Vec3::from(*radiance);
            if radiance.is_finite() { radiance.max(Vec3::ZERO) } else { Vec3::ZERO }
        };
        let (mut radiance, mut distance): (Vec<Vec3>, Vec<f32>) =
            all.map(|(radiance, &distance)| (sound(radiance), distance)).unzip();
        let (mut light, mut known) = (Vec3::ZERO, 0.0);
        for (texel, (radiance, distance)) in radiance.iter().zip(&distance).enumerate() {
            if *distance > 0.0 {
                let solid_angle = cube.solid_angle(texel);
                light += *radiance * solid_angle;
                known += solid_angle;
            }
        }
        if light == Vec3::ZERO {
            return Err(ProbeError::NoLight);
        }
        for (radiance, distance) in radiance.iter_mut().zip(&mut distance) {
            if *distance > 0.0 {
                continue;
            }
            (*radiance, *distance) = (light / known, f32::INFINITY);
        }
        Ok(LightProbe { centre, cube, radiance, distance })
    }

    /// Returns the place that it is the light of.
    #[must_use]
    pub fn centre(&self) -> DVec3 {
        self.centre
    }

    /// Returns what a texel shows, relative to the centre; `None` for the sky.
    #[inline]
    pub(crate) fn place(&self, texel: usize) -> Option<Vec3> {
        let distance = self.distance[texel];
        distance.is_finite().then(|| self.cube.direction(texel) * distance)
    }

    /// Returns the unit normal of what a texel shows, towards the centre, from the places around
    /// it. For the sky, that is the direction to the centre.
    pub(crate) fn normal(&self, texel: usize) -> Vec3 {
        let towards = -self.cube.direction(texel);
        let Some(here) = self.place(texel) else { return towards };
        let slope = |[before, after]: [usize; 2]| {
            // At the edge of a surface, the neighbour on the other side of it is far away.
            let step = |other: usize, sign: f32| match self.place(other) {
                Some(there) if other != texel => Some((there - here) * sign),
                _ => None,
            };
            let steps = [step(before, -1.0), step(after, 1.0)];
            steps.into_iter().flatten().min_by(|a, b| a.length().total_cmp(&b.length()))
        };
        let [across, down] = self.cube.around(texel);
        let normal = slope(across).zip(slope(down)).and_then(|(a, b)| a.cross(b).try_normalize());
        let normal = normal.unwrap_or(towards);
        if normal.dot(towards) < 0.0 { -normal } else { normal }
    }

    /// Returns the direction from the centre to what is seen from a point in a direction. `point` is
    /// relative to the centre.
    ///
    /// Along the ray, the distance from the centre over that of what the probe shows there is linear
    /// on a plane, and 1 where the ray meets it. So the secant method is exact on planes. A ray that
    /// passes behind an edge meets nothing there: it is taken to see what is beyond the edge.
    #[inline]
    pub(crate) fn direction_seen(&self, point: Vec3, direction: Vec3) -> Vec3 {
        /// More steps gain nothing in rooms.
        const STEPS: usize = 6;
        /// Relative difference of distances at which a ray meets what the probe shows.
        const CLOSE: f32 = 3e-3;
        /// The same at the end of the search, for curved surfaces.
        const NEARLY: f32 = 0.1;
        let shown = |at: Vec3| self.distance[self.cube.texel(at)];
        // Every point is before the sky: -1.
        let behind = |at: Vec3| at.length() / shown(at) - 1.0;
        let first = shown(direction);
        // The search stays between a point before the surface and one behind it.
        let (mut near, mut far) = ((0.0, behind(point).min(-1e-3)), None);
        let mut along = if first.is_finite() { first } else { 2.0 * point.length() };
        for _ in 0..STEPS {
            let at = point + direction * along;
            let here = behind(at);
            if here.abs() < CLOSE {
                return at.normalize_or(direction);
            }
            if here < 0.0 {
                near = (along, here);
            } else {
                far = Some((along, here));
            }
            along = match far {
                Some((distance, behind)) => {
                    near.0 - near.1 * (distance - near.0) / (behind - near.1)
                }
                None => 2.0 * along,
            };
        }
        // Beyond all that is near, a ray sees what is in its direction.
        let Some((distance, behind)) = far else { return direction };
        let [before, after] = [near.0, distance].map(|along| point + direction * along);
        let is_before = match behind.min(-near.1) < NEARLY {
            true => -near.1 < behind,
            false => shown(before) > shown(after),
        };
        let seen = if is_before { before } else { after };
        seen.normalize_or(direction)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the frames of a room: a sphere of this radius around `middle`, as seen from the
    /// origin, whose radiance is a function of the place.
    fn sphere(middle: DVec3, radius: f64, radiance: impl Fn(DVec3) -> f32) -> [Frame; 6] {
        probe_views(DVec3::ZERO).unwrap().map(|view| {
            let size = (32, 32);
            let mut frame = Frame::black(size);
            for row in 0..size.1 {
                for column in 0..size.0 {
                    let (x, y) = View::pixel_centre(size, column, row);
                    let (_, direction) = view.ray(x, y);
                    let along = middle.dot(direction);
                    let far = (radius * radius - middle.length_squared() + along * along).sqrt();
                    let distance = along + far;
                    let at = (row * size.0 + column) as usize;
                    frame.picture.pixels[at] = [radiance(direction * distance); 3];
                    frame.depth[at] = distance as f32;
                }
            }
            frame
        })
    }

    #[test]
    fn a_probe_knows_places_and_normals_of_what_is_around_it() {
        let middle = DVec3::new(0.3, -0.2, 0.1);
        let probe = LightProbe::new(DVec3::ZERO, &sphere(middle, 2.0, |_| 1.0)).unwrap();
        for texel in (0..probe.cube.texels()).step_by(37) {
            let place = probe.place(texel).unwrap().as_dvec3();
            assert!((place.distance(middle) - 2.0).abs() < 1e-3);
            let expected = (middle - place).normalize().as_vec3();
            assert!(probe.normal(texel).dot(expected) > 0.99);
        }
    }

    #[test]
    fn what_is_seen_from_another_point_is_found_by_its_distance() {
        let probe = LightProbe::new(DVec3::ZERO, &sphere(DVec3::ZERO, 2.0, |_| 1.0)).unwrap();
        let (point, direction) = (Vec3::new(0.5, 0.2, -0.3), Vec3::new(0.0, 0.6, 0.8));
        let seen = probe.direction_seen(point, direction) * 2.0;
        let missed = (seen - point).cross(direction).length();
        assert!(missed < 1e-3 && (seen - point).dot(direction) > 0.0, "{seen}");
    }

    #[test]
    fn a_ray_that_passes_behind_an_edge_sees_what_is_beyond() {
        // A floor that ends at x = 1.2, under the sky.
        let mut frames = sphere(DVec3::ZERO, 1.0, |_| 1.0);
        for (frame, view) in frames.iter_mut().zip(probe_views(DVec3::ZERO).unwrap()) {
            for (pixel, depth) in frame.depth.iter_mut().enumerate() {
                let (column, row) = (pixel as u32 % 32, pixel as u32 / 32);
                let (x, y) = View::pixel_centre((32, 32), column, row);
                let (_, direction) = view.ray(x, y);
                let distance = -0.4 / direction.z;
                let is_floor = direction.z < 0.0 && direction.x * distance < 1.2;
                *depth = if is_floor { distance as f32 } else { f32::INFINITY };
            }
        }
        let probe = LightProbe::new(DVec3::ZERO, &frames).unwrap();
        let is_sky = |seen: Vec3| probe.distance[probe.cube.texel(seen)].is_infinite();
        let point = Vec3::new(0.4, 0.0, 0.4);
        for (down, passes) in [(0.2, true), (0.5, true), (0.7, true), (1.4, false), (3.0, false)] {
            let seen = probe.direction_seen(point, Vec3::new(1.0, 0.0, -down).normalize());
            assert_eq!(is_sky(seen), passes, "{down}: {seen}");
        }
    }

    #[test]
    fn a_floor_is_seen_in_its_place_from_points_before_the_sky() {
        // A floor 1 below the probe, under the sky.
        let mut frames = sphere(DVec3::ZERO, 1.0, |_| 1.0);
        for (frame, view) in frames.iter_mut().zip(probe_views(DVec3::ZERO).unwrap()) {
            for (pixel, depth) in frame.depth.iter_mut().enumerate() {
                let (column, row) = (pixel as u32 % 32, pixel as u32 / 32);
                let (x, y) = View::pixel_centre((32, 32), column, row);
                let (_, direction) = view.ray(x, y);
                let down = -direction.z;
                *depth = if down > 0.0 { (1.0 / down) as f32 } else { f32::INFINITY };
            }
        }
        let probe = LightProbe::new(DVec3::ZERO, &frames).unwrap();
        let direction = Vec3::new(0.6, 0.0, -0.8);
        for point in [Vec3::new(0.3, 0.2, 0.25), Vec3::new(0.3, 0.2, -0.25)] {
            let hit = point + direction * ((point.z + 1.0) / 0.8);
            let seen = probe.direction_seen(point, direction);
            assert!(seen.distance(hit.normalize()) < 0.01, "{point}: {seen}");
        }
    }

    #[test]
    fn a_probe_without_light_is_refused_and_unknown_pixels_have_the_mean() {
        let mut frames = sphere(DVec3::ZERO, 1.0, |_| 0.0);
        assert_eq!(LightProbe::new(DVec3::ZERO, &frames).err(), Some(ProbeError::NoLight));
        frames = sphere(DVec3::ZERO, 1.0, |_| 3.0);
        frames[2].depth.fill(0.0);
        frames[2].picture.pixels.fill([0.0; 3]);
        let probe = LightProbe::new(DVec3::ZERO, &frames).unwrap();
        assert!(probe.radiance.iter().all(|radiance| (radiance.x - 3.0).abs() < 1e-4));
        frames[1] = Frame::black((3, 3));
        assert_eq!(LightProbe::new(DVec3::ZERO, &frames).err(), Some(ProbeError::Frames));
    }
}

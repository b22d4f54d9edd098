//! The light that arrives at a place, from all directions, with distances.

use glam::{DVec3, Vec3};
use holo_display::Frame;
use holo_picture::View;
use holo_reflection_cube::{CubeAnswer, FACE_AXES, ReflectionCube, ReflectionSample};

/// Why there is no probe of a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ProbeError {
    /// The frames are not those of [`probe_views`], all of a size that a cube can have.
    #[error("the frames of a light probe are not squares of one power of two")]
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
    let mut views = Vec::with_capacity(FACE_AXES.len());
    for [forward, _, down] in FACE_AXES {
        let (forward, up) = (forward.as_dvec3(), -down.as_dvec3());
        views.push(View::new(centre, forward, up, Some(90.0), Some(90.0), (1, 1)).ok()?);
    }
    views.try_into().ok()
}

/// The light that arrives at a place from all directions.
#[derive(Clone, Debug)]
pub struct LightProbe {
    centre: DVec3,
    /// The light around the centre, which is the cube's zero. All texels are valid. Radiance in
    /// W·sr⁻¹·m⁻², distances in scene units.
    pub(crate) cube: ReflectionCube,
}

/// Returns the radiance of a texel.
#[inline]
pub(crate) fn radiance(cube: &ReflectionCube, texel: usize) -> Vec3 {
    cube.light_of(texel).map_or(Vec3::ZERO, |light| light.radiance.into())
}

impl LightProbe {
    /// Returns the light around `centre`, from the frames of its [`probe_views`]. Pixels about
    /// which nothing is known have the mean radiance of the others, infinitely far away.
    ///
    /// # Errors
    /// If the frames are not squares of one size that a cube can have, or show no light.
    pub fn new(centre: DVec3, frames: &[Frame; 6]) -> Result<LightProbe, ProbeError> {
        let side = frames[0].picture.width;
        let mut cube = ReflectionCube::new(Vec3::ZERO, side);
        let pixels = side as usize * side as usize;
        let fits = |frame: &Frame| {
            frame.picture.size() == (side, side)
                && frame.picture.pixels.len() == pixels
                && frame.depth.len() == pixels
        };
        if cube.grid().resolution() != side || !frames.iter().all(fits) {
            return Err(ProbeError::Frames);
        }
        // Frames show the faces of the cube pixel by pixel.
        let all = frames.iter().flat_map(|frame| frame.picture.pixels.iter().zip(&frame.depth));
        let (mut light, mut known) = (Vec3::ZERO, 0.0);
        let mut unknown = Vec::new();
        let sample = |direction, distance, radiance| ReflectionSample {
            origin: Vec3::ZERO,
            direction,
            distance,
            radiance,
            count: 1,
            generation: 0,
        };
        for (texel, (&radiance, &distance)) in all.enumerate() {
            let radiance = Vec3::from(radiance).max(Vec3::ZERO);
            let direction = cube.grid().direction_of(texel);
            let is_known =
                distance > 0.0 && cube.insert(&sample(direction, distance, radiance.to_array()));
            if !is_known {
                unknown.push(direction);
                continue;
            }
            let solid_angle = cube.grid().solid_angle_of(texel);
            light += radiance * solid_angle;
            known += solid_angle;
        }
        if light == Vec3::ZERO {
            return Err(ProbeError::NoLight);
        }
        for direction in unknown {
            cube.insert(&sample(direction, f32::INFINITY, (light / known).to_array()));
        }
        cube.refresh_levels();
        Ok(LightProbe { centre, cube })
    }

    /// Returns the place that it is the light of.
    #[must_use]
    pub fn centre(&self) -> DVec3 {
        self.centre
    }

    /// Returns the radiance in a direction from the centre, blurred over an angle in radians.
    #[inline]
    pub(crate) fn blurred(&self, direction: Vec3, blur: f32) -> Vec3 {
        match self.cube.look_up(self.cube.centre(), direction, blur..=blur) {
            CubeAnswer::Light(light) => light.radiance.into(),
            // All texels are valid.
            CubeAnswer::Unknown | CubeAnswer::MustTrace => Vec3::ZERO,
        }
    }

    /// Returns the radiance of a texel.
    #[inline]
    pub(crate) fn radiance(&self, texel: usize) -> Vec3 {
        radiance(&self.cube, texel)
    }

    /// Returns what a texel shows, relative to the centre; `None` for the sky.
    #[inline]
    pub(crate) fn place(&self, texel: usize) -> Option<Vec3> {
        let distance = self.cube.light_of(texel)?.distance;
        distance.is_finite().then(|| self.cube.grid().direction_of(texel) * distance)
    }

    /// Returns the unit normal of what a texel shows, towards the centre, from the places around
    /// it. For the sky, that is the direction to the centre.
    pub(crate) fn normal(&self, texel: usize) -> Vec3 {
        let towards = -self.cube.grid().direction_of(texel);
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
        let [across, down] = self.around(texel);
        let normal = slope(across).zip(slope(down)).and_then(|(a, b)| a.cross(b).try_normalize());
        let normal = normal.unwrap_or(towards);
        if normal.dot(towards) < 0.0 { -normal } else { normal }
    }

    /// Returns the texels on both sides of a texel in its face: left and right, above and below.
    /// At the edge of a face, the texel itself stands for the missing one.
    fn around(&self, texel: usize) -> [[usize; 2]; 2] {
        let side = self.cube.grid().resolution() as usize;
        let (column, row) = (texel % side, texel / side % side);
        let before = |at: usize, step: usize| if at > 0 { texel - step } else { texel };
        let after = |at: usize, step: usize| if at + 1 < side { texel + step } else { texel };
        [[before(column, 1), after(column, 1)], [before(row, side), after(row, side)]]
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
        for texel in (0..probe.cube.grid().len()).step_by(37) {
            let place = probe.place(texel).unwrap().as_dvec3();
            assert!((place.distance(middle) - 2.0).abs() < 1e-3);
            let expected = (middle - place).normalize().as_vec3();
            assert!(probe.normal(texel).dot(expected) > 0.99);
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
        assert!(
            (0..probe.cube.grid().len()).all(|texel| (probe.radiance(texel).x - 3.0).abs() < 1e-4)
        );
        frames[1] = Frame::black((3, 3));
        assert_eq!(LightProbe::new(DVec3::ZERO, &frames).err(), Some(ProbeError::Frames));
    }
}

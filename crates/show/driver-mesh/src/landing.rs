//! Where stored rays end as a view sees them, how near to the eye they pass, and their weight.

use glam::DVec3;
use holo_display::Camera;
use holo_picture::{Clip, View};
use holo_section::{BeamKey, Sample, Section, SectionRay};

use crate::chart::RayEnd;

/// A ray is aligned if it passes the eye within this share of the distance of what it met. Its
/// direction then differs from the eye's by less than 5.7 degrees.
const ALIGNED: f64 = 0.1;
/// Weight of a ray that passes within its own footprint of the eye.
const FULL_WEIGHT: f64 = 64.0;
/// Least weight of a ray.
const LEAST_WEIGHT: f64 = 8.0;
/// Distance at which the weight of a ray that hit nothing is determined, in diagonals of its
/// section.
const FAR_DIAGONALS: f64 = 8.0;
/// Most paths that a sample counts for.
const MAX_PATHS: u16 = 1024;
/// Samples beside the picture are used up to this share of its width and height, so that triangles
/// at its edges end outside.
const MARGIN: f64 = 0.06;
/// Greatest angle, as a cosine, between a parallel view's direction and a ray without a hit that
/// counts for the view: about 6°.
const ALONG: f64 = 0.995;

/// A sample as a view sees it.
#[derive(Clone, Copy, Debug)]
pub struct SampleLanding {
    /// What the ray met. The sky of a parallel view has a point, where the ray leaves its section.
    pub end: RayEnd,
    /// False if the ray met nothing, or something beyond the aft clipping surface.
    pub is_surface: bool,
    /// Radiance; 0 beyond the aft clipping surface.
    pub radiance: [f32; 3],
    /// Weight by nearness of the ray to the eye, and by paths.
    pub weight: u32,
    /// True if the ray looks in nearly the same direction as the eye, so that glossy surfaces look
    /// the same.
    pub is_aligned: bool,
    /// True if the ray passes the eye within a pixel, so that nothing stands between the eye and what
    /// it met.
    pub is_near: bool,
    /// Number of the pixel, row by row from the top; `None` beside the picture.
    pub pixel: Option<usize>,
}

/// Projects samples into a view.
pub struct SampleProjector<'a> {
    pub view: &'a View,
    pub size: (u32, u32),
    camera: Camera,
}

impl<'a> SampleProjector<'a> {
    pub fn new(view: &'a View, size: (u32, u32)) -> SampleProjector<'a> {
        SampleProjector { view, size, camera: Camera::new(view, size) }
    }

    /// Calls `land` with each sample of a beam that the view may see. `is_elsewhere` if another
    /// section contains the eye and this one does not.
    pub fn land(
        &self,
        section: &Section,
        is_elsewhere: bool,
        key: BeamKey,
        (paths, samples): (u16, &[Sample]),
        mut land: impl FnMut(SampleLanding),
    ) {
        let Some(pair) = section.cells(key.beam) else { return };
        let paths = u32::from(paths.clamp(1, MAX_PATHS));
        for sample in samples {
            let ray = section.ray(pair, sample.coords);
            let distance = sample.distance(section.diagonal());
            let Some(mut landing) = self.see(&ray, distance, section, is_elsewhere) else {
                continue;
            };
            if landing.is_surface || !distance.is_finite() && !self.view.clips_sky() {
                landing.radiance = sample.rgb();
            }
            landing.weight *= paths;
            land(landing);
        }
    }

    /// Returns where a ray lands, black and of one path. `None` if the view does not see its end.
    fn see(
        &self,
        ray: &SectionRay,
        distance: f64,
        section: &Section,
        is_elsewhere: bool,
    ) -> Option<SampleLanding> {
        let hits = distance.is_finite();
        let end = if hits {
            RayEnd::Point(ray.origin + ray.direction * distance)
        } else if self.view.kind.has_eye() {
            RayEnd::Sky(ray.direction)
        } else if ray.direction.dot(self.view.vd) > ALONG {
            RayEnd::Point(ray.origin + ray.direction * ray.length)
        } else {
            return None;
        };
        let pixel = self.pixel(end)?;
        let (eye, sight) = match end {
            RayEnd::Point(point) => self.view.ray_to(point),
            RayEnd::Sky(direction) => (self.view.eye(), direction),
        };
        let seen_at = match end {
            RayEnd::Point(point) if hits => (point - eye).length(),
            _ => FAR_DIAGONALS * section.diagonal(),
        };
        let missed = (ray.origin - eye).cross(ray.direction).length();
        let is_along = !hits || missed <= ALIGNED * seen_at;
        if is_along && sight.dot(ray.direction) < 0.0 {
            // It met the back of a surface.
            return None;
        }
        let begins_ahead = (ray.origin - eye).dot(sight) > 0.0;
        let is_surface = match end {
            RayEnd::Point(point) if hits => match self.view.clip(point) {
                Clip::Before => return None,
                clip => clip == Clip::Shown,
            },
            _ => false,
        };
        let footprint = self.camera.pixel_width.squared_at(seen_at * seen_at).sqrt();
        let weight = (FULL_WEIGHT / (missed / footprint).max(1.0).sqrt()).max(LEAST_WEIGHT);
        let is_aligned = is_along && !(is_elsewhere && begins_ahead);
        let is_near = is_aligned && missed <= footprint;
        let (weight, radiance) = (weight as u32, [0.0; 3]);
        Some(SampleLanding { end, is_surface, radiance, weight, is_aligned, is_near, pixel })
    }

    /// Returns the pixel that shows the end of a ray, if the end is not too far beside the picture.
    fn pixel(&self, end: RayEnd) -> Option<Option<usize>> {
        let (x, y) = match end {
            RayEnd::Point(point) => self.view.project(point).map(|(x, y, _)| (x, y))?,
            RayEnd::Sky(direction) => self.view.project_direction(direction)?,
        };
        let is_near = |at: f64| (-MARGIN..=1.0 + MARGIN).contains(&at);
        let pixel = || {
            let (column, row) = View::pixel_at(self.size, x, y)?;
            Some(row as usize * self.size.0 as usize + column as usize)
        };
        (is_near(x) && is_near(y)).then(pixel)
    }

    /// Returns whether the end of a ray is in the picture or a little beside it.
    pub fn is_near(&self, end: RayEnd) -> bool {
        self.pixel(end).is_some()
    }

    /// Returns where a live ray lands.
    pub fn live(
        &self,
        (origin, direction): (DVec3, DVec3),
        distance: f64,
        paths: u16,
        radiance: [f32; 3],
    ) -> Option<SampleLanding> {
        let hits = distance.is_finite();
        let end = if hits || !self.view.kind.has_eye() {
            RayEnd::Point(origin + direction * if hits { distance } else { 1.0 })
        } else {
            RayEnd::Sky(direction)
        };
        let clip = match end {
            RayEnd::Point(point) if hits => self.view.clip(point),
            _ if self.view.clips_sky() => Clip::Beyond,
            _ => Clip::Shown,
        };
        let weight = FULL_WEIGHT as u32 * u32::from(paths.clamp(1, MAX_PATHS));
        let pixel = self.pixel(end)?;
        let radiance = if clip == Clip::Shown { radiance } else { [0.0; 3] };
        let is_surface = hits && clip == Clip::Shown;
        let is_shown = clip != Clip::Before;
        let (is_aligned, is_near) = (true, true);
        let landing =
            SampleLanding { end, is_surface, radiance, weight, is_aligned, is_near, pixel };
        is_shown.then_some(landing)
    }
}

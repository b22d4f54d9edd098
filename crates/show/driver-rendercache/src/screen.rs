//! The view that a driver shows, and the pixels of stored samples.
//!
//! Invariants:
//! - A pixel that no section covers is 0. A pixel whose beam cannot hit anything shows the sky.
//! - A sample is a pixel's own only if its ray passes near enough to the eye. The limit is the
//!   viewpoint radius plus one step of ray coordinates, because stored rays lie on a lattice of
//!   such steps.

use std::{collections::HashSet, sync::Arc};

use glam::DVec3;
use holo_display::{Frame, FrameRequest, SkyView, best_beam, covered, for_bands, viewpoint_radius};
use holo_picture::{Clip, View};
use holo_section::{BeamKey, RayCoords, Sample, Section, SectionRay, ray_eye_distance};

use crate::Place;

/// Wanted samples per pixel. They set the viewpoint radius of a pixel's own rays to a quarter of a
/// pixel's footprint on the nearest surface.
const SAMPLES_PER_PIXEL: f64 = 16.0;

/// Greatest angle, as a cosine, between a parallel view's direction and a ray without a hit that
/// counts for the view. It is about 6°, as in a cell of a coarse grid.
const ALONG: f64 = 0.995;

/// Rows whose best beams one thread determines at a time.
const ROWS: usize = 16;

/// A stored sample in the scene.
pub(crate) struct StoredRay {
    /// Its coordinates in its beam.
    pub coords: RayCoords,
    /// Its ray.
    pub ray: SectionRay,
    /// Distance along the ray to what it hit, scene units; infinite for nothing.
    pub distance: f64,
    /// Radiance.
    pub radiance: [f32; 3],
}

impl StoredRay {
    /// Returns where the ray ended.
    pub fn place(&self) -> Place {
        match self.distance.is_finite() {
            true => Place::At(self.ray.origin + self.ray.direction * self.distance),
            false => Place::Toward(self.ray.direction),
        }
    }
}

/// A stored sample as the view sees it.
pub(crate) struct ProjectedSample {
    /// Column and row of its pixel.
    pub pixel: (u32, u32),
    /// Where its ray ended.
    pub place: Place,
    /// Radiance; 0 beyond an aft clipping surface.
    pub radiance: [f32; 3],
    /// Distance from where the view's ray begins, scene units; infinite for nothing.
    pub distance: f32,
    /// True if its ray passes so near to the eye that the sample is the pixel's own.
    pub is_own: bool,
}

/// A view, its covered and unseen pixels, and the number of samples in it.
pub(crate) struct CacheScreen {
    pub view: View,
    /// Width and height, pixels.
    pub size: (u32, u32),
    sections: Arc<[Section]>,
    sky: SkyView,
    /// The viewpoint radius: largest distance of the view's own rays from the eye, scene units.
    radius: f64,
    /// Whether a section covers each pixel; empty until the first frame.
    covered: Vec<bool>,
    /// Best beam of each pixel's middle; empty until a frame needs it.
    best: Vec<Option<BeamKey>>,
    unseen: HashSet<BeamKey>,
    used: u64,
}

impl CacheScreen {
    pub fn new(sections: Arc<[Section]>, sky: SkyView, look: &FrameRequest) -> Self {
        Self {
            view: look.view,
            size: look.size,
            sections,
            sky,
            radius: 0.0,
            covered: Vec::new(),
            best: Vec::new(),
            unseen: HashSet::new(),
            used: 0,
        }
    }

    pub fn is_of(&self, look: &FrameRequest) -> bool {
        (self.view, self.size) == (look.view, look.size)
    }

    /// Returns whether a driver can use its data of this view for another view.
    pub fn serves(&self, look: &FrameRequest) -> bool {
        sees_alike(&self.view, &look.view)
    }

    /// Returns the screen of another view. Until its samples `are_requested`, the viewpoint radius
    /// and the unseen beams of the view before hold for it too.
    pub fn next(self, look: &FrameRequest, are_requested: bool) -> Self {
        let mut next = Self::new(Arc::clone(&self.sections), self.sky, look);
        if !are_requested {
            (next.radius, next.unseen) = (self.radius, self.unseen);
        }
        next
    }

    /// Sets the viewpoint radius, scene units, if this is the screen of `look`.
    pub fn set_radius(&mut self, look: &FrameRequest, radius: f64) {
        if self.is_of(look) {
            self.radius = radius;
        }
    }

    /// Notes that no ray of a beam can hit anything.
    pub fn insert_unseen(&mut self, key: BeamKey) {
        if key.section_in(&self.sections).is_some() {
            self.unseen.insert(key);
        }
    }

    /// Calls `insert` with each sample of a beam, and with what the view sees of it, if it sees it.
    /// `insert` returns whether it used the sample.
    pub fn locate(
        &mut self,
        key: BeamKey,
        samples: &[Sample],
        mut insert: impl FnMut(&StoredRay, Option<ProjectedSample>) -> bool,
    ) {
        let Some(section) = self.sections.get(usize::from(key.section)) else { return };
        let Some(pair) = section.cells(key.beam) else { return };
        // A ray that was snapped to the lattice may pass the eye a step farther away.
        let near = self.radius + step(section);
        for sample in samples {
            let ray = section.ray(pair, sample.coords);
            let distance = sample.distance(section.diagonal());
            let ray = StoredRay { coords: sample.coords, ray, distance, radiance: sample.rgb() };
            let seen = self.see(&ray, near);
            self.used += u64::from(insert(&ray, seen));
        }
    }

    fn see(&self, stored: &StoredRay, near: f64) -> Option<ProjectedSample> {
        let StoredRay { ray, distance, radiance, .. } = stored;
        let view = &self.view;
        let has_eye = view.kind.has_eye();
        let (place, x, y, seen_at) = if distance.is_finite() {
            let end = ray.origin + ray.direction * *distance;
            let (x, y, seen_at) = view.project(end)?;
            (Place::At(end), x, y, seen_at)
        } else if has_eye {
            let (x, y) = view.project_direction(ray.direction)?;
            (Place::Toward(ray.direction), x, y, f64::INFINITY)
        } else {
            // The ray counts where it leaves the section.
            let (x, y, _) = view.project(ray.origin + ray.direction * ray.length)?;
            if ray.direction.dot(view.vd) < ALONG {
                return None;
            }
            (Place::Toward(view.vd), x, y, f64::INFINITY)
        };
        let pixel = View::pixel_at(self.size, x, y)?;
        let (clip, eye) = match place {
            Place::At(end) => (view.clip(end), view.ray_to(end).0),
            Place::Toward(_) => (
                if view.clips_sky() { Clip::Beyond } else { Clip::Shown },
                // A parallel view has no eye. The test above ensures that the ray is parallel to
                // it.
                if has_eye { view.eye() } else { ray.origin },
            ),
        };
        let (radiance, seen_at) = match clip {
            Clip::Before => return None,
            Clip::Shown => (*radiance, seen_at),
            Clip::Beyond => ([0.0; 3], f64::INFINITY),
        };
        let is_own = ray_eye_distance(ray, eye) <= near;
        Some(ProjectedSample { pixel, place, radiance, distance: seen_at as f32, is_own })
    }

    /// Returns the frame of a picture and its depths, with pixels outside every section black and
    /// pixels of unseen beams showing the sky.
    pub fn frame(&mut self, picture: holo_picture::Picture, depth: Vec<f32>) -> Frame {
        if self.covered.is_empty() {
            self.covered = covered(&self.sections, &self.view, self.size);
        }
        if !self.unseen.is_empty() {
            self.find_best_beams();
        }
        let mut frame = Frame { picture, depth, samples_used: self.used, ..Frame::black((1, 1)) };
        frame.picture.view = Some(self.view);
        let (view, size) = (self.view, self.size);
        let sky = |pixel: usize| match view.clips_sky() {
            true => [0.0; 3],
            false => self.sky.at_pixel(&view, size, pixel),
        };
        let pixels = frame.picture.pixels.iter_mut().zip(&mut frame.depth);
        for (index, ((pixel, depth), is_covered)) in pixels.zip(&self.covered).enumerate() {
            let best = self.best.get(index).copied().flatten();
            if !is_covered {
                (*pixel, *depth) = ([0.0; 3], 0.0);
                frame.uncovered_pixels += 1;
            } else if best.is_some_and(|beam| self.unseen.contains(&beam)) {
                (*pixel, *depth) = (sky(index), f32::INFINITY);
                frame.unseen_pixels += 1;
            } else {
                frame.empty_pixels += u64::from(*depth == 0.0);
            }
        }
        frame
    }

    /// Finds the best beam of each pixel. Only frames with unseen beams need them, and the search
    /// casts a ray through every section for every pixel.
    fn find_best_beams(&mut self) {
        if !self.best.is_empty() {
            return;
        }
        let (view, size, sections) = (&self.view, self.size, &self.sections);
        let width = size.0 as usize;
        self.best = vec![None; width * size.1 as usize];
        for_bands(&mut self.best, width, ROWS, |band, best| {
            for (pixel, best) in ((band * ROWS * width) as u32..).zip(best) {
                let (x, y) = View::pixel_centre(size, pixel % size.0, pixel / size.0);
                let ray = view.clipped_ray(x, y);
                *best = ray.and_then(|(eye, along, _)| best_beam(sections, eye, along));
            }
        });
    }
}

/// Returns whether data of one view can be used for another.
///
/// It cannot if the clipping differs, because clipped surfaces are stored as black. In parallel
/// views, infinitely far surfaces are stored by pixel, so their directions must be equal.
pub(crate) fn sees_alike(before: &View, now: &View) -> bool {
    if (before.vo, before.va) != (now.vo, now.va) {
        return false;
    }
    before.kind.has_eye() && now.kind.has_eye() || before.kind == now.kind && before.vd == now.vd
}

/// Returns the pixel in which a view shows a place. `None` if it does not, or clips the place.
pub(crate) fn pixel_of(view: &View, size: (u32, u32), place: DVec3) -> Option<(u32, u32)> {
    let (x, y, _) = view.project(place)?;
    View::pixel_at(size, x, y).filter(|_| view.clip(place) == Clip::Shown)
}

/// Returns the viewpoint radius of a pixel's own rays, scene units, if the nearest visible surface
/// is at distance `nearest`.
///
/// It is at least one step of ray coordinates. With less, whole rows of pixels had no samples of
/// parts that they see.
pub(crate) fn radius(sections: &[Section], view: &View, size: (u32, u32), nearest: f64) -> f64 {
    let finest = sections.iter().map(step).fold(f64::INFINITY, f64::min);
    viewpoint_radius(view, size, nearest, SAMPLES_PER_PIXEL).max(finest)
}

/// Returns the longest step of a section's ray coordinates, scene units.
fn step(section: &Section) -> f64 {
    let spec = section.spec();
    let cell =
        |axis: usize| DVec3::from_array(spec.axes[axis]).length() / f64::from(spec.grid[axis]);
    (0..3).map(cell).fold(0.0, f64::max) / 256.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_of_another_type_of_view_is_used_only_if_it_means_the_same() {
        let view = |words: &str| {
            View::parse_vf(&format!("-vp 0 0 0 {words}")).unwrap().resolve((48, 36)).unwrap().0
        };
        let (perspective, fisheye) = (view("-vd 0 1 0"), view("-vd 0 1 0 -vta"));
        let (parallel, turned) = (view("-vd 0 1 0 -vtl -vh 3"), view("-vd 1 1 0 -vtl -vh 3"));
        assert!(sees_alike(&perspective, &fisheye));
        assert!(sees_alike(&parallel, &view("-vd 0 2 0 -vtl -vh 9")));
        assert!(!sees_alike(&perspective, &view("-vd 0 1 0 -va 3")));
        assert!(!sees_alike(&perspective, &parallel) && !sees_alike(&parallel, &turned));
    }
}

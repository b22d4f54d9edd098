//! Chooses the rays to request, and the use of their samples (Walter et al. 1999, §4.1).

use holo_display::{mix, pair};

use crate::points::Details;
use crate::sample::{Place, Purpose, RayTarget, Request, Tag};
use crate::{PointImage, dither};

/// Largest difference of depth, as a share of it, of two samples of one surface in one pixel.
const SAME_SURFACE: f64 = 0.01;

impl PointImage {
    /// Adds requests for at most, and about, `wanted` pixels of the current view.
    pub(crate) fn request_pixels(&mut self, wanted: usize) {
        let seed = mix(self.params.seed, self.frames);
        let pixels = self.planes.priority.len() as u64;
        let chosen: Vec<u32> = if self.params.stages.dither {
            dither::choose(&self.planes.priority, self.planes.width, wanted, seed)
        } else {
            let anywhere = |index| ((u64::from(mix(seed, index)) * pixels) >> 32) as u32;
            (0..wanted as u32).map(anywhere).collect()
        };
        for pixel in chosen {
            self.requests.push(self.request(pixel, seed));
        }
    }

    fn request(&self, pixel: u32, seed: u32) -> Request {
        let (width, height) = (self.planes.width, self.planes.height);
        let (column, row) = self.planes.place(pixel);
        let anywhere = || {
            let (x, y) = pair(seed, pixel);
            RayTarget::Picture(
                (column as f32 + x) / width as f32,
                1.0 - (row as f32 + y) / height as f32,
            )
        };
        let point = self.planes.shown(pixel);
        let resampling = self.params.stages.resampling;
        // From time to time, a pixel with a sample of this view is tested for a change.
        let is_check = || resampling && mix(!seed, pixel).is_multiple_of(self.params.check_every);
        let (aim, purpose) = match point {
            None => (anywhere(), Purpose::Pixel),
            Some(slot) if self.points.is_fresh[slot] && !is_check() => {
                (anywhere(), Purpose::Refine)
            }
            Some(slot) if resampling => {
                (RayTarget::Through(self.points.position(slot)), Purpose::Resample)
            }
            Some(_) => (anywhere(), Purpose::Pixel),
        };
        Request { aim, predicted: false, tag: self.tag(pixel, purpose, point) }
    }

    /// Returns the tag for a ray of the current view, anywhere in this pixel, that was traced
    /// without a request. Its sample then counts as a requested one. `None` outside the picture.
    pub fn pixel_tag(&self, column: u32, row: u32) -> Option<Tag> {
        let pixel = self.pixel(column, row)?;
        let point = self.point_in(pixel);
        let purpose = match point {
            Some(slot) if self.points.is_fresh[slot] => Purpose::Refine,
            Some(_) if self.params.stages.resampling => Purpose::Resample,
            _ => Purpose::Pixel,
        };
        Some(self.tag(pixel, purpose, point))
    }

    /// Returns the tag for a sample that was seen from elsewhere and lies in this pixel. `None`
    /// outside the picture.
    ///
    /// The cache averages such samples of a pixel in one point, and shows the nearer of two
    /// surfaces. They never change a sample of the current view.
    pub fn guess_tag(&self, column: u32, row: u32) -> Option<Tag> {
        let pixel = self.pixel(column, row)?;
        Some(self.tag(pixel, Purpose::Guess, None))
    }

    /// Returns whether the sample of a request counts as its tag says even if its ray missed the
    /// pixel a little: it went through a point, or the pixel was one of an earlier view.
    pub(crate) fn is_for_itself(&self, tag: Tag) -> bool {
        tag.purpose == Purpose::Resample || tag.epoch != self.epoch
    }

    /// Returns the mean radiance of the samples of a pixel's point, and their number, if a sample
    /// at `place` lies on the same surface.
    pub(crate) fn known_at(&self, column: u32, row: u32, place: Place) -> Option<([f32; 3], u32)> {
        let slot = self.point_in(self.pixel(column, row)?)?;
        let Place::At(place) = place else { return None };
        let (old, found) = self.depths(slot, (place - self.origin).as_vec3().to_array());
        let Details { mean, count, .. } = self.points.details[slot];
        ((found - old).abs() <= SAME_SURFACE * old).then_some((mean, count))
    }

    fn pixel(&self, column: u32, row: u32) -> Option<u32> {
        let (width, height) = (self.planes.width as u32, self.planes.height as u32);
        (column < width && row < height).then(|| row * width + column)
    }

    fn tag(&self, pixel: u32, purpose: Purpose, point: Option<usize>) -> Tag {
        let generation = point.map_or(0, |slot| self.points.generation[slot]);
        Tag { purpose, pixel, slot: point.unwrap_or(usize::MAX), generation, epoch: self.epoch }
    }

    /// Returns the slot of the point that a pixel shows, if the point lies in the pixel. Since the
    /// last picture, another point may have taken the slot.
    pub(crate) fn point_in(&self, pixel: u32) -> Option<usize> {
        self.planes.shown(pixel).filter(|&slot| self.is_in(slot, pixel))
    }

    /// Returns whether a point lies in a pixel of the current view.
    pub(crate) fn is_in(&self, slot: usize, pixel: u32) -> bool {
        let Some(map) = &self.map else { return false };
        let [column, row, depth] = map.project(self.points.position(slot));
        let at = self.planes.place(pixel);
        depth > 0.0
            && (column.floor(), row.floor()) == (at.0 as f32, at.1 as f32)
            && !self.points.is_empty(slot)
    }
}

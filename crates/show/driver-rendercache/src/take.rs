//! Adds new samples to the cache (Walter et al. 1999, §4.1 to §4.3).
//!
//! Invariants:
//! - A sample with a number that is not finite changes nothing.
//! - A late sample, for an earlier view, becomes a point like any other.

use glam::DVec3;
use holo_picture::{Clip, View};

use crate::PointImage;
use crate::colour::{self, LARGEST};
use crate::map::{far_along, far_away};
use crate::points::Details;
use crate::sample::{Place, Purpose, RayResult, Tag};

/// A new sample in the cache's coordinates.
#[derive(Clone, Copy)]
struct NewSample {
    tag: Tag,
    /// Relative to the cache's origin.
    position: [f32; 3],
    radiance: [f32; 3],
    noise: f32,
    object: u32,
    is_changing: bool,
}

impl PointImage {
    /// Adds samples. Returns the number of new points.
    pub(crate) fn take_all(&mut self, samples: &[RayResult]) -> usize {
        self.noise.take(samples, self.points.capacity());
        let mut new_points = 0;
        for sample in samples {
            if let Some(new) = self.converted(sample) {
                new_points += usize::from(self.take(&new));
            }
        }
        new_points
    }

    /// Converts a sample to the cache's coordinates. `None` if a number is not finite, or if the
    /// sample lies before the fore clipping surface, which a requested ray never hits.
    fn converted(&self, sample: &RayResult) -> Option<NewSample> {
        let tag = sample.tag;
        let position = match sample.place {
            Place::At(position) => position - self.origin,
            Place::Toward(direction) if direction.normalize_or_zero() == DVec3::ZERO => {
                return None;
            }
            Place::Toward(direction) => self.far(tag, direction),
        };
        let position = position.as_vec3().to_array();
        if !position.iter().chain(&sample.radiance).all(|number| number.is_finite()) {
            return None;
        }
        let radiance = match self.clip(sample) {
            Clip::Before => return None,
            Clip::Shown => sample.radiance.map(|channel| channel.clamp(0.0, LARGEST)),
            // The view shows black there, so the pixel's mean takes black.
            Clip::Beyond => [0.0; 3],
        };
        let noise = if sample.noise.is_nan() { f32::INFINITY } else { sample.noise.max(0.0) };
        let RayResult { object, is_changing, .. } = *sample;
        Some(NewSample { tag, position, radiance, noise, object, is_changing })
    }

    /// Returns whether the view clips a sample. A sample without a request is never clipped.
    fn clip(&self, sample: &RayResult) -> Clip {
        let is_for_view = |view: &&View| view.is_clipped() && sample.tag.purpose != Purpose::Fill;
        match self.view.as_ref().filter(is_for_view) {
            None => Clip::Shown,
            Some(view) => match sample.place {
                Place::At(position) => view.clip(position),
                Place::Toward(_) if view.clips_sky() => Clip::Beyond,
                Place::Toward(_) => Clip::Shown,
            },
        }
    }

    /// Returns the position that stands for an infinitely far surface, relative to the origin.
    fn far(&self, tag: Tag, direction: DVec3) -> DVec3 {
        let is_parallel = |view: &View| !view.kind.has_eye() && tag.purpose != Purpose::Fill;
        let Some(view) = self.view.filter(is_parallel) else { return far_away(direction) };
        let size = (self.planes.width as u32, self.planes.height as u32);
        let (x, y) = View::pixel_centre(size, tag.pixel % size.0, tag.pixel / size.0);
        let (origin, direction) = view.ray(x, y);
        origin + direction * far_along(&view) - self.origin
    }

    /// Adds a sample. Returns whether it made a new point.
    fn take(&mut self, new: &NewSample) -> bool {
        let Tag { purpose, pixel, slot, .. } = new.tag;
        let is_current = new.tag.epoch == self.epoch;
        let holds = slot < self.points.capacity()
            && self.points.generation[slot] == new.tag.generation
            && !self.points.is_empty(slot);
        match purpose {
            Purpose::Resample if holds => self.resample(slot, new, is_current),
            Purpose::Refine if holds && is_current => self.refine(slot, new),
            Purpose::Refine if holds => self.put(slot, new, false),
            Purpose::Pixel if is_current => match self.fresh_point_of(pixel) {
                // The pixel was requested twice before its first sample arrived.
                Some(slot) => self.refine(slot, new),
                None => return self.begin(new, true),
            },
            Purpose::Guess if is_current => match self.point_in(pixel) {
                None => return self.begin(new, false),
                Some(slot) => self.guess(slot, new),
            },
            _ => return self.add(new, false).is_some(),
        }
        false
    }

    /// Puts a sample into a free slot and returns the slot. `None` if a sample that is not of this
    /// view would overwrite one that is: at rest the picture would then never converge.
    fn add(&mut self, new: &NewSample, is_fresh: bool) -> Option<usize> {
        let slot = self.points.free_slot();
        if self.points.is_fresh[slot] && !is_fresh {
            return None;
        }
        self.put(slot, new, is_fresh);
        Some(slot)
    }

    /// Makes a sample the first point of its pixel. Returns whether there was a slot for it.
    fn begin(&mut self, new: &NewSample, is_fresh: bool) -> bool {
        let slot = self.add(new, is_fresh);
        if let Some(slot) = slot {
            self.planes.show(new.tag.pixel, slot, self.points.colour[slot]);
        }
        slot.is_some()
    }

    /// Compares a sample with the point that its ray went through (1999, §4.1).
    fn resample(&mut self, slot: usize, new: &NewSample, is_current: bool) {
        if !self.has_changed(slot, new) {
            return self.confirm(slot, new, is_current);
        }
        self.put(slot, new, is_current);
        // A ray of unknown noise that met something else says nothing about the pixels around it.
        if new.noise.is_finite() {
            self.age_neighbours(new.tag.pixel, slot);
        }
    }

    /// Adds a sample that was seen from elsewhere to a pixel that shows a point.
    fn guess(&mut self, slot: usize, new: &NewSample) {
        if self.points.is_fresh[slot] {
            return;
        }
        let (old, found) = self.depths(slot, new.position);
        if found < old * (1.0 - self.params.move_threshold) {
            self.put(slot, new, false);
        } else if found <= old * (1.0 + self.params.move_threshold) {
            self.confirm(slot, new, false);
        }
    }

    /// Returns the depths of a point and of a place, relative to the cache's origin: distances from
    /// the eye, or along the direction of a parallel view.
    pub(crate) fn depths(&self, slot: usize, place: [f32; 3]) -> (f64, f64) {
        let Some(view) = &self.view else { return (0.0, 0.0) };
        let eye = view.eye() - self.origin;
        let depth = |position: [f32; 3]| {
            let from_eye = DVec3::from(position.map(f64::from)) - eye;
            if view.kind.has_eye() { from_eye.length() } else { from_eye.dot(view.vd) }
        };
        (depth(self.points.position(slot)), depth(place))
    }

    fn fresh_point_of(&self, pixel: u32) -> Option<usize> {
        let slot = *self.planes.slot.get(pixel as usize)? as usize;
        // Since the last picture another pixel's point may have taken the slot.
        let is_fresh = *self.points.is_fresh.get(slot)?
            && self.points.details[slot].epoch == self.epoch
            && self.is_in(slot, pixel);
        is_fresh.then_some(slot)
    }

    /// Returns whether a sample differs from the point that its ray went through by more than its
    /// stated noise explains.
    fn has_changed(&self, slot: usize, new: &NewSample) -> bool {
        let Details { reference, reference_count, noise, .. } = self.points.details[slot];
        let largest = reference.into_iter().chain(new.radiance).fold(0.0, f32::max);
        // A mean of n samples has 1/n of their variance. Unknown noise of older samples counts as
        // 0, so that a clean sample corrects them.
        let noise = if noise.is_finite() { noise } else { 0.0 };
        let variance = new.noise * new.noise + noise * noise / reference_count.max(1) as f32;
        let allowed =
            self.params.change_threshold * largest + self.params.noise_deviations * variance.sqrt();
        let differs = new.radiance.iter().zip(&reference).any(|(n, old)| (n - old).abs() > allowed);
        let (old, found) = self.depths(slot, new.position);
        differs || (found - old).abs() > self.params.move_threshold * old
    }

    /// Puts a new point into a slot.
    fn put(&mut self, slot: usize, new: &NewSample, is_fresh: bool) {
        self.has_fresh |= is_fresh;
        let points = &mut self.points;
        points.set_position(slot, new.position);
        points.colour[slot] = colour::encode(new.radiance);
        points.age[slot] = 0;
        points.is_fresh[slot] = is_fresh;
        points.is_changing[slot] = new.is_changing;
        points.generation[slot] = points.generation[slot].wrapping_add(1);
        points.details[slot] = Details {
            mean: new.radiance,
            count: 1,
            reference: new.radiance,
            reference_count: 1,
            noise: new.noise,
            object: new.object,
            epoch: if is_fresh { self.epoch } else { self.epoch.wrapping_sub(1) },
        };
    }

    /// Averages a sample into a point that its ray has confirmed.
    fn confirm(&mut self, slot: usize, new: &NewSample, is_current: bool) {
        let most = self.params.moving_mean;
        let details = &mut self.points.details[slot];
        average(&mut details.reference, new.radiance, &mut details.reference_count, most);
        if details.epoch != self.epoch {
            average(&mut details.mean, new.radiance, &mut details.count, most);
            self.points.colour[slot] = colour::encode(details.mean);
            if is_current {
                // A pixel's mean needs rays all over the pixel, and this mean has rays through one
                // point only. So it counts as one sample.
                (details.epoch, details.count) = (self.epoch, 1);
            }
        }
        if new.noise > 0.0 {
            details.noise = new.noise;
        }
        details.object = new.object;
        self.points.is_changing[slot] = new.is_changing;
        let is_fresh = details.epoch == self.epoch;
        self.has_fresh |= is_fresh;
        self.points.is_fresh[slot] = is_fresh;
        self.points.age[slot] = 0;
        self.points.set_position(slot, new.position);
    }

    /// Averages another ray of the same pixel and view into the point: the box filter of the pixel.
    fn refine(&mut self, slot: usize, new: &NewSample) {
        let details = &mut self.points.details[slot];
        average(&mut details.mean, new.radiance, &mut details.count, self.params.resting_mean);
        self.points.colour[slot] = colour::encode(details.mean);
        self.points.age[slot] = 0;
    }

    /// Makes the points around a changed one older, because they have probably changed too (1999,
    /// §4.1).
    fn age_neighbours(&mut self, pixel: u32, changed: usize) {
        let (width, height) = (self.planes.width, self.planes.height);
        let (column, row) = self.planes.place(pixel);
        let reach = self.params.change_reach as usize;
        for y in row.saturating_sub(reach)..(row + reach + 1).min(height) {
            for x in column.saturating_sub(reach)..(column + reach + 1).min(width) {
                let slot = self.planes.slot[y * width + x] as usize;
                if slot != changed && slot < self.points.capacity() {
                    self.points.add_age(slot, self.params.change_ageing);
                }
            }
        }
    }
}

/// Adds a value to a mean of `count` values. From `most` values on, the new value has the weight
/// 1/`most`.
fn average(mean: &mut [f32; 3], value: [f32; 3], count: &mut u32, most: u32) {
    *count = (*count).min(most - 1) + 1;
    let share = 1.0 / *count as f32;
    for (mean, value) in mean.iter_mut().zip(value) {
        *mean += (value - *mean) * share;
    }
}

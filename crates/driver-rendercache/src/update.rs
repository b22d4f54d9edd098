//! Takes new samples into the cache (Walter et al. 1999, §4.1 to §4.3).
//!
//! Always true: a sample with a number that is not finite changes nothing; a sample that comes late is a point like any other.

use super::PointImage;
use super::colour;
use super::map::{far_along, far_away};
use super::points::{
    Details, FRESH, GENERATION, GENERATIONS, HIDDEN, HIGHLIGHT, NOISY, REFINED, State,
};
use super::sample::{Place, Purpose, Sample};
use glam::DVec3;
use holo_picture::{Clip, View};

impl PointImage {
    /// Takes a sample in; false if it has a number that is not finite.
    pub(super) fn take(&mut self, sample: &Sample) -> bool {
        let position = match sample.place {
            Place::At(position) => (position - self.origin).to_array(),
            Place::Toward(direction) => self.far(sample, direction).to_array(),
        }
        .map(|coordinate| coordinate as f32);
        let is_finite = position.iter().chain(&sample.radiance).all(|number| number.is_finite());
        if !is_finite || position == [0.0; 3] && matches!(sample.place, Place::Toward(_)) {
            return false;
        }
        let mut radiance = sample.radiance.map(|channel| channel.clamp(0.0, colour::LARGEST));
        // +0 for -0, so that equal colours have equal bits.
        radiance.iter_mut().for_each(|channel| *channel += 0.0);
        match self.clip(sample) {
            Clip::Shown => {}
            // Not what the view sees: whoever asked began the ray too early.
            Clip::Before => return true,
            // The mean over a pixel's rays is of what they show. Where it is kept it is black in such views anyway.
            Clip::Beyond => radiance = [0.0; 3],
        }
        let tag = sample.tag;
        let slot = tag.slot as usize;
        let is_current = tag.epoch == self.epoch && tag.purpose != Purpose::Fill;
        let is_held =
            |state: &State| state.flags() & GENERATIONS == tag.generation && !state.is_empty();
        let holds = self.points.states.get(slot).is_some_and(is_held);
        match tag.purpose {
            Purpose::Resample if holds => {
                if self.has_changed(slot, position, radiance, sample) {
                    self.put(slot, position, radiance, sample, is_current);
                    // A ray of unknown noise that met something else says nothing about the pixels around it.
                    if sample.noise.is_finite() {
                        self.age_neighbours(tag.pixel, slot);
                    }
                } else {
                    self.confirm(slot, position, radiance, sample, is_current);
                }
            }
            Purpose::Refine if holds && is_current => self.refine(slot, radiance),
            Purpose::Refine if holds => self.put(slot, position, radiance, sample, false),
            Purpose::Pixel if is_current => match self.fresh_point_of(tag.pixel) {
                // Asked for twice before the first came.
                Some(slot) => self.refine(slot, radiance),
                None => self.begin(position, radiance, sample, true),
            },
            Purpose::Guess if is_current => match self.point_in(tag.pixel).map(|(slot, _)| slot) {
                None => self.begin(position, radiance, sample, false),
                Some(slot) if self.points.is_of_view(slot) => {}
                Some(slot) => {
                    let (old, new) = self.distances(slot, position);
                    if new < old * (1.0 - self.params.move_threshold) {
                        self.put(slot, position, radiance, sample, false);
                    } else if new <= old * (1.0 + self.params.move_threshold) {
                        self.confirm(slot, position, radiance, sample, false);
                    }
                }
            },
            _ => {
                let slot = self.points.free_slot();
                // What is not of this view must not push out what is: at rest the picture would never come to an end.
                if !self.points.is_of_view(slot) {
                    self.put(slot, position, radiance, sample, false);
                    self.points.taken += 1;
                }
            }
        }
        true
    }

    /// Whether the view shows what a ray that is meant for it met.
    #[inline]
    fn clip(&self, sample: &Sample) -> Clip {
        match self
            .view
            .as_ref()
            .filter(|view| view.is_clipped() && sample.tag.purpose != Purpose::Fill)
        {
            None => Clip::Shown,
            Some(view) => match sample.place {
                Place::At(position) => view.clip(position),
                Place::Toward(_) if view.clips_sky() => Clip::Beyond,
                Place::Toward(_) => Clip::Shown,
            },
        }
    }

    /// The first point of a pixel.
    fn begin(&mut self, position: [f32; 3], radiance: [f32; 3], sample: &Sample, is_fresh: bool) {
        let slot = self.points.free_slot();
        // What is not of this view must not push out what is.
        if !is_fresh && self.points.is_of_view(slot) {
            return;
        }
        self.put(slot, position, radiance, sample, is_fresh);
        self.points.taken += 1;
        let pixel = sample.tag.pixel as usize;
        if let Some((shown, colour)) =
            self.planes.slot.get_mut(pixel).zip(self.planes.colour.get_mut(pixel))
        {
            (*shown, *colour) = (slot as u32, self.points.colour(slot));
        }
    }

    /// Where something infinitely far away is kept, relative to the origin.
    fn far(&self, sample: &Sample, direction: DVec3) -> DVec3 {
        let parallel =
            self.view.filter(|view| !view.kind.has_eye() && sample.tag.purpose != Purpose::Fill);
        let Some(view) = parallel else { return far_away(direction) };
        let (width, height) = (self.planes.size.0 as u32, self.planes.size.1 as u32);
        let (x, y) =
            View::pixel_centre((width, height), sample.tag.pixel % width, sample.tag.pixel / width);
        let (origin, direction) = view.ray(x, y);
        origin + direction * far_along(&view) - self.origin
    }

    /// Distances from the eye, of a point and of another place.
    fn distances(&self, slot: usize, position: [f32; 3]) -> (f64, f64) {
        if let Some(view) = self.view.filter(|view| !view.kind.has_eye()) {
            let depth =
                |p: [f32; 3]| DVec3::from(p.map(f64::from)).dot(view.vd) - self.eye.dot(view.vd);
            return (depth(self.points.position(slot)), depth(position));
        }
        let eye = self.eye.to_array();
        let distance = |p: [f32; 3]| {
            (0..3).map(|axis| (f64::from(p[axis]) - eye[axis]).powi(2)).sum::<f64>().sqrt()
        };
        (distance(self.points.position(slot)), distance(position))
    }

    fn fresh_point_of(&self, pixel: u32) -> Option<usize> {
        let slot = *self.planes.slot.get(pixel as usize)? as usize;
        let is_fresh = self.points.states.get(slot)?.has(FRESH);
        // Since the last picture another pixel's point may have taken the slot.
        (is_fresh && self.points.details[slot].epoch == self.epoch && self.is_in(slot, pixel))
            .then_some(slot)
    }

    /// The colour-change test, with the noise that the renderer stated.
    fn has_changed(
        &self,
        slot: usize,
        position: [f32; 3],
        radiance: [f32; 3],
        sample: &Sample,
    ) -> bool {
        let reference = self.reference(slot);
        let largest = reference
            .iter()
            .chain(&radiance)
            .fold(0.0_f32, |largest, &channel| largest.max(channel));
        let mut variance = sample.noise * sample.noise;
        if self.points.states[slot].has(NOISY) {
            let details = &self.points.details[slot];
            // A mean of n samples has 1/n of their variance.
            variance += details.noise * details.noise / details.reference_count.max(1) as f32;
        }
        let allowed = self.params.change_threshold * largest
            + self.params.noise_deviations * variance.max(0.0).sqrt();
        let changed = radiance.iter().zip(&reference).any(|(new, old)| (new - old).abs() > allowed);
        let (old, new) = self.distances(slot, position);
        changed || (new - old).abs() > self.params.move_threshold * old
    }

    /// Mean of rays through a point.
    fn reference(&self, slot: usize) -> [f32; 3] {
        let is_refined = self.points.states[slot].has(REFINED);
        colour::decode(if is_refined {
            self.points.details[slot].reference
        } else {
            self.points.colour(slot)
        })
    }

    /// A new point in a slot. Reads nothing but the flags: what it writes is rarely in a cache, and would be waited for.
    fn put(
        &mut self,
        slot: usize,
        position: [f32; 3],
        radiance: [f32; 3],
        sample: &Sample,
        is_fresh: bool,
    ) {
        self.has_fresh |= is_fresh;
        let points = &mut self.points;
        points.set_position(slot, position);
        points.set_colour(slot, colour::encode(radiance));
        let generation = (points.states[slot].flags() & GENERATIONS).wrapping_add(GENERATION);
        points.states[slot] = State::new(0, generation | flags(sample, is_fresh));
        points.object[slot] = sample.object;
        points.details[slot] = Details {
            mean: radiance,
            count: 1,
            reference: colour::NONE,
            noise: if sample.noise.is_finite() { sample.noise.max(0.0) } else { 0.0 },
            epoch: if is_fresh { self.epoch } else { self.epoch.wrapping_sub(1) },
            reference_count: 1,
        };
    }

    /// The ray through a point found it as it was: averages it in.
    fn confirm(
        &mut self,
        slot: usize,
        position: [f32; 3],
        radiance: [f32; 3],
        sample: &Sample,
        is_current: bool,
    ) {
        let mut reference = self.reference(slot);
        let points = &mut self.points;
        let mut details = points.details[slot];
        details.reference_count = details.reference_count.min(self.params.moving_mean - 1) + 1;
        average(&mut reference, radiance, details.reference_count);
        let kept = points.states[slot].flags() & (GENERATIONS | REFINED | NOISY | HIDDEN);
        if details.epoch != self.epoch {
            details.count = details.count.min(self.params.moving_mean - 1) + 1;
            average(&mut details.mean, radiance, details.count);
            if is_current {
                // A pixel's mean needs rays all over the pixel: this one stands for its point only. It counts as the first.
                (details.epoch, details.count) = (self.epoch, 1);
            }
            points.set_colour(slot, colour::encode(details.mean));
        }
        if kept & REFINED != 0 {
            details.reference = colour::encode(reference);
        }
        points.details[slot] = details;
        let is_fresh = details.epoch == self.epoch;
        self.has_fresh |= is_fresh;
        points.states[slot] = State::new(0, kept | flags(sample, is_fresh));
        points.set_position(slot, position);
    }

    /// Another ray of the same pixel and view: the mean over them is the pixel's box filter.
    fn refine(&mut self, slot: usize, radiance: [f32; 3]) {
        let state = self.points.states[slot];
        let mut details = self.points.details[slot];
        if !state.has(REFINED) {
            details.reference = self.points.colour(slot);
        }
        details.count = details.count.min(self.params.resting_mean - 1) + 1;
        average(&mut details.mean, radiance, details.count);
        self.points.details[slot] = details;
        self.points.set_colour(slot, colour::encode(details.mean));
        self.points.states[slot] = State::new(0, state.flags() | REFINED);
    }

    /// Where one point has changed its neighbours probably have (1999, §4.1).
    fn age_neighbours(&mut self, pixel: u32, changed: usize) {
        let (width, height) = self.planes.size;
        let (column, row) = (pixel as usize % width, pixel as usize / width);
        let reach = self.params.change_reach as usize;
        for y in row.saturating_sub(reach)..(row + reach + 1).min(height) {
            for x in column.saturating_sub(reach)..(column + reach + 1).min(width) {
                let slot = self.planes.slot[y * width + x] as usize;
                if slot != changed
                    && self.points.states.get(slot).is_some_and(|state| !state.is_empty())
                {
                    self.points.age(slot, self.params.change_ageing);
                }
            }
        }
    }
}

fn flags(sample: &Sample, is_fresh: bool) -> u8 {
    let flag = |is: bool, flag: u8| if is { flag } else { 0 };
    flag(is_fresh, FRESH) | flag(sample.is_highlight, HIGHLIGHT) | flag(sample.noise > 0.0, NOISY)
}

/// Moves a mean towards the newest of `count` values.
fn average(mean: &mut [f32; 3], value: [f32; 3], count: u32) {
    let share = 1.0 / count.max(1) as f32;
    for (mean, value) in mean.iter_mut().zip(value) {
        *mean += (value - *mean) * share;
    }
}

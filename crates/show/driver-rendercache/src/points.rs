//! The points of the cache: a fixed number of slots, array by array (Walter et al. 1999, §4.3).
//!
//! Invariants:
//! - A slot is empty exactly if its age is [`EMPTY`].
//! - A sample of the current view is never evicted, and is overwritten only by another one.

use crate::colour;

/// Age of an empty slot.
pub(crate) const EMPTY: u8 = u8::MAX;

/// Least number of units of age to add at a time. Each addition visits all points.
const STEP: f64 = 8.0;

/// Number of points that are projected together. The number of slots is a multiple of it, and it is
/// a multiple of the size of a group.
pub(crate) const BLOCK: usize = 256;

/// The data of a point that only new samples use, not projection.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Details {
    /// Mean radiance.
    pub mean: [f32; 3],
    /// Samples in `mean`.
    pub count: u32,
    /// Mean radiance of the rays through the point. `mean` may be that of a whole pixel.
    pub reference: [f32; 3],
    /// Samples in `reference`.
    pub reference_count: u32,
    /// Standard deviation of one sample, as its renderer stated it.
    pub noise: f32,
    /// The number of the view of `mean`, if it is the mean of a pixel of one view.
    pub epoch: u32,
    /// The object that the last sample hit; 0 if it is unknown.
    pub object: u32,
}

impl Details {
    /// Returns the share of the pixel's own samples in its colour, 0 to 1. The rest is the smoothed
    /// colour, which has the weight of `prior` samples. Without noise the share is 1.
    pub fn own_share(&self, prior: f32) -> f32 {
        let count = self.count as f32;
        if self.noise > 0.0 { count / (count + prior) } else { 1.0 }
    }
}

/// The slots.
#[derive(Debug)]
pub(crate) struct PointSlots {
    /// x, y and z relative to the cache's origin, scene units.
    pub position: [Vec<f32>; 3],
    /// Mean radiance, packed.
    pub colour: Vec<u32>,
    pub age: Vec<u8>,
    /// True if the point is a sample of the current view.
    pub is_fresh: Vec<bool>,
    /// True if the point is likely to change soon.
    pub is_changing: Vec<bool>,
    /// Number of points that the slot has held, modulo 256. A slot is reused after tens of frames
    /// at the earliest. So only a sample that is thousands of frames late could be confused.
    pub generation: Vec<u8>,
    pub details: Vec<Details>,
    /// New points take the oldest of this many slots.
    group: usize,
    /// First slot of the next group.
    cursor: usize,
    /// Units of age that are still to be added.
    due: f64,
    /// True if some pixel shows the point. Used while points age.
    is_shown: Vec<bool>,
}

impl PointSlots {
    /// Returns empty slots. `capacity` is a multiple of [`BLOCK`].
    pub fn new(capacity: usize, group: usize) -> Self {
        Self {
            position: std::array::from_fn(|_| vec![0.0; capacity]),
            colour: vec![colour::NONE; capacity],
            age: vec![EMPTY; capacity],
            is_fresh: vec![false; capacity],
            is_changing: vec![false; capacity],
            generation: vec![0; capacity],
            details: vec![Details::default(); capacity],
            group,
            cursor: 0,
            due: 0.0,
            is_shown: vec![false; capacity + 1],
        }
    }

    /// Adds empty slots until there are `capacity`, a multiple of [`BLOCK`]. Points keep their
    /// slots.
    pub fn grow(&mut self, capacity: usize) {
        if capacity <= self.capacity() {
            return;
        }
        self.position.iter_mut().for_each(|axis| axis.resize(capacity, 0.0));
        self.colour.resize(capacity, colour::NONE);
        self.age.resize(capacity, EMPTY);
        self.is_fresh.resize(capacity, false);
        self.is_changing.resize(capacity, false);
        self.generation.resize(capacity, 0);
        self.details.resize(capacity, Details::default());
        self.is_shown.resize(capacity + 1, false);
    }

    pub fn capacity(&self) -> usize {
        self.age.len()
    }

    pub fn is_empty(&self, slot: usize) -> bool {
        self.age[slot] == EMPTY
    }

    /// Returns a point's position relative to the cache's origin.
    pub fn position(&self, slot: usize) -> [f32; 3] {
        self.position.each_ref().map(|axis| axis[slot])
    }

    pub fn set_position(&mut self, slot: usize, position: [f32; 3]) {
        for (axis, coordinate) in self.position.iter_mut().zip(position) {
            axis[slot] = coordinate;
        }
    }

    /// Returns the units of age to add after `samples` new samples: 0 until [`STEP`] are due.
    /// Points are then overwritten at age `mean_last_age` on average (2002, §3.4).
    pub fn increment(&mut self, samples: usize, mean_last_age: f64) -> u8 {
        self.due += mean_last_age * samples as f64 / self.capacity() as f64;
        let whole = if self.due < STEP { 0.0 } else { self.due.floor().min(254.0) };
        self.due = (self.due - whole).min(254.0);
        whole as u8
    }

    /// Makes points older: the `shown` ones by `by`, all others by `hidden_by`, and `changing`
    /// times as much those that are likely to change. Removes points of age `evict` and more, if an
    /// age is given.
    pub fn grow_older(
        &mut self,
        (by, hidden_by, changing): (u8, u8, u8),
        evict: Option<u8>,
        shown: impl Iterator<Item = usize>,
    ) {
        self.is_shown.fill(false);
        // One more element than slots: for pixels without a point.
        shown.for_each(|slot| self.is_shown[slot.min(self.age.len())] = true);
        let evict = evict.map_or(u16::MAX, u16::from);
        let slots = self.age.iter_mut().zip(&self.is_fresh).zip(&self.is_shown);
        for (((age, &is_fresh), &is_shown), &is_changing) in slots.zip(&self.is_changing) {
            let by = if is_shown { by } else { hidden_by };
            let factor = if is_changing { changing } else { 1 };
            let older = age.saturating_add(by.saturating_mul(factor));
            let leaves = !is_fresh & (u16::from(older) >= evict);
            *age = if leaves | (*age == EMPTY) { EMPTY } else { older.min(EMPTY - 1) };
        }
    }

    /// Adds units to a point's age. The point is removed no earlier than the next
    /// [`grow_older`](Self::grow_older).
    pub fn add_age(&mut self, slot: usize, units: u8) {
        if self.age[slot] != EMPTY {
            self.age[slot] = self.age[slot].saturating_add(units).min(EMPTY - 1);
            self.is_fresh[slot] = false;
        }
    }

    /// Removes a point.
    pub fn remove(&mut self, slot: usize) {
        (self.age[slot], self.is_fresh[slot], self.is_changing[slot]) = (EMPTY, false, false);
        self.details[slot] = Details::default();
    }

    /// Returns the slot for a new point: the oldest of the next group. Groups take turns.
    ///
    /// A sample of the current view is returned only if the next few groups hold nothing else. At
    /// rest there are nearly as many such samples as slots, and a pixel that loses its mean must
    /// start again.
    ///
    /// The slots of a group lie far apart, and the next group's slots lie beside them. So the new
    /// points of a frame lie together (docs/notes/render-cache.md).
    pub fn free_slot(&mut self) -> usize {
        let stride = self.capacity() / self.group;
        let mut slot = self.cursor;
        for _ in 0..self.group {
            let group = (self.cursor..self.capacity()).step_by(stride);
            self.cursor = (self.cursor + 1) % stride;
            let key = |&slot: &usize| (self.is_fresh[slot], EMPTY - self.age[slot]);
            slot = group.min_by_key(key).unwrap_or(slot);
            if !self.is_fresh[slot] {
                break;
            }
        }
        slot
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the ages at which points are overwritten, by frames of `samples` new points.
    fn last_ages(samples: usize, mean_last_age: f64, group: usize, hidden_ageing: u8) -> Vec<u8> {
        let mut points = PointSlots::new(2048, group);
        let mut ages = Vec::new();
        for frame in 0..20 * 2048 / samples {
            let by = points.increment(samples, mean_last_age);
            points.grow_older((by, by.saturating_mul(hidden_ageing), 1), Some(EMPTY), 0..0);
            for _ in 0..samples {
                let slot = points.free_slot();
                if frame > 4 * 2048 / samples {
                    ages.push(points.age[slot]);
                }
                points.age[slot] = 0;
            }
        }
        ages
    }

    #[test]
    fn points_are_overwritten_at_the_chosen_age_on_average() {
        for (samples, mean_last_age, group) in
            [(7, 128.0, 8), (100, 128.0, 8), (512, 128.0, 8), (100, 40.0, 2), (100, 200.0, 32)]
        {
            let ages = last_ages(samples, mean_last_age, group, 1);
            let mean = ages.iter().map(|&age| f64::from(age)).sum::<f64>() / ages.len() as f64;
            // A frame's increment is added whole, before or after a point of the frame is replaced.
            let allowed = mean_last_age * samples as f64 / 2048.0 + 1.0;
            assert!(
                (mean - mean_last_age).abs() <= allowed,
                "{samples} a frame: {mean} for {mean_last_age}"
            );
        }
    }

    #[test]
    fn hidden_points_leave_before_they_would_be_overwritten() {
        assert!(last_ages(100, 128.0, 8, 3).iter().all(|&age| age == EMPTY));
    }

    #[test]
    fn shown_points_age_more_slowly_than_hidden_ones() {
        let mut points = PointSlots::new(256, 8);
        points.age.fill(10);
        points.grow_older((1, 3, 1), None, [5, 7].into_iter());
        assert_eq!((points.age[5], points.age[6], points.age[7]), (11, 13, 11));
    }

    #[test]
    fn the_oldest_of_a_group_is_replaced_but_never_a_sample_of_the_view() {
        let mut points = PointSlots::new(256, 8);
        points.age.fill(10);
        // Group 0 is slots 0, 32, 64 and so on.
        points.age[96] = 11;
        assert_eq!(points.free_slot(), 96);
        assert_eq!(points.free_slot(), 1);
        points.age[2 + 5 * 32] = EMPTY;
        points.age[2 + 4 * 32] = EMPTY - 1;
        assert_eq!(points.free_slot(), 2 + 5 * 32);
        // Group 3 has one point of another view; group 4 has none, group 5 has only others.
        (0..8).for_each(|place| points.is_fresh[3 + place * 32] = place != 6);
        (0..8).for_each(|place| points.is_fresh[4 + place * 32] = true);
        assert_eq!(points.free_slot(), 3 + 6 * 32);
        assert_eq!(points.free_slot(), 5);
    }

    #[test]
    fn points_leave_at_the_chosen_age_but_never_those_of_the_view() {
        for evict in [Some(255), Some(60), None] {
            let mut points = PointSlots::new(512, 8);
            for slot in 0..512 {
                points.age[slot] = (slot / 2) as u8;
                // An empty slot has no sample of the view.
                points.is_fresh[slot] = slot % 2 == 1 && slot < 510;
            }
            points.grow_older((3, 3, 1), evict, 0..0);
            for slot in 0..512 {
                let (before, is_fresh) = (slot / 2, slot % 2 == 1);
                let is_gone = before == 255
                    || !is_fresh && evict.is_some_and(|evict| before + 3 >= usize::from(evict));
                let expected = if is_gone { 255 } else { (before + 3).min(254) };
                assert_eq!(
                    usize::from(points.age[slot]),
                    expected,
                    "{before} {is_fresh} {evict:?}"
                );
            }
        }
    }

    #[test]
    fn a_group_of_one_is_the_next_slot_whatever_its_age() {
        let mut points = PointSlots::new(256, 1);
        points.age.fill(10);
        points.age[7] = 200;
        let slots: Vec<_> = (0..9).map(|_| points.free_slot()).collect();
        assert_eq!(slots, (0..9).collect::<Vec<_>>());
    }
}

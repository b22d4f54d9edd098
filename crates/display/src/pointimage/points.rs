//! The cache of points: a fixed number of them, array by array, and when each leaves.
//!
//! Always true: a slot is empty exactly if its age is 255. What every frame reads lies in arrays of its own; what only a new sample
//! touches lies together, a cache line a point.

use super::colour;
use super::huge::filled;
use super::isa::Kernel;
use super::parallel;
use super::params::PointImageParams;
use super::prefetch::prefetch;

/// Flag: the point is a sample of the current view.
pub(super) const FRESH: u8 = 1;
/// Flag: the renderer expects it to change.
pub(super) const HIGHLIGHT: u8 = 2;
/// Flag: its colour is a mean over a pixel, not over rays through the point; [`Details::reference`] has that.
pub(super) const REFINED: u8 = 4;
/// Flag: the renderer stated noise.
pub(super) const NOISY: u8 = 8;
/// Lowest bit of the count of points that the slot has held, modulo 16. A slot is taken again after tens of frames at soonest: a sample
/// must be hundreds of frames late to be taken for another's, and then only brings a colour that soon changes again.
pub(super) const GENERATION: u8 = 16;
/// Bits of the count.
pub(super) const GENERATIONS: u8 = !(GENERATION - 1);
/// Age of an empty slot.
pub(super) const EVICTED: u8 = u8::MAX;
/// New points look for the oldest of this many slots (1999, §4.3).
const GROUP: usize = 8;
/// Points are aged so that they are overwritten at this age on average (2002, §3.4).
const MEAN_LAST_AGE: f64 = 128.0;

/// What only new samples touch.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(32))]
pub(super) struct Details {
    /// Mean radiance.
    pub mean: [f32; 3],
    /// Samples in `mean`.
    pub count: u32,
    /// Mean radiance of rays through the very point, packed, if the point is [`REFINED`]; else its colour is that.
    pub reference: u32,
    /// Standard deviation of one sample, as stated.
    pub noise: f32,
    /// The view that `mean` is of, if it is one view's.
    pub epoch: u32,
    /// Samples in the reference.
    pub reference_count: u32,
}

const _: () = assert!(size_of::<Details>() == 32);

/// The cache.
#[derive(Debug)]
pub(super) struct Points {
    /// x, y and z relative to the origin.
    pub position: [Vec<f32>; 3],
    /// Packed mean radiance. One entry more than points, as of `age` and `is_hidden`: what a pixel without a point shows.
    pub colour: Vec<u32>,
    pub age: Vec<u8>,
    pub flags: Vec<u8>,
    /// 1 for points outside the picture or behind others, else 0. Which pixel shows a point only pixels know.
    pub is_hidden: Vec<u8>,
    pub object: Vec<u32>,
    pub details: Vec<Details>,
    /// Where the next new point looks for a slot.
    cursor: usize,
    /// New points since it was set to 0.
    pub taken: usize,
    /// Age that is due but not a whole number.
    due: f64,
}

impl Points {
    /// `capacity` is a multiple of [`super::project::BLOCK`].
    pub fn new(capacity: usize) -> Self {
        Self {
            position: std::array::from_fn(|_| filled(0.0, capacity)),
            colour: filled(colour::NONE, capacity + 1),
            age: filled(EVICTED, capacity + 1),
            flags: filled(0, capacity),
            is_hidden: filled(1, capacity + 1),
            object: filled(0, capacity),
            details: filled(Details::default(), capacity),
            cursor: 0,
            taken: 0,
            due: 0.0,
        }
    }

    pub fn capacity(&self) -> usize {
        self.flags.len()
    }

    /// Age by which a frame with `samples` new samples makes points older.
    pub fn increment(&mut self, samples: usize) -> u8 {
        self.due += MEAN_LAST_AGE * samples as f64 / self.capacity() as f64;
        let whole = self.due.floor().min(254.0);
        self.due = (self.due - whole).min(254.0);
        whole as u8
    }

    /// The oldest of the next group of slots, round robin.
    ///
    /// A group's slots lie far apart, and the next group's beside them: so a frame's new points, which come tile by tile, lie
    /// together, and are found together in every later frame. With groups of neighbours the z-buffer took 2.5 times as long.
    ///
    /// Samples of the current view are passed over if their group, or one of the next, has something else, however young: at rest
    /// there are nearly as many of them as slots, and a pixel that loses its mean begins anew.
    pub fn free_slot(&mut self) -> usize {
        let mut slot = self.cursor;
        for _ in 0..GROUP {
            slot = self.oldest_of_group();
            if self.is_of_view(slot) {
                // Rarely so while the view moves: only then are flags looked at.
                match self.oldest_not_of_view() {
                    Some(other) => slot = other,
                    None => {
                        self.next_group();
                        continue;
                    }
                }
            }
            break;
        }
        self.next_group();
        slot
    }

    /// Whether a slot holds a sample of the current view.
    pub fn is_of_view(&self, slot: usize) -> bool {
        self.flags[slot] & FRESH != 0 && self.age[slot] != EVICTED
    }

    /// The slots of the group at the cursor.
    fn group(&self) -> impl Iterator<Item = usize> {
        (self.cursor..self.capacity()).step_by(self.capacity() / GROUP)
    }

    /// The oldest of the group at the cursor. Of equals the first; an empty slot is the oldest.
    fn oldest_of_group(&self) -> usize {
        // Age first, then the place in the group: no branch, since which is older cannot be guessed.
        let key = |(slot, place): (usize, usize)| usize::from(self.age[slot]) * GROUP + place;
        let oldest = self.group().zip((0..GROUP).rev()).map(key).fold(0, usize::max);
        self.cursor + (GROUP - 1 - oldest % GROUP) * (self.capacity() / GROUP)
    }

    /// The same of those that are not samples of the current view.
    fn oldest_not_of_view(&self) -> Option<usize> {
        let mut oldest = None;
        for candidate in self.group().filter(|&slot| !self.is_of_view(slot)) {
            if oldest.is_none_or(|oldest: usize| self.age[candidate] > self.age[oldest]) {
                oldest = Some(candidate);
            }
        }
        oldest
    }

    fn next_group(&mut self) {
        self.cursor = if self.cursor + 1 < self.capacity() / GROUP { self.cursor + 1 } else { 0 };
    }

    /// Asks for points that will be needed: they lie anywhere, and one after another each would wait for memory.
    pub fn prefetch(&self, slots: impl Iterator<Item = u32>) {
        for slot in slots.map(|slot| slot as usize).filter(|&slot| slot < self.capacity()) {
            self.position.iter().for_each(|axis| prefetch(&axis[slot]));
            prefetch(&self.colour[slot]);
            prefetch(&self.age[slot]);
            prefetch(&self.flags[slot]);
            prefetch(&self.details[slot]);
        }
    }

    /// Asks for what a request for a point needs.
    pub fn prefetch_places(&self, slots: impl Iterator<Item = u32>) {
        for slot in slots.map(|slot| slot as usize).filter(|&slot| slot < self.capacity()) {
            self.position.iter().for_each(|axis| prefetch(&axis[slot]));
            prefetch(&self.flags[slot]);
        }
    }

    /// Makes a point older; the next frame's ageing may evict it.
    pub fn age(&mut self, slot: usize, by: u8) {
        self.age[slot] = self.age[slot].saturating_add(by).min(EVICTED - 1);
        self.flags[slot] &= !FRESH;
    }
}

/// A frame's ageing. Hidden points and highlights age faster; samples of the current view never leave.
pub(super) struct Age<'a> {
    pub age: &'a mut [u8],
    pub flags: &'a mut [u8],
    pub is_hidden: &'a [u8],
    /// Age of visible, of hidden, of likely to change points.
    pub increments: [u8; 3],
    /// Oldest age of a point that may not leave.
    pub evict: bool,
    /// The view is another: nothing is a sample of it.
    pub moved: bool,
}

impl<'a> Age<'a> {
    pub fn new(points: &'a mut Points, increment: u8, moved: bool, params: &PointImageParams) -> Self {
        let increments =
            [1, params.hidden_ageing, params.highlight_ageing].map(|times| increment.saturating_mul(times));
        let Points { age, flags, is_hidden, .. } = points;
        Self { age, flags, is_hidden, increments, evict: params.stages.eviction, moved }
    }

    /// One for each range of slots.
    pub fn split(self, ranges: &[std::ops::Range<usize>]) -> Vec<Self> {
        let Self { age, flags, is_hidden, increments, evict, moved } = self;
        let ages = parallel::cut(age, ranges.iter().map(|range| range.len()));
        let flags = parallel::cut(flags, ranges.iter().map(|range| range.len()));
        let parts = ranges.iter().zip(ages).zip(flags);
        let part = |((range, age), flags): ((&std::ops::Range<usize>, &'a mut [u8]), &'a mut [u8])| Self {
            age,
            flags,
            is_hidden: &is_hidden[range.clone()],
            increments,
            evict,
            moved,
        };
        parts.map(part).collect()
    }
}

impl Kernel for Age<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { age, flags, is_hidden, increments: [visible, hidden, highlight], evict, moved } = self;
        let keep = if moved { !FRESH } else { u8::MAX };
        let oldest = if evict { EVICTED } else { EVICTED - 1 };
        age_all(age, flags, is_hidden, [visible, hidden.max(visible), highlight.max(visible)], keep, oldest);
    }
}

#[inline(always)]
fn age_all(
    age: &mut [u8],
    flags: &mut [u8],
    is_hidden: &[u8],
    [visible, hidden, highlight]: [u8; 3],
    keep: u8,
    oldest: u8,
) {
    for ((age, flags), is_hidden) in age.iter_mut().zip(flags).zip(is_hidden) {
        *flags &= keep;
        let by = if *is_hidden != 0 { hidden } else { visible };
        let by = by.max(if *flags & HIGHLIGHT != 0 { highlight } else { 0 });
        let limit = if *flags & FRESH != 0 { EVICTED - 1 } else { oldest };
        let older = age.saturating_add(by).min(limit);
        *age = if *age == EVICTED { EVICTED } else { older };
    }
}

#[cfg(test)]
mod tests {
    use super::super::isa::{Instructions, Isa};
    use super::*;

    /// Ages at which points are overwritten, by frames of `samples` new points.
    fn last_ages(samples: usize, hidden: bool) -> Vec<u8> {
        let mut points = Points::new(2048);
        points.is_hidden.fill(u8::from(hidden));
        let isa = Isa::new(Instructions::Portable).unwrap();
        let mut ages = Vec::new();
        for frame in 0..20 * 2048 / samples {
            let increment = points.increment(samples);
            isa.run(Age::new(&mut points, increment, true, &PointImageParams::default()));
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
    fn points_are_overwritten_at_age_128_on_average() {
        for samples in [7, 100, 512] {
            let ages = last_ages(samples, false);
            let mean = ages.iter().map(|&age| f64::from(age)).sum::<f64>() / ages.len() as f64;
            // A frame's increment is added whole, before or after a point of the frame is replaced.
            assert!((mean - 128.0).abs() <= 128.0 * samples as f64 / 2048.0 + 1.0, "{samples} a frame: {mean}");
        }
    }

    #[test]
    fn hidden_points_leave_before_they_would_be_overwritten() {
        assert!(last_ages(100, true).iter().all(|&age| age == EVICTED));
    }

    #[test]
    fn the_oldest_of_a_group_is_replaced() {
        let mut points = Points::new(256);
        points.age.fill(10);
        // Group 0 is slots 0, 32, 64 and so on.
        points.age[96] = 11;
        assert_eq!(points.free_slot(), 96);
        assert_eq!(points.free_slot(), 1);
        points.age[2 + 5 * 32] = EVICTED;
        points.age[2 + 4 * 32] = EVICTED - 1;
        assert_eq!(points.free_slot(), 2 + 5 * 32);
    }
}

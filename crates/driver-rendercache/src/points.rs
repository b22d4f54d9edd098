//! The cache of points: a fixed number of them, array by array, and when each leaves.
//!
//! Always true: a slot is empty exactly if its age is 255. What every frame reads lies in arrays of its own; what only a new sample
//! touches lies together, a cache line a point.

use super::colour;
use super::params::PointImageParams;
use super::project::BLOCK;
use holo_cpu::Kernel;
use holo_cpu::filled;
use holo_cpu::{prefetch, prefetch_at};

/// Flag: the point is a sample of the current view.
pub(super) const FRESH: u8 = 1;
/// Flag: the renderer expects it to change.
pub(super) const HIGHLIGHT: u8 = 2;
/// Flag: its colour is a mean over a pixel, not over rays through the point; [`Details::reference`] has that.
pub(super) const REFINED: u8 = 4;
/// Flag: the renderer stated noise.
pub(super) const NOISY: u8 = 8;
/// Flag: the point is outside the picture or behind others. Which pixel shows a point only pixels know.
pub(super) const HIDDEN: u8 = 16;
/// Lowest bit of the count of points that the slot has held, modulo 8. A slot is taken again after tens of frames at soonest: a sample
/// must be hundreds of frames late to be taken for another's, and then only brings a colour that soon changes again.
pub(super) const GENERATION: u8 = 32;
/// Bits of the count.
pub(super) const GENERATIONS: u8 = !(GENERATION - 1);
/// Age of an empty slot.
pub(super) const EVICTED: u8 = u8::MAX;
/// Slots of a group in the papers: loops over it are compiled for it.
const USUAL_GROUP: usize = 8;
/// Numbers of a [`Block`]'s arrays, and of planes, in a cache line.
pub(super) const LINE: usize = 64 / size_of::<f32>();

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

/// What projection reads of [`BLOCK`] points, array by array: a page of memory. Points one after another instead, 16 bytes each, made one
/// line for a sample to wait for instead of four, and projection a quarter slower.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(super) struct Block {
    /// x, y and z relative to the origin.
    pub position: [[f32; BLOCK]; 3],
    /// Packed mean radiance.
    pub colour: [u32; BLOCK],
}

impl Block {
    /// Asks for the positions of a block that will be read: processors on their own do not look beyond a page of memory.
    #[inline(always)]
    pub fn prefetch(blocks: &[Self], index: usize) {
        if let Some(block) = blocks.get(index) {
            for axis in &block.position {
                axis.as_chunks::<LINE>().0.iter().for_each(prefetch);
            }
        }
    }
}

impl Default for Block {
    fn default() -> Self {
        Self { position: [[0.0; BLOCK]; 3], colour: [colour::NONE; BLOCK] }
    }
}

/// Age in the low byte, flags in the high one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub(super) struct State(pub u16);

impl State {
    #[inline(always)]
    pub fn new(age: u8, flags: u8) -> Self {
        Self(u16::from(age) | u16::from(flags) << 8)
    }

    #[inline(always)]
    pub fn age(self) -> u8 {
        self.0 as u8
    }

    #[inline(always)]
    pub fn flags(self) -> u8 {
        (self.0 >> 8) as u8
    }

    /// Whether a flag is set.
    #[inline(always)]
    pub fn has(self, flag: u8) -> bool {
        self.flags() & flag != 0
    }

    #[inline(always)]
    pub fn is_empty(self) -> bool {
        self.age() == EVICTED
    }

    pub fn set_age(&mut self, age: u8) {
        *self = Self::new(age, self.flags());
    }

    pub fn set_flags(&mut self, flags: u8) {
        *self = Self::new(self.age(), flags);
    }
}

/// The cache.
#[derive(Debug)]
pub(super) struct Points {
    pub blocks: Vec<Block>,
    pub states: Vec<State>,
    pub object: Vec<u32>,
    pub details: Vec<Details>,
    /// New points look for the oldest of this many slots (1999, §4.3).
    group: usize,
    /// Where the next new point looks for a slot.
    cursor: usize,
    /// New points since it was set to 0.
    pub taken: usize,
    /// Age that is due but not a whole number.
    due: f64,
}

impl Points {
    /// `capacity` is a multiple of [`BLOCK`], that of `group`.
    pub fn new(capacity: usize, group: usize) -> Self {
        Self {
            group,
            blocks: filled(Block::default(), capacity / BLOCK),
            states: filled(State::new(EVICTED, HIDDEN), capacity),
            object: filled(0, capacity),
            details: filled(Details::default(), capacity),
            cursor: 0,
            taken: 0,
            due: 0.0,
        }
    }

    pub fn capacity(&self) -> usize {
        self.states.len()
    }

    /// Relative to the origin.
    #[inline(always)]
    pub fn position(&self, slot: usize) -> [f32; 3] {
        self.blocks[slot / BLOCK].position.each_ref().map(|axis| axis[slot % BLOCK])
    }

    #[inline(always)]
    pub fn set_position(&mut self, slot: usize, position: [f32; 3]) {
        for (axis, coordinate) in self.blocks[slot / BLOCK].position.iter_mut().zip(position) {
            axis[slot % BLOCK] = coordinate;
        }
    }

    #[inline(always)]
    pub fn colour(&self, slot: usize) -> u32 {
        self.blocks[slot / BLOCK].colour[slot % BLOCK]
    }

    #[inline(always)]
    pub fn set_colour(&mut self, slot: usize, colour: u32) {
        self.blocks[slot / BLOCK].colour[slot % BLOCK] = colour;
    }

    /// Age by which a frame with `samples` new samples makes points older, so that they are overwritten at `mean_last_age` on average
    /// (2002, §3.4).
    pub fn increment(&mut self, samples: usize, mean_last_age: f64) -> u8 {
        self.due += mean_last_age * samples as f64 / self.capacity() as f64;
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
        for _ in 0..self.group {
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
        let state = self.states[slot];
        state.has(FRESH) && !state.is_empty()
    }

    /// The slots of the group at the cursor.
    fn group(&self) -> impl Iterator<Item = usize> {
        (self.cursor..self.capacity()).step_by(self.capacity() / self.group)
    }

    /// The oldest of the group at the cursor. Of equals the first; an empty slot is the oldest.
    fn oldest_of_group(&self) -> usize {
        self.oldest_at(self.cursor)
    }

    /// The oldest of the group at `cursor`.
    fn oldest_at(&self, cursor: usize) -> usize {
        match self.group {
            USUAL_GROUP => self.oldest_of(cursor, USUAL_GROUP),
            other => self.oldest_of(cursor, other),
        }
    }

    /// The oldest of `group` slots from `cursor` on.
    #[inline(always)]
    fn oldest_of(&self, cursor: usize, group: usize) -> usize {
        let stride = self.capacity() / group;
        // Age first, then the place in the group: no branch, since which is older cannot be guessed.
        let mut oldest = 0;
        for place in 0..group {
            let age = usize::from(self.states[cursor + place * stride].age());
            oldest = oldest.max(age * group + (group - 1 - place));
        }
        cursor + (group - 1 - oldest % group) * stride
    }

    /// The same of those that are not samples of the current view.
    fn oldest_not_of_view(&self) -> Option<usize> {
        let mut oldest = None;
        for candidate in self.group().filter(|&slot| !self.is_of_view(slot)) {
            if oldest.is_none_or(|oldest: usize| {
                self.states[candidate].age() > self.states[oldest].age()
            }) {
                oldest = Some(candidate);
            }
        }
        oldest
    }

    fn next_group(&mut self) {
        self.cursor =
            if self.cursor + 1 < self.capacity() / self.group { self.cursor + 1 } else { 0 };
    }

    /// Asks for points that will be needed: they lie anywhere, and one after another each would wait for memory.
    pub fn prefetch(&self, slot: u32) {
        self.prefetch_place(slot);
        prefetch_at(&self.details, slot as usize);
    }

    /// Asks for what a request for a point needs.
    pub fn prefetch_place(&self, slot: u32) {
        let slot = slot as usize;
        prefetch_at(&self.states, slot);
        if let Some(block) = self.blocks.get(slot / BLOCK) {
            block.position.iter().for_each(|axis| prefetch(&axis[slot % BLOCK]));
            prefetch(&block.colour[slot % BLOCK]);
        }
    }

    /// Asks for the slot that the `ahead`-th new point from now on will probably take.
    pub fn prefetch_free(&self, ahead: usize) {
        let cursor = self.cursor + ahead;
        if cursor < self.capacity() / self.group {
            let slot = self.oldest_at(cursor);
            self.prefetch(slot as u32);
            prefetch_at(&self.object, slot);
        }
    }

    /// Makes a point older; the next frame's ageing may evict it.
    pub fn age(&mut self, slot: usize, by: u8) {
        let state = self.states[slot];
        self.states[slot] =
            State::new(state.age().saturating_add(by).min(EVICTED - 1), state.flags() & !FRESH);
    }
}

/// A frame's ageing. Hidden points and highlights age faster; samples of the current view never leave.
pub(super) struct Age<'a> {
    pub states: &'a mut [State],
    /// Age of visible, of hidden, of likely to change points.
    pub increments: [u8; 3],
    /// Age at which points leave; `None`: never.
    pub evict: Option<u8>,
    /// The view is another: nothing is a sample of it.
    pub moved: bool,
}

impl<'a> Age<'a> {
    pub fn new(
        states: &'a mut [State],
        increment: u8,
        moved: bool,
        params: &PointImageParams,
    ) -> Self {
        let increments = [1, params.hidden_ageing, params.highlight_ageing]
            .map(|times| increment.saturating_mul(times));
        Self {
            states,
            increments,
            evict: params.stages.eviction.then_some(params.eviction_age),
            moved,
        }
    }
}

impl Kernel for Age<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { states, increments: [visible, hidden, highlight], evict, moved } = self;
        let keep = if moved { !FRESH } else { u8::MAX };
        let increments = [visible, hidden.max(visible), highlight.max(visible)];
        match evict {
            // As in the paper, without a comparison more for each point: it took a tenth of the stage's time.
            Some(EVICTED) => age_all(states, increments, keep, EVICTED),
            None => age_all(states, increments, keep, EVICTED - 1),
            Some(leaving) => {
                age_all(states, increments, keep, EVICTED);
                evict_all(states, leaving);
            }
        }
    }
}

/// Makes points older, `oldest` at the most; those of the view stay.
#[inline(always)]
fn age_all(states: &mut [State], increments: [u8; 3], keep: u8, oldest: u8) {
    // In numbers of 16 bits throughout, of which ages fill a part: as many fit into a register as there are states.
    let [visible, hidden, highlight] = increments.map(u16::from);
    let [keep, oldest, evicted] = [keep, oldest, EVICTED].map(u16::from);
    let [fresh, is_hidden, is_highlight] =
        [FRESH, HIDDEN, HIGHLIGHT].map(|flag| u16::from(flag) << 8);
    for state in states {
        let age = state.0 & 255;
        let flags = state.0 & (keep << 8);
        let by = if flags & is_hidden != 0 { hidden } else { visible };
        let by = by.max(if flags & is_highlight != 0 { highlight } else { 0 });
        let limit = if flags & fresh != 0 { evicted - 1 } else { oldest };
        let older = (age + by).min(limit);
        state.0 = flags | if age == evicted { evicted } else { older };
    }
}

/// Has points leave from an age on, but those of the view.
#[inline(always)]
fn evict_all(states: &mut [State], leaving: u8) {
    let (leaving, evicted, fresh) = (u16::from(leaving), u16::from(EVICTED), u16::from(FRESH) << 8);
    for state in states {
        let is_gone = (state.0 & 255 >= leaving) & (state.0 & fresh == 0);
        state.0 |= if is_gone { evicted } else { 0 };
    }
}

#[cfg(test)]
mod tests {
    use super::super::params::Stages;
    use super::*;
    use holo_cpu::{Instructions, Isa};

    /// Ages at which points are overwritten, by frames of `samples` new points.
    fn last_ages(samples: usize, hidden: bool, params: &PointImageParams) -> Vec<u8> {
        let mut points = Points::new(2048, params.group as usize);
        points.states.fill(State::new(EVICTED, if hidden { HIDDEN } else { 0 }));
        let isa = Isa::new(Instructions::Portable).unwrap();
        let mut ages = Vec::new();
        for frame in 0..20 * 2048 / samples {
            let increment = points.increment(samples, params.mean_last_age);
            isa.run(Age::new(&mut points.states, increment, true, params));
            for _ in 0..samples {
                let slot = points.free_slot();
                if frame > 4 * 2048 / samples {
                    ages.push(points.states[slot].age());
                }
                points.states[slot].set_age(0);
            }
        }
        ages
    }

    #[test]
    fn points_are_overwritten_at_age_128_or_another_on_average() {
        for (samples, mean_last_age, group) in
            [(7, 128.0, 8), (100, 128.0, 8), (512, 128.0, 8), (100, 40.0, 2), (100, 200.0, 32)]
        {
            let params = PointImageParams { mean_last_age, group, ..PointImageParams::default() };
            let ages = last_ages(samples, false, &params);
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
        assert!(
            last_ages(100, true, &PointImageParams::default()).iter().all(|&age| age == EVICTED)
        );
    }

    #[test]
    fn the_oldest_of_a_group_is_replaced() {
        let mut points = Points::new(256, 8);
        points.states.fill(State::new(10, 0));
        // Group 0 is slots 0, 32, 64 and so on.
        points.states[96].set_age(11);
        assert_eq!(points.free_slot(), 96);
        assert_eq!(points.free_slot(), 1);
        points.states[2 + 5 * 32].set_age(EVICTED);
        points.states[2 + 4 * 32].set_age(EVICTED - 1);
        assert_eq!(points.free_slot(), 2 + 5 * 32);
    }

    #[test]
    fn points_leave_at_the_age_that_was_chosen_but_never_those_of_the_view() {
        let isa = Isa::new(Instructions::Portable).unwrap();
        for (eviction_age, eviction) in [(255, true), (60, true), (60, false)] {
            let stages = Stages { eviction, ..Stages::ALL };
            let params = PointImageParams { eviction_age, stages, ..PointImageParams::default() };
            let mut states: Vec<_> = (0..=u8::MAX)
                .flat_map(|age| [State::new(age, 0), State::new(age, FRESH)])
                .collect();
            isa.run(Age::new(&mut states, 3, false, &params));
            for (index, state) in states.iter().enumerate() {
                let (before, is_fresh) = (index / 2, index % 2 == 1);
                let is_gone =
                    before == 255 || (before + 3 >= eviction_age.into() && eviction && !is_fresh);
                let expected = if is_gone { 255 } else { (before + 3).min(254) };
                assert_eq!(
                    usize::from(state.age()),
                    expected,
                    "{before} {is_fresh} {eviction_age} {eviction}"
                );
            }
        }
    }

    #[test]
    fn a_group_of_one_is_the_next_slot_whatever_its_age() {
        let mut points = Points::new(256, 1);
        points.states.fill(State::new(10, 0));
        points.states[7].set_age(200);
        assert_eq!(
            (0..9).map(|_| points.free_slot()).collect::<Vec<_>>(),
            (0..9).collect::<Vec<_>>()
        );
    }
}

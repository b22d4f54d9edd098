//! What an application knows and a cache cannot (Walter et al. 1999, §4.2): things that moved, things that will have changed.

use super::PointImage;
use super::points::{EVICTED, FRESH, State};
use glam::{DAffine3, DVec3};

impl PointImage {
    /// Moves all points of an object, in scene units. Points that get a number that is not finite leave. How many moved.
    pub fn move_object(&mut self, object: u32, motion: &DAffine3) -> usize {
        let mut moved = 0;
        for slot in 0..self.points.capacity() {
            let state = self.points.states[slot];
            if self.points.object[slot] != object || state.is_empty() {
                continue;
            }
            let position = motion.transform_point3(self.position(slot)) - self.origin;
            let position = position.to_array().map(|coordinate| coordinate as f32);
            if position.iter().all(|coordinate| coordinate.is_finite()) {
                self.points.set_position(slot, position);
                self.points.states[slot].set_flags(state.flags() & !FRESH);
            } else {
                self.points.states[slot].set_age(EVICTED);
            }
            moved += 1;
        }
        self.is_dirty |= moved > 0;
        moved
    }

    /// Makes all points of an object older by `units`, so that they are asked for again sooner; at 255 they leave. How many did age.
    pub fn age_object(&mut self, object: u32, units: u8) -> usize {
        self.age_where(units, |its, _| its == object)
    }

    /// Makes points older that `choose` picks by their object and position: those in a moved thing's shadow, say. How many.
    pub fn age_where(&mut self, units: u8, mut choose: impl FnMut(u32, DVec3) -> bool) -> usize {
        let mut aged = 0;
        for slot in 0..self.points.capacity() {
            let state = self.points.states[slot];
            if !state.is_empty() && choose(self.points.object[slot], self.position(slot)) {
                self.points.states[slot] =
                    State::new(state.age().saturating_add(units), state.flags() & !FRESH);
                aged += 1;
            }
        }
        self.is_dirty |= aged > 0;
        self.is_hinted |= aged > 0;
        aged
    }

    fn position(&self, slot: usize) -> DVec3 {
        DVec3::from(self.points.position(slot).map(f64::from)) + self.origin
    }
}

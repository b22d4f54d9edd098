//! Hints to the cache about points (Walter et al. 1999, §4.2): objects that move, and places that
//! are likely to change.
//!
//! Invariant: a hint moves, ages and removes points. It makes none, and changes no colour.

use glam::{DAffine3, DMat3, DVec3};
use holo_display::ObjectMotion;

use crate::cache::Stale;
use crate::{PointImage, PointImageError};

/// Largest difference of a rigid transform's matrix from one that keeps all lengths.
const RIGID: f64 = 1e-6;

/// Number of the object that [`PointImage::follow`] moves. Renderers may not use it.
const FOLLOWED: u32 = u32::MAX;

/// An object's light and shadow change within so many of its radii.
const SHADOW: f64 = 2.0;

impl PointImage {
    /// Moves the points of an object by a rigid transform of the scene, because the object has
    /// moved. Returns the number of points.
    ///
    /// `object` is a [`RayResult::object`](crate::RayResult::object). The points around those that
    /// moved, where these were and where they are, grow older: the object may have covered them, or
    /// its shadow. The points that moved are likely to change again soon.
    ///
    /// # Errors
    /// If the transform is not rigid or not finite. No point is moved then.
    pub fn move_object(
        &mut self,
        object: u32,
        motion: &DAffine3,
    ) -> Result<usize, PointImageError> {
        let turn = motion.matrix3;
        let difference = turn * turn.transpose() - DMat3::IDENTITY;
        let is_rigid = motion.is_finite()
            && difference.to_cols_array().iter().all(|part| part.abs() <= RIGID)
            && turn.determinant() > 0.0;
        if !is_rigid {
            return Err(PointImageError::NotRigid);
        }
        let slots: Vec<usize> = (0..self.points.capacity())
            .filter(|&slot| {
                object != 0
                    && !self.points.is_empty(slot)
                    && self.points.details[slot].object == object
            })
            .collect();
        // What is shown around them: where they were, and below where they are.
        let mut around: Vec<usize> = slots.iter().flat_map(|&slot| self.around(slot)).collect();
        for &slot in &slots {
            let after = motion.transform_point3(self.place(slot)) - self.origin;
            self.points.set_position(slot, after.as_vec3().to_array());
            self.points.is_fresh[slot] = false;
            self.points.is_changing[slot] = true;
        }
        around.extend(slots.iter().flat_map(|&slot| self.around(slot)));
        around.sort_unstable();
        around.dedup();
        around.retain(|&slot| self.points.details[slot].object != object);
        for slot in around {
            self.points.add_age(slot, self.params.change_ageing);
        }
        if !slots.is_empty() {
            self.stale = Stale::Projection;
        }
        Ok(slots.len())
    }

    /// Moves the points of objects that have moved meanwhile, and removes those of objects that are
    /// gone or have another size. What is around these objects is likely to change. If none has
    /// moved, the scene has changed in another way, and everything is.
    pub(crate) fn follow(&mut self, motions: &[ObjectMotion]) {
        let share = self.planes.point_count() as f64 / self.planes.colour.len() as f64;
        self.share_before_hole = if motions.is_empty() { 0.0 } else { share };
        for motion in motions {
            self.number_followed(&*motion.lay_on);
            let moved = motion.to_now.map(|to_now| self.move_object(FOLLOWED, &to_now));
            if !matches!(moved, Some(Ok(_))) {
                self.remove_object(FOLLOWED);
            }
            self.number_followed(&|_| false);
            for (centre, radius) in std::iter::once(motion.sphere).chain(motion.sphere_now()) {
                self.expect_changes(centre, SHADOW * radius);
            }
        }
        if motions.is_empty() {
            self.points.is_changing.fill(true);
        }
        self.stale = Stale::Projection;
    }

    /// Gives the points that lie on an object the number [`FOLLOWED`], and takes it from others.
    fn number_followed(&mut self, lies_on: &dyn Fn(DVec3) -> bool) {
        for slot in 0..self.points.capacity() {
            let is_of_it = !self.points.is_empty(slot) && lies_on(self.place(slot));
            let number = &mut self.points.details[slot].object;
            if is_of_it {
                *number = FOLLOWED;
            } else if *number == FOLLOWED {
                *number = 0;
            }
        }
    }

    fn remove_object(&mut self, object: u32) {
        for slot in 0..self.points.capacity() {
            if self.points.details[slot].object == object {
                self.points.remove(slot);
            }
        }
    }

    /// Returns a point's place in the scene.
    fn place(&self, slot: usize) -> DVec3 {
        DVec3::from(self.points.position(slot).map(f64::from)) + self.origin
    }

    /// Marks the points within a sphere of the scene as likely to change, such as those in the old
    /// and in the new shadow of an object. They age faster until samples confirm them. Returns
    /// their number.
    pub fn expect_changes(&mut self, centre: DVec3, radius: f64) -> usize {
        let mut count = 0;
        for slot in 0..self.points.capacity() {
            if !self.points.is_empty(slot) && self.place(slot).distance(centre) <= radius {
                self.points.is_changing[slot] = true;
                self.points.add_age(slot, self.params.change_ageing);
                count += 1;
            }
        }
        count
    }

    /// Returns the points that the current view shows at a point and around it, as far as a change
    /// of colour reaches.
    fn around(&self, slot: usize) -> Vec<usize> {
        let Some(map) = &self.map else { return Vec::new() };
        let [column, row, depth] = map.project(self.points.position(slot));
        let (width, height) = (self.planes.width, self.planes.height);
        let is_in = (0.0..width as f32).contains(&column) && (0.0..height as f32).contains(&row);
        if depth <= 0.0 || !is_in {
            return Vec::new();
        }
        let reach = self.params.change_reach as usize;
        let near = |at: f32, end: usize| {
            (at as usize).saturating_sub(reach)..(at as usize + reach + 1).min(end)
        };
        let pixels = near(row, height).flat_map(|row| near(column, width).map(move |c| (row, c)));
        let shown = pixels.map(|(row, column)| self.planes.slot[row * width + column] as usize);
        shown.filter(|&slot| slot < self.points.capacity()).collect()
    }
}

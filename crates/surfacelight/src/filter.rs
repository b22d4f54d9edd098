//! Looks up.

use crate::cell::{LEVELS, Place, Sums, brightest};
use crate::store::Store;
use crate::view::{Seen, View};

impl View<'_> {
    /// Sums of the cell of a surface point on a level.
    #[must_use]
    pub fn sums(&self, store: &Store, seen: &Seen, level: usize) -> Option<Sums> {
        if !seen.is_surface() {
            return None;
        }
        let place = Place::new(seen.point, store.finest());
        store.get(self.face(seen).key(place, level.min(LEVELS - 1))).copied()
    }

    /// Sums of the first level on which a surface point has so many samples.
    #[must_use]
    pub fn first_with(&self, store: &Store, seen: &Seen, samples: u32) -> Option<Sums> {
        if !seen.is_surface() {
            return None;
        }
        let place = Place::new(seen.point, store.finest());
        let face = self.face(seen);
        let mut sums = (0..LEVELS).filter_map(|level| store.get(face.key(place, level)));
        sums.find(|sums| sums.count >= samples).copied()
    }
}

/// Luminance and light of the brightest sample, in fixed-point steps.
#[must_use]
pub fn brightest_of(sums: &Sums) -> (f32, [f32; 3]) {
    brightest(sums.brightest)
}

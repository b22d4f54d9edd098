//! Where the mirrors and the solid glass of a room are in a view, for frames of moving objects.

use std::sync::atomic::{AtomicU8, Ordering};

use holo_picture::View;

use crate::room::Room;

/// Side of a block, pixels. Mirrors that fit between the middles of blocks show no moving object.
const BLOCK: u32 = 4;

const UNKNOWN: u8 = 0;
const MIRROR: u8 = 1;
const NO_MIRROR: u8 = 2;

/// Which blocks of a view's pixels show a mirror. A block is looked at once, when it is asked for:
/// objects do not change it.
pub(super) struct MirrorMap {
    view: View,
    size: (u32, u32),
    blocks: Vec<AtomicU8>,
}

impl MirrorMap {
    pub(super) fn new(view: &View, size: (u32, u32)) -> MirrorMap {
        let count = size.0.div_ceil(BLOCK) as usize * size.1.div_ceil(BLOCK) as usize;
        let blocks = (0..count).map(|_| AtomicU8::new(UNKNOWN)).collect();
        MirrorMap { view: *view, size, blocks }
    }

    /// Returns whether it is that of a view.
    pub(super) fn is_of(&self, view: &View, size: (u32, u32)) -> bool {
        self.view == *view && self.size == size
    }

    /// Returns whether the block of a pixel shows a mirror.
    pub(super) fn has_mirror(&self, room: &Room, (column, row): (u32, u32)) -> bool {
        let place = (column / BLOCK, row / BLOCK);
        let block = &self.blocks[(place.1 * self.size.0.div_ceil(BLOCK) + place.0) as usize];
        // Threads that ask at the same time find the same.
        let known = block.load(Ordering::Relaxed);
        if known != UNKNOWN {
            return known == MIRROR;
        }
        let middle = |block: u32, most: u32| (block * BLOCK + BLOCK / 2).min(most - 1);
        let (column, row) = (middle(place.0, self.size.0), middle(place.1, self.size.1));
        let (x, y) = View::pixel_centre(self.size, column, row);
        let hit = self.view.clipped_ray(x, y);
        let hit = hit.and_then(|(origin, direction, _)| room.nearest(origin, direction));
        let is_mirror = hit.is_some_and(|(hit, _)| room.is_mirror(&hit));
        block.store(if is_mirror { MIRROR } else { NO_MIRROR }, Ordering::Relaxed);
        is_mirror
    }
}

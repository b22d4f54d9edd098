//! Points that a renderer of the render cache leaves to the next one. A session that follows another
//! makes a new driver, and goes on with the points that are known of the scene.
//!
//! Invariant: points are taken only by a driver of the scene that they were left for, once.

use std::sync::Arc;

use holo_display::ObjectMotion;
use holo_picture::View;
use parking_lot::{Mutex, MutexGuard};

use crate::PointImage;

/// Most motions of objects that are remembered. Earlier samples of the scene are moved along with
/// them, and after so many generations none is left.
const MOST_MOTIONS: usize = 64;

/// The points that one renderer leaves to the next, and the motions of objects meanwhile.
#[derive(Clone, Debug, Default)]
pub struct PointMemory(Arc<Mutex<SceneMemory>>);

#[derive(Debug, Default)]
struct SceneMemory {
    left: Option<LeftPoints>,
    /// True if the next renderer takes what is left.
    is_wanted: bool,
    motions: Vec<ObjectMotion>,
    /// Number of all motions so far. `motions` are the last ones of them.
    count: usize,
}

/// Points of a renderer that is gone.
#[derive(Debug)]
pub(crate) struct LeftPoints {
    pub cache: PointImage,
    /// Its last view.
    pub view: View,
    /// Number of motions that the points have followed.
    pub followed: usize,
}

impl PointMemory {
    /// Lets the next driver go on with the points of the last one, in a scene in which objects have
    /// moved so.
    pub fn go_on(&self, motions: &[ObjectMotion]) {
        let memory = &mut *self.lock();
        memory.is_wanted = true;
        memory.motions.extend_from_slice(motions);
        memory.count += motions.len();
        let surplus = memory.motions.len().saturating_sub(MOST_MOTIONS);
        memory.motions.drain(..surplus);
    }

    /// Forgets the points, because the next driver begins with none.
    pub fn forget(&self) {
        let memory = &mut *self.lock();
        (memory.left, memory.is_wanted) = (None, false);
    }

    /// Returns the motions so far, and their number.
    pub(crate) fn motions(&self) -> (Vec<ObjectMotion>, usize) {
        let memory = self.lock();
        (memory.motions.clone(), memory.count)
    }

    /// Leaves points to the next renderer.
    pub(crate) fn leave(&self, points: LeftPoints) {
        self.lock().left = Some(points);
    }

    /// Takes the points that were left for this scene, moved along with their objects.
    pub(crate) fn take(&self) -> Option<LeftPoints> {
        let memory = &mut *self.lock();
        if !std::mem::take(&mut memory.is_wanted) {
            return None;
        }
        let mut left = memory.left.take()?;
        let new = memory.count - left.followed;
        // Points that would miss the first of their motions are of no use.
        let motions = memory.motions.len().checked_sub(new).map(|from| &memory.motions[from..])?;
        left.cache.follow(motions);
        left.followed = memory.count;
        Some(left)
    }

    fn lock(&self) -> MutexGuard<'_, SceneMemory> {
        // Every change leaves it consistent.
        self.0.lock()
    }
}

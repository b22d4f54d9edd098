//! The known room of `display`'s tests, and quadtrees of its samples.

#![allow(dead_code, unused_imports, reason = "each test file uses its own part")]

#[path = "../../../../display/tests/common/mod.rs"]
mod room;

use holo_driver_quadtree::{Quadtree, QuadtreeParams};
use holo_picture::View;
use holo_section::Section;
pub use room::*;
use std::sync::Arc;

/// A quadtree of one section with these samples.
pub fn quadtree(
    section: &Section,
    view: &View,
    size: (u32, u32),
    params: QuadtreeParams,
    stored: &[Stored],
) -> Quadtree {
    let mut quadtree = Quadtree::new(Arc::from([section.clone()]), *view, size, params);
    insert(&mut quadtree, stored);
    quadtree
}

pub fn insert(quadtree: &mut Quadtree, stored: &[Stored]) {
    for (beam, sample) in stored {
        quadtree.insert(key(0, *beam), 1, std::slice::from_ref(sample));
    }
}

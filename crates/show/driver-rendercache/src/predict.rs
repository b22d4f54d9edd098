//! Predicted projection and sampling (Walter et al. 2002, §3.1): requests rays for parts that will
//! come into view.
//!
//! Invariant: a block of pixels of the predicted view, 4×4 by default, is occupied exactly if a
//! point falls into it. Depth does not matter.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use glam::DVec3;
use holo_display::{mix, pair};
use holo_picture::View;
use rayon::prelude::*;

use crate::map::Map;
use crate::points::{BLOCK, PointSlots};
use crate::project::each_seen;
use crate::sample::{RayTarget, Request, Tag};

/// Points that one thread projects at a time.
const PART: usize = 256 * BLOCK;

/// The blocks of the predicted view, and whether each has a point.
#[derive(Debug)]
pub(crate) struct Occupancy {
    /// Pixels along a block's side.
    side: usize,
    picture: (usize, usize),
    /// Columns and rows of blocks.
    size: (usize, usize),
    is_occupied: Vec<AtomicBool>,
}

impl Occupancy {
    pub fn new(picture: (usize, usize), side: usize) -> Self {
        let size = (picture.0.div_ceil(side), picture.1.div_ceil(side));
        let is_occupied = (0..size.0 * size.1).map(|_| AtomicBool::new(false)).collect();
        Self { side, picture, size, is_occupied }
    }

    /// Marks the blocks of a view into which points fall as occupied, and all others as empty.
    pub fn project(&mut self, points: &PointSlots, view: &View, origin: DVec3) {
        let scaled = |pixels: usize| pixels as f64 / self.side as f64;
        let map = Map::new(view, origin, (scaled(self.picture.0), scaled(self.picture.1)));
        let (size, is_occupied) = (self.size, &mut self.is_occupied);
        is_occupied.iter_mut().for_each(|block| *block.get_mut() = false);
        let starts = (0..points.capacity()).into_par_iter().step_by(PART);
        starts.for_each(|start| {
            let slots = start..(start + PART).min(points.capacity());
            each_seen(points, slots, &map, size, |_, column, row, _| {
                let block = &is_occupied[row * size.0 + column];
                // Most blocks are already marked. A store would take the cache line from other
                // threads.
                if !block.load(Relaxed) {
                    block.store(true, Relaxed);
                }
            });
        });
    }

    /// Returns requests for empty blocks: every n-th in scanline order, at most `limit`.
    pub fn requests(&self, limit: usize, seed: u32) -> Vec<Request> {
        let is_empty = |block: &(usize, &AtomicBool)| !block.1.load(Relaxed);
        let blocks = || self.is_occupied.iter().enumerate().filter(is_empty);
        let empty = blocks().count();
        if empty == 0 || limit == 0 {
            return Vec::new();
        }
        let every = empty.div_ceil(limit);
        let phase = mix(seed, 0) as usize % every;
        let chosen = blocks().skip(phase).step_by(every);
        chosen.map(|(block, _)| self.request(block, seed)).collect()
    }

    /// Returns a request for any point of a block.
    fn request(&self, block: usize, seed: u32) -> Request {
        let (column, row) = (block % self.size.0 * self.side, block / self.size.0 * self.side);
        let (x, y) = pair(seed, block as u32);
        // The last block of a row or column may be narrower.
        let (width, height) = self.picture;
        let across = column as f32 + x * self.side.min(width - column) as f32;
        let down = row as f32 + y * self.side.min(height - row) as f32;
        let aim = RayTarget::Picture(across / width as f32, 1.0 - down / height as f32);
        Request { aim, predicted: true, tag: Tag::default() }
    }
}

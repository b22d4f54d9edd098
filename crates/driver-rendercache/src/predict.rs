//! Predicted projection and sampling (Walter et al. 2002, §3.1): asks for what is about to come into view.
//!
//! Each thread marks a picture of its own: with one for all, in which most stores repeat what is there, each line went from one core
//! to the other by turns, and two threads took three quarters of one's time.
//!
//! Always true: a byte per block of 4×4 pixels (or as many as are chosen) of the predicted view says whether a point falls there; depth does not matter.

use super::map::{Lens, Map};
use super::points::{Block, State};
use super::project::BLOCK;
use super::sample::{Aim, Request, Tag};
use super::truncate::truncate;
use holo_cpu::{Isa, Kernel};
use holo_display::{mix, pair};

/// Which blocks of the predicted view have points.
#[derive(Debug)]
pub(super) struct Occupancy {
    /// Pixels along a block's side.
    side: usize,
    size: (usize, usize),
    /// For each thread, a row of blocks after another, and one byte more for points that fall outside. The first has all in the end.
    is_occupied: Vec<Vec<u8>>,
}

impl Occupancy {
    pub fn new(size: (usize, usize), side: usize, threads: usize) -> Self {
        let size = (size.0.div_ceil(side), size.1.div_ceil(side));
        Self { side, size, is_occupied: vec![vec![0; size.0 * size.1 + 1]; threads] }
    }

    /// The whole picture's size in blocks, which need not be whole.
    pub fn scaled(&self, size: (usize, usize)) -> (f64, f64) {
        (size.0 as f64 / self.side as f64, size.1 as f64 / self.side as f64)
    }

    /// Empty, to be marked by [`Marks::add`], for each thread.
    pub fn begin<'a>(&'a mut self, map: &'a Map) -> Vec<Marks<'a>> {
        let (size, pictures) = (self.size, self.is_occupied.iter_mut());
        pictures
            .map(|is_occupied| {
                is_occupied.fill(0);
                Marks { map, size, is_occupied }
            })
            .collect()
    }

    /// Requests for blocks that no thread marked, every n-th in scanline order so that there are at most `limit`.
    pub fn request(
        &mut self,
        picture: (usize, usize),
        limit: usize,
        seed: u32,
        requests: &mut Vec<Request>,
    ) {
        let Some((blocks, others)) = self.is_occupied.split_first_mut() else { return };
        for other in others {
            blocks.iter_mut().zip(other).for_each(|(block, other)| *block |= *other);
        }
        let blocks = &blocks[..self.size.0 * self.size.1];
        let empty = blocks.iter().filter(|&&occupied| occupied == 0).count();
        if empty == 0 || limit == 0 {
            return;
        }
        let every = empty.div_ceil(limit);
        let phase = mix(seed, 0) as usize % every;
        let chosen = blocks
            .iter()
            .enumerate()
            .filter(|&(_, &occupied)| occupied == 0)
            .skip(phase)
            .step_by(every);
        requests.extend(chosen.map(|(block, _)| {
            let (column, row) = (block % self.size.0 * self.side, block / self.size.0 * self.side);
            let (x, y) = pair(seed, block as u32);
            // The last block of a row or column may be narrower.
            let across = column as f32 + x * self.side.min(picture.0 - column) as f32;
            let down = row as f32 + y * self.side.min(picture.1 - row) as f32;
            let aim = Aim::Picture(across / picture.0 as f32, 1.0 - down / picture.1 as f32);
            Request { aim, predicted: true, tag: Tag::default() }
        }));
    }
}

/// The blocks of a predicted view, for one thread to mark.
pub(super) struct Marks<'a> {
    map: &'a Map,
    size: (usize, usize),
    is_occupied: &'a mut [u8],
}

impl Marks<'_> {
    /// Marks the blocks into which points fall. A multiple of [`BLOCK`].
    pub fn add(&mut self, isa: Isa, blocks: &[Block], states: &[State]) {
        let (map, size, is_occupied) = (self.map, self.size, &mut *self.is_occupied);
        match map {
            Map::Flat(map) => isa.run(Project { map, size, blocks, states, is_occupied }),
            Map::Cut(map) => isa.run(Project { map, size, blocks, states, is_occupied }),
            Map::Curved(map) => isa.run(Project { map, size, blocks, states, is_occupied }),
        }
    }
}

struct Project<'a, L> {
    map: &'a L,
    size: (usize, usize),
    blocks: &'a [Block],
    states: &'a [State],
    is_occupied: &'a mut [u8],
}

impl<L: Lens> Kernel for Project<'_, L> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { map, size, blocks, states, is_occupied } = self;
        let mut block = [0_u32; BLOCK];
        for ((points, states), following) in blocks.iter().zip(states.as_chunks().0).zip(1..) {
            Block::prefetch(blocks, following);
            place(map, size, &points.position, states, &mut block);
            // Not by `get`: with another way out of it for each point the loop took a fifth longer.
            for &block in &block {
                is_occupied[block as usize] = 1;
            }
        }
    }
}

#[inline(always)]
fn place<L: Lens>(
    map: &L,
    size: (usize, usize),
    [x, y, z]: &[[f32; BLOCK]; 3],
    states: &[State; BLOCK],
    block: &mut [u32; BLOCK],
) {
    let (right, bottom) = (size.0 as f32, size.1 as f32);
    let (across, outside) = (size.0 as i32, (size.0 * size.1) as i32);
    let nearest = map.nearest();
    for i in 0..BLOCK {
        let (column, row, depth) = map.project([x[i], y[i], z[i]]);
        let seen = (depth >= nearest)
            & (column >= 0.0)
            & (column < right)
            & (row >= 0.0)
            & (row < bottom)
            & !states[i].is_empty();
        let (column, row) = (truncate(column, right), truncate(row, bottom));
        block[i] = if seen { row * across + column } else { outside } as u32;
    }
}

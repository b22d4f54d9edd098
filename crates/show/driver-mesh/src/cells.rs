//! Cells of directions, about as large as a pixel. Each cell with samples becomes a vertex.
//!
//! In the paper, the better one of two samples in nearly the same direction replaces the other
//! (Larson & Simmons 1999, §2.4.5). Here a cell has the mean of its samples, since samples of one
//! path are noisy.
//!
//! A cell has samples of several depths at silhouettes, and where rays that pass the eye look
//! behind an object. If the rays of some samples pass the eye within a pixel, the vertex is where
//! most of these end. Otherwise it is the nearest surface.
//!
//! Invariants:
//! - A vertex is a function of the set of its cell's samples.
//! - A vertex lies in its cell, so no two cells have the same one.

use rustc_hash::FxHashMap;

use crate::direction::{BITS, GridDirection, STEPS};
use crate::index::square;
use crate::sums::{CellSample, LayerSums};

/// Depth bins in a doubling of depth. A bin is 4.4 % wide.
const BINS: f64 = 16.0;
/// The bin of rays that hit nothing.
const FAR: i16 = i16::MAX;
/// Most depths of a cell. The nearest ones stay.
const MOST_LAYERS: usize = 4;
/// Bits by which vertices are finer than cells. Vertices move less often than means do.
const PLACE_BITS: u32 = 3;
/// No number.
const NONE: u32 = u32::MAX;

/// The light of a vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VertexLight {
    /// Direction from the canonical eye.
    pub direction: GridDirection,
    /// Depth, scene units; infinite for the sky.
    pub depth: f32,
    /// Radiance.
    pub colour: [f32; 3],
    /// Number of its samples.
    pub count: u32,
    /// True if the rays of some of its samples pass near to the eye, so that the eye sees it.
    pub is_near: bool,
}

/// Samples of one depth bin of a cell.
struct CellLayer {
    bin: i16,
    /// The layer behind it; [`NONE`] behind the last one.
    behind: u32,
    sums: LayerSums,
}

/// A cell.
struct DirectionCell {
    square: u64,
    /// The nearest layer; [`NONE`] without samples of this view.
    nearest: u32,
    /// The light of earlier views, shown until there are samples of this view.
    earlier: Option<VertexLight>,
    /// The vertex in the mesh; [`NONE`] without one.
    vertex: u32,
    is_changed: bool,
}

/// A cell that may need another vertex.
pub struct ChangedCell<'a> {
    /// Its vertex in the mesh so far.
    pub vertex: &'a mut u32,
    /// What it shows now.
    pub light: Option<VertexLight>,
}

/// All cells with samples.
pub struct DirectionCells {
    /// Cells have 2^`shift` steps a side.
    shift: u32,
    numbers: FxHashMap<u64, u32>,
    cells: Vec<DirectionCell>,
    layers: Vec<CellLayer>,
    /// Numbers of cells that have changed.
    changed: Vec<u32>,
}

/// Returns the bits of a side of cells about as large as a pixel, which is `angle` radians wide.
pub fn cell_shift(angle: f64) -> u32 {
    // In the middle of a face, a cell of side 1 has the area of a square of 2.28 steps of 2⁻²⁰.
    let side = angle * f64::from(STEPS) / 2.28;
    side.log2().round().clamp(0.0, f64::from(BITS - 1)) as u32
}

/// Returns the bin of a depth, and the place in the bin, 0 to 1.
fn bin(depth: f64) -> (i16, f64) {
    if !depth.is_finite() {
        return (FAR, 0.0);
    }
    let place = depth.max(f64::MIN_POSITIVE).log2() * BINS;
    let bin = place.floor().clamp(f64::from(i16::MIN), f64::from(FAR - 2));
    (bin as i16, place - bin)
}

/// Returns the depth at a place in a bin.
fn depth_at(bin: i16, share: f64) -> f64 {
    if bin == FAR { f64::INFINITY } else { ((f64::from(bin) + share) / BINS).exp2() }
}

impl DirectionCells {
    /// Returns no cells, with sides of 2^`shift` steps.
    pub fn new(shift: u32) -> DirectionCells {
        let (numbers, cells, layers) = (FxHashMap::default(), Vec::new(), Vec::new());
        DirectionCells { shift, numbers, cells, layers, changed: Vec::new() }
    }

    /// Returns the bits of a cell's side.
    pub fn shift(&self) -> u32 {
        self.shift
    }

    /// Returns the number of cells.
    pub fn len(&self) -> usize {
        self.cells.len()
    }

    /// Adds a sample.
    pub fn insert(&mut self, sample: &CellSample) {
        let number = self.cell_of(sample.direction);
        let (bin, share) = bin(sample.depth);
        if let Some(layer) = self.layer(number, bin) {
            self.layers[layer as usize].sums.add(sample, share);
            self.mark(number);
        }
    }

    /// Adds light of an earlier view, unless the cell has some.
    pub fn insert_earlier(&mut self, light: VertexLight) {
        let number = self.cell_of(light.direction);
        let earlier = &mut self.cells[number as usize].earlier;
        if earlier.is_none() {
            *earlier = Some(light);
            self.mark(number);
        }
    }

    /// Makes the samples light of an earlier view.
    pub fn begin_view(&mut self) {
        for number in 0..self.cells.len() as u32 {
            let light = self.own_light(number);
            let cell = &mut self.cells[number as usize];
            if let Some(light) = light {
                cell.earlier = Some(VertexLight { is_near: false, ..light });
            }
            cell.nearest = NONE;
            self.mark(number);
        }
        self.layers.clear();
    }

    /// Takes out the light of earlier views, and returns it.
    pub fn take_earlier(&mut self) -> Vec<VertexLight> {
        let mut taken = Vec::new();
        for number in 0..self.cells.len() as u32 {
            if let Some(light) = self.cells[number as usize].earlier.take() {
                taken.push(light);
                self.mark(number);
            }
        }
        taken
    }

    /// Returns what the cells show: samples of this view first, then the newest cells first.
    pub fn lights(&self) -> impl Iterator<Item = VertexLight> + '_ {
        let own = (0..self.cells.len() as u32).filter_map(|number| self.own_light(number));
        let is_earlier = |cell: &&DirectionCell| cell.nearest == NONE;
        own.chain(self.cells.iter().rev().filter(is_earlier).filter_map(|cell| cell.earlier))
    }

    /// Returns the number of cells that show light of earlier views.
    pub fn earlier_count(&self) -> u64 {
        let is_earlier = |cell: &&DirectionCell| cell.nearest == NONE && cell.earlier.is_some();
        self.cells.iter().filter(is_earlier).count() as u64
    }

    /// Returns the lights of the samples of this view.
    pub fn own_lights(&self) -> impl Iterator<Item = VertexLight> + '_ {
        (0..self.cells.len() as u32).filter_map(|number| self.own_light(number))
    }

    /// Calls `change` with each cell that has changed since the last time, in the order of their
    /// places, so that one is near the next.
    pub fn for_changed(&mut self, mut change: impl FnMut(ChangedCell)) {
        let mut changed = std::mem::take(&mut self.changed);
        changed.sort_unstable_by_key(|&number| self.cells[number as usize].square);
        for &number in &changed {
            let light = self.own_light(number).or(self.cells[number as usize].earlier);
            let cell = &mut self.cells[number as usize];
            cell.is_changed = false;
            change(ChangedCell { vertex: &mut cell.vertex, light });
        }
        changed.clear();
        self.changed = changed;
    }

    fn mark(&mut self, number: u32) {
        let cell = &mut self.cells[number as usize];
        if !cell.is_changed {
            cell.is_changed = true;
            self.changed.push(number);
        }
    }

    /// Returns the number of the cell of a direction.
    fn cell_of(&mut self, direction: GridDirection) -> u32 {
        let square = square(direction, BITS - self.shift) as u64;
        let next = self.cells.len() as u32;
        let number = *self.numbers.entry(square).or_insert(next);
        if number == next {
            let (nearest, vertex) = (NONE, NONE);
            self.cells.push(DirectionCell {
                square,
                nearest,
                earlier: None,
                vertex,
                is_changed: false,
            });
        }
        number
    }

    /// Returns the layer of a bin; `None` if the cell has enough layers nearer than that.
    fn layer(&mut self, cell: u32, bin: i16) -> Option<u32> {
        let (mut before, mut at) = (NONE, self.cells[cell as usize].nearest);
        let mut count = 0;
        while at != NONE && self.layers[at as usize].bin < bin {
            (before, at) = (at, self.layers[at as usize].behind);
            count += 1;
        }
        if at != NONE && self.layers[at as usize].bin == bin {
            return Some(at);
        }
        if count == MOST_LAYERS {
            return None;
        }
        let layer = CellLayer { bin, behind: at, sums: LayerSums::default() };
        let number = self.place_for(cell);
        // The layer that made room may be the one behind the new one.
        let behind = if number == at { NONE } else { at };
        let layer = CellLayer { behind, ..layer };
        match self.layers.get_mut(number as usize) {
            Some(slot) => *slot = layer,
            None => self.layers.push(layer),
        }
        match before {
            NONE => self.cells[cell as usize].nearest = number,
            before => self.layers[before as usize].behind = number,
        }
        Some(number)
    }

    /// Returns the number for one more layer of a cell. If the cell is full, takes out its last
    /// one.
    fn place_for(&mut self, cell: u32) -> u32 {
        let (mut before, mut at, mut count) = (NONE, self.cells[cell as usize].nearest, 0);
        while at != NONE {
            count += 1;
            let behind = self.layers[at as usize].behind;
            if behind == NONE && count == MOST_LAYERS {
                if before != NONE {
                    self.layers[before as usize].behind = NONE;
                }
                return at;
            }
            (before, at) = (at, behind);
        }
        self.layers.len() as u32
    }

    /// Returns the light of a cell's samples; `None` without any.
    fn own_light(&self, cell: u32) -> Option<VertexLight> {
        let cell = &self.cells[cell as usize];
        let (group, sums) = self.shown_group(cell.nearest)?;
        let depths = self
            .group(group)
            .map(|layer| (layer.sums.weight(), depth_at(layer.bin, layer.sums.depth_share())));
        let (weight, depth) = depths
            .fold((0.0, 0.0), |(weight, sum), (more, depth)| (weight + more, sum + more * depth));
        let face = (cell.square >> (2 * (BITS - self.shift))) as usize;
        Some(VertexLight {
            direction: self.rounded(face, sums.place()),
            depth: (depth / weight) as f32,
            colour: sums.colour(),
            count: sums.count(),
            is_near: sums.near_count() > 0,
        })
    }

    /// Returns the first layer of the surface that is shown, and its sums. Layers of adjacent bins
    /// are one surface.
    fn shown_group(&self, nearest: u32) -> Option<(u32, LayerSums)> {
        let (mut best, mut first) = (None::<(u32, LayerSums)>, nearest);
        while first != NONE {
            let (mut sums, mut end) = (LayerSums::default(), first);
            for layer in self.group(first) {
                sums.join(&layer.sums);
                end = layer.behind;
            }
            if best.is_none_or(|(_, best)| sums.near_count() > best.near_count()) {
                best = Some((first, sums));
            }
            first = end;
        }
        best
    }

    /// Returns the layers of one surface, from its first one.
    fn group(&self, first: u32) -> impl Iterator<Item = &CellLayer> {
        let layer = |number: u32| self.layers.get(number as usize);
        std::iter::successors(layer(first), move |before| {
            layer(before.behind).filter(|behind| before.bin.checked_add(1) == Some(behind.bin))
        })
    }

    /// Returns the direction at a place of a face, rounded so that small changes of the mean do not
    /// move it. It stays in the cell of the place.
    fn rounded(&self, face: usize, place: [i32; 2]) -> GridDirection {
        let bits = self.shift.saturating_sub(PLACE_BITS);
        let [x, y] = place.map(|at| (at >> bits << bits) + (1 << bits >> 1));
        // At the edge of the face, the rounded place may lie beyond it.
        let [x, y] = if x + y < STEPS { [x, y] } else { place };
        GridDirection::on_face(face, x, y)
    }
}

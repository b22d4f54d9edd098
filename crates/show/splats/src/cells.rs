//! Collects samples in the cells of a grid: one surfel for each cell and side of a surface.
//!
//! Invariant: memory is bounded by the number of cells and not by that of samples. If there are
//! more cells than wanted, the grid becomes coarser.

use glam::Vec3;
use holo_color::relative_luminance;
use rayon::prelude::*;
use rustc_hash::FxHashMap;

/// Parts of the cells, each filled by one thread at a time.
const SHARDS: usize = 64;

/// Ratio of the spacings of a grid and the next coarser one.
const COARSER: f32 = 1.25;

/// Bits of a cell's number along each axis.
const AXIS_BITS: u32 = 20;

/// Directions that count as different sides of a surface: both ways along three axes.
pub(crate) const SIDES: u64 = 6;

/// Number of the side of surfaces without known normals.
const NO_SIDE: u64 = SIDES;

/// Light of one sample at the place where its ray ended.
#[derive(Clone, Copy, Debug)]
pub struct LightPoint {
    /// The place, relative to the origin.
    pub position: Vec3,
    /// Unit normal of the surface on the side of the ray; `None` if the surface is unknown.
    pub normal: Option<Vec3>,
    /// Unit vector from the place towards the ray's origin.
    pub towards: Vec3,
    /// The sample's radiance.
    pub radiance: [f32; 3],
    /// The share of light that the surface reflects there; 1 if it is unknown.
    pub reflectance: [f32; 3],
    /// Colour of the surface that is drawn from the scene, and left out of the light; 1 if it is
    /// part of the light.
    pub drawn_colour: [f32; 3],
    /// Number of paths that the radiance is the mean of.
    pub paths: u16,
    /// True if the light depends on the direction.
    pub is_directional: bool,
    /// True if the surface itself emits light.
    pub shines: bool,
}

/// Sums over the samples of a cell.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct CellSums {
    /// Number of samples.
    pub samples: u32,
    /// Sum of weights: numbers of paths.
    pub weight: f32,
    /// Weighed sum of places, from the middle of the cell: large sums would lose small offsets.
    pub position: Vec3,
    /// Weighed sum of normals; of directions to the eye if there are no normals.
    pub normal: Vec3,
    /// Weighed sum of light: radiance over reflectance.
    pub light: Vec3,
    /// Weighed sum of squares of the light's luminance.
    pub squares: f32,
    /// Weighed sum of reflectances.
    pub reflectance: Vec3,
    /// Weighed sum of the colours that are drawn from the scene.
    pub drawn_colour: Vec3,
    /// Weight of samples whose light depends on the direction.
    pub directional: f32,
    /// Weight of samples on lamps.
    pub shining: f32,
}

impl CellSums {
    /// Returns the sums of one sample, with its place from the origin.
    fn of(point: &LightPoint) -> CellSums {
        let weight = f32::from(point.paths.max(1));
        let reflectance = Vec3::from(point.reflectance).max(Vec3::splat(LEAST_REFLECTANCE));
        let light = Vec3::from(point.radiance) / reflectance;
        CellSums {
            samples: 1,
            weight,
            position: point.position * weight,
            normal: point.normal.unwrap_or(point.towards) * weight,
            light: light * weight,
            squares: relative_luminance(light.into()).powi(2) * weight,
            reflectance: reflectance * weight,
            drawn_colour: Vec3::from(point.drawn_colour) * weight,
            directional: if point.is_directional { weight } else { 0.0 },
            shining: if point.shines { weight } else { 0.0 },
        }
    }

    fn add(&mut self, other: &CellSums) {
        self.samples = self.samples.saturating_add(other.samples);
        self.weight += other.weight;
        self.position += other.position;
        self.normal += other.normal;
        self.light += other.light;
        self.squares += other.squares;
        self.reflectance += other.reflectance;
        self.drawn_colour += other.drawn_colour;
        self.directional += other.directional;
        self.shining += other.shining;
    }
}

/// Least reflectance that light is divided by. Samples of black surfaces show nothing of the light
/// on them.
pub const LEAST_REFLECTANCE: f32 = 0.02;

/// Cells in the order in which they were found.
#[derive(Default)]
struct CellShard {
    places: FxHashMap<u64, u32>,
    cells: Vec<(u64, CellSums)>,
}

impl CellShard {
    fn add(&mut self, key: u64, sums: &CellSums) {
        let next = self.cells.len() as u32;
        let place = *self.places.entry(key).or_insert(next);
        match self.cells.get_mut(place as usize) {
            Some((_, cell)) => cell.add(sums),
            None => self.cells.push((key, *sums)),
        }
    }
}

/// Collects samples in cells, and makes surfels of them.
pub struct SurfelCells {
    spacing: f32,
    most: usize,
    shards: Vec<CellShard>,
    samples: u64,
}

impl SurfelCells {
    /// Returns cells of this size, scene units. Once there are more than `most`, they become
    /// larger.
    pub fn new(spacing: f32, most: usize) -> SurfelCells {
        let shards = (0..SHARDS).map(|_| CellShard::default()).collect();
        SurfelCells { spacing, most, shards, samples: 0 }
    }

    /// Returns the size of the cells, scene units.
    pub fn spacing(&self) -> f32 {
        self.spacing
    }

    /// Returns the number of cells.
    pub fn len(&self) -> usize {
        self.shards.iter().map(|shard| shard.cells.len()).sum()
    }

    /// Returns true if no sample was added.
    pub fn is_empty(&self) -> bool {
        self.samples == 0
    }

    /// Returns the number of samples that were added.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Adds samples. Ignores those whose place, normal or light is no number.
    pub fn add(&mut self, points: &[LightPoint]) {
        let is_sound = |sums: &CellSums| {
            (sums.position + sums.normal + sums.light).is_finite() && sums.squares.is_finite()
        };
        let spacing = self.spacing;
        let keyed = points.par_iter().map(|point| {
            let side = point.normal.map_or(NO_SIDE, side);
            placed(CellSums::of(point), point.position, side, spacing)
        });
        let keyed: Vec<(u64, CellSums)> = keyed.filter(|(_, sums)| is_sound(sums)).collect();
        self.samples += keyed.len() as u64;
        self.distribute(&keyed);
        while self.len() > self.most {
            self.coarsen();
        }
    }

    /// Adds sums to their cells, in order.
    fn distribute(&mut self, keyed: &[(u64, CellSums)]) {
        let mut by_shard: Vec<Vec<u32>> = vec![Vec::new(); SHARDS];
        for (at, (key, _)) in (0..).zip(keyed) {
            by_shard[shard_of(*key)].push(at);
        }
        self.shards.par_iter_mut().zip(by_shard).for_each(|(shard, places)| {
            for at in places {
                let (key, sums) = &keyed[at as usize];
                shard.add(*key, sums);
            }
        });
    }

    /// Moves everything into larger cells, by the mean place of each.
    fn coarsen(&mut self) {
        let fine = self.spacing;
        self.spacing *= COARSER;
        let spacing = self.spacing;
        let moved = |(old, sums): (u64, CellSums)| {
            let place = middle(old, fine) + sums.position / sums.weight;
            placed(sums, place, side_of(old), spacing)
        };
        let keyed: Vec<(u64, CellSums)> = self.take_cells().into_par_iter().map(moved).collect();
        self.distribute(&keyed);
    }

    /// Takes all cells, in an order that depends on the samples' order alone.
    fn take_cells(&mut self) -> Vec<(u64, CellSums)> {
        let shards = self.shards.iter_mut().map(std::mem::take);
        shards.flat_map(|shard| shard.cells).collect()
    }

    /// Returns all cells by number, sorted.
    pub(crate) fn into_sorted(mut self) -> Vec<(u64, CellSums)> {
        let mut cells = self.take_cells();
        cells.par_sort_unstable_by_key(|(key, _)| *key);
        cells
    }
}

/// Returns the number of the side that a normal looks to.
fn side(normal: Vec3) -> u64 {
    let axis = normal.abs().max_position();
    2 * axis as u64 + u64::from(normal[axis] < 0.0)
}

/// Returns the side of a cell's number.
pub(crate) fn side_of(key: u64) -> u64 {
    key & 7
}

/// Returns sums with the number of their cell. `place` is their mean place from the origin.
fn placed(sums: CellSums, place: Vec3, side: u64, spacing: f32) -> (u64, CellSums) {
    let key = key(place, side, spacing);
    (key, CellSums { position: (place - middle(key, spacing)) * sums.weight, ..sums })
}

/// Returns the middle of a cell, from the origin.
pub(crate) fn middle(key: u64, spacing: f32) -> Vec3 {
    let half = (1_u64 << (AXIS_BITS - 1)) as f32;
    let axis = |axis: u32| (key >> (3 + axis * AXIS_BITS) & ((1 << AXIS_BITS) - 1)) as f32;
    (Vec3::new(axis(0), axis(1), axis(2)) - half + 0.5) * spacing
}

/// Returns the cell of a place as a number: side, then x, y and z.
fn key(position: Vec3, side: u64, spacing: f32) -> u64 {
    let middle = (1_i64 << (AXIS_BITS - 1)) as f32;
    let place = (position / spacing).floor() + middle;
    let [x, y, z] = place.to_array().map(|axis| axis.clamp(0.0, 2.0 * middle - 1.0) as u64);
    side | x << 3 | y << (3 + AXIS_BITS) | z << (3 + 2 * AXIS_BITS)
}

/// Returns the number of a neighbour of a cell, on the same side; `None` beyond the grid.
pub(crate) fn neighbour(key: u64, offset: [i64; 3]) -> Option<u64> {
    let mut moved = side_of(key);
    for (axis, step) in (0..).zip(offset) {
        let shift = 3 + axis * AXIS_BITS;
        let place = (key >> shift & ((1 << AXIS_BITS) - 1)) as i64 + step;
        let place = u64::try_from(place).ok().filter(|place| *place < 1 << AXIS_BITS)?;
        moved |= place << shift;
    }
    Some(moved)
}

/// Returns the number of the cube of 2^`scale` cells along each axis that a cell is in, on its
/// side.
pub(crate) fn region(key: u64, scale: u32) -> u64 {
    let low = (1_u64 << scale) - 1;
    let axes = low | low << AXIS_BITS | low << (2 * AXIS_BITS);
    key & !(axes << 3)
}

fn shard_of(key: u64) -> usize {
    (key.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 58) as usize
}

const _: () = assert!(SHARDS == 64);

//! The table of cells, which many threads read and write.
//!
//! Cells of level 0 are the widest; those of each further level are half as wide as those of the
//! level before. An estimate goes to the cell of level 1, and to one further level for each that
//! knows enough. It also goes to level 0, which only serves until level 1 is known, while the cell
//! of level 1 has fewer than [`ENOUGH`].
//!
//! - Levels 0 and 1 are used from [`READY`] estimates on.
//! - Level k + 1 begins to learn once the cell of level k has had 256 · 4^(k - 1) estimates
//!   ([`opens`]).
//! - Level k above 1 is used once its cell has had 4^(k + 1) estimates ([`ready`]).
//!
//! So a place with N estimates uses cells with about √N estimates each, and a width in proportion
//! to N^(-1/4).
//!
//! Invariants:
//! - A place uses a cell only if nothing stands between it and the cell's anchor, the first point
//!   that taught the cell. A cell that a wall divides is divided into parts. A cell around which
//!   nothing stands on the surface is not tested again.
//! - Memory is bounded by [`MAX_CELLS`].

use glam::Vec3;
use parking_lot::{Mutex, MutexGuard};
use rustc_hash::FxHashMap;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::estimates::Estimates;
use super::place::SurfacePlace;
use super::shared_cell::{LEVELS, SharedCell};

/// Most cells: about 100 MB.
const MAX_CELLS: usize = 1 << 20;

/// Number of locks; a power of two, many times the number of threads.
const SHARDS: usize = 1 << 10;

/// The level with which look-ups begin. The wider level 0 only serves until level 1 is known.
const BASE: u32 = 1;

/// Estimates from which cells of the first two levels are used. With 2 to 32, the error of a
/// furnished house differed by less than a fifth.
const READY: u32 = 4;

/// Estimates of a cell of level 1 from which its place no longer teaches level 0.
const ENOUGH: u32 = 16;

/// Most parts of a cell.
const PARTS: u32 = 3;

/// Least footprint of a path over the width of a cell in which it may end.
const LEAST_FOOTPRINT: f32 = 2.0;

/// Least number of estimates of a cell that are sent to others at a time, and least share of those
/// that the cell has. So a cell that has learned much is sent seldom.
const LEAST_SENT: f32 = 4.0;
const LEAST_SHARE_SENT: f32 = 0.25;

/// Returns the number of estimates from which a cell is used.
fn ready(level: u32) -> u32 {
    if level <= BASE { READY } else { 1 << (2 * (level + 1)) }
}

/// Returns the number of estimates from which the next level learns.
fn opens(level: u32) -> u32 {
    256 << (2 * level.saturating_sub(BASE))
}

/// The light of a cell.
#[derive(Clone, Copy, Debug)]
struct SurfaceCell {
    /// The first point that taught the cell, and its normal.
    anchor: Vec3,
    normal: Vec3,
    /// True if nothing stands on the surface around the cell.
    is_clear: bool,
    /// Number of estimates so far, without fading.
    total: u32,
    estimates: Estimates,
    /// Own estimates that no other process has been sent.
    unsent: Estimates,
    /// What distinguishes the cell, for other processes.
    material: u32,
    bounces: u32,
    level: u32,
}

/// The cells of one scene.
#[derive(Debug)]
pub(crate) struct CellMap {
    /// Width of the cells of level 0.
    widest: f32,
    count: AtomicUsize,
    shards: Box<[Mutex<FxHashMap<u64, SurfaceCell>>]>,
}

impl CellMap {
    pub(crate) fn new(widest: f32) -> Self {
        let shards = (0..SHARDS).map(|_| Mutex::default()).collect();
        Self { widest, count: AtomicUsize::new(0), shards }
    }

    /// Returns the number of estimates that count, of all cells.
    #[cfg(test)]
    pub(super) fn estimates(&self) -> f32 {
        let of_shard = |shard: &Mutex<FxHashMap<u64, SurfaceCell>>| {
            let shard = shard.lock();
            shard.values().map(|cell| cell.estimates.count).sum::<f32>()
        };
        self.shards.iter().map(of_shard).sum()
    }

    /// Returns the number of cells.
    pub(super) fn count(&self) -> usize {
        self.count.load(Ordering::Relaxed)
    }

    #[inline]
    fn width(&self, level: u32) -> f32 {
        self.widest / (1_u32 << level) as f32
    }

    #[inline]
    fn shard(&self, key: u64) -> MutexGuard<'_, FxHashMap<u64, SurfaceCell>> {
        // No panic leaves a cell half changed.
        self.shards[(key >> 32) as usize % SHARDS].lock()
    }

    /// Returns the light, divided by reflectance, of the narrowest cell that knows enough and is
    /// narrow beside the footprint.
    #[inline]
    pub(super) fn look_up(&self, place: &SurfacePlace, footprint: f32) -> Option<Vec3> {
        let fits = |level: u32| LEAST_FOOTPRINT * self.width(level) <= footprint;
        let mut found = None;
        for level in BASE..LEVELS {
            let Some(cell) = self.cell(place, level) else { break };
            if fits(level) && cell.total >= ready(level) {
                found = Some(cell.estimates.mean());
            }
            if cell.total < opens(level) {
                break;
            }
        }
        if found.is_some() || !fits(0) {
            return found;
        }
        self.cell(place, 0).filter(|cell| cell.total >= ready(0)).map(|cell| cell.estimates.mean())
    }

    /// Returns the cell of a level that contains a place and sees it.
    #[inline]
    fn cell(&self, place: &SurfacePlace, level: u32) -> Option<SurfaceCell> {
        let width = self.width(level);
        for part in 0..PARTS {
            let key = place.spot.key(width, level, part);
            let cell = *self.shard(key).get(&key)?;
            if cell.is_clear || !place.is_parted(cell.anchor, cell.normal) {
                return Some(cell);
            }
        }
        None
    }

    /// Adds an estimate of the light that a place reflects, with its albedo.
    pub(super) fn add(&self, place: &SurfacePlace, light: Vec3, albedo: Vec3) {
        let new = Estimates { light, albedo, count: 1.0 };
        for level in BASE..LEVELS {
            let total = self.add_at(place, level, &new, true);
            if level == BASE && total.is_none_or(|total| total < ENOUGH) {
                self.add_at(place, 0, &new, true);
            }
            if total.is_none_or(|total| total < opens(level)) {
                return;
            }
        }
    }

    /// Adds estimates of another process to the cell of one level.
    pub(super) fn add_received(&self, place: &SurfacePlace, level: u32, new: &Estimates) {
        self.add_at(place, level, new, false);
    }

    /// Returns the estimates of the cell of a level, if it may be used.
    pub(super) fn known(&self, place: &SurfacePlace, level: u32) -> Option<Estimates> {
        self.cell(place, level).filter(|cell| cell.total >= READY).map(|cell| cell.estimates)
    }

    /// Returns own estimates that others lack, of at most `most` cells.
    pub(super) fn take_new(&self, most: usize) -> Vec<SharedCell> {
        let mut taken = Vec::new();
        for shard in &self.shards {
            let mut shard = shard.lock();
            let due = |cell: &&mut SurfaceCell| {
                cell.unsent.count >= LEAST_SENT.max(LEAST_SHARE_SENT * cell.total as f32)
            };
            for cell in shard.values_mut().filter(due).take(most - taken.len()) {
                let new = std::mem::take(&mut cell.unsent);
                taken.push(SharedCell {
                    point: cell.anchor.to_array(),
                    normal: cell.normal.to_array(),
                    light: new.light.to_array(),
                    albedo: new.albedo.to_array(),
                    count: new.count as u32,
                    material: cell.material,
                    bounces: cell.bounces,
                    level: cell.level,
                });
            }
        }
        taken
    }

    /// Forgets all cells.
    pub(super) fn clear(&self) {
        for shard in &self.shards {
            shard.lock().clear();
        }
        self.count.store(0, Ordering::Relaxed);
    }

    /// Adds estimates to the cell of one level. Returns how many it has had; `None` if there is no
    /// such cell and no room for one.
    fn add_at(
        &self,
        place: &SurfacePlace,
        level: u32,
        new: &Estimates,
        is_own: bool,
    ) -> Option<u32> {
        let width = self.width(level);
        for part in 0..PARTS {
            let key = place.spot.key(width, level, part);
            let known = self.shard(key).get(&key).map(|c| (c.is_clear, c.anchor, c.normal));
            let is_clear = match known {
                None if self.count.load(Ordering::Relaxed) >= MAX_CELLS => return None,
                None => place.is_clear(width),
                Some((false, anchor, normal)) if place.is_parted(anchor, normal) => continue,
                Some((is_clear, ..)) => is_clear,
            };
            let mut shard = self.shard(key);
            let cell = shard.entry(key).or_insert_with(|| {
                self.count.fetch_add(1, Ordering::Relaxed);
                SurfaceCell {
                    anchor: place.spot.point.point,
                    normal: place.spot.normal,
                    is_clear,
                    total: 0,
                    estimates: Estimates::default(),
                    unsent: Estimates::default(),
                    material: place.spot.material,
                    bounces: place.spot.bounces,
                    level,
                }
            });
            if is_own {
                cell.unsent.sum(new);
            }
            cell.total = cell.total.saturating_add(new.count as u32);
            cell.estimates.add(new, cell.total as f32);
            return Some(cell.total);
        }
        None
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::sync::Arc;

    use glam::DVec3;
    use holo_raycast::Raycaster;
    use holo_scene::{Material, Scene};

    use super::super::place::Spot;
    use super::*;
    use crate::sampler::Sampler;

    /// A square of width 1 that faces up.
    pub fn floor() -> Raycaster {
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let positions = corners.map(|[x, y]| DVec3::new(x, y, 0.0));
        let triangles = [[0, 1, 2], [0, 2, 3]];
        let materials = vec![Material::grey("floor")];
        let made = Scene::from_world(&positions, &triangles, &[0, 0], materials, [0.0; 3]);
        Raycaster::build(Arc::new(made.unwrap().0)).unwrap()
    }

    pub fn place(raycaster: &Raycaster, [u, v]: [f32; 2]) -> SurfacePlace<'_> {
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        let point = raycaster.surface(0, u, v);
        let spot = Spot { point, normal: Vec3::Z, material: 0, bounces: u32::MAX };
        SurfacePlace { raycaster, spot }
    }

    /// Light that changes by its own mean over the width of the floor.
    fn light(place: &SurfacePlace) -> f32 {
        1.0 + place.spot.point.point.x
    }

    /// Returns the root mean squared error of the light of cells after many noisy estimates.
    fn error_after(raycaster: &Raycaster, estimates: u64) -> f32 {
        let cells = CellMap::new(0.5);
        for number in 0..estimates {
            let mut sampler = Sampler::new(7, number);
            let place = place(raycaster, sampler.two());
            // Most paths find nothing.
            let found = if sampler.one() < 0.25 { 4.0 * light(&place) } else { 0.0 };
            cells.add(&place, Vec3::splat(0.5 * found), Vec3::splat(0.5));
        }
        let errors: Vec<f32> = (0..4000)
            .filter_map(|number| {
                let place = place(raycaster, Sampler::new(8, number).two());
                Some((cells.look_up(&place, f32::INFINITY)?.x - light(&place)).powi(2))
            })
            .collect();
        assert!(errors.len() > 3900, "{estimates}: {} of 4000 are known", errors.len());
        (errors.iter().sum::<f32>() / errors.len() as f32).sqrt()
    }

    #[test]
    fn the_error_of_cells_falls_as_stated_with_the_number_of_estimates() {
        let raycaster = floor();
        let (early, late) = (error_after(&raycaster, 2000), error_after(&raycaster, 512_000));
        // Noise of 256 times the estimates falls by 256^(3/16), and the width by more. 1500 cells
        // decide about the late error. Cells of one width would leave 0.072 of the light's change.
        assert!(late < early / 256_f32.powf(3.0 / 16.0) * 1.1, "{early} {late}");
    }

    #[test]
    fn a_cell_serves_only_wide_paths_and_only_its_own_side_material_and_number_of_bounces() {
        let raycaster = floor();
        let cells = CellMap::new(0.5);
        let here = place(&raycaster, [0.3, 0.3]);
        for _ in 0..READY {
            assert_eq!(cells.look_up(&here, 1.0), None);
            cells.add(&here, Vec3::ONE, Vec3::splat(0.5));
        }
        assert_eq!(cells.look_up(&here, 1.0), Some(Vec3::splat(2.0)));
        assert_eq!(cells.look_up(&here, 0.49), None);
        let others: [&dyn Fn(&mut Spot); 3] =
            [&|spot| spot.normal = -spot.normal, &|spot| spot.material = 1, &|spot| {
                spot.bounces = 1
            }];
        for change in others {
            let mut other = here;
            change(&mut other.spot);
            assert_eq!(cells.look_up(&other, 1.0), None);
        }
    }
}

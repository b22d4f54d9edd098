//! The engine `gather`. Its paths end early, in cells of surface light that all paths share.
//!
//! The first surface of a path that is neither a mirror nor glass is treated as by the engine
//! `path`, with as many light samples and continuations as pay there ([`Spreads`]). At each later
//! diffuse surface, the path ends if a cell knows the light there
//! ([`CellMap`]). Otherwise it continues as a path would, and its light becomes an estimate for the
//! cell. A share of paths ([`SHARE`]) also continues where a cell is known, and only teaches it.
//!
//! A cell holds reflected light divided by reflectance, so textures and colours stay sharp. Light
//! that a surface emits is no part of it: emission is counted as by `path`, with the same weights.
//!
//! Invariants:
//! - Where a path ends depends on counts and geometry, never on light. So a path that ends in a
//!   cell has the same expectation as one that continues, apart from the width of the cell, and no
//!   light is lost while cells are few.
//! - A path ends only in a cell narrower than half the path's footprint ([`Footprint`]), as wide at
//!   most as [`room`] allows, and visible from the path's vertex. So corners and contacts stay
//!   sharp, and no light passes through walls.
//! - Cells shrink while they learn: after N estimates in a place, cells there have a width in
//!   proportion to N^(-1/4), and so a bias of that order. The mean of a cell has √N estimates, of
//!   which about 2 N^(3/8) count, and so a standard error in proportion to N^(-3/16). [`CellMap`]
//!   has the rule. The error of a picture therefore tends to 0 as long as paths go on. Without room
//!   for more cells, paths continue, and have no bias.
//! - Coats end a path only from directions in which they reflect little
//!   ([`Scatter::diffuse_albedo`]). Their cells hold the mean over these directions.
//! - Cells of light with a limited number of bounces are cells of their own for each number.
//!
//! The value of a pixel depends on earlier paths of all threads: only `path` is a function of its
//! seed. Neighbouring pixels share the error of cells. [`Tracer::trace_with_variance`] does not
//! include it.
//!
//! [`Scatter::diffuse_albedo`]: crate::bsdf::Scatter::diffuse_albedo
//! [`Tracer::trace_with_variance`]: crate::Tracer::trace_with_variance

mod cells;
mod estimates;
mod footprint;
mod lessons;
mod place;
mod room;
mod shared;
mod shared_cell;
mod spread;

use glam::Vec3;
use holo_raycast::Raycaster;

pub(crate) use cells::CellMap;
pub(crate) use footprint::Footprint;
pub use shared::Verdict;
pub use shared_cell::SharedCell;

use crate::engine::{PathEngine, Spread};
use crate::path::Start;
use crate::policy::{Carried, FirstSurface, LaterVertex, PathPolicy};
use crate::sampler::{NumberPurpose, Sampler};
use lessons::Lessons;
use parking_lot::{Mutex, MutexGuard};
use place::SurfacePlace;
use shared::Makers;
use spread::Spreads;

/// Share of paths that continue where a cell is known, and teach it. With 1/8, the error that
/// neighbouring pixels share is a sixth greater in a furnished house.
const SHARE: f32 = 0.25;

/// The same for a path that already teaches another cell. So light travels from the lamps through
/// many cells even in places that few paths reach. Without it, the shared error is half as great
/// again.
const CHAIN: f32 = 0.5;

/// The cells of one scene.
#[derive(Debug)]
pub(crate) struct Gather {
    cells: CellMap,
    makers: Mutex<Makers>,
    /// `None` if the engine's own numbers hold everywhere.
    spreads: Option<Spreads>,
}

impl Gather {
    pub(crate) fn new(engine: &PathEngine, raycaster: &Raycaster) -> Self {
        let widest = room::widest_cell(raycaster);
        let is_free = engine.bounces > 0 && engine.branches == 1;
        Self {
            cells: CellMap::new(widest),
            makers: Mutex::default(),
            spreads: is_free.then(|| Spreads::new(widest)),
        }
    }

    /// Returns the number of cells.
    pub(crate) fn cell_count(&self) -> usize {
        self.cells.count()
    }

    /// Implements [`Tracer::new_cells`](crate::Tracer::new_cells).
    pub(crate) fn new_cells(&self, most: usize) -> Vec<SharedCell> {
        self.cells.take_new(most)
    }

    /// Implements [`Tracer::receive_cells`](crate::Tracer::receive_cells).
    pub(crate) fn receive(
        &self,
        raycaster: &Raycaster,
        maker: u16,
        cells: &[SharedCell],
    ) -> Option<Verdict> {
        self.makers().receive(&self.cells, raycaster, maker, cells)
    }

    /// Implements [`Tracer::review_cells`](crate::Tracer::review_cells).
    pub(crate) fn review(&self, raycaster: &Raycaster) -> Vec<(u16, Verdict)> {
        self.makers().review(&self.cells, raycaster)
    }

    /// Implements [`Tracer::trust_cells`](crate::Tracer::trust_cells).
    pub(crate) fn trust(&self, raycaster: &Raycaster, maker: u16) {
        self.makers().trust(&self.cells, raycaster, maker);
    }

    /// Implements [`Tracer::trusted_makers`](crate::Tracer::trusted_makers).
    pub(crate) fn trusted(&self) -> Vec<u16> {
        self.makers().trusted()
    }

    fn makers(&self) -> MutexGuard<'_, Makers> {
        self.makers.lock()
    }

    /// Returns one estimate of the radiance that arrives against `start.direction`.
    pub(crate) fn radiance(
        &self,
        engine: &PathEngine,
        raycaster: &Raycaster,
        start: Start,
        sampler: &mut Sampler,
    ) -> Vec3 {
        let policy = GatherPolicy { cells: &self.cells, spreads: self.spreads.as_ref(), engine };
        engine.follow(raycaster, start, &policy, sampler)
    }
}

/// The policy of this engine: paths end in cells.
#[derive(Clone, Copy)]
struct GatherPolicy<'a> {
    cells: &'a CellMap,
    spreads: Option<&'a Spreads>,
    engine: &'a PathEngine,
}

impl PathPolicy for GatherPolicy<'_> {
    type Lessons = Lessons;

    fn ends(
        &self,
        lessons: &mut Lessons,
        at: &LaterVertex,
        carried: &mut Carried,
        sampler: &mut Sampler,
    ) -> bool {
        let Some(albedo) = at.scatter.diffuse_albedo(at.wo) else { return false };
        let place = SurfacePlace::new(at, self.engine.bounces);
        let known = self.cells.look_up(&place, at.footprint);
        if let Some(light) = known {
            *carried.radiance += *carried.throughput * albedo * light;
            let share = if lessons.is_empty() { SHARE } else { CHAIN };
            sampler.turn(at.depth, NumberPurpose::Teach);
            if lessons.is_full() || sampler.one() >= share {
                return true;
            }
        }
        if !lessons.is_full() {
            lessons.begin(place.spot(), albedo, carried, known.is_some());
        }
        false
    }

    #[inline]
    fn spread(&self, engine: &PathEngine, point: Vec3) -> Spread {
        self.spreads.map_or_else(|| engine.spread(), |spreads| spreads.at(point))
    }

    #[inline]
    fn branched(&self, point: Vec3, seen: &FirstSurface) {
        if let Some(spreads) = self.spreads {
            spreads.learn(point, seen);
        }
    }

    fn learn(&self, raycaster: &Raycaster, lessons: Lessons, radiance: Vec3) -> Vec3 {
        lessons.end(radiance, |spot, light, albedo| {
            self.cells.add(&SurfacePlace { raycaster, spot }, light, albedo);
        })
    }
}

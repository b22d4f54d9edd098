//! The objects of a frame: what is seen of them, and their shadows.
//!
//! Invariants:
//! - Pixels that no object and no shadow touches are never changed.
//! - While an object moves, a ray stands for a square of pixels, a *cell*. At rest, each pixel is a
//!   cell.
//! - Passes add up. The result does not depend on how many are drawn at a time, nor on threads.

mod blend;
mod cells;
mod deflected;
mod mirror_map;
mod pass;
mod touch;

use std::sync::Arc;

use glam::Vec3;
use holo_display::{Frame, Interrupt};
use holo_picture::View;
use rayon::prelude::*;

use crate::lit::LitObject;
use crate::room::Room;
use crate::shading::{LightDetail, Shader};
use cells::{CellGrid, LayerTile, Touch, TouchedCells};
use mirror_map::MirrorMap;
use pass::LayerScene;
use touch::TouchTest;

/// How a frame shows objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LayerDetail {
    /// At once, while an object or the eye moves. Each square of this many pixels a side has one
    /// ray. Shadows are sharp, by squares of twice that side.
    Quick(u32),
    /// By this many passes in all, each with other rays.
    Exact(u32),
}

/// What is seen of objects in one view.
pub struct ObjectLayer {
    view: View,
    detail: LayerDetail,
    /// Passes that are drawn.
    passes: u32,
    /// Cells that may show objects. At rest, also those that may lie in their shadows.
    seen: TouchedCells,
    /// Cells that may lie in shadows, in quick frames.
    shaded: Option<TouchedCells>,
    /// Where mirrors of the room are, for quick frames.
    mirrors: Arc<MirrorMap>,
}

impl ObjectLayer {
    /// Returns a layer without any pass, for frames of a view. `frame` is one of them: it
    /// determines where shadows may fall. `room` is the model of the scene, if it is known.
    #[must_use]
    pub fn new(
        frame: &Frame,
        view: &View,
        objects: &[LitObject],
        room: Option<&Room>,
        detail: LayerDetail,
    ) -> ObjectLayer {
        let mirrors = Arc::new(MirrorMap::new(view, frame.picture.size()));
        let never = Interrupt::default();
        ObjectLayer::with(mirrors, frame, view, objects, room, detail, &never)
    }

    /// Returns the same, after another layer. If that is of the same view of the room, what it has
    /// found of the room is not looked for again. `None` if it was interrupted.
    #[must_use]
    pub fn after(
        before: Option<&ObjectLayer>,
        frame: &Frame,
        view: &View,
        objects: &[LitObject],
        room: Option<&Room>,
        detail: LayerDetail,
        interrupt: &Interrupt,
    ) -> Option<ObjectLayer> {
        let size = frame.picture.size();
        let known = before.map(|before| &before.mirrors).filter(|map| map.is_of(view, size));
        let mirrors = known.map_or_else(|| Arc::new(MirrorMap::new(view, size)), Arc::clone);
        let layer = ObjectLayer::with(mirrors, frame, view, objects, room, detail, interrupt);
        (!interrupt.is_set()).then_some(layer)
    }

    /// Returns a layer of what objects touch. An interrupted one is not complete.
    fn with(
        mirrors: Arc<MirrorMap>,
        frame: &Frame,
        view: &View,
        objects: &[LitObject],
        room: Option<&Room>,
        detail: LayerDetail,
        interrupt: &Interrupt,
    ) -> ObjectLayer {
        let size = frame.picture.size();
        let touched = |step: u32, touch: Touch| {
            let grid = CellGrid { size, step };
            let (detail, mirrors) = (detail.into(), &*mirrors);
            let test = TouchTest { frame, view, grid, objects, room, mirrors, touch, detail };
            test.touched(interrupt)
        };
        let (seen, shaded) = match detail {
            LayerDetail::Quick(step) => {
                let step = step.max(1);
                (touched(step, Touch::Sight), Some(touched(2 * step, Touch::Shadow)))
            }
            LayerDetail::Exact(_) => (touched(1, Touch::Both), None),
        };
        ObjectLayer { view: *view, detail, passes: 0, seen, shaded, mirrors }
    }

    /// Returns whether more passes would make it better.
    #[must_use]
    pub fn is_unfinished(&self) -> bool {
        let all = match self.detail {
            LayerDetail::Quick(_) => 1,
            LayerDetail::Exact(passes) => passes,
        };
        let mut cells = std::iter::once(&self.seen).chain(&self.shaded);
        self.passes < all && cells.any(|cells| !cells.tiles.is_empty())
    }

    /// Returns whether it can be composed: a pass is drawn.
    #[must_use]
    pub fn is_drawn(&self) -> bool {
        self.passes > 0
    }

    /// Draws at most this many passes, unless enough are drawn. An interrupt ends the work at once;
    /// the next call goes on with the same pass.
    pub fn draw(
        &mut self,
        frame: &Frame,
        objects: &[LitObject],
        room: Option<&Room>,
        most: u32,
        interrupt: &Interrupt,
    ) {
        let detail = self.detail.into();
        for _ in 0..most {
            if !self.is_unfinished() {
                return;
            }
            let pass = self.passes;
            for touched in std::iter::once(&mut self.seen).chain(&mut self.shaded) {
                let grid = touched.grid;
                let footprint =
                    |distance: f64| self.view.pixel_footprint(grid.cells(), distance) as f32;
                let base = footprint(0.0);
                let width = (base, footprint(1.0) - base);
                let shader = Shader { objects, room, detail };
                let scene = LayerScene {
                    shader,
                    frame,
                    view: &self.view,
                    grid,
                    touch: touched.touch,
                    width,
                };
                touched.tiles.par_iter_mut().for_each(|tile| {
                    if tile.passes == pass && !interrupt.is_set() {
                        tile.cells.iter_mut().for_each(|cell| scene.add(cell, pass));
                        tile.passes += 1;
                    }
                });
                if touched.tiles.iter().any(|tile| tile.passes == pass) {
                    return;
                }
            }
            self.passes += 1;
        }
    }

    /// Draws objects and shadows over a frame of the layer's view and size, without objects so far.
    pub fn compose(&self, frame: &mut Frame) {
        let grid = self.seen.grid;
        if self.passes == 0 || frame.picture.size() != grid.size {
            return;
        }
        if let Some(shaded) = &self.shaded {
            let depth = frame.depth.clone();
            shaded.compose(frame, &depth);
            self.seen.compose(frame, &depth);
            return;
        }
        for (cell, passes) in self.seen.tiles.iter().flat_map(LayerTile::cells_and_passes) {
            let share = 1.0 / passes as f32;
            let at = (cell.row * grid.size.0 + cell.column) as usize;
            let room = Vec3::from(frame.picture.pixels[at]);
            let seen = room * cell.behind.max(Vec3::ZERO) + cell.radiance;
            // Surfaces of the room that show an object lose what they showed of the room.
            frame.picture.pixels[at] = (seen * share).max(Vec3::ZERO).to_array();
            if 2 * cell.seen > passes {
                frame.depth[at] = cell.distance / cell.seen as f32;
            }
        }
    }

    /// Returns the share of the picture in which an object is seen, 0 to 1.
    #[must_use]
    pub fn visible_share(&self) -> f64 {
        let seen = self.seen.cells().filter(|cell| 2 * cell.seen > self.passes).count();
        let (columns, rows) = self.seen.grid.cells();
        seen as f64 / (f64::from(columns) * f64::from(rows))
    }

    /// Returns whether an object is seen in a pixel of the layer, in most of its passes.
    #[must_use]
    pub fn shows_object(&self, column: u32, row: u32) -> bool {
        let step = self.seen.grid.step;
        let here = (column / step, row / step);
        let mut here = self.seen.cells().filter(|cell| (cell.column, cell.row) == here);
        here.any(|cell| 2 * cell.seen > self.passes)
    }
}

impl From<LayerDetail> for LightDetail {
    fn from(detail: LayerDetail) -> LightDetail {
        match detail {
            LayerDetail::Quick(_) => LightDetail::Quick,
            LayerDetail::Exact(_) => LightDetail::Exact,
        }
    }
}

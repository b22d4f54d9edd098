//! Finds the cells that objects or their shadows may touch.

use glam::Vec3;
use holo_display::{Frame, Interrupt};
use holo_picture::View;
use rayon::prelude::*;

use super::cells::{CellGrid, LayerCell, LayerTile, TILE, Touch, TouchedCells};
use super::deflected::DeflectedRays;
use super::mirror_map::MirrorMap;
use crate::lit::LitObject;
use crate::room::{DeflectedRay, Room};
use crate::shading::LightDetail;
use crate::shadow::may_shadow;
use crate::sheen::RoomSheen;

/// Distance of the cells by which a tile is tested, cells.
const APART: u32 = 4;

/// Finds the cells that objects touch.
pub(super) struct TouchTest<'a> {
    pub frame: &'a Frame,
    pub view: &'a View,
    pub grid: CellGrid,
    pub objects: &'a [LitObject],
    /// The model of the scene, if it is known.
    pub room: Option<&'a Room>,
    /// Where its mirrors are, for quick frames.
    pub mirrors: &'a MirrorMap,
    pub touch: Touch,
    pub detail: LightDetail,
}

impl TouchTest<'_> {
    /// Returns the cells that objects touch; only some of them if it was interrupted.
    pub(super) fn touched(&self, interrupt: &Interrupt) -> TouchedCells {
        let cells = self.grid.cells();
        let across = cells.0.div_ceil(TILE);
        let tile = |tile: u32| {
            let (left, top) = (tile % across * TILE, tile / across * TILE);
            let columns = left..(left + TILE).min(cells.0);
            let rows = top..(top + TILE).min(cells.1);
            let row = tile / across;
            let places = |step: usize| {
                let columns = columns.clone().step_by(step);
                let rows = rows.clone().step_by(step);
                rows.flat_map(move |row| columns.clone().map(move |column| (column, row)))
            };
            // Most tiles are far from all objects, and a few of their cells say so.
            let is_far = || !places(APART as usize).any(|place| self.cell(place, APART).is_some());
            if interrupt.is_set() || is_far() {
                return LayerTile { row, passes: 0, cells: Vec::new() };
            }
            LayerTile {
                row,
                passes: 0,
                cells: places(1).filter_map(|at| self.cell(at, 1)).collect(),
            }
        };
        let tiles = (0..across * cells.1.div_ceil(TILE)).into_par_iter().map(tile);
        let tiles = tiles.filter(|tile| !tile.cells.is_empty()).collect();
        TouchedCells { grid: self.grid, touch: self.touch, tiles }
    }

    /// Returns a cell that an object or its shadow may touch, or another one within `reach` cells;
    /// `None` if neither can.
    fn cell(&self, (column, row): (u32, u32), reach: u32) -> Option<LayerCell> {
        let size = self.grid.size;
        let pixel = self.grid.place(column, row);
        let (x, y) = View::pixel_centre(size, pixel.0, pixel.1);
        let (origin, direction, _) = self.view.clipped_ray(x, y)?;
        let cells = self.grid.cells();
        let margin =
            |distance: f64| f64::from(reach) * 1.5 * self.view.pixel_footprint(cells, distance);
        let shows = |lit: &LitObject| {
            let object = &lit.object;
            object.is_near(origin, direction, margin(origin.distance(object.centre())))
        };
        let may_show = self.touch != Touch::Shadow && self.objects.iter().any(shows);
        let depth = f64::from(self.frame.depth[self.grid.pixel(column, row)]);
        let is_surface = self.touch != Touch::Sight && depth > 0.0 && depth.is_finite();
        let place = self.view.ray_to(origin).0 + direction * depth;
        // Surfaces that are seen from the side go farther between two pixels.
        let around = if reach > 1 { 4.0 * margin(depth) } else { 0.0 };
        let shades = |lit: &LitObject| may_shadow(lit, place, around, self.detail);
        let may_shade = is_surface && self.objects.iter().any(shades);
        let is_quick = self.detail == LightDetail::Quick;
        let mirrors = self.room.filter(|room| {
            room.has_mirrors() && (!is_quick || self.mirrors.has_mirror(room, pixel))
        });
        let gloss = self.room.filter(|room| room.has_gloss() && !is_quick);
        let mut may_gleam = false;
        let mut gleams = |sheen: RoomSheen| {
            let margin = margin(origin.distance(sheen.origin));
            may_gleam |= self.objects.iter().any(|lit| sheen.may_show(&lit.object, margin));
        };
        let hit = match (gloss, mirrors) {
            (Some(room), _) => {
                room.sheens((origin, direction), f64::INFINITY, |sheen, _| gleams(sheen)).1
            }
            (None, Some(room)) => room.nearest(origin, direction),
            (None, None) => None,
        };
        let may_mirror = mirrors.is_some_and(|room| {
            let far = |way: f64| margin(depth.max(0.0)) + margin(way);
            let shows = |ray: &DeflectedRay, lit: &LitObject| {
                let margin = far(ray.origin.distance(lit.object.centre()));
                self.touch != Touch::Shadow && lit.object.is_near(ray.origin, ray.direction, margin)
            };
            let shades = |ray: &DeflectedRay, distance: f64, lit: &LitObject| {
                let place = ray.origin + ray.direction * distance;
                self.touch != Touch::Sight && may_shadow(lit, place, far(distance), self.detail)
            };
            let mut deflected = DeflectedRays::new(room, (origin, direction), hit);
            deflected.any(|(ray, hit)| {
                self.objects.iter().any(|lit| {
                    shows(&ray, lit) || hit.is_some_and(|(_, distance)| shades(&ray, distance, lit))
                })
            })
        });
        (may_show || may_shade || may_mirror || may_gleam).then_some(LayerCell {
            column,
            row,
            may_show,
            may_shadow: may_shade,
            may_mirror,
            may_gleam,
            radiance: Vec3::ZERO,
            behind: Vec3::ZERO,
            seen: 0,
            distance: 0.0,
        })
    }
}

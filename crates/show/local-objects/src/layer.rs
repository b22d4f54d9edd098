//! The objects of a frame: what is seen of them, and their shadows.
//!
//! Invariants:
//! - Pixels that no object and no shadow touches are never changed.
//! - While an object moves, a ray stands for a square of pixels, a *cell*. At rest, each pixel is a
//!   cell.
//! - Passes add up. The result does not depend on how many are drawn at a time, nor on threads.

use glam::{DVec3, Vec3};
use holo_display::{Frame, Interrupt, mix};
use holo_picture::View;
use rayon::prelude::*;

use crate::lit::LitObject;
use crate::numbers::PassNumbers;
use crate::room::{Room, RoomSurface};
use crate::shading::{LightDetail, SeenObject, Shader};
use crate::shadow::{Shadowed, may_shadow};

/// Side of a tile, cells.
const TILE: u32 = 16;

/// Distance of the cells by which a tile is tested, cells.
const APART: u32 = 4;

/// Relative difference of distances within which an object is in front of what a frame shows there.
const NEARLY: f64 = 1e-3;

/// Relative difference of distances within which two pixels show the same surface.
const SAME_DEPTH: f32 = 0.05;

/// Weight of cells in pixels that show another surface.
const OTHER_DEPTH: f32 = 1e-3;

/// Share of light above which no shadow is seen.
const NEARLY_ALL_LIGHT: f32 = 0.995;

/// How a frame shows objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LayerDetail {
    /// At once, while an object or the eye moves: one ray for each square of this many pixels a
    /// side, and sharp shadows.
    Quick(u32),
    /// By this many passes in all, each with other rays.
    Exact(u32),
}

/// What is seen of objects in one view.
pub struct ObjectLayer {
    view: View,
    grid: CellGrid,
    detail: LayerDetail,
    /// Passes that are drawn.
    passes: u32,
    tiles: Vec<LayerTile>,
}

/// The cells of a tile that objects touch.
struct LayerTile {
    /// The row of tiles.
    row: u32,
    cells: Vec<LayerCell>,
}

/// A cell that objects touch, and sums over its passes.
#[derive(Clone, Copy)]
struct LayerCell {
    column: u32,
    row: u32,
    /// Whether an object may be seen here, and whether its shadow may be.
    may_show: bool,
    may_shadow: bool,
    /// Radiance of objects.
    radiance: Vec3,
    /// Share of what is behind them that is seen, with the light that they leave there.
    behind: Vec3,
    /// Number of passes that see an object, and the sum of its distances.
    seen: u32,
    distance: f32,
}

/// The cells of a picture.
#[derive(Clone, Copy)]
struct CellGrid {
    /// Columns and rows of the picture.
    size: (u32, u32),
    /// Side of a cell, pixels.
    step: u32,
}

/// What all cells of a layer share.
struct LayerScene<'a> {
    shader: Shader<'a>,
    frame: &'a Frame,
    view: &'a View,
    grid: CellGrid,
    /// Width of a ray at its beginning, and its growth with the distance.
    width: (f32, f32),
}

impl ObjectLayer {
    /// Returns a layer without any pass, for frames of a view. `frame` is one of them: it determines
    /// where shadows may fall.
    #[must_use]
    pub fn new(
        frame: &Frame,
        view: &View,
        objects: &[LitObject],
        detail: LayerDetail,
    ) -> ObjectLayer {
        let step = match detail {
            LayerDetail::Quick(step) => step.max(1),
            LayerDetail::Exact(_) => 1,
        };
        let grid = CellGrid { size: frame.picture.size(), step };
        let cells = grid.cells();
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
            let touches = TouchTest { frame, view, grid, objects, detail: detail.into() };
            // Most tiles are far from all objects, and a few of their cells say so.
            if !places(APART as usize).any(|place| touches.cell(place, APART).is_some()) {
                return LayerTile { row, cells: Vec::new() };
            }
            LayerTile { row, cells: places(1).filter_map(|at| touches.cell(at, 1)).collect() }
        };
        let tiles: Vec<LayerTile> = (0..across * cells.1.div_ceil(TILE))
            .into_par_iter()
            .map(tile)
            .filter(|tile| !tile.cells.is_empty())
            .collect();
        ObjectLayer { view: *view, grid, detail, passes: 0, tiles }
    }

    /// Returns whether more passes would make it better.
    #[must_use]
    pub fn is_unfinished(&self) -> bool {
        let all = match self.detail {
            LayerDetail::Quick(_) => 1,
            LayerDetail::Exact(passes) => passes,
        };
        self.passes < all && !self.tiles.is_empty()
    }

    /// Draws at most this many passes, unless enough are drawn. An interrupt ends the work between
    /// two of them, but not before the first.
    pub fn draw(
        &mut self,
        frame: &Frame,
        objects: &[LitObject],
        room: Option<&Room>,
        most: u32,
        interrupt: &Interrupt,
    ) {
        let detail = self.detail.into();
        let cells = self.grid.cells();
        let footprint = |distance: f64| self.view.pixel_footprint(cells, distance) as f32;
        let base = footprint(0.0);
        let scene = LayerScene {
            shader: Shader { objects, room, detail },
            frame,
            view: &self.view,
            grid: self.grid,
            width: (base, footprint(1.0) - base),
        };
        for drawn in 0..most {
            if !self.is_unfinished() || (drawn > 0 && interrupt.is_set()) {
                return;
            }
            let pass = self.passes;
            self.tiles.par_iter_mut().for_each(|tile| {
                tile.cells.iter_mut().for_each(|cell| scene.add(cell, pass));
            });
            self.passes += 1;
        }
    }

    /// Draws objects and shadows over a frame of the layer's view and size, without objects so far.
    pub fn compose(&self, frame: &mut Frame) {
        if self.passes == 0 || frame.picture.size() != self.grid.size {
            return;
        }
        if self.grid.step > 1 {
            self.compose_cells(frame);
            return;
        }
        let share = 1.0 / self.passes as f32;
        for cell in self.tiles.iter().flat_map(|tile| &tile.cells) {
            let at = (cell.row * self.grid.size.0 + cell.column) as usize;
            let room = Vec3::from(frame.picture.pixels[at]);
            let seen = room * cell.behind.max(Vec3::ZERO) + cell.radiance;
            frame.picture.pixels[at] = (seen * share).to_array();
            if 2 * cell.seen > self.passes {
                frame.depth[at] = cell.distance / cell.seen as f32;
            }
        }
    }

    /// Draws over a frame whose pixels lie between the middles of cells.
    fn compose_cells(&self, frame: &mut Frame) {
        let (width, step) = (self.grid.size.0 as usize, self.grid.step);
        let across = self.grid.cells().0 as usize;
        let mut places = vec![u32::MAX; across * self.grid.cells().1 as usize];
        let cells: Vec<&LayerCell> = self.tiles.iter().flat_map(|tile| &tile.cells).collect();
        for (number, cell) in (0..).zip(&cells) {
            places[cell.row as usize * across + cell.column as usize] = number;
        }
        let depth = frame.depth.clone();
        let blend = CellBlend { grid: self.grid, places, cells, depth: &depth };
        let band = width * (TILE * step) as usize;
        let bands = frame.picture.pixels.par_chunks_mut(band);
        bands.zip(frame.depth.par_chunks_mut(band)).enumerate().for_each(|(band, rows)| {
            let (pixels, depth) = rows;
            let tiles = self.tiles.iter().filter(|tile| tile.row as usize == band);
            for tile in tiles {
                let left = tile.cells[0].column / TILE * TILE * step;
                let right = (left + TILE * step).min(self.grid.size.0);
                for (row, line) in pixels.chunks_exact_mut(width).enumerate() {
                    for column in left..right {
                        let place = (column, row as u32 + tile.row * TILE * step);
                        let Some((behind, radiance, distance)) = blend.at(place) else { continue };
                        let pixel = &mut line[column as usize];
                        *pixel = (Vec3::from(*pixel) * behind + radiance).to_array();
                        if let Some(distance) = distance {
                            depth[row * width + column as usize] = distance;
                        }
                    }
                }
            }
        });
    }

    /// Returns the share of the picture in which an object is seen, 0 to 1.
    #[must_use]
    pub fn visible_share(&self) -> f64 {
        let cells = self.tiles.iter().flat_map(|tile| &tile.cells);
        let seen = cells.filter(|cell| 2 * cell.seen > self.passes).count();
        let (columns, rows) = self.grid.cells();
        seen as f64 / (f64::from(columns) * f64::from(rows))
    }

    /// Returns whether an object is seen in a pixel of the layer, in most of its passes.
    #[must_use]
    pub fn shows_object(&self, column: u32, row: u32) -> bool {
        let here = (column / self.grid.step, row / self.grid.step);
        let cells = self.tiles.iter().flat_map(|tile| &tile.cells);
        let mut here = cells.filter(|cell| (cell.column, cell.row) == here);
        here.any(|cell| 2 * cell.seen > self.passes)
    }
}

/// Cells around pixels.
struct CellBlend<'a> {
    grid: CellGrid,
    /// For each cell of the grid, its place in `cells`.
    places: Vec<u32>,
    cells: Vec<&'a LayerCell>,
    /// Distances of the frame without objects.
    depth: &'a [f32],
}

impl CellBlend<'_> {
    /// Returns what the cells around a pixel say: the share of what is behind the objects, their
    /// radiance, and their distance if one is seen. `None` if objects change nothing there.
    ///
    /// A cell counts little where the room is at another distance than at its middle.
    fn at(&self, (column, row): (u32, u32)) -> Option<(Vec3, Vec3, Option<f32>)> {
        let (columns, rows) = self.grid.cells();
        let between = |pixel: u32, count: u32| {
            // The ray of a cell goes through the middle of one of its pixels.
            let along = (pixel as f32 - (self.grid.step / 2) as f32) / self.grid.step as f32;
            let first = along.floor();
            let of = |step: f32| ((first + step).max(0.0) as u32).min(count - 1);
            ([of(0.0), of(1.0)], along - first)
        };
        let ((left_right, across), (top_bottom, down)) =
            (between(column, columns), between(row, rows));
        let here = self.depth[(row * self.grid.size.0 + column) as usize];
        let (mut behind, mut radiance) = (Vec3::ZERO, Vec3::ZERO);
        let (mut whole, mut seen, mut distance) = (0.0, 0.0, 0.0);
        let mut is_touched = false;
        for (row, weight) in top_bottom.into_iter().zip([1.0 - down, down]) {
            for (column, share) in left_right.into_iter().zip([1.0 - across, across]) {
                let there = self.depth[self.grid.pixel(column, row)];
                let is_same = there == here || (there - here).abs() < SAME_DEPTH * here;
                let weight = weight * share * if is_same { 1.0 } else { OTHER_DEPTH };
                whole += weight;
                match self.places[(row * columns + column) as usize] {
                    u32::MAX => behind += Vec3::splat(weight),
                    place => {
                        let cell = self.cells[place as usize];
                        is_touched = true;
                        behind += cell.behind * weight;
                        radiance += cell.radiance * weight;
                        if cell.seen > 0 {
                            seen += weight;
                            distance += cell.distance * weight;
                        }
                    }
                }
            }
        }
        let distance = (2.0 * seen > whole).then(|| distance / seen);
        let share = 1.0 / whole.max(f32::MIN_POSITIVE);
        is_touched.then_some((behind * share, radiance * share, distance))
    }
}

impl CellGrid {
    /// Returns the columns and rows of cells.
    fn cells(self) -> (u32, u32) {
        (self.size.0.div_ceil(self.step), self.size.1.div_ceil(self.step))
    }

    /// Returns the column and row of the pixel through whose middle a cell's ray goes.
    fn place(self, column: u32, row: u32) -> (u32, u32) {
        let of = |cell: u32, most: u32| (cell * self.step + self.step / 2).min(most - 1);
        (of(column, self.size.0), of(row, self.size.1))
    }

    /// Returns the number of that pixel.
    fn pixel(self, column: u32, row: u32) -> usize {
        let (column, row) = self.place(column, row);
        (row * self.size.0 + column) as usize
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

/// Finds the cells that objects touch.
struct TouchTest<'a> {
    frame: &'a Frame,
    view: &'a View,
    grid: CellGrid,
    objects: &'a [LitObject],
    detail: LightDetail,
}

impl TouchTest<'_> {
    /// Returns a cell that an object or its shadow may touch, or another one within `reach` cells;
    /// `None` if neither can.
    fn cell(&self, (column, row): (u32, u32), reach: u32) -> Option<LayerCell> {
        let size = self.grid.size;
        let place = self.grid.place(column, row);
        let (x, y) = View::pixel_centre(size, place.0, place.1);
        let (origin, direction, _) = self.view.clipped_ray(x, y)?;
        let cells = self.grid.cells();
        let margin =
            |distance: f64| f64::from(reach) * 1.5 * self.view.pixel_footprint(cells, distance);
        let shows = |lit: &LitObject| {
            let object = &lit.object;
            object.is_near(origin, direction, margin(origin.distance(object.centre())))
        };
        let may_show = self.objects.iter().any(shows);
        let depth = f64::from(self.frame.depth[self.grid.pixel(column, row)]);
        let is_surface = depth > 0.0 && depth.is_finite();
        let place = self.view.ray_to(origin).0 + direction * depth;
        // Surfaces that are seen from the side go farther between two pixels.
        let margin = if reach > 1 { 4.0 * margin(depth) } else { 0.0 };
        let shades = |lit: &LitObject| may_shadow(lit, place, margin, self.detail);
        let may_shadow = is_surface && self.objects.iter().any(shades);
        (may_show || may_shadow).then_some(LayerCell {
            column,
            row,
            may_show,
            may_shadow,
            radiance: Vec3::ZERO,
            behind: Vec3::ZERO,
            seen: 0,
            distance: 0.0,
        })
    }
}

impl LayerScene<'_> {
    /// Adds a pass to a cell.
    fn add(&self, cell: &mut LayerCell, pass: u32) {
        let (column, row) = self.grid.place(cell.column, cell.row);
        let number = row * self.grid.size.0 + column;
        let mut numbers = PassNumbers::new(mix(1, number), pass);
        let is_quick = self.shader.detail == LightDetail::Quick;
        let (dx, dy) = if is_quick { (0.5, 0.5) } else { numbers.two() };
        let (width, height) = (f64::from(self.grid.size.0), f64::from(self.grid.size.1));
        let x = (f64::from(column) + f64::from(dx)) / width;
        let y = 1.0 - (f64::from(row) + f64::from(dy)) / height;
        let (mut through, mut left) = (Vec3::ONE, Vec3::ONE);
        if let Some((origin, direction, reach)) = self.view.clipped_ray(x, y) {
            // To be quick, only what seems to lie in a shadow is looked at.
            let is_asked = !is_quick || cell.may_show;
            let room = self.shader.room.filter(|_| is_asked);
            let known = room.map(|room| (room, room.nearest(origin, direction)));
            // Distances of frames begin at the eye, also if the view is clipped.
            let clipped = self.view.ray_to(origin).0.distance(origin);
            let depth = f64::from(self.frame.depth[number as usize]) - clipped;
            let behind = match &known {
                Some((_, hit)) => hit.map_or(f64::INFINITY, |(_, distance)| distance),
                None if depth > 0.0 => depth,
                None => f64::INFINITY,
            };
            let seen = match cell.may_show {
                true => self.shader.seen(origin, direction, self.width, &mut numbers),
                false => None,
            };
            let in_front = |seen: &SeenObject| seen.distance < (behind * (1.0 + NEARLY)).min(reach);
            if let Some(seen) = seen.filter(in_front) {
                through = seen.through;
                cell.radiance += seen.radiance;
                cell.seen += 1;
                cell.distance += (seen.distance + clipped) as f32;
            }
            if through != Vec3::ZERO && cell.may_shadow && behind.is_finite() {
                let place = origin + direction * behind;
                let seems_dark = !is_quick
                    || self.left_at((column, row), place, &mut numbers).min_element() < NEARLY_ALL_LIGHT;
                left = match (self.shader.room, known) {
                    _ if !seems_dark => Vec3::ONE,
                    (Some(room), known) => {
                        let hit = known.map_or_else(|| room.nearest(origin, direction), |k| k.1);
                        let width = self.width.0 + self.width.1 * behind as f32;
                        let surface =
                            hit.and_then(|(hit, _)| room.surface(&hit, direction.as_vec3(), width));
                        surface.map_or(Vec3::ONE, |surface| {
                            self.left_of(room, &surface, number, &mut numbers)
                        })
                    }
                    (None, _) => self.left_at((column, row), place, &mut numbers),
                };
            }
        }
        cell.behind += through * left;
    }

    /// Returns the share of light that objects leave to a surface of the room.
    fn left_of(
        &self,
        room: &Room,
        surface: &RoomSurface,
        number: u32,
        numbers: &mut PassNumbers,
    ) -> Vec3 {
        let radiance = Vec3::from(self.frame.picture.pixels[number as usize]);
        let (place, normal) = (surface.place, surface.normal);
        self.left(Shadowed { place, normal, known: Some((room, surface, radiance)) }, numbers)
    }

    /// Returns the share of light that objects leave to what a pixel shows, by the frame's
    /// distances alone.
    fn left_at(&self, pixel: (u32, u32), place: DVec3, numbers: &mut PassNumbers) -> Vec3 {
        match self.normal(pixel, place) {
            Some(normal) => self.left(Shadowed { place, normal, known: None }, numbers),
            None => Vec3::ONE,
        }
    }

    fn left(&self, surface: Shadowed, numbers: &mut PassNumbers) -> Vec3 {
        let objects = self.shader.objects.iter();
        let detail = self.shader.detail;
        objects.map(|lit| Vec3::ONE - surface.share(lit, detail, numbers)).product()
    }

    /// Returns the normal of what a pixel shows, by the distances of the pixels around it.
    fn normal(&self, (column, row): (u32, u32), here: DVec3) -> Option<Vec3> {
        let at = |column: Option<u32>, row: Option<u32>| {
            let (column, row) = (column?, row?);
            let size = self.grid.size;
            if column >= size.0 || row >= size.1 {
                return None;
            }
            let depth = f64::from(self.frame.depth[(row * size.0 + column) as usize]);
            let (x, y) = View::pixel_centre(size, column, row);
            let (origin, direction, _) = self.view.clipped_ray(x, y)?;
            (depth > 0.0 && depth.is_finite()).then(|| origin + direction * depth)
        };
        let here = at(Some(column), Some(row)).unwrap_or(here);
        let step = |before: Option<DVec3>, after: Option<DVec3>| {
            let steps = [before.map(|before| here - before), after.map(|after| after - here)];
            steps.into_iter().flatten().min_by(|a, b| a.length().total_cmp(&b.length()))
        };
        let across = step(at(column.checked_sub(1), Some(row)), at(Some(column + 1), Some(row)))?;
        let down = step(at(Some(column), row.checked_sub(1)), at(Some(column), Some(row + 1)))?;
        let normal = across.cross(down).try_normalize()?;
        let towards = self.view.ray_to(here).1;
        let normal = if normal.dot(towards) > 0.0 { -normal } else { normal };
        Some(normal.as_vec3())
    }
}

//! The objects of a frame: what is seen of them, and their shadows.
//!
//! Invariants:
//! - Pixels that no object and no shadow touches are never changed.
//! - While an object moves, a ray stands for a square of pixels, a *cell*. At rest, each pixel is a
//!   cell.
//! - Passes add up. The result does not depend on how many are drawn at a time, nor on threads.

use std::ops::Range;

use glam::{DVec3, Vec3};
use holo_display::{Frame, Interrupt, mix};
use holo_picture::View;
use holo_raycast::Hit;
use rayon::prelude::*;

use crate::lit::LitObject;
use crate::numbers::PassNumbers;
use crate::room::{MirroredRay, Room, RoomSurface};
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

/// How a frame shows objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LayerDetail {
    /// At once, while an object or the eye moves: one ray for each square of this many pixels a
    /// side, and sharp shadows by squares of twice that side.
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
}

/// The cells of a grid that objects touch.
struct TouchedCells {
    grid: CellGrid,
    touch: Touch,
    tiles: Vec<LayerTile>,
}

/// The cells of a tile that objects touch.
struct LayerTile {
    /// The row of tiles.
    row: u32,
    /// Passes that are drawn.
    passes: u32,
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
    /// Whether one of both may be in a mirror of the room.
    may_mirror: bool,
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
    touch: Touch,
    /// Width of a ray at its beginning, and its growth with the distance.
    width: (f32, f32),
}

impl ObjectLayer {
    /// Returns a layer without any pass, for frames of a view. `frame` is one of them: it determines
    /// where shadows may fall. `room` is the model of the scene, if it is known.
    #[must_use]
    pub fn new(
        frame: &Frame,
        view: &View,
        objects: &[LitObject],
        room: Option<&Room>,
        detail: LayerDetail,
    ) -> ObjectLayer {
        let mirrors = room.filter(|room| room.has_mirrors());
        let touched = |step: u32, what: Touch| {
            let grid = CellGrid { size: frame.picture.size(), step };
            let test =
                TouchTest { frame, view, grid, objects, mirrors, what, detail: detail.into() };
            TouchedCells::new(&test)
        };
        let (seen, shaded) = match detail {
            LayerDetail::Quick(step) => {
                let step = step.max(1);
                (touched(step, Touch::Sight), Some(touched(2 * step, Touch::Shadow)))
            }
            LayerDetail::Exact(_) => (touched(1, Touch::Both), None),
        };
        ObjectLayer { view: *view, detail, passes: 0, seen, shaded }
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
            frame.picture.pixels[at] = (seen * share).to_array();
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

impl LayerTile {
    /// Returns the cells, each with its passes: an interrupted pass is a part of some.
    fn cells_and_passes(&self) -> impl Iterator<Item = (&LayerCell, u32)> {
        self.cells.iter().map(|cell| (cell, self.passes))
    }
}

impl TouchedCells {
    /// Returns the cells that objects touch.
    fn new(test: &TouchTest<'_>) -> TouchedCells {
        let cells = test.grid.cells();
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
            if !places(APART as usize).any(|place| test.cell(place, APART).is_some()) {
                return LayerTile { row, passes: 0, cells: Vec::new() };
            }
            LayerTile {
                row,
                passes: 0,
                cells: places(1).filter_map(|at| test.cell(at, 1)).collect(),
            }
        };
        let tiles = (0..across * cells.1.div_ceil(TILE)).into_par_iter().map(tile);
        let tiles = tiles.filter(|tile| !tile.cells.is_empty()).collect();
        TouchedCells { grid: test.grid, touch: test.what, tiles }
    }

    fn cells(&self) -> impl Iterator<Item = &LayerCell> {
        self.tiles.iter().flat_map(|tile| &tile.cells)
    }

    /// Draws over a frame whose pixels lie between the middles of cells. `depth` has its distances
    /// without objects.
    fn compose(&self, frame: &mut Frame, depth: &[f32]) {
        let (grid, (across, down)) = (self.grid, self.grid.cells());
        let mut places = vec![u32::MAX; across as usize * down as usize];
        let changes = |cell: &&LayerCell| cell.seen > 0 || cell.behind != Vec3::ONE;
        let cells: Vec<&LayerCell> = self.cells().filter(changes).collect();
        for (number, cell) in (0..).zip(&cells) {
            places[(cell.row * across + cell.column) as usize] = number;
        }
        let corner = |column: i64, row: i64| {
            let of = |cell: i64, count: u32| cell.clamp(0, i64::from(count) - 1) as u32;
            let (column, row) = (of(column, across), of(row, down));
            let cell = cells.get(places[(row * across + column) as usize] as usize);
            BlendCorner { cell: cell.copied(), depth: depth[grid.pixel(column, row)] }
        };
        let (width, side) = (grid.size.0, TILE * grid.step);
        let band = (width * side) as usize;
        let bands = frame.picture.pixels.par_chunks_mut(band);
        bands.zip(frame.depth.par_chunks_mut(band)).enumerate().for_each(|(number, band)| {
            let (pixels, distances) = band;
            let top = number as u32 * side;
            let rows = top..top + (pixels.len() / width as usize) as u32;
            for tile in self.tiles.iter().filter(|tile| tile.row as usize == number) {
                let left = tile.cells[0].column / TILE * side;
                let columns = left..(left + side).min(width);
                for (cell_row, rows) in grid.squares(rows.clone()) {
                    for (cell_column, columns) in grid.squares(columns.clone()) {
                        let at = |x: i64, y: i64| corner(cell_column + x, cell_row + y);
                        let corners = [at(0, 0), at(1, 0), at(0, 1), at(1, 1)];
                        if corners.iter().all(|corner| corner.cell.is_none()) {
                            continue;
                        }
                        for row in rows.clone() {
                            let y = grid.share(cell_row, row);
                            for column in columns.clone() {
                                let here = depth[(row * width + column) as usize];
                                let place = [grid.share(cell_column, column), y];
                                let (behind, radiance, distance) = blend(&corners, place, here);
                                let at = ((row - top) * width + column) as usize;
                                let seen = Vec3::from(pixels[at]) * behind + radiance;
                                pixels[at] = seen.to_array();
                                distances[at] = distance.unwrap_or(distances[at]);
                            }
                        }
                    }
                }
            }
        });
    }
}

/// One of the four cells around a pixel.
struct BlendCorner<'a> {
    /// `None` if objects change nothing there.
    cell: Option<&'a LayerCell>,
    /// Distance of the room at the cell's middle.
    depth: f32,
}

/// Returns what the cells around a pixel say: the share of what is behind the objects, their
/// radiance, and their distance if one is seen. The pixel's place between them is from 0 to 1.
///
/// A cell counts little where the room is at another distance than at its middle.
fn blend(corners: &[BlendCorner<'_>; 4], [x, y]: [f32; 2], here: f32) -> (Vec3, Vec3, Option<f32>) {
    let weights = [(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y];
    let (mut behind, mut radiance) = (Vec3::ZERO, Vec3::ZERO);
    let (mut whole, mut seen, mut distance) = (0.0, 0.0, 0.0);
    for (BlendCorner { cell, depth }, weight) in corners.iter().zip(weights) {
        let is_same = *depth == here || (depth - here).abs() < SAME_DEPTH * here;
        let weight = if is_same { weight } else { OTHER_DEPTH * weight };
        whole += weight;
        let Some(cell) = cell else {
            behind += Vec3::splat(weight);
            continue;
        };
        behind += cell.behind * weight;
        radiance += cell.radiance * weight;
        if cell.seen > 0 {
            seen += weight;
            distance += cell.distance * weight;
        }
    }
    let distance = (2.0 * seen > whole).then(|| distance / seen);
    let share = 1.0 / whole.max(f32::MIN_POSITIVE);
    (behind * share, radiance * share, distance)
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

    /// Returns the pixels of a range that lie between the middles of two cells, with the number of
    /// the first cell: from -1, before the picture.
    fn squares(self, pixels: Range<u32>) -> impl Iterator<Item = (i64, Range<u32>)> {
        let (step, half) = (i64::from(self.step), i64::from(self.step / 2));
        let cell = move |pixel: u32| (i64::from(pixel) - half).div_euclid(step);
        (cell(pixels.start)..=cell(pixels.end - 1)).map(move |cell| {
            let first = (cell * step + half).max(i64::from(pixels.start)) as u32;
            let end = ((cell + 1) * step + half).min(i64::from(pixels.end)) as u32;
            (cell, first..end)
        })
    }

    /// Returns where a pixel lies between the middle of a cell, 0, and that of the next one, 1.
    fn share(self, cell: i64, pixel: u32) -> f32 {
        let (step, half) = (i64::from(self.step), i64::from(self.step / 2));
        (i64::from(pixel) - half - cell * step) as f32 / step as f32
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

/// How objects touch cells.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Touch {
    /// They may be seen there.
    Sight,
    /// Their shadows may be.
    Shadow,
    /// One of both.
    Both,
}

/// Most mirrors that a ray follows.
const MOST_MIRRORS: usize = 4;

/// The rays that mirrors of the room send on, one after the other, with what each meets.
struct Mirrored<'a> {
    room: &'a Room,
    direction: DVec3,
    hit: Option<(Hit, f64)>,
    mirrors: usize,
}

impl<'a> Mirrored<'a> {
    fn new(room: &'a Room, origin: DVec3, direction: DVec3) -> Mirrored<'a> {
        Mirrored { room, direction, hit: room.nearest(origin, direction), mirrors: 0 }
    }
}

impl Iterator for Mirrored<'_> {
    type Item = (MirroredRay, Option<(Hit, f64)>);

    fn next(&mut self) -> Option<Self::Item> {
        self.mirrors += 1;
        let (hit, _) = self.hit.filter(|_| self.mirrors <= MOST_MIRRORS)?;
        let ray = self.room.mirrored(&hit, self.direction)?;
        self.direction = ray.direction;
        self.hit = self.room.nearest(ray.origin, ray.direction);
        Some((ray, self.hit))
    }
}

/// Finds the cells that objects touch.
struct TouchTest<'a> {
    frame: &'a Frame,
    view: &'a View,
    grid: CellGrid,
    objects: &'a [LitObject],
    /// The room, if it has mirrors.
    mirrors: Option<&'a Room>,
    what: Touch,
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
        let may_show = self.what != Touch::Shadow && self.objects.iter().any(shows);
        let depth = f64::from(self.frame.depth[self.grid.pixel(column, row)]);
        let is_surface = self.what != Touch::Sight && depth > 0.0 && depth.is_finite();
        let place = self.view.ray_to(origin).0 + direction * depth;
        // Surfaces that are seen from the side go farther between two pixels.
        let around = if reach > 1 { 4.0 * margin(depth) } else { 0.0 };
        let shades = |lit: &LitObject| may_shadow(lit, place, around, self.detail);
        let may_shade = is_surface && self.objects.iter().any(shades);
        let may_mirror = self.mirrors.is_some_and(|room| {
            let far = |way: f64| margin(depth.max(0.0)) + margin(way);
            let shows = |ray: &MirroredRay, lit: &LitObject| {
                let margin = far(ray.origin.distance(lit.object.centre()));
                self.what != Touch::Shadow && lit.object.is_near(ray.origin, ray.direction, margin)
            };
            let shades = |ray: &MirroredRay, distance: f64, lit: &LitObject| {
                let place = ray.origin + ray.direction * distance;
                self.what != Touch::Sight && may_shadow(lit, place, far(distance), self.detail)
            };
            let mut mirrored = Mirrored::new(room, origin, direction);
            mirrored.any(|(ray, hit)| {
                self.objects.iter().any(|lit| {
                    shows(&ray, lit) || hit.is_some_and(|(_, distance)| shades(&ray, distance, lit))
                })
            })
        });
        (may_show || may_shade || may_mirror).then_some(LayerCell {
            column,
            row,
            may_show,
            may_shadow: may_shade,
            may_mirror,
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
            let radiance = Vec3::from(self.frame.picture.pixels[number as usize]);
            // Quick frames trust the distances of the frame.
            let room = self.shader.room.filter(|_| !is_quick);
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
                left = match (self.shader.room, known) {
                    (Some(room), known) => {
                        let hit = known.map_or_else(|| room.nearest(origin, direction), |k| k.1);
                        let width = self.width.0 + self.width.1 * behind as f32;
                        let surface =
                            hit.and_then(|(hit, _)| room.surface(&hit, direction.as_vec3(), width));
                        surface.map_or(Vec3::ONE, |surface| {
                            self.left_of(room, &surface, radiance, &mut numbers)
                        })
                    }
                    (None, _) => self.left_at((column, row), place, &mut numbers),
                };
            }
            if through != Vec3::ZERO && cell.may_mirror {
                let ray = (origin, direction);
                left *= self.add_mirrored(cell, ray, (radiance, through), &mut numbers);
            }
        }
        cell.behind += through * left;
    }

    /// Adds what mirrors show of objects along a ray to a cell. Returns the share that is left of
    /// what the mirrors show of the room. `radiance` is what the frame shows there, and `through` the
    /// share of it that objects in front leave.
    fn add_mirrored(
        &self,
        cell: &mut LayerCell,
        (origin, direction): (DVec3, DVec3),
        (radiance, through): (Vec3, Vec3),
        numbers: &mut PassNumbers,
    ) -> Vec3 {
        let Some(room) = self.shader.room.filter(|_| cell.may_mirror) else { return Vec3::ONE };
        let (mut left, mut colour) = (Vec3::ONE, Vec3::ONE);
        for (ray, hit) in Mirrored::new(room, origin, direction) {
            colour *= ray.colour;
            let behind = hit.map_or(f64::INFINITY, |(_, distance)| distance);
            let seen = match self.touch {
                Touch::Shadow => None,
                _ => self.shader.seen(ray.origin, ray.direction, self.width, numbers),
            };
            if let Some(seen) = seen.filter(|seen| seen.distance < behind) {
                cell.radiance += through * left * colour * seen.radiance;
                left *= seen.through;
            }
            let towards = ray.direction.as_vec3();
            let surface = hit.filter(|_| self.touch != Touch::Sight);
            let surface = surface.and_then(|(hit, _)| room.surface(&hit, towards, 0.0));
            if let Some(surface) = surface.filter(|_| left != Vec3::ZERO) {
                let radiance = radiance / colour.max(Vec3::splat(f32::MIN_POSITIVE));
                left *= self.left_of(room, &surface, radiance, numbers);
            }
        }
        left
    }

    /// Returns the share of light that objects leave to a surface of the room of this radiance.
    fn left_of(
        &self,
        room: &Room,
        surface: &RoomSurface,
        radiance: Vec3,
        numbers: &mut PassNumbers,
    ) -> Vec3 {
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

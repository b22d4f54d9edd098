//! The objects of a frame: what is seen of them, and their shadows.
//!
//! Invariants:
//! - Pixels that no object and no shadow touches are never changed.
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

/// Side of a tile, pixels.
const TILE: u32 = 16;

/// Relative difference of distances within which an object is in front of what a frame shows there.
const NEARLY: f64 = 1e-3;

/// How a frame shows objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LayerDetail {
    /// At once, while an object or the eye moves: one ray for each pixel, and sharp shadows.
    Quick,
    /// By this many passes in all, each with other rays.
    Exact(u32),
}

/// What is seen of objects in one view.
pub struct ObjectLayer {
    view: View,
    size: (u32, u32),
    detail: LayerDetail,
    /// Passes that are drawn.
    passes: u32,
    tiles: Vec<LayerTile>,
}

/// The pixels of a tile that objects touch.
struct LayerTile {
    pixels: Vec<LayerPixel>,
}

/// A pixel that objects touch, and sums over its passes.
#[derive(Clone, Copy)]
struct LayerPixel {
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

/// What all pixels of a layer share.
struct LayerScene<'a> {
    shader: Shader<'a>,
    frame: &'a Frame,
    view: &'a View,
    size: (u32, u32),
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
        let size = frame.picture.size();
        let across = size.0.div_ceil(TILE);
        let tile = |tile: u32| {
            let (left, top) = (tile % across * TILE, tile / across * TILE);
            let columns = left..(left + TILE).min(size.0);
            let rows = top..(top + TILE).min(size.1);
            let places = rows.flat_map(|row| columns.clone().map(move |column| (column, row)));
            let pixel = |(column, row)| pixel_of(frame, view, objects, column, row);
            LayerTile { pixels: places.filter_map(pixel).collect() }
        };
        let tiles: Vec<LayerTile> = (0..across * size.1.div_ceil(TILE))
            .into_par_iter()
            .map(tile)
            .filter(|tile| !tile.pixels.is_empty())
            .collect();
        ObjectLayer { view: *view, size, detail, passes: 0, tiles }
    }

    /// Returns whether more passes would make it better.
    #[must_use]
    pub fn is_unfinished(&self) -> bool {
        let all = match self.detail {
            LayerDetail::Quick => 1,
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
        let detail = match self.detail {
            LayerDetail::Quick => LightDetail::Quick,
            LayerDetail::Exact(_) => LightDetail::Exact,
        };
        let footprint = |distance: f64| self.view.pixel_footprint(self.size, distance) as f32;
        let base = footprint(0.0);
        let scene = LayerScene {
            shader: Shader { objects, room, detail },
            frame,
            view: &self.view,
            size: self.size,
            width: (base, footprint(1.0) - base),
        };
        for drawn in 0..most {
            if !self.is_unfinished() || (drawn > 0 && interrupt.is_set()) {
                return;
            }
            let pass = self.passes;
            self.tiles.par_iter_mut().for_each(|tile| {
                tile.pixels.iter_mut().for_each(|pixel| scene.add(pixel, pass));
            });
            self.passes += 1;
        }
    }

    /// Draws objects and shadows over a frame of the layer's view and size, without objects so far.
    pub fn compose(&self, frame: &mut Frame) {
        if self.passes == 0 || frame.picture.size() != self.size {
            return;
        }
        let share = 1.0 / self.passes as f32;
        for pixel in self.tiles.iter().flat_map(|tile| &tile.pixels) {
            let at = (pixel.row * self.size.0 + pixel.column) as usize;
            let room = Vec3::from(frame.picture.pixels[at]);
            let seen = room * pixel.behind + pixel.radiance;
            frame.picture.pixels[at] = (seen * share).to_array();
            if 2 * pixel.seen > self.passes {
                frame.depth[at] = pixel.distance / pixel.seen as f32;
            }
        }
    }

    /// Returns the share of the picture in which an object is seen, 0 to 1.
    #[must_use]
    pub fn visible_share(&self) -> f64 {
        let pixels = self.tiles.iter().flat_map(|tile| &tile.pixels);
        let seen = pixels.filter(|pixel| 2 * pixel.seen > self.passes).count();
        seen as f64 / (f64::from(self.size.0) * f64::from(self.size.1))
    }

    /// Returns whether an object is seen in a pixel of the layer, in most of its passes.
    #[must_use]
    pub fn shows_object(&self, column: u32, row: u32) -> bool {
        let pixels = self.tiles.iter().flat_map(|tile| &tile.pixels);
        let mut here = pixels.filter(|pixel| (pixel.column, pixel.row) == (column, row));
        here.any(|pixel| 2 * pixel.seen > self.passes)
    }
}

/// Returns a pixel that an object or its shadow may touch; `None` if neither can.
fn pixel_of(
    frame: &Frame,
    view: &View,
    objects: &[LitObject],
    column: u32,
    row: u32,
) -> Option<LayerPixel> {
    let size = frame.picture.size();
    let (x, y) = View::pixel_centre(size, column, row);
    let (origin, direction, _) = view.clipped_ray(x, y)?;
    let shows = |lit: &LitObject| {
        let object = &lit.object;
        let margin = view.pixel_footprint(size, origin.distance(object.centre()));
        object.is_near(origin, direction, margin)
    };
    let may_show = objects.iter().any(shows);
    let depth = f64::from(frame.depth[(row * size.0 + column) as usize]);
    let is_surface = depth > 0.0 && depth.is_finite();
    let place = origin + direction * depth;
    let may_shadow = is_surface && objects.iter().any(|lit| may_shadow(lit, place));
    (may_show || may_shadow).then_some(LayerPixel {
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

impl LayerScene<'_> {
    /// Adds a pass to a pixel.
    fn add(&self, pixel: &mut LayerPixel, pass: u32) {
        let number = pixel.row * self.size.0 + pixel.column;
        let mut numbers = PassNumbers::new(mix(1, number), pass);
        let is_quick = self.shader.detail == LightDetail::Quick;
        let (dx, dy) = if is_quick { (0.5, 0.5) } else { numbers.two() };
        let (width, height) = (f64::from(self.size.0), f64::from(self.size.1));
        let x = (f64::from(pixel.column) + f64::from(dx)) / width;
        let y = 1.0 - (f64::from(pixel.row) + f64::from(dy)) / height;
        let (mut through, mut left) = (Vec3::ONE, Vec3::ONE);
        if let Some((origin, direction, reach)) = self.view.clipped_ray(x, y) {
            let known = match self.shader.room.filter(|_| pixel.may_show || pixel.may_shadow) {
                Some(room) => Some((room, room.nearest(origin, direction))),
                None => None,
            };
            let depth = f64::from(self.frame.depth[number as usize]);
            let behind = match &known {
                Some((_, hit)) => hit.map_or(f64::INFINITY, |(_, distance)| distance),
                None if depth > 0.0 => depth,
                None => f64::INFINITY,
            };
            let seen = match pixel.may_show {
                true => self.shader.seen(origin, direction, self.width, &mut numbers),
                false => None,
            };
            let in_front = |seen: &SeenObject| seen.distance < (behind * (1.0 + NEARLY)).min(reach);
            if let Some(seen) = seen.filter(in_front) {
                through = seen.through;
                pixel.radiance += seen.radiance;
                pixel.seen += 1;
                pixel.distance += seen.distance as f32;
            }
            if through != Vec3::ZERO && pixel.may_shadow && behind.is_finite() {
                left = match known {
                    Some((room, hit)) => {
                        let hit = hit.map(|(hit, _)| hit);
                        let width = self.width.0 + self.width.1 * behind as f32;
                        let surface =
                            hit.and_then(|hit| room.surface(&hit, direction.as_vec3(), width));
                        surface.map_or(Vec3::ONE, |surface| {
                            self.left_of(room, &surface, number, &mut numbers)
                        })
                    }
                    None => self.left_at(pixel, origin + direction * behind, &mut numbers),
                };
            }
        }
        pixel.behind += through * left;
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
    fn left_at(&self, pixel: &LayerPixel, place: DVec3, numbers: &mut PassNumbers) -> Vec3 {
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
    fn normal(&self, pixel: &LayerPixel, here: DVec3) -> Option<Vec3> {
        let at = |column: Option<u32>, row: Option<u32>| {
            let (column, row) = (column?, row?);
            if column >= self.size.0 || row >= self.size.1 {
                return None;
            }
            let depth = f64::from(self.frame.depth[(row * self.size.0 + column) as usize]);
            let (x, y) = View::pixel_centre(self.size, column, row);
            let (origin, direction, _) = self.view.clipped_ray(x, y)?;
            (depth > 0.0 && depth.is_finite()).then(|| origin + direction * depth)
        };
        let LayerPixel { column, row, .. } = *pixel;
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

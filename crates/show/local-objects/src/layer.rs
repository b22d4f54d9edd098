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

/// Distance of the pixels by which a tile is tested, pixels.
const APART: u32 = 4;

/// Relative difference of distances within which an object is in front of what a frame shows there.
const NEARLY: f64 = 1e-3;

/// Share of light above which no shadow is seen.
const NEARLY_ALL_LIGHT: f32 = 0.995;

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
            let places = |step: usize| {
                let columns = columns.clone().step_by(step);
                let rows = rows.clone().step_by(step);
                rows.flat_map(move |row| columns.clone().map(move |column| (column, row)))
            };
            let touches = TouchTest { frame, view, objects, detail: detail.into() };
            // Most tiles are far from all objects, and a few of their pixels say so.
            if !places(APART as usize).any(|place| touches.pixel(place, APART).is_some()) {
                return LayerTile { pixels: Vec::new() };
            }
            LayerTile { pixels: places(1).filter_map(|at| touches.pixel(at, 1)).collect() }
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
        let detail = self.detail.into();
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

impl From<LayerDetail> for LightDetail {
    fn from(detail: LayerDetail) -> LightDetail {
        match detail {
            LayerDetail::Quick => LightDetail::Quick,
            LayerDetail::Exact(_) => LightDetail::Exact,
        }
    }
}

/// Finds the pixels that objects touch.
struct TouchTest<'a> {
    frame: &'a Frame,
    view: &'a View,
    objects: &'a [LitObject],
    detail: LightDetail,
}

impl TouchTest<'_> {
    /// Returns a pixel that an object or its shadow may touch, or another one within `reach` pixels;
    /// `None` if neither can.
    fn pixel(&self, (column, row): (u32, u32), reach: u32) -> Option<LayerPixel> {
        let size = self.frame.picture.size();
        let (x, y) = View::pixel_centre(size, column, row);
        let (origin, direction, _) = self.view.clipped_ray(x, y)?;
        let margin =
            |distance: f64| f64::from(reach) * 1.5 * self.view.pixel_footprint(size, distance);
        let shows = |lit: &LitObject| {
            let object = &lit.object;
            object.is_near(origin, direction, margin(origin.distance(object.centre())))
        };
        let may_show = self.objects.iter().any(shows);
        let depth = f64::from(self.frame.depth[(row * size.0 + column) as usize]);
        let is_surface = depth > 0.0 && depth.is_finite();
        let place = self.view.ray_to(origin).0 + direction * depth;
        // Surfaces that are seen from the side go farther between two pixels.
        let margin = if reach > 1 { 4.0 * margin(depth) } else { 0.0 };
        let shades = |lit: &LitObject| may_shadow(lit, place, margin, self.detail);
        let may_shadow = is_surface && self.objects.iter().any(shades);
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
            // To be quick, only what seems to lie in a shadow is looked at.
            let is_asked = !is_quick || pixel.may_show;
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
            let seen = match pixel.may_show {
                true => self.shader.seen(origin, direction, self.width, &mut numbers),
                false => None,
            };
            let in_front = |seen: &SeenObject| seen.distance < (behind * (1.0 + NEARLY)).min(reach);
            if let Some(seen) = seen.filter(in_front) {
                through = seen.through;
                pixel.radiance += seen.radiance;
                pixel.seen += 1;
                pixel.distance += (seen.distance + clipped) as f32;
            }
            if through != Vec3::ZERO && pixel.may_shadow && behind.is_finite() {
                let place = origin + direction * behind;
                let seems_dark = !is_quick
                    || self.left_at(pixel, place, &mut numbers).min_element() < NEARLY_ALL_LIGHT;
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
                    (None, _) => self.left_at(pixel, place, &mut numbers),
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

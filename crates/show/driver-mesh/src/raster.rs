//! Draws triangles with their colours and depths, in bands of rows on all cores.
//!
//! A pixel is in a triangle if its ray is on the inner side of the three planes through the eye and
//! an edge. So one rule serves all types of views, and triangles that reach behind the eye need no
//! clipping.
//!
//! Colours and depths are interpolated between the corners (Gouraud). A triangle across a jump of
//! depth is *split*: each pixel belongs to the corners on one side of the jump, those of the nearest
//! corner, so that no colour smears over the silhouette.
//!
//! Invariants:
//! - Adjacent triangles compute the same number for a pixel at their edge, with opposite signs. So
//!   no pixel is missed and none is drawn twice.
//! - The picture does not depend on the order of triangles or on the number of threads.

use glam::DVec3;
use holo_display::for_bands;
use std::ops::Range;

use crate::direction::GridDirection;
use crate::seen::{SeenVertex, is_jump};

/// Rows of a band, and columns of its tiles.
const TILE: usize = 16;

/// What a pixel shows.
#[derive(Clone, Copy, Debug)]
pub struct PixelFragment {
    /// Radiance.
    pub colour: [f32; 3],
    /// 1 / distance from the eye; 0 for the sky, negative where there is nothing.
    pub nearness: f32,
    order: GridDirection,
}

/// A triangle to draw.
pub struct ScreenTriangle {
    corners: [SeenVertex; 3],
    /// Normals of the planes through the eye and the edge opposite to each corner.
    planes: [DVec3; 3],
    /// The volume of the three sights.
    volume: f64,
    /// For each corner, a bit for each corner on its side of jumps.
    sides: [u8; 3],
    columns: Range<u32>,
    rows: Range<u32>,
}

/// The rays of a picture's pixels.
pub struct PixelSights {
    /// Width and height, pixels.
    pub size: (u32, u32),
    /// True if the view has an eye.
    pub has_eye: bool,
    /// As [`SeenVertex::sight`]; 0 for pixels without a ray.
    sights: Vec<DVec3>,
    /// A cone around the rays of each tile, row by row.
    cones: Vec<TileCone>,
}

/// A cone around the rays of a tile.
struct TileCone {
    /// A unit vector; 0 without rays.
    axis: DVec3,
    /// Sine of the angle between the axis and the farthest ray; 1 from a right angle on.
    sine: f64,
}

impl PixelSights {
    /// Returns the rays of a picture, row by row from the top.
    pub fn new(size: (u32, u32), sights: Vec<DVec3>, has_eye: bool) -> PixelSights {
        let (width, height) = (size.0 as usize, size.1 as usize);
        let across = width.div_ceil(TILE);
        let cone = |tile: usize| {
            let (left, top) = (tile % across * TILE, tile / across * TILE);
            let pixels = || {
                let rows = top..(top + TILE).min(height);
                let row = move |row| (left..(left + TILE).min(width)).map(move |x| row * width + x);
                rows.flat_map(row).map(|pixel| sights[pixel].normalize_or_zero())
            };
            let axis = pixels().sum::<DVec3>().normalize_or_zero();
            let rays = pixels().filter(|ray| *ray != DVec3::ZERO);
            let least = rays.map(|ray| ray.dot(axis)).fold(1.0, f64::min);
            let sine = if least > 0.0 { (1.0 - least * least).max(0.0).sqrt() } else { 1.0 };
            // A slack for rounding.
            TileCone { axis, sine: sine + 1e-9 }
        };
        let cones = (0..across * height.div_ceil(TILE)).map(cone).collect();
        PixelSights { size, has_eye, sights, cones }
    }
}

impl ScreenTriangle {
    /// Prepares a triangle within these pixels. Its first corner is the least one, so that rounding
    /// is the same each time. `None` if the eye sees its back.
    pub fn new(
        mut corners: [SeenVertex; 3],
        bounds: (Range<u32>, Range<u32>),
    ) -> Option<ScreenTriangle> {
        let least = (0..3).min_by_key(|&at| corners[at].order)?;
        corners.rotate_left(least);
        let [a, b, c] = [0, 1, 2].map(|at: usize| corners[at].sight);
        // Camera coordinates are left-handed, so that counterclockwise corners have a negative volume
        // there.
        let planes = [c.cross(b), a.cross(c), b.cross(a)];
        let volume = a.dot(planes[0]);
        if volume <= 0.0 {
            return None;
        }
        let (columns, rows) = bounds;
        Some(ScreenTriangle { sides: sides(&corners), corners, planes, volume, columns, rows })
    }

    /// Returns whether the triangle may show something in a tile.
    fn may_be_in(&self, tile: &TileCone) -> bool {
        let is_beside = |plane: &DVec3| plane.dot(tile.axis) < -tile.sine * plane.length();
        tile.axis != DVec3::ZERO && !self.planes.iter().any(is_beside)
    }

    /// Returns whether the triangle's bounds are so small that a test of tiles does not pay.
    fn is_small(&self) -> bool {
        self.columns.len() * self.rows.len() <= TILE
    }

    /// Returns what the triangle shows along a ray; `None` beside it.
    #[inline]
    fn at(&self, sight: DVec3, has_eye: bool) -> Option<PixelFragment> {
        let weights = self.planes.map(|plane| plane.dot(sight));
        let is_inside = |at: usize| {
            // A pixel on an edge belongs to the triangle whose edge goes up in the order of
            // vertices.
            let (from, to) = (&self.corners[(at + 1) % 3], &self.corners[(at + 2) % 3]);
            weights[at] > 0.0 || weights[at] == 0.0 && from.order < to.order
        };
        if !(is_inside(0) && is_inside(1) && is_inside(2)) {
            return None;
        }
        let sum = weights[0] + weights[1] + weights[2];
        let order = self.corners[0].order;
        let nearness = |at: usize| weights[at] * self.corners[at].nearness;
        if self.sides == [0b111; 3] {
            let all = nearness(0) + nearness(1) + nearness(2);
            let nearness = all / if has_eye { self.volume } else { sum };
            let share = weights.map(|weight| (weight / sum) as f32);
            let channel = |c: usize| (0..3).map(|at| share[at] * self.corners[at].colour[c]).sum();
            let colour = [channel(0), channel(1), channel(2)];
            return (sum > 0.0).then_some(PixelFragment {
                colour,
                nearness: nearness as f32,
                order,
            });
        }
        let away = |at: usize| (self.corners[at].sight - sight).length_squared();
        let nearest = (0..3).min_by(|&a, &b| away(a).total_cmp(&away(b)))?;
        let is_on_side = |at: &usize| self.sides[nearest] >> at & 1 == 1;
        let side = || (0..3).filter(is_on_side);
        let sum: f64 = side().map(|at| weights[at]).sum();
        let all: f64 = side().map(nearness).sum();
        let channel = |c: usize| {
            side().map(|at| (weights[at] / sum) as f32 * self.corners[at].colour[c]).sum()
        };
        let colour = [channel(0), channel(1), channel(2)];
        (sum > 0.0).then_some(PixelFragment { colour, nearness: (all / sum) as f32, order })
    }
}

/// Returns for each corner a bit for each corner on its side of jumps.
fn sides(corners: &[SeenVertex; 3]) -> [u8; 3] {
    let joined = |a: usize, b: usize| !is_jump(&corners[a], &corners[b]);
    match (joined(0, 1), joined(1, 2), joined(2, 0)) {
        (true, true, _) | (true, _, true) | (_, true, true) => [0b111; 3],
        (true, false, false) => [0b011, 0b011, 0b100],
        (false, true, false) => [0b001, 0b110, 0b110],
        (false, false, true) => [0b101, 0b010, 0b101],
        (false, false, false) => [0b001, 0b010, 0b100],
    }
}

/// Draws triangles.
pub fn rasterise(triangles: &[ScreenTriangle], rays: &PixelSights) -> Vec<PixelFragment> {
    let width = rays.size.0 as usize;
    let bands = (rays.size.1 as usize).div_ceil(TILE);
    let mut of_band: Vec<Vec<u32>> = vec![Vec::new(); bands];
    for (number, triangle) in (0..).zip(triangles) {
        let rows = triangle.rows.start as usize / TILE..(triangle.rows.end as usize).div_ceil(TILE);
        of_band[rows].iter_mut().for_each(|band| band.push(number));
    }
    let order = GridDirection::on_face(0, 0, 0);
    let nothing = PixelFragment { colour: [0.0; 3], nearness: -1.0, order };
    let mut pixels = vec![nothing; rays.sights.len()];
    for_bands(&mut pixels, width, TILE, |band, pixels| {
        for &number in &of_band[band] {
            draw(&triangles[number as usize], rays, band, pixels);
        }
    });
    pixels
}

/// Draws a triangle into the pixels of a band.
fn draw(triangle: &ScreenTriangle, rays: &PixelSights, band: usize, pixels: &mut [PixelFragment]) {
    let width = rays.size.0 as usize;
    let (top, across) = (band * TILE, width.div_ceil(TILE));
    let rows = triangle.rows.start as usize..triangle.rows.end as usize;
    let rows = rows.start.max(top)..rows.end.min(top + pixels.len() / width);
    let columns = triangle.columns.start as usize..triangle.columns.end as usize;
    for tile in columns.start / TILE..columns.end.div_ceil(TILE) {
        if !triangle.is_small() && !triangle.may_be_in(&rays.cones[band * across + tile]) {
            continue;
        }
        for row in rows.clone() {
            let columns = columns.start.max(tile * TILE)..columns.end.min((tile + 1) * TILE);
            for column in columns {
                let place = row * width + column;
                let found = triangle.at(rays.sights[place], rays.has_eye);
                let pixel = &mut pixels[place - top * width];
                if let Some(found) = found
                    && (found.nearness, found.order) > (pixel.nearness, pixel.order)
                {
                    *pixel = found;
                }
            }
        }
    }
}

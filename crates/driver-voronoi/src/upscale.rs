//! A picture of which surfaces and light are known at fewer pixels than it has: for views that follow each other quickly.
//!
//! Where a coarse pixel and all around it see one surface, colours are interpolated; next to edges each pixel's own ray is cast, and its
//! light interpolated from the coarse pixels that see the same surface (joint bilateral upsampling: Kopf, Cohen, Lischinski & Uyttendaele
//! 2007, with surfaces that are the same or not in place of a weight of how alike they are).
//!
//! What always holds:
//! - No light crosses from one surface to another.
//! - Light is interpolated linearly, so that the picture is as bright as one at full resolution.
//! - What is missed is what lies wholly between the middles of neighbouring coarse pixels.

use super::drawing::Drawing;
use super::edges::Shows;
use super::surfaces::Caster;
use holo_display::for_bands;
use holo_raycast::{Hit, MAX_TILE, Ray};
use std::ops::Range;
use std::sync::OnceLock;

/// Coarse pixels a side of a tile whose edges' rays are cast together: each has at most 2 × 2 of the picture's.
const SIDE: usize = 4;
const _: () = assert!(4 * SIDE * SIDE <= MAX_TILE);

/// Rows of one piece of work.
const ROWS: usize = 16;

/// Where the pixels of one axis of a picture lie among fewer ones.
#[derive(Clone)]
struct Axis {
    coarse: usize,
    /// Coarse pixels for each of the picture's.
    step: f64,
}

impl Axis {
    fn new(fine: usize, coarse: usize) -> Axis {
        Axis { coarse, step: coarse as f64 / fine.max(1) as f64 }
    }

    /// The place of a pixel's middle, in coarse pixels.
    fn middle(&self, fine: usize) -> f64 {
        (fine as f64 + 0.5) * self.step
    }

    /// The coarse pixel that holds it.
    fn holder(&self, fine: usize) -> usize {
        (self.middle(fine) as usize).min(self.coarse.saturating_sub(1))
    }

    /// The coarse pixels whose middles are on both sides of it, and the second one's part.
    fn beside(&self, fine: usize) -> (usize, usize, f32) {
        let place = (self.middle(fine) - 0.5).max(0.0);
        let last = self.coarse.saturating_sub(1);
        let first = (place as usize).min(last);
        (first, (first + 1).min(last), (place - first as f64) as f32)
    }

    /// The pixels that a coarse one holds.
    fn held(&self, coarse: usize) -> Range<usize> {
        let guess = (coarse as f64 / self.step) as usize;
        let mut first = guess.saturating_sub(1);
        while self.holder(first) < coarse {
            first += 1;
        }
        let mut end = first;
        while self.holder(end) == coarse && self.middle(end) < self.coarse as f64 {
            end += 1;
        }
        first..end
    }
}

/// How a picture lies on a coarse one.
#[derive(Clone)]
pub(crate) struct Scale {
    columns: Axis,
    rows: Axis,
    pub fine: (usize, usize),
    pub coarse: (usize, usize),
}

impl Scale {
    /// Sizes as columns and rows.
    pub fn new(fine: (u32, u32), coarse: (u32, u32)) -> Scale {
        let whole = |size: (u32, u32)| (size.0 as usize, size.1 as usize);
        let (fine, coarse) = (whole(fine), whole(coarse));
        Scale {
            columns: Axis::new(fine.0, coarse.0),
            rows: Axis::new(fine.1, coarse.1),
            fine,
            coarse,
        }
    }

    /// The coarse pixel that holds a pixel.
    pub fn holder(&self, (column, row): (usize, usize)) -> usize {
        self.rows.holder(row) * self.coarse.0 + self.columns.holder(column)
    }

    /// The first pixel that a coarse one holds.
    pub fn first_held(&self, coarse: usize) -> usize {
        let (column, row) = (coarse % self.coarse.0, coarse / self.coarse.0);
        self.rows.held(row).start * self.fine.0 + self.columns.held(column).start
    }

    /// The four coarse pixels around a pixel's middle, and their parts in it.
    fn around(&self, (column, row): (usize, usize)) -> [(usize, f32); 4] {
        let ((left, right, across), (above, below, down)) =
            (self.columns.beside(column), self.rows.beside(row));
        let at = |column: usize, row: usize| row * self.coarse.0 + column;
        [
            (at(left, above), (1.0 - across) * (1.0 - down)),
            (at(right, above), across * (1.0 - down)),
            (at(left, below), (1.0 - across) * down),
            (at(right, below), across * down),
        ]
    }

    /// For each pixel what its coarse one has.
    pub fn spread<T: Copy + Default + Send + Sync>(&self, coarse: &[T]) -> Vec<T> {
        let (width, height) = self.fine;
        let mut fine = vec![T::default(); width * height];
        for_bands(&mut fine, width, ROWS, |part, rows| {
            for (row, line) in (part * ROWS..).zip(rows.chunks_mut(width)) {
                for (column, value) in line.iter_mut().enumerate() {
                    *value = coarse[self.holder((column, row))];
                }
            }
        });
        fine
    }

    /// Colours between those of a coarse picture.
    pub fn interpolate(&self, coarse: &[[f32; 3]], fine: &mut [[f32; 3]]) {
        let (width, _) = self.fine;
        let columns: Vec<_> = (0..width).map(|column| self.columns.beside(column)).collect();
        for_bands(fine, width, ROWS, |part, rows| {
            for (row, line) in (part * ROWS..).zip(rows.chunks_mut(width)) {
                let (above, below, down) = self.rows.beside(row);
                let of = |row: usize| &coarse[row * self.coarse.0..][..self.coarse.0];
                let (above, below) = (of(above), of(below));
                for (colour, &(left, right, across)) in line.iter_mut().zip(&columns) {
                    let mix = |a: [f32; 3], b: [f32; 3], part: f32| {
                        [0, 1, 2].map(|i| a[i] + part * (b[i] - a[i]))
                    };
                    *colour = mix(
                        mix(above[left], above[right], across),
                        mix(below[left], below[right], across),
                        down,
                    );
                }
            }
        });
    }
}

/// A pixel whose own ray is cast.
struct Point {
    pixel: u32,
    /// The coarse one that holds it.
    holder: u32,
    shows: Shows,
    hit: Option<Hit>,
}

/// The pixels next to edges, and what their middles meet: found once for a view, since samples do not change it.
pub(crate) struct FinePoints {
    strips: Vec<Vec<Point>>,
}

impl FinePoints {
    /// Casts the rays of all pixels held by coarse ones next to `edges`.
    pub fn cast(drawing: &Drawing, scale: &Scale, caster: &Caster, edges: &[bool]) -> FinePoints {
        let (width, height) = scale.coarse;
        let mut strips: Vec<Vec<Point>> = Vec::new();
        strips.resize_with(height.div_ceil(SIDE), Vec::new);
        for_bands(&mut strips, 1, 1, |strip, points| {
            let rows = strip * SIDE..((strip + 1) * SIDE).min(height);
            for points in points {
                for left in (0..width).step_by(SIDE) {
                    let tile = (left..(left + SIDE).min(width), rows.clone());
                    cast_tile(drawing, scale, caster, edges, tile, points);
                }
            }
        });
        FinePoints { strips }
    }

    /// Paints them; `coarse` has the coarse picture's colours.
    pub fn paint(
        &self,
        drawing: &Drawing,
        scale: &Scale,
        coarse: &[[f32; 3]],
        fine: &mut [[f32; 3]],
    ) {
        let mut colours: Vec<Vec<[f32; 3]>> = vec![Vec::new(); self.strips.len()];
        for_bands(&mut colours, 1, 1, |strip, colours| {
            let colour = |point: &Point| {
                let (pixel, holder) = (point.pixel as usize, point.holder as usize);
                let place = (pixel % scale.fine.0, pixel / scale.fine.0);
                let known = match point.shows {
                    Shows::Lit { by, material } => {
                        drawing.between(by as usize, material, &scale.around(place))
                    }
                    Shows::Beyond => drawing.open(holder).map(|near| coarse[near]),
                    _ => None,
                };
                let known = known.or_else(|| drawing.shown(holder, &point.shows, coarse));
                let known = known.or_else(|| {
                    let at = (scale.columns.middle(place.0), scale.rows.middle(place.1));
                    let (ray, _) = drawing.caster().ray(at.0, at.1)?;
                    drawing.point(holder, &ray, point.hit)
                });
                known.unwrap_or(coarse[holder])
            };
            let points = &self.strips[strip];
            colours.iter_mut().for_each(|colours| *colours = points.iter().map(colour).collect());
        });
        for (points, colours) in self.strips.iter().zip(colours) {
            points
                .iter()
                .zip(colours)
                .for_each(|(point, colour)| fine[point.pixel as usize] = colour);
        }
    }
}

/// Returns a picture of more pixels than were cast, from these colours of those. `points` gets the
/// view's edges the first time.
pub(crate) fn upscale(
    drawing: &Drawing,
    points: &OnceLock<FinePoints>,
    scale: &Scale,
    coarse: &[[f32; 3]],
) -> Vec<[f32; 3]> {
    let mut fine = vec![[0.0; 3]; scale.fine.0 * scale.fine.1];
    scale.interpolate(coarse, &mut fine);
    let points =
        points.get_or_init(|| FinePoints::cast(drawing, scale, drawing.caster(), &drawing.edges()));
    points.paint(drawing, scale, coarse, &mut fine);
    fine
}

/// Adds the points of the edges among some coarse columns and rows.
fn cast_tile(
    drawing: &Drawing,
    scale: &Scale,
    caster: &Caster,
    edges: &[bool],
    (columns, rows): (Range<usize>, Range<usize>),
    points: &mut Vec<Point>,
) {
    let mut rays = [Ray::new(glam::Vec3::ZERO, glam::Vec3::ZERO); MAX_TILE];
    let mut places = [(0, 0, 0); MAX_TILE];
    let mut count = 0;
    for (row, column) in rows.flat_map(|row| columns.clone().map(move |column| (row, column))) {
        let holder = row * scale.coarse.0 + column;
        if !edges[holder] {
            continue;
        }
        for (y, x) in
            scale.rows.held(row).flat_map(|y| scale.columns.held(column).map(move |x| (y, x)))
        {
            if let Some((ray, _)) = caster.ray(scale.columns.middle(x), scale.rows.middle(y))
                && count < MAX_TILE
            {
                (rays[count], places[count]) = (ray, (x, y, holder));
                count += 1;
            }
        }
    }
    let mut hits = [None; MAX_TILE];
    caster.nearest_tile(&rays[..count], &mut hits[..count]);
    for ((ray, hit), &(x, y, holder)) in rays.iter().zip(hits).zip(&places[..count]) {
        let shows =
            drawing.look((scale.columns.middle(x), scale.rows.middle(y)), holder, ray, &hit);
        points.push(Point {
            pixel: (y * scale.fine.0 + x) as u32,
            holder: holder as u32,
            shows,
            hit,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_pixel_is_held_by_one_coarse_pixel_and_lies_between_its_neighbours(fine in 1_usize..2000, less in 0.5_f64..1.0) {
            let coarse = ((fine as f64 * less).ceil() as usize).max(1);
            let axis = Axis::new(fine, coarse);
            let held: Vec<usize> = (0..coarse).flat_map(|coarse| axis.held(coarse)).collect();
            prop_assert_eq!(held, (0..fine).collect::<Vec<_>>());
            for pixel in 0..fine {
                let (first, second, part) = axis.beside(pixel);
                let holder = axis.holder(pixel);
                prop_assert!(first <= holder && holder <= second && second < coarse && (0.0..=1.0).contains(&part));
                // Where there are neighbours on both sides, what grows evenly is met exactly.
                let place = axis.middle(pixel) - 0.5;
                if place >= 0.0 && place <= (coarse - 1) as f64 {
                    let there = first as f64 + f64::from(part) * (second - first) as f64;
                    prop_assert!((there - place).abs() < 1e-3, "{} {}", there, place);
                }
                prop_assert!(axis.held(holder).len() <= 2);
            }
        }
    }
}

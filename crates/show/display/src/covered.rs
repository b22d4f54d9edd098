//! Determines which pixels some section covers.
//!
//! Invariant: a pixel is covered exactly if [`is_covered`] holds for the ray through its middle.
//!
//! Rectangles of pixels are tested by the rays through their four corners. Sections are convex: if
//! one section meets all four rays of an eye on the same side, it meets every ray between them.

use crate::bands::for_bands;
use crate::candidates::is_covered;
use glam::DVec3;
use holo_picture::{View, ViewKind};
use holo_section::Section;
use std::ops::Range;

/// Side of the squares that are tested as a whole, pixels. Also the number of rows of a band.
const SIDE: usize = 16;

/// The side of the eye on which a ray meets a section.
#[derive(Clone, Copy, PartialEq, Eq)]
enum EyeSide {
    Around,
    Ahead,
    Behind,
}

/// Returns whether some section covers each pixel of a picture of `size`, row by row from the top.
pub fn covered(sections: &[Section], view: &View, size: (u32, u32)) -> Vec<bool> {
    let (width, height) = (size.0 as usize, size.1 as usize);
    let coverage = PictureRays { sections, view, size: (width as f64, height as f64) };
    let mut covered = vec![false; width * height];
    for_bands(&mut covered, width, SIDE, |band, lines| {
        let (mut hint, top) = (0, band * SIDE);
        let rows = top..top + lines.len() / width;
        for left in (0..width).step_by(SIDE) {
            let columns = left..(left + SIDE).min(width);
            let is_full = coverage.is_full(hint, &columns, &rows);
            for (row, line) in rows.clone().zip(lines.chunks_mut(width)) {
                for column in columns.clone() {
                    line[column] = is_full || {
                        let (eye, along) = coverage.ray(column, row);
                        is_covered(sections, eye, along, &mut hint)
                    };
                }
            }
        }
    });
    covered
}

/// The rays of a picture's pixels, and the sections that they may meet.
struct PictureRays<'a> {
    sections: &'a [Section],
    view: &'a View,
    size: (f64, f64),
}

impl PictureRays<'_> {
    /// Returns origin and direction of the ray through a pixel's middle. The direction is 0 in the
    /// corners of a fisheye, which show nothing.
    fn ray(&self, column: usize, row: usize) -> (DVec3, DVec3) {
        let x = (column as f64 + 0.5) / self.size.0;
        let ray = self.view.clipped_ray(x, 1.0 - (row as f64 + 0.5) / self.size.1);
        ray.map_or((self.view.vp, DVec3::ZERO), |(origin, direction, _)| (origin, direction))
    }

    /// Returns the side of the eye on which a pixel's ray meets a section; `None` if it misses.
    fn side(&self, section: &Section, column: usize, row: usize) -> Option<EyeSide> {
        let (eye, along) = self.ray(column, row);
        section.line(eye, along).map(|hit| match hit.entry_t {
            entry if entry > 0.0 => EyeSide::Ahead,
            _ if hit.exit_t < 0.0 => EyeSide::Behind,
            _ => EyeSide::Around,
        })
    }

    /// Returns whether section `number` covers all pixels of a rectangle, as far as its corners
    /// show.
    fn is_full(&self, number: usize, columns: &Range<usize>, rows: &Range<usize>) -> bool {
        let has_one_eye = self.view.kind == ViewKind::Perspective && self.view.vo == 0.0;
        let Some(section) = self.sections.get(number).filter(|_| has_one_eye) else { return false };
        let (left, right, top, bottom) = (columns.start, columns.end - 1, rows.start, rows.end - 1);
        let first = self.side(section, left, top);
        let others = [(right, top), (left, bottom), (right, bottom)];
        first.is_some() && others.iter().all(|&(x, y)| self.side(section, x, y) == first)
    }
}

/// Returns the numbers of the uncovered pixels whose middles have a view ray, row by row from the
/// top.
///
/// `covered` has one entry for each pixel of a picture of `size`. In the corners of a fisheye,
/// pixels have no view ray.
pub fn uncovered_pixels(covered: &[bool], view: &View, size: (u32, u32)) -> Vec<u32> {
    let has_ray = |pixel: &u32| {
        let (x, y) = View::pixel_centre(size, pixel % size.0, pixel / size.0);
        view.try_ray(x, y).is_some()
    };
    let uncovered = (0..).zip(covered).filter(|(_, covered)| !**covered);
    uncovered.map(|(pixel, _)| pixel).filter(has_ray).collect()
}

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

/// Side of the squares that are tested as a whole first, pixels. Also the rows of a thread's band.
const LARGE: usize = 32;

/// Side of the squares that a large square is divided into if one section does not cover it,
/// pixels.
const SMALL: usize = 8;

/// The side of the eye on which a ray meets a section.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Side {
    Around,
    Ahead,
    Behind,
}

/// Returns whether some section covers each pixel of a picture of `size`, row by row from the top.
pub fn covered(sections: &[Section], view: &View, size: (u32, u32)) -> Vec<bool> {
    let (width, height) = (size.0 as usize, size.1 as usize);
    let has_one_eye = view.kind == ViewKind::Perspective && view.vo == 0.0;
    let mut covered = vec![false; width * height];
    let ray = |column: usize, row: usize| {
        let x = (column as f64 + 0.5) / width as f64;
        let ray = view.clipped_ray(x, 1.0 - (row as f64 + 0.5) / height as f64);
        ray.map_or((view.vp, DVec3::ZERO), |(origin, direction, _)| (origin, direction))
    };
    let side = |section: &Section, (column, row): (usize, usize)| {
        let (eye, along) = ray(column, row);
        section.line(eye, along).map(|hit| match hit.entry_t {
            entry if entry > 0.0 => Side::Ahead,
            _ if hit.exit_t < 0.0 => Side::Behind,
            _ => Side::Around,
        })
    };
    let covers_all = |section: &Section, columns: &Range<usize>, rows: &Range<usize>| {
        let (right, bottom) = (columns.end - 1, rows.end - 1);
        let corners = [
            (columns.start, rows.start),
            (right, rows.start),
            (columns.start, bottom),
            (right, bottom),
        ];
        let first = side(section, corners[0]);
        first.is_some() && corners.iter().all(|&corner| side(section, corner) == first)
    };
    for_bands(&mut covered, width, LARGE, |band, lines| {
        let (mut hint, top) = (0, band * LARGE);
        let bottom = top + lines.len() / width;
        let is_full = |hint: usize, columns: &Range<usize>, rows: &Range<usize>| {
            has_one_eye
                && sections.get(hint).is_some_and(|section| covers_all(section, columns, rows))
        };
        for columns in pieces(0..width, LARGE) {
            if is_full(hint, &columns, &(top..bottom)) {
                lines.chunks_mut(width).for_each(|line| line[columns.clone()].fill(true));
                continue;
            }
            for rows in pieces(top..bottom, SMALL) {
                let lines = &mut lines[(rows.start - top) * width..(rows.end - top) * width];
                for columns in pieces(columns.clone(), SMALL) {
                    if is_full(hint, &columns, &rows) {
                        lines.chunks_mut(width).for_each(|line| line[columns.clone()].fill(true));
                        continue;
                    }
                    for (row, line) in rows.clone().zip(lines.chunks_mut(width)) {
                        for column in columns.clone() {
                            let (eye, along) = ray(column, row);
                            line[column] = is_covered(sections, eye, along, &mut hint);
                        }
                    }
                }
            }
        }
    });
    covered
}

/// Cuts a range into pieces of `length`; the last one may be shorter.
fn pieces(range: Range<usize>, length: usize) -> impl Iterator<Item = Range<usize>> {
    range.clone().step_by(length).map(move |start| start..(start + length).min(range.end))
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

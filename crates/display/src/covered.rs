//! Which pixels some section covers.
//!
//! Invariant: a pixel is covered exactly if a section meets its middle's ray, as [`is_covered`] tells: a section is convex, so what is
//! within four rays of one eye that meet it on one side meets it too.

use crate::candidates::is_covered;
use crate::parts::for_parts;
use glam::DVec3;
use holo_picture::{View, ViewKind};
use holo_section::Section;

/// Rows of one piece of work, and columns that are looked at together.
const SIDE: usize = 8;

/// On which side of the eye a section lies on a ray.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Side {
    Around,
    Ahead,
    Behind,
}

/// Whether some section covers each pixel's middle.
pub(crate) fn covered(sections: &[Section], view: &View, size: (u32, u32)) -> Vec<bool> {
    let (width, height) = (size.0 as usize, size.1 as usize);
    let has_one_eye = view.kind == ViewKind::Perspective && view.vo == 0.0;
    let mut covered = vec![false; width * height];
    let ray = |column: usize, row: usize| {
        let x = (column as f64 + 0.5) / width as f64;
        let ray = view.clipped_ray(x, 1.0 - (row as f64 + 0.5) / height as f64);
        ray.map_or((view.vp, DVec3::ZERO), |(origin, direction, _)| (origin, direction))
    };
    for_parts(&mut covered, width, SIDE, |part, rows| {
        let (mut hint, top) = (0, part * SIDE);
        let bottom = top + rows.len() / width - 1;
        for left in (0..width).step_by(SIDE) {
            let right = (left + SIDE).min(width) - 1;
            let corners = [(left, top), (right, top), (left, bottom), (right, bottom)];
            let side = |section: &Section, (column, row): (usize, usize)| {
                let (eye, along) = ray(column, row);
                section.line(eye, along).map(|hit| match hit.entry_t {
                    entry if entry > 0.0 => Side::Ahead,
                    _ if hit.exit_t < 0.0 => Side::Behind,
                    _ => Side::Around,
                })
            };
            let holds_all = |section: &Section| {
                let first = side(section, corners[0]);
                first.is_some() && corners.iter().all(|&corner| side(section, corner) == first)
            };
            if has_one_eye && sections.get(hint).is_some_and(holds_all) {
                rows.chunks_mut(width).for_each(|line| line[left..=right].fill(true));
                continue;
            }
            for (row, line) in rows.chunks_mut(width).enumerate() {
                for (column, covered) in line.iter_mut().enumerate().take(right + 1).skip(left) {
                    let (eye, along) = ray(column, top + row);
                    *covered = is_covered(sections, eye, along, &mut hint);
                }
            }
        }
    });
    covered
}

//! Projects earlier frames to the current position of the eye: each pixel moves to where its
//! surface is seen from there.
//!
//! A driver takes longer to draw than a person should wait. Between two of its frames, a person who
//! walks sees such pictures. The render cache (Walter, Drettakis & Parker 1999) projects points the
//! same way. Gaps that neither of two earlier frames fills take the farther of the surfaces beside
//! them.
//!
//! Invariants:
//! - Where two surfaces of an earlier frame overlap, the nearer one is shown.
//! - A pixel that some source fills never turns black.

use glam::{DVec3, Vec3};
use holo_display::{Camera, Frame};
use holo_picture::{View, ViewKind};

/// A surface lies behind another one if it is farther by this factor.
const BEHIND: f32 = 1.02;

/// Share of pixels that may be missing before an older frame is used too.
const FEW: f64 = 0.002;

/// A frame with its view.
#[derive(Clone, Copy)]
pub struct Source<'a> {
    /// The view.
    pub view: &'a View,
    /// Its frame.
    pub frame: &'a Frame,
}

/// Marks a pixel without a source.
const NONE: u32 = u32::MAX;

/// A pixel of the new picture, with the source pixel that it shows.
#[derive(Clone, Copy)]
struct Target {
    depth: f32,
    /// The source's pixel, or [`NONE`].
    pixel: u32,
    /// The source's number.
    source: u32,
}

const EMPTY: Target = Target { depth: f32::INFINITY, pixel: NONE, source: 0 };

/// Returns whether frames of `source` can be projected to `view`: both must be perspective views
/// without clipping.
pub fn can_show(source: &View, view: &View) -> bool {
    let is_perspective = |view: &View| view.kind == ViewKind::Perspective && !view.is_clipped();
    is_perspective(source) && is_perspective(view)
}

/// Projects earlier frames to `view`, in a picture of `size` pixels. Returns `None` if they contain
/// nothing of it. Earlier sources take precedence. The numbers of empty and uncovered pixels are
/// those of the first source, scaled to `size`.
pub fn warp(sources: &[Source<'_>], view: &View, size: (u32, u32)) -> Option<Frame> {
    let mut frame = Frame::black(size);
    let mut targets = vec![EMPTY; frame.depth.len()];
    for (number, source) in (0..).zip(sources) {
        let missing = targets.iter().filter(|target| target.pixel == NONE).count();
        if missing as f64 > FEW * targets.len() as f64 {
            project(source, number, view, size, &mut targets);
        }
    }
    if !fill(&mut targets, size) {
        return None;
    }
    for ((target, pixel), depth) in
        targets.iter().zip(&mut frame.picture.pixels).zip(&mut frame.depth)
    {
        if let Some(source) = sources.get(target.source as usize)
            && target.pixel != NONE
        {
            *pixel = source.frame.picture.pixels[target.pixel as usize];
            // A depth of 0 or less marks unknown light, and is kept.
            let known = source.frame.depth[target.pixel as usize];
            *depth = if known > 0.0 { target.depth } else { known };
        }
    }
    frame.picture.view = Some(*view);
    if let Some(Source { frame: first, .. }) = sources.first() {
        let grown = frame.depth.len() as f64 / first.depth.len().max(1) as f64;
        let count = |count: u64| (count as f64 * grown) as u64;
        frame.empty_pixels = count(first.empty_pixels);
        frame.uncovered_pixels = count(first.uncovered_pixels);
        frame.gleam_pixels = count(first.gleam_pixels);
        frame.samples_used = first.samples_used;
    }
    Some(frame)
}

/// Projects the pixels of a source into `view`, where no earlier source has filled a pixel.
fn project(
    source: &Source<'_>,
    number: u32,
    view: &View,
    size: (u32, u32),
    targets: &mut [Target],
) {
    let own = source.frame.picture.size();
    let (from, to) = (Camera::new(source.view, own), Camera::new(view, size));
    // Steps along a source's row and column, in the camera of `view`.
    let turned = |vector: DVec3| to.to_camera(vector).as_vec3();
    let (right, up, forward) = (turned(from.right), turned(from.up), turned(from.forward));
    let origin = turned(from.eye - to.eye);
    let focal = (to.focal.0 as f32, to.focal.1 as f32);
    let centre = (to.centre.0 as f32, to.centre.1 as f32);
    let (width, height) = (size.0 as usize, size.1 as usize);
    // If the source is finer than the picture, some of its columns and rows suffice.
    let step = |own: u32, size: u32| ((own + size / 4) / size.max(1)).max(1) as usize;
    let (across, down) = (step(own.0, size.0), step(own.1, size.1));
    let is_taken: Vec<bool> = if number == 0 {
        Vec::new()
    } else {
        targets.iter().map(|target| target.pixel != NONE).collect()
    };
    for row in (down / 2..own.1 as usize).step_by(down) {
        let y = (from.centre.1 as f32 - row as f32 - 0.5) / from.focal.1 as f32;
        let start = forward + y * up;
        let depths = &source.frame.depth[row * own.0 as usize..(row + 1) * own.0 as usize];
        for (column, &distance) in depths.iter().enumerate().skip(across / 2).step_by(across) {
            let x = (column as f32 + 0.5 - from.centre.0 as f32) / from.focal.0 as f32;
            let towards: Vec3 = start + x * right;
            // Pixels without a known distance move as if they were infinitely far.
            let is_known = distance > 0.0 && distance.is_finite();
            let (place, depth) = if is_known {
                let place = origin + towards * (distance / towards.length());
                (place, place.length())
            } else {
                (towards, f32::INFINITY)
            };
            if place.z <= 0.0 {
                continue;
            }
            let inverse = place.z.recip();
            let (x, y) =
                (centre.0 + focal.0 * place.x * inverse, centre.1 - focal.1 * place.y * inverse);
            if !(x >= 0.0 && y >= 0.0 && x < width as f32 && y < height as f32) {
                continue;
            }
            let at = y as usize * width + x as usize;
            let target = &mut targets[at];
            let is_free = is_taken.get(at).is_none_or(|taken| !taken);
            if is_free && (target.pixel == NONE || depth < target.depth) {
                let pixel = (row * own.0 as usize + column) as u32;
                *target = Target { depth, pixel, source: number };
            }
        }
    }
}

/// Fills empty pixels from the farther of their neighbours in the row. Rows without any pixel copy
/// the nearest row that has some. Returns false if all rows are empty.
fn fill(targets: &mut [Target], (width, height): (u32, u32)) -> bool {
    let width = width as usize;
    let mut empty_rows = Vec::new();
    for (number, row) in targets.chunks_mut(width).enumerate() {
        if !fill_row(row) {
            empty_rows.push(number);
        }
    }
    let is_empty = |row: &usize| empty_rows.binary_search(row).is_ok();
    for &row in &empty_rows {
        let above = (0..row).rev().find(|row| !is_empty(row));
        let below = (row + 1..height as usize).find(|row| !is_empty(row));
        let nearest = match (above, below) {
            (Some(above), Some(below)) if below - row < row - above => below,
            (Some(above), _) => above,
            (None, Some(below)) => below,
            (None, None) => return false,
        };
        targets.copy_within(nearest * width..(nearest + 1) * width, row * width);
    }
    true
}

/// Fills a row's gaps. Returns false if the row is empty.
fn fill_row(row: &mut [Target]) -> bool {
    let mut at = 0;
    while at < row.len() {
        if row[at].pixel != NONE {
            at += 1;
            continue;
        }
        let end = (at..row.len()).find(|&next| row[next].pixel != NONE).unwrap_or(row.len());
        let left = at.checked_sub(1).map(|left| row[left]);
        let filling = match (left, row.get(end).copied()) {
            // Both sides belong to one surface, so each half continues its own side.
            (Some(left), Some(right)) if is_one(left.depth, right.depth) => {
                let middle = at + (end - at) / 2;
                row[at..middle].fill(left);
                row[middle..end].fill(right);
                at = end;
                continue;
            }
            (Some(left), Some(right)) if left.depth > right.depth => left,
            (_, Some(right)) => right,
            (Some(left), None) => left,
            (None, None) => return false,
        };
        row[at..end].fill(filling);
        at = end;
    }
    true
}

fn is_one(a: f32, b: f32) -> bool {
    a == b || (a < b * BEHIND && b < a * BEHIND)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (u32, u32) = (160, 90);

    /// Draws a wall at y = 4 whose radiance depends on the place, and a near board before it.
    fn scene(view: &View, size: (u32, u32)) -> Frame {
        let mut frame = Frame::black(size);
        for row in 0..size.1 {
            for column in 0..size.0 {
                let (x, y) = View::pixel_centre(size, column, row);
                let (origin, direction) = view.ray(x, y);
                let at = |far: f64| origin + direction * ((far - origin.y) / direction.y);
                let board = at(2.0);
                let is_board = board.x.abs() < 0.3 && board.z.abs() < 0.5;
                let point = if is_board { board } else { at(4.0) };
                let pixel = (row * size.0 + column) as usize;
                frame.depth[pixel] = (point - origin).length() as f32;
                frame.picture.pixels[pixel] = light(point, is_board);
            }
        }
        frame
    }

    fn light(point: DVec3, is_board: bool) -> [f32; 3] {
        let stripes = 1.0 + 0.5 * (3.0 * point.x).sin() as f32 + 0.2 * point.z as f32;
        if is_board { [5.0, 0.0, 0.0] } else { [stripes, stripes, 1.0] }
    }

    fn view(x: f64, turn: f64) -> View {
        let direction = DVec3::new(turn.sin(), turn.cos(), 0.0);
        View::new(DVec3::new(x, 0.0, 0.0), direction, DVec3::Z, Some(60.0), None, SIZE).unwrap()
    }

    /// Returns the share of pixels that differ from the scene as seen from `view`.
    fn wrong(shown: &Frame, view: &View) -> f64 {
        let truth = scene(view, shown.picture.size());
        let pairs = shown.picture.pixels.iter().zip(&truth.picture.pixels);
        let wrong = pairs.filter(|(a, b)| (0..3).any(|c| (a[c] - b[c]).abs() > 0.1)).count();
        wrong as f64 / truth.depth.len() as f64
    }

    #[test]
    fn the_same_view_shows_the_same_picture() {
        let from = view(0.0, 0.0);
        let frame = scene(&from, SIZE);
        let shown = warp(&[Source { view: &from, frame: &frame }], &from, SIZE).unwrap();
        assert_eq!(shown.picture.pixels, frame.picture.pixels);
        assert_eq!(shown.picture.view, Some(from));
    }

    #[test]
    fn a_step_and_a_turn_show_the_scene_from_there() {
        let from = view(0.0, 0.0);
        let frame = scene(&from, SIZE);
        let source = Source { view: &from, frame: &frame };
        for to in [view(0.1, 0.0), view(0.0, 0.02), view(-0.1, 0.05)] {
            let shown = warp(&[source], &to, SIZE).unwrap();
            let (before, after) = (wrong(&frame, &to), wrong(&shown, &to));
            assert!(after < 0.03 && after < 0.5 * before, "{after} {before}");
        }
    }

    #[test]
    fn a_second_frame_shows_what_the_first_one_did_not_see() {
        let (left, right, between) = (view(0.0, -0.2), view(0.0, 0.2), view(0.0, 0.0));
        let (ahead, behind) = (scene(&right, SIZE), scene(&left, SIZE));
        let first = Source { view: &right, frame: &ahead };
        let second = Source { view: &left, frame: &behind };
        let wrong =
            |sources: &[Source<'_>]| wrong(&warp(sources, &between, SIZE).unwrap(), &between);
        let (alone, both) = (wrong(&[first]), wrong(&[first, second]));
        assert!(both < 0.02 && both < alone, "{both} {alone}");
    }

    #[test]
    fn nothing_turns_black_however_far_one_turns() {
        let from = view(0.0, 0.0);
        let frame = scene(&from, SIZE);
        for turn in [-0.9, -0.3, 0.3, 0.9] {
            let to = view(0.0, turn);
            let shown = warp(&[Source { view: &from, frame: &frame }], &to, (80, 45)).unwrap();
            assert!(shown.picture.pixels.iter().all(|pixel| pixel[2] + pixel[0] > 0.5), "{turn}");
        }
        let back = view(0.0, 3.0);
        assert!(warp(&[Source { view: &from, frame: &frame }], &back, SIZE).is_none());
    }
}

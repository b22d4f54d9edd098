//! Projects earlier frames to the current position of the eye: each pixel moves to where its
//! surface is seen from there.
//!
//! A driver takes longer to draw than a person should wait. Between two of its frames, a person who
//! walks sees such pictures. The render cache (Walter, Drettakis & Parker 1999) projects points the
//! same way. Gaps that neither of two earlier frames fills take the farther of the surfaces around
//! them ([`fill`]).
//!
//! Invariants:
//! - Where two surfaces of an earlier frame overlap, the nearer one is shown.
//! - A pixel that some source fills never turns black.

mod fill;

use glam::{DVec3, Vec3};
use holo_display::{Camera, Frame};
use holo_picture::{View, ViewKind};

/// A surface lies behind another one if it is farther by this factor.
const BEHIND: f32 = 1.05;

/// Greatest distance of a crack's sides from its pixels.
const CRACK: isize = 2;

/// Factor by which a pixel of unknown distance is placed behind the known one beside it, so that
/// known ones are shown where both fall. It is less than [`BEHIND`].
const UNKNOWN_BEHIND: f32 = 1.02;

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
struct WarpTarget {
    depth: f32,
    /// The source's pixel, or [`NONE`].
    pixel: u32,
    /// The source's number.
    source: u32,
}

const EMPTY: WarpTarget = WarpTarget { depth: f32::INFINITY, pixel: NONE, source: 0 };

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
            close_cracks(&mut targets, size);
        }
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
    let is_gap = |pixel: usize| targets[pixel].pixel == NONE;
    if !fill::fill(&mut frame.picture.pixels, &mut frame.depth, size, is_gap) {
        return None;
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
    targets: &mut [WarpTarget],
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
        (0..targets.len()).map(|at| is_known_or_crack(targets, size, at)).collect()
    };
    for row in (down / 2..own.1 as usize).step_by(down) {
        let y = (from.centre.1 as f32 - row as f32 - 0.5) / from.focal.1 as f32;
        let start = forward + y * up;
        let depths = &source.frame.depth[row * own.0 as usize..(row + 1) * own.0 as usize];
        // A pixel of unknown distance moves with the known one before it in its row. If it stayed
        // behind as if it were infinitely far, gaps between points would slide over them.
        let mut beside = depths.iter().copied().find(|d| *d > 0.0).unwrap_or(f32::INFINITY);
        for (column, &distance) in depths.iter().enumerate().skip(across / 2).step_by(across) {
            let x = (column as f32 + 0.5 - from.centre.0 as f32) / from.focal.0 as f32;
            let towards: Vec3 = start + x * right;
            let is_known = distance > 0.0;
            if is_known {
                beside = distance;
            }
            let (place, depth) = if beside.is_finite() {
                let place = origin + towards * (beside / towards.length());
                (place, place.length() * if is_known { 1.0 } else { UNKNOWN_BEHIND })
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
                *target = WarpTarget { depth, pixel, source: number };
            }
        }
    }
}

/// Closes cracks through which a farther surface shows: pixels that lie behind what is on both
/// sides in some direction, if that is one surface. Such a pixel takes the nearer surface. At the
/// picture's edge, one side suffices.
fn close_cracks(targets: &mut [WarpTarget], (width, height): (u32, u32)) {
    let nearest = nearest_around(targets, width as usize);
    let (width, height) = (width as isize, height as isize);
    for y in 0..height {
        for x in 0..width {
            let at = (y * width + x) as usize;
            let own = targets[at];
            // Most pixels have nothing before them.
            if own.pixel == NONE || own.depth <= BEHIND * nearest[at] {
                continue;
            }
            let is_before = |other: &WarpTarget| own.depth > BEHIND * other.depth;
            // The first nearer surface to one side; `Err` at the picture's edge.
            let side = |across: isize, down: isize| {
                for far in 1..=CRACK {
                    let (x, y) = (x + far * across, y + far * down);
                    if !((0..width).contains(&x) && (0..height).contains(&y)) {
                        return Err(());
                    }
                    let other = targets[(y * width + x) as usize];
                    if other.pixel != NONE && is_before(&other) {
                        return Ok(Some(other));
                    }
                }
                Ok(None)
            };
            let nearer =
                [(1, 0), (0, 1), (1, 1), (1, -1)].iter().find_map(|&(across, down)| {
                    match (side(-across, -down), side(across, down)) {
                        (Ok(Some(a)), Ok(Some(b))) if is_one(a.depth, b.depth) => Some(a),
                        (Ok(Some(a)), Err(())) | (Err(()), Ok(Some(a))) => Some(a),
                        _ => None,
                    }
                });
            targets[at] = nearer.unwrap_or(own);
        }
    }
}

/// Returns the least depth around each pixel, at most [`CRACK`] columns and rows away.
fn nearest_around(targets: &[WarpTarget], width: usize) -> Vec<f32> {
    const REACH: usize = CRACK as usize;
    let mut across = vec![f32::INFINITY; targets.len()];
    let mut line = vec![f32::INFINITY; width + 2 * REACH];
    for (least, targets) in across.chunks_mut(width).zip(targets.chunks(width)) {
        for (depth, target) in line[REACH..].iter_mut().zip(targets) {
            *depth = target.depth;
        }
        for (column, least) in least.iter_mut().enumerate() {
            *least =
                line[column..=column + 2 * REACH].iter().copied().fold(f32::INFINITY, f32::min);
        }
    }
    let mut nearest = vec![f32::INFINITY; targets.len()];
    for (row, nearest) in nearest.chunks_mut(width).enumerate() {
        let above = row.saturating_sub(REACH) * width;
        for line in across[above..].chunks(width).take(row.min(REACH) + REACH + 1) {
            for (nearest, depth) in nearest.iter_mut().zip(line) {
                *nearest = nearest.min(*depth);
            }
        }
    }
    nearest
}

fn is_one(a: f32, b: f32) -> bool {
    a < b * BEHIND && b < a * BEHIND
}

/// Returns whether a pixel is filled, or is a crack in a surface: no pixel of a source happens to
/// lie there, but some do on both sides. An older source would show something else through it.
fn is_known_or_crack(targets: &[WarpTarget], (width, height): (u32, u32), at: usize) -> bool {
    let is_known = |at: usize| targets[at].pixel != NONE;
    if is_known(at) {
        return true;
    }
    let (width, height) = (width as isize, height as isize);
    let (x, y) = (at as isize % width, at as isize / width);
    // Beyond the picture's edge, nothing contradicts a crack.
    let is_side = |across: isize, down: isize| {
        let (x, y) = (x + across, y + down);
        let is_in = (0..width).contains(&x) && (0..height).contains(&y);
        !is_in || is_known((y * width + x) as usize)
    };
    let has_side = |across, down| (1..=CRACK).any(|far| is_side(far * across, far * down));
    let ways = [(1, 0), (0, 1), (1, 1), (1, -1)];
    ways.iter().any(|&(across, down)| has_side(across, down) && has_side(-across, -down))
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
    fn gaps_of_unknown_distance_move_with_what_is_beside_them() {
        let (from, to) = (view(0.0, 0.0), view(0.1, 0.0));
        let whole = scene(&from, SIZE);
        let mut sparse = whole.clone();
        // Every third pixel has a point; the others have its light and no distance.
        for (pixel, depth) in sparse.depth.iter_mut().enumerate() {
            if pixel % 3 != 0 {
                *depth = 0.0;
            }
        }
        let [of_whole, of_sparse] = [&whole, &sparse]
            .map(|frame| wrong(&warp(&[Source { view: &from, frame }], &to, SIZE).unwrap(), &to));
        assert!(of_sparse < of_whole + 0.02, "{of_sparse} {of_whole}");
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

    /// Returns the greatest difference between neighbouring rows of a picture, in a column.
    fn steps(shown: &Frame, column: u32) -> f32 {
        let at = |row| shown.picture.get(column, row).unwrap();
        let differ = |row: u32| {
            let (here, below) = (at(row), at(row + 1));
            (0..3).map(|c| (here[c] - below[c]).abs()).fold(0.0, f32::max)
        };
        (0..shown.picture.height - 1).map(differ).fold(0.0, f32::max)
    }

    #[test]
    fn what_a_board_uncovers_and_what_lies_beyond_the_edge_has_no_comb() {
        let from = view(0.0, 0.0);
        let frame = scene(&from, SIZE);
        let source = Source { view: &from, frame: &frame };
        // The eye steps to the right, so the wall to the left of the board is uncovered.
        let to = view(0.25, 0.0);
        let shown = warp(&[source], &to, SIZE).unwrap();
        let truth = scene(&to, SIZE);
        let is_red = |frame: &Frame, pixel: usize| frame.picture.pixels[pixel][1] == 0.0;
        let bled = (0..truth.depth.len())
            .filter(|&pixel| is_red(&shown, pixel) && !is_red(&truth, pixel))
            .count();
        assert!(bled < 200, "{bled} pixels of the wall show the board");
        // The eye turns, so a third of the picture was outside every frame. The wall's rows differ
        // little, and so must those that are filled.
        let to = view(0.0, 0.4);
        let shown = warp(&[source], &to, SIZE).unwrap();
        let (filled, known) = (steps(&shown, SIZE.0 - 20), steps(&shown, SIZE.0 / 2));
        assert!(filled < 2.0 * known + 0.02, "{filled} {known}");
    }

    #[test]
    fn a_coarse_frame_of_another_shape_leaves_no_black_rows() {
        let from = View::new(DVec3::ZERO, DVec3::Y, DVec3::Z, Some(60.0), None, (80, 80)).unwrap();
        let frame = scene(&from, (80, 80));
        // An older frame knows no light.
        let dark = Frame::black((80, 80));
        let sources = [&frame, &dark].map(|frame| Source { view: &from, frame });
        let shown = warp(&sources, &view(0.05, 0.0), SIZE).unwrap();
        let dark = shown.picture.pixels.iter().filter(|pixel| pixel[2] + pixel[0] < 0.5).count();
        assert!(dark < SIZE.1 as usize, "{dark} pixels are black");
    }

    #[test]
    fn an_older_frame_does_not_show_through_the_cracks_of_a_nearer_surface() {
        // The eye has come closer to the wall, so its pixels lie apart. An older frame is green.
        let from = view(0.0, 0.0);
        let frame = scene(&from, SIZE);
        let mut older = frame.clone();
        older.picture.pixels.fill([0.0, 9.0, 0.0]);
        let eye = DVec3::new(0.0, 0.4, 0.0);
        let to = View::new(eye, DVec3::Y, DVec3::Z, Some(60.0), None, SIZE).unwrap();
        let sources = [&frame, &older].map(|frame| Source { view: &from, frame });
        let shown = warp(&sources, &to, SIZE).unwrap();
        let green = shown.picture.pixels.iter().filter(|pixel| pixel[1] > 8.0).count();
        assert_eq!(green, 0);
    }

    #[test]
    fn a_farther_surface_does_not_show_through_the_cracks_of_a_nearer_one() {
        // The eye comes closer and steps aside, so the wall's pixels move behind the board, whose
        // own pixels lie apart.
        let from = view(0.0, 0.0);
        let frame = scene(&from, SIZE);
        let eye = DVec3::new(0.3, 0.9, 0.0);
        let to = View::new(eye, DVec3::Y, DVec3::Z, Some(60.0), None, SIZE).unwrap();
        let shown = warp(&[Source { view: &from, frame: &frame }], &to, SIZE).unwrap();
        // The middle of the board, away from its edges.
        let leaks = (0..SIZE.1).flat_map(|row| (0..SIZE.0).map(move |column| (column, row)));
        let leaks = leaks.filter(|&(column, row)| {
            let (x, y) = View::pixel_centre(SIZE, column, row);
            let (origin, direction) = to.ray(x, y);
            let at = origin + direction * ((2.0 - origin.y) / direction.y);
            let is_board = at.x.abs() < 0.26 && at.z.abs() < 0.4;
            is_board && shown.picture.get(column, row).is_some_and(|rgb| rgb[1] > 0.0)
        });
        assert_eq!(leaks.count(), 0);
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

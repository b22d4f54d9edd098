//! Marks the pixels of a view that lie within two pixels of an edge. `edges_of_view SCENE.obj "-vp
//! … -vd … -vu … -vh …" 320x240` prints the picture's rows, with `#` for such a pixel and `.` for
//! others.
//!
//! A pixel is on an edge if a neighbour shows another material, or a surface that does not continue
//! the plane.

use glam::{DVec3, Vec3};
use holo_picture::{View, ViewSpec};
use holo_raycast::Raycaster;
use holo_scene::{LoadOptions, load};
use std::path::PathBuf;
use std::sync::Arc;

/// Distance from an edge within which pixels are marked.
const NEAR: usize = 2;

/// The surface at a pixel's middle: place relative to the eye, unit normal, material.
type Seen = Option<(Vec3, Vec3, u32)>;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args_os().skip(1);
    let mut next = || arguments.next().ok_or("wants a scene, a view and a size");
    let (path, line, size) = (PathBuf::from(next()?), next()?, next()?);
    let mut spec = ViewSpec { vu: Some(DVec3::Z), ..ViewSpec::default() };
    spec.apply_line(&line.to_string_lossy())?;
    let size = size.to_string_lossy();
    let (width, height) = size.split_once('x').ok_or("a size is written 320x240")?;
    let (view, size) = spec.resolve((width.parse()?, height.parse()?))?;
    let raycaster = Raycaster::build(Arc::new(load(&path, &LoadOptions::default())?.scene))?;
    let (width, height) = (size.0 as usize, size.1 as usize);
    let seen: Vec<Seen> = (0..width * height)
        .map(|pixel| look(&raycaster, &view, pixel % width, pixel / width, size))
        .collect();
    let at = |column: usize, row: usize| seen[row * width + column];
    let mut marks = vec![false; seen.len()];
    for row in 0..height {
        for column in 0..width {
            let right = (column + 1 < width).then(|| at(column + 1, row));
            let below = (row + 1 < height).then(|| at(column, row + 1));
            if [right, below]
                .into_iter()
                .flatten()
                .any(|other| differ(at(column, row), other, &view, size))
            {
                for y in row.saturating_sub(NEAR)..(row + NEAR + 1).min(height) {
                    for x in column.saturating_sub(NEAR)..(column + NEAR + 1).min(width) {
                        marks[y * width + x] = true;
                    }
                }
            }
        }
    }
    for row in marks.chunks(width) {
        println!("{}", row.iter().map(|&mark| if mark { '#' } else { '.' }).collect::<String>());
    }
    Ok(())
}

fn look(raycaster: &Raycaster, view: &View, column: usize, row: usize, size: (u32, u32)) -> Seen {
    let x = (column as f64 + 0.5) / f64::from(size.0);
    let (eye, direction) = view.ray(x, 1.0 - (row as f64 + 0.5) / f64::from(size.1));
    let (ray, skipped) = raycaster.localize(eye, direction)?;
    let hit = raycaster.nearest(&ray)?;
    let place = direction.as_vec3() * (hit.t + skipped as f32);
    Some((
        place,
        raycaster.geometric_normal(hit.triangle),
        raycaster.scene().material_id(hit.triangle),
    ))
}

/// Returns true if two neighbours show different materials, or if the step between them leaves both
/// planes by more than a pixel.
fn differ(a: Seen, b: Seen, view: &View, size: (u32, u32)) -> bool {
    let (Some((here, normal, material)), Some((there, other, its))) = (a, b) else {
        return a.is_some() != b.is_some();
    };
    let (_, left) = view.ray(0.5, 0.5);
    let (_, right) = view.ray(0.5 + 1.0 / f64::from(size.0), 0.5);
    let pixel = left.distance(right) as f32 * here.length();
    let between = there - here;
    let is_step = between.dot(normal).abs().min(between.dot(other).abs()) > pixel;
    material != its || is_step || normal.dot(other).abs() < 0.9
}

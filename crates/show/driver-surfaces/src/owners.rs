//! Finds the pixels and the reflections that samples count in.
//!
//! Invariant: the owners of a sample are a function of the sample and the view.

use crate::light_store::{Cube, FaceClass, Grid};
use crate::view::SurfaceView;
use crate::visible::Edge;
use crate::visible::VisiblePoint;
use glam::{Mat3, Vec3};
use holo_display::Camera;
use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};
use std::ops::Range;

/// Pixels whose surfaces are examined together.
const PIXELS: usize = 1 << 14;

/// Share of a cube's width up to which a pixel's samples lie in cubes that pixels' middles see.
const FINE: f32 = 0.25;

/// Most half cubes to each side of a pixel's middle in which its samples are searched for.
const MOST_STEPS: f32 = 8.0;

/// Weight of a sample's distance from the plane of a surface, beside its distance from the middle
/// of a pixel there.
const OFF_PLANE: f32 = 16.0;

/// Stands for no coat.
const NO_COAT: u32 = u32::MAX;

/// Rejects most samples that cannot count in a pixel, with one look into a small table.
#[derive(Clone, Copy, Debug)]
struct SampleGate {
    /// Distance of the pixel's surface from the eye.
    distance: f32,
    /// Greatest difference from it for a sample to count.
    tolerance: f32,
}

/// Finds the pixels that samples count in.
#[derive(Clone, Debug)]
pub(crate) struct Owners {
    pub grid: Grid,
    camera: Camera,
    eye: Vec3,
    turn: Mat3,
    /// Gates by pixel.
    gates: Vec<SampleGate>,
    /// For each pixel, true if it lies on an edge.
    pub on_edges: Vec<bool>,
    /// The number of each pixel's coat, or [`NO_COAT`]. Empty without coats.
    coats: Vec<u32>,
    /// The pieces of each pixel that has any apart. `None` until the view has looked into its
    /// edges.
    pub pieces: Option<FxHashMap<usize, Range<usize>>>,
    /// The cubes of all visible surfaces.
    pub cubes: FxHashSet<Cube>,
    /// Surfaces visible in mirrors, by cube.
    pub mirrors: FxHashMap<Cube, Mirrored>,
}

/// A surface seen in a mirror, and the number of its sums.
type InMirror = (usize, VisiblePoint);

/// Surfaces of one cube that mirrors and panes show, by place.
#[derive(Clone, Debug)]
pub(crate) struct Mirrored {
    /// Width of a place, scene units.
    width: f32,
    /// The surfaces near each place, in order of places.
    shown: Vec<InMirror>,
    places: FxHashMap<u64, Range<u32>>,
}

/// The surfaces that some pixels show.
#[derive(Default)]
struct PixelSurfaces {
    cubes: FxHashSet<Cube>,
    in_mirrors: Vec<(Cube, InMirror)>,
}

impl Owners {
    pub fn new(view: &SurfaceView, grid: Grid) -> Owners {
        let (camera, eye) = view.camera();
        let rows = [camera.right, camera.up, camera.forward].map(|axis| axis.as_vec3());
        let turn = Mat3::from_cols(rows[0], rows[1], rows[2]).transpose();
        let mut on_edges = vec![false; view.seen.len()];
        view.on_edges().iter().for_each(|&pixel| on_edges[pixel] = true);
        let mut owners = Owners {
            grid,
            camera,
            eye: eye.as_vec3(),
            turn,
            gates: gates(view, eye.as_vec3(), grid.unit),
            on_edges,
            coats: number_coats(view),
            pieces: None,
            cubes: FxHashSet::default(),
            mirrors: FxHashMap::default(),
        };
        let panes = view.in_panes[..view.panes_of_middles].iter().map(|pane| pane.seen);
        let panes: Vec<VisiblePoint> = panes.collect();
        let mut in_mirrors: FxHashMap<Cube, Vec<InMirror>> = FxHashMap::default();
        for (first, seen) in [(0, &view.seen), (view.seen.len(), &panes)] {
            let found = |(part, seen): (usize, &[VisiblePoint])| {
                PixelSurfaces::new(view, grid, first + part * PIXELS, seen)
            };
            let found: Vec<PixelSurfaces> =
                seen.par_chunks(PIXELS).enumerate().map(found).collect();
            for found in found {
                owners.cubes.extend(found.cubes);
                for (cube, shown) in found.in_mirrors {
                    in_mirrors.entry(cube).or_default().push(shown);
                }
            }
        }
        let mirrors = in_mirrors.into_par_iter();
        let mirrors = mirrors.map(|(cube, shown)| (cube, Mirrored::new(&shown, grid)));
        owners.mirrors = mirrors.collect();
        owners
    }

    /// Adds the pieces of a view that has looked into its edges. Returns the cubes that only the
    /// pieces show.
    pub fn look_into_edges(&mut self, view: &SurfaceView) -> Vec<Cube> {
        let mut all = FxHashMap::default();
        let mut new = Vec::new();
        for Edge { pixel, pieces } in &view.edges {
            let apart = || view.pieces[pieces.clone()].iter().filter(|piece| piece.is_apart);
            if apart().next().is_some() {
                all.insert(*pixel, pieces.clone());
            }
            let cubes = apart().map(|piece| self.grid.cube(piece.seen.point));
            new.extend(cubes.filter(|cube| self.cubes.insert(*cube)));
        }
        self.pieces = Some(all);
        new
    }

    /// Returns the pixel in whose direction a point lies, and true if the point is about as far
    /// from the eye as the pixel's surface.
    #[inline]
    pub fn pixel(&self, view: &SurfaceView, point: Vec3) -> Option<(usize, bool)> {
        let from_eye = self.turn * (point - self.eye);
        let (x, y) = self.camera.pixel(from_eye)?;
        if !(x >= 0.0 && y >= 0.0 && x < view.size.0 as f32 && y < view.size.1 as f32) {
            return None;
        }
        let pixel = y as usize * view.size.0 + x as usize;
        let gate = &self.gates[pixel];
        Some((pixel, (from_eye.length() - gate.distance).abs() <= gate.tolerance))
    }

    /// Returns how many pixels show coats.
    pub fn coat_count(&self) -> usize {
        self.coats.iter().filter(|coat| **coat != NO_COAT).count()
    }

    /// Returns the number of the coat that a pixel shows.
    #[inline]
    pub fn coat(&self, pixel: usize) -> Option<usize> {
        self.coats.get(pixel).filter(|coat| **coat != NO_COAT).map(|coat| *coat as usize)
    }

    /// Returns true if samples at this point, on this face, lie on the surface `seen`, and no
    /// mirror shows that surface.
    #[inline]
    pub fn is_on(
        &self,
        view: &SurfaceView,
        seen: &VisiblePoint,
        point: Vec3,
        face: FaceClass,
    ) -> bool {
        let way = view.way(seen);
        seen.away(point, self.grid.unit).is_some()
            && face.serves(seen.normal, seen.material, way.direction)
            && !way.is_mirrored
    }
}

impl PixelSurfaces {
    /// Returns the surfaces of these pixels. `first` is the number of the first one's sums.
    fn new(view: &SurfaceView, grid: Grid, first: usize, seen: &[VisiblePoint]) -> PixelSurfaces {
        let mut found = PixelSurfaces::default();
        let mut last = None;
        let eye = view.camera().1.as_vec3();
        for (owner, seen) in (first..).zip(seen).filter(|(_, seen)| seen.is_surface()) {
            let cube = grid.cube(seen.point);
            if last != Some(cube) {
                found.cubes.insert(cube);
                last = Some(cube);
            }
            if seen.width > FINE * grid.cube_width() {
                found.add_footprint(grid, eye, seen);
            }
            // Before what a pixel sees, there may be covered surfaces.
            if view.way(seen).is_mirrored || owner >= view.seen.len() {
                found.in_mirrors.push((cube, (owner, *seen)));
            }
        }
        found
    }

    /// Adds all cubes that a wide pixel may touch.
    fn add_footprint(&mut self, grid: Grid, eye: Vec3, seen: &VisiblePoint) {
        let along = (seen.point - eye).normalize_or_zero();
        let cosine = along.dot(seen.normal).abs();
        let across = along.cross(seen.normal).normalize_or(seen.normal.any_orthonormal_vector());
        let half = 0.5 * seen.width;
        let sides = [across, seen.normal.cross(across) / cosine.max(0.1)].map(|side| half * side);
        let steps =
            sides.map(|side| (2.0 * side.length() / grid.cube_width()).ceil().min(MOST_STEPS));
        let [across, away] = steps.map(|steps| -(steps as i32)..=steps as i32);
        for x in across {
            for y in away.clone() {
                let offset = sides[0] * (x as f32 / steps[0]) + sides[1] * (y as f32 / steps[1]);
                self.cubes.insert(grid.cube(seen.point + offset));
            }
        }
    }
}

impl Mirrored {
    fn new(all: &[InMirror], grid: Grid) -> Mirrored {
        let widest = all.iter().map(|(_, seen)| seen.width).fold(grid.unit, f32::max);
        let width = 2.0 * widest;
        let mut at_places: Vec<(u64, u32)> = Vec::with_capacity(8 * all.len());
        for (number, (_, seen)) in all.iter().enumerate() {
            for corner in 0..8 {
                let side = [corner & 1, corner >> 1 & 1, corner >> 2];
                let side = Vec3::from_array(side.map(|bit| bit as f32 - 0.5));
                at_places.push((place(seen.point + side * width, width), number as u32));
            }
        }
        at_places.sort_unstable();
        at_places.dedup();
        let mut places: FxHashMap<u64, Range<u32>> = FxHashMap::default();
        for (at, &(place, _)) in (0..).zip(&at_places) {
            places.entry(place).or_insert(at..at).end = at + 1;
        }
        let shown = at_places.iter().map(|&(_, number)| all[number as usize]).collect();
        Mirrored { width, shown, places }
    }

    /// Returns the number of the sums in which a sample counts.
    pub fn owner(
        &self,
        view: &SurfaceView,
        point: Vec3,
        face: FaceClass,
        unit: f32,
    ) -> Option<usize> {
        let Range { start, end } = *self.places.get(&place(point, self.width))?;
        let nearest =
            self.shown[start as usize..end as usize].iter().filter_map(|(owner, seen)| {
                let serves = face.serves(seen.normal, seen.material, view.way(seen).direction);
                let away = seen.away(point, unit)?;
                // Of two sheets close together, a sample is on that in whose plane it lies.
                let off = (point - seen.point).dot(seen.normal).abs();
                (serves && away < seen.width + 2.0 * unit)
                    .then_some((away + OFF_PLANE * off, *owner))
            });
        nearest.min_by(|(a, i), (b, j)| a.total_cmp(b).then(i.cmp(j))).map(|(_, owner)| owner)
    }
}

/// Returns the number of each pixel's coat, or [`NO_COAT`]. Empty without coats. Coats that mirrors
/// show have no number.
fn number_coats(view: &SurfaceView) -> Vec<u32> {
    let materials = view.follower().materials;
    if !materials.finishes.iter().any(|finish| finish.is_coated)
        || !view.seen.par_iter().any(|seen| view.shows_coat(seen))
    {
        return Vec::new();
    }
    let mut coats = 0;
    let number = |seen: &VisiblePoint| {
        if !view.shows_coat(seen) {
            return NO_COAT;
        }
        coats += 1;
        coats - 1
    };
    view.seen.iter().map(number).collect()
}

/// Returns the number of the place that contains a point. Places are `width` wide.
#[inline]
fn place(point: Vec3, width: f32) -> u64 {
    let [x, y, z] = (point / width).to_array().map(|c| c.floor() as i64 as u64 & 0x1f_ffff);
    x << 42 | y << 21 | z
}

/// Returns the gates of all pixels.
fn gates(view: &SurfaceView, eye: Vec3, unit: f32) -> Vec<SampleGate> {
    let gate = |seen: &VisiblePoint| {
        let between = seen.point - eye;
        let distance = between.length();
        let cosine = (between.dot(seen.normal) / distance).abs().max(1e-3);
        SampleGate { distance, tolerance: (2.0 * seen.width + 3.0 * unit) / cosine }
    };
    view.seen.par_iter().map(gate).collect()
}

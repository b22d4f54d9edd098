//! Sums of a view's pixels: each sample on a surface that the view sees counts in one pixel, and in
//! one more if a mirror shows it too. There are further sums for the surfaces that pixels on edges
//! see beside their middle, and for what panes mirror.
//!
//! Noise is therefore independent from pixel to pixel, which the last filter relies on.
//!
//! Invariant: which pixels a sample counts in is a function of the sample and the view.

use crate::cell::{Face, Light, Sums};
use crate::edges::{Edge, Piece};
use crate::place::Placed;
use crate::store::{Cube, Grid, Record, Store};
use crate::view::{InPane, Seen, View};
use glam::{Mat3, Vec3};
use holo_display::Camera;
use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};
use std::ops::Range;

/// Cubes whose samples are given to pixels together.
const CUBES: usize = 16;

/// Parts of the picture whose sums are made at the same time.
const PARTS: usize = 4;

/// The sums of a view's pixels, then those of its pieces, then those of what panes mirror.
#[derive(Debug)]
pub struct Gathered {
    sums: Vec<Sums>,
    pixels: usize,
    pieces: usize,
    owners: Owners,
}

/// A sample and the number of the sums that it counts in.
struct Claim {
    owner: usize,
    light: Light,
}

impl Gathered {
    /// Gathers all samples of a store that the view sees.
    #[must_use]
    pub fn new(view: &View, store: &Store) -> Gathered {
        let owners = Owners::new(view, store.grid());
        let (pixels, pieces) = (view.seen.len(), view.pieces.len());
        let sums = vec![Sums::default(); pixels + pieces + view.in_panes.len()];
        let mut gathered = Gathered { sums, pixels, pieces, owners };
        let cubes: Vec<Cube> = gathered.owners.cubes.iter().copied().collect();
        let of_cubes = |cubes: &[Cube]| {
            let mut claims = Vec::new();
            for &cube in cubes {
                let Some(bucket) = store.bucket(cube) else { continue };
                let mirrored = gathered.owners.mirrors.get(&cube);
                for record in &bucket.records {
                    gathered.claim(view, (cube, record), mirrored, &mut claims);
                }
            }
            claims
        };
        let claims: Vec<Vec<Claim>> = cubes.par_chunks(CUBES).map(of_cubes).collect();
        gathered.sum(&claims);
        gathered
    }

    /// Returns how many samples count, those twice that a mirror shows too.
    #[must_use]
    pub fn samples(&self) -> u64 {
        self.sums.par_iter().map(|sums| u64::from(sums.count)).sum()
    }

    /// Returns the sums of all pixels.
    pub(crate) fn pixels(&self) -> &[Sums] {
        &self.sums[..self.pixels]
    }

    /// Returns the sums of all pieces of pixels on edges. Only those that are apart have samples.
    pub(crate) fn pieces(&self) -> &[Sums] {
        &self.sums[self.pixels..][..self.pieces]
    }

    /// Returns the sums of all that panes mirror.
    pub(crate) fn in_panes(&self) -> &[Sums] {
        &self.sums[self.pixels + self.pieces..]
    }

    /// Adds samples that have come since, for the same view. The sums are what
    /// [`new`](Self::new) would make of all.
    pub fn add(&mut self, view: &View, placed: &[Placed]) {
        let grid = self.owners.grid;
        let of_samples = |samples: &[Placed]| {
            let mut claims = Vec::new();
            for sample in samples {
                let (cube, record) = grid.record(sample);
                if self.owners.cubes.contains(&cube) {
                    let mirrored = self.owners.mirrors.get(&cube);
                    self.claim(view, (cube, &record), mirrored, &mut claims);
                }
            }
            claims
        };
        let claims: Vec<Vec<Claim>> = placed.par_chunks(4096).map(of_samples).collect();
        self.sum(&claims);
    }

    /// Appends the sums that a sample counts in.
    #[inline]
    fn claim(
        &self,
        view: &View,
        (cube, record): (Cube, &Record),
        mirrored: Option<&Mirrored>,
        claims: &mut Vec<Claim>,
    ) {
        let point = self.owners.grid.point(cube, record.key);
        let face = record.key.face();
        let straight = self.owners.straight(view, point, face);
        let mirrored = mirrored.and_then(|m| m.owner(view, point, face, self.owners.grid.unit));
        for owner in straight.into_iter().chain(mirrored) {
            claims.push(Claim { owner, light: record.light });
        }
    }

    fn sum(&mut self, claims: &[Vec<Claim>]) {
        let part = self.sums.len().div_ceil(PARTS).max(1);
        self.sums.par_chunks_mut(part).enumerate().for_each(|(number, sums)| {
            for claim in claims.iter().flatten() {
                let at = claim.owner.wrapping_sub(number * part);
                if let Some(sum) = sums.get_mut(at) {
                    sum.add(&Sums::of(&claim.light));
                }
            }
        });
    }
}

/// Tells samples that cannot count in a pixel, at the price of one look into a small table.
#[derive(Clone, Copy, Debug)]
struct Gate {
    /// How far from the eye the pixel's surface is.
    distance: f32,
    /// How far from that a sample may be; infinite if the pixel has pieces apart.
    tolerance: f32,
}

/// Finds the pixels that samples count in.
#[derive(Debug)]
struct Owners {
    grid: Grid,
    camera: Camera,
    eye: Vec3,
    turn: Mat3,
    /// By pixel.
    gates: Vec<Gate>,
    /// The numbers of the pieces of pixels that have any apart.
    pieces: FxHashMap<usize, Range<usize>>,
    /// The cubes of all that is seen.
    cubes: FxHashSet<Cube>,
    /// What is seen in mirrors, by cube.
    mirrors: FxHashMap<Cube, Mirrored>,
}

/// A surface seen in a mirror, and the number of its sums.
type InMirror = (usize, Seen);

/// What mirrors and panes show of one cube, by place.
#[derive(Debug)]
struct Mirrored {
    /// Width of a place, scene units.
    width: f32,
    shown: FxHashMap<u64, Vec<InMirror>>,
}

impl Owners {
    fn new(view: &View, grid: Grid) -> Owners {
        let (camera, eye) = view.camera();
        let rows = [camera.right, camera.up, camera.forward].map(|axis| axis.as_vec3());
        let turn = Mat3::from_cols(rows[0], rows[1], rows[2]).transpose();
        let mut owners = Owners {
            grid,
            camera,
            eye: eye.as_vec3(),
            turn,
            gates: gates(view, eye.as_vec3(), grid.unit),
            pieces: FxHashMap::default(),
            cubes: FxHashSet::default(),
            mirrors: FxHashMap::default(),
        };
        for Edge { pixel, pieces } in &view.edges {
            let apart = view.pieces[pieces.clone()].iter().filter(|piece| piece.is_apart);
            let cubes: Vec<Cube> = apart.map(|piece| grid.cube(piece.seen.point)).collect();
            if !cubes.is_empty() {
                owners.gates[*pixel].tolerance = f32::INFINITY;
                owners.pieces.insert(*pixel, pieces.clone());
                owners.cubes.extend(cubes);
            }
        }
        let mut in_mirrors: FxHashMap<Cube, Vec<InMirror>> = FxHashMap::default();
        let mut last = None;
        for (pixel, seen) in view.seen.iter().enumerate().filter(|(_, seen)| seen.is_surface()) {
            let cube = grid.cube(seen.point);
            if last != Some(cube) {
                owners.cubes.insert(cube);
                last = Some(cube);
            }
            if view.way(seen).is_mirrored {
                in_mirrors.entry(cube).or_default().push((pixel, *seen));
            }
        }
        let first = view.seen.len() + view.pieces.len();
        for (number, InPane { seen, .. }) in view.in_panes.iter().enumerate() {
            if seen.is_surface() {
                let cube = grid.cube(seen.point);
                owners.cubes.insert(cube);
                in_mirrors.entry(cube).or_default().push((first + number, *seen));
            }
        }
        let mirrors = in_mirrors.into_par_iter();
        let mirrors = mirrors.map(|(cube, shown)| (cube, Mirrored::new(&shown, grid)));
        owners.mirrors = mirrors.collect();
        owners
    }

    /// Returns which sums a sample counts in: those of the pixel in its direction, or of a piece of it.
    #[inline]
    fn straight(&self, view: &View, point: Vec3, face: Face) -> Option<usize> {
        let from_eye = self.turn * (point - self.eye);
        let (x, y) = self.camera.pixel(from_eye)?;
        if !(x >= 0.0 && y >= 0.0 && x < view.size.0 as f32 && y < view.size.1 as f32) {
            return None;
        }
        let pixel = y as usize * view.size.0 + x as usize;
        let gate = &self.gates[pixel];
        if (from_eye.length() - gate.distance).abs() > gate.tolerance {
            return None;
        }
        let is_on = |seen: &Seen| {
            let way = view.way(seen);
            seen.away(point, self.grid.unit).is_some()
                && face.serves(seen.normal, seen.material, way.direction)
                && !way.is_mirrored
        };
        if is_on(&view.seen[pixel]) {
            return Some(pixel);
        }
        if gate.tolerance < f32::INFINITY {
            return None;
        }
        let serves = |piece: &Piece| piece.is_apart && is_on(&piece.seen);
        let mut pieces = self.pieces.get(&pixel)?.clone();
        pieces.find(|&piece| serves(&view.pieces[piece])).map(|piece| view.seen.len() + piece)
    }
}

impl Mirrored {
    fn new(all: &[InMirror], grid: Grid) -> Mirrored {
        let widest = all.iter().map(|(_, seen)| seen.width).fold(grid.unit, f32::max);
        let mut mirrored = Mirrored { width: 2.0 * widest, shown: FxHashMap::default() };
        for &(owner, seen) in all {
            let point = seen.point;
            let mut places: Vec<u64> = (0..8)
                .map(|corner| {
                    let side = [corner & 1, corner >> 1 & 1, corner >> 2];
                    let side = Vec3::from_array(side.map(|bit| bit as f32 - 0.5));
                    mirrored.place(point + side * mirrored.width)
                })
                .collect();
            places.sort_unstable();
            places.dedup();
            for place in places {
                mirrored.shown.entry(place).or_default().push((owner, seen));
            }
        }
        mirrored
    }

    #[inline]
    fn place(&self, point: Vec3) -> u64 {
        let [x, y, z] =
            (point / self.width).to_array().map(|c| c.floor() as i64 as u64 & 0x1f_ffff);
        x << 42 | y << 21 | z
    }

    /// Returns the sums that a sample counts in.
    fn owner(&self, view: &View, point: Vec3, face: Face, unit: f32) -> Option<usize> {
        let candidates = self.shown.get(&self.place(point))?;
        let nearest = candidates.iter().filter_map(|&(owner, seen)| {
            let serves = face.serves(seen.normal, seen.material, view.way(&seen).direction);
            let away = seen.away(point, unit)?;
            (serves && away < seen.width + 2.0 * unit).then_some((away, owner))
        });
        nearest.min_by(|(a, i), (b, j)| a.total_cmp(b).then(i.cmp(j))).map(|(_, owner)| owner)
    }
}

/// Returns the gates of all pixels.
fn gates(view: &View, eye: Vec3, unit: f32) -> Vec<Gate> {
    let gate = |seen: &Seen| {
        let between = seen.point - eye;
        let distance = between.length();
        let cosine = (between.dot(seen.normal) / distance).abs().max(1e-3);
        Gate { distance, tolerance: (2.0 * seen.width + 3.0 * unit) / cosine }
    };
    view.seen.par_iter().map(gate).collect()
}

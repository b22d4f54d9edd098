//! Sums of a view's pixels: each sample on a surface that the view sees counts in one pixel, and in
//! one more if a mirror shows it too.
//!
//! Noise is therefore independent from pixel to pixel, which the last filter relies on.
//!
//! Invariant: which pixels a sample counts in is a function of the sample and the view.

use crate::cell::{Face, Light, Sums};
use crate::place::Placed;
use crate::store::{Cube, Grid, Record, Store};
use crate::view::{Seen, View};
use glam::{Mat3, Vec3};
use holo_display::Camera;
use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};

/// Cubes whose samples are given to pixels together.
const CUBES: usize = 16;

/// Parts of the picture whose sums are made at the same time.
const PARTS: usize = 4;

/// The sums of a view's pixels.
#[derive(Debug)]
pub struct Gathered {
    pub(crate) sums: Vec<Sums>,
    owners: Owners,
}

/// A sample and the pixel that it counts in.
struct Claim {
    pixel: usize,
    light: Light,
}

impl Gathered {
    /// Gathers all samples of a store that the view sees.
    #[must_use]
    pub fn new(view: &View, store: &Store) -> Gathered {
        let owners = Owners::new(view, store.grid());
        let sums = vec![Sums::default(); view.seen.len()];
        let mut gathered = Gathered { sums, owners };
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

    /// Appends the pixels that a sample counts in.
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
        for pixel in straight.into_iter().chain(mirrored) {
            claims.push(Claim { pixel, light: record.light });
        }
    }

    fn sum(&mut self, claims: &[Vec<Claim>]) {
        let part = self.sums.len().div_ceil(PARTS).max(1);
        self.sums.par_chunks_mut(part).enumerate().for_each(|(number, sums)| {
            for claim in claims.iter().flatten() {
                let at = claim.pixel.wrapping_sub(number * part);
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
    /// How far from that a sample of it may be.
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
    /// The cubes of all that is seen.
    cubes: FxHashSet<Cube>,
    /// What is seen in mirrors, by cube.
    mirrors: FxHashMap<Cube, Mirrored>,
}

/// Pixels that see surfaces of one cube in a mirror, by the place of these surfaces.
#[derive(Debug)]
struct Mirrored {
    /// Width of a place, scene units.
    width: f32,
    pixels: FxHashMap<u64, Vec<usize>>,
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
            gates: Vec::new(),
            cubes: FxHashSet::default(),
            mirrors: FxHashMap::default(),
        };
        owners.gates = gates(view, owners.eye, grid.unit);
        let mut in_mirrors: FxHashMap<Cube, Vec<usize>> = FxHashMap::default();
        let mut last = None;
        for (pixel, seen) in view.seen.iter().enumerate().filter(|(_, seen)| seen.is_surface()) {
            let cube = grid.cube(seen.point);
            if last != Some(cube) {
                owners.cubes.insert(cube);
                last = Some(cube);
            }
            if view.way(seen).is_mirrored {
                in_mirrors.entry(cube).or_default().push(pixel);
            }
        }
        let mirrors = in_mirrors.into_par_iter();
        let mirrors = mirrors.map(|(cube, pixels)| (cube, Mirrored::new(view, &pixels, grid)));
        owners.mirrors = mirrors.collect();
        owners
    }

    /// Returns the pixel that sees a sample's surface in the sample's direction.
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
        let seen = &view.seen[pixel];
        let way = view.way(seen);
        seen.away(point, self.grid.unit)?;
        let serves = face.serves(seen.normal, seen.material, way.direction);
        (serves && !way.is_mirrored).then_some(pixel)
    }
}

impl Mirrored {
    fn new(view: &View, pixels: &[usize], grid: Grid) -> Mirrored {
        let widest = pixels.iter().map(|&pixel| view.seen[pixel].width).fold(grid.unit, f32::max);
        let mut mirrored = Mirrored { width: 2.0 * widest, pixels: FxHashMap::default() };
        for &pixel in pixels {
            let point = view.seen[pixel].point;
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
                mirrored.pixels.entry(place).or_default().push(pixel);
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

    /// Returns the pixel that sees a sample's surface.
    fn owner(&self, view: &View, point: Vec3, face: Face, unit: f32) -> Option<usize> {
        let candidates = self.pixels.get(&self.place(point))?;
        let nearest = candidates.iter().filter_map(|&pixel| {
            let seen = &view.seen[pixel];
            let serves = face.serves(seen.normal, seen.material, view.way(seen).direction);
            let away = seen.away(point, unit)?;
            (serves && away < seen.width + 2.0 * unit).then_some((away, pixel))
        });
        nearest.min_by(|(a, i), (b, j)| a.total_cmp(b).then(i.cmp(j))).map(|(_, pixel)| pixel)
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

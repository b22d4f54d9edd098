//! Samples onto pixels: each to the pixel whose surface it lies on, if there is one.
//!
//! What always holds:
//! - A sample serves only a pixel of its own surface: on its plane, on the side that the eye sees; next to an edge, of its own
//!   material too, which a ray tells.
//! - What lies before the surfaces around it and is seen by no pixel's middle, a face narrower than a pixel, is summed up by face.
//! - Sums are of integers, so the order of samples changes no bit.

use super::blocks;
use super::shade::Shadings;
use super::surfaces::{Caster, SMOOTH, Seen, Surfaces, Window};
use bytemuck::Zeroable;
use glam::DVec3;
use holo_display::Camera;
use holo_display::LiveSample;
use holo_display::{DistanceTable, PlacedSection};
use holo_section::{CellPair, Sample, distance};
use rustc_hash::FxHashMap;

/// Paths a sample counts for at most.
const MAX_PATHS: u16 = 1024;

/// Fixed-point light is cut here: a thousand times the brightest lamp.
const MOST_LIGHT: f32 = (1_u64 << 36) as f32;

/// Rounding of distances from the eye, relative: of f32 positions, and of surfaces that are not quite flat.
const ROUNDING: f32 = 2e-4;

/// Sums over the samples of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Zeroable)]
pub(crate) struct Sums {
    pub light: [u64; 3],
    pub weight: u64,
    /// Of squared luminance.
    pub square: u128,
}

/// Sums by sides of triangles.
pub(crate) type SideSums = FxHashMap<(u32, bool), Sums>;

impl Sums {
    /// Adds light of so many steps.
    fn add(&mut self, light: [f32; 3], weight: u64) {
        for (sum, steps) in self.light.iter_mut().zip(light) {
            *sum = sum.saturating_add((steps + 0.5) as u64 * weight);
        }
        let bright = luminance(light) as u64;
        self.weight = self.weight.saturating_add(weight);
        self.square = self
            .square
            .saturating_add(u128::from(bright) * u128::from(bright) * u128::from(weight));
    }
}

/// Luminance, the scene's unit.
#[inline]
pub(crate) fn luminance(rgb: [f32; 3]) -> f32 {
    0.265 * rgb[0] + 0.670 * rgb[1] + 0.065 * rgb[2]
}

/// What a beam's samples need to find their pixels.
pub(crate) struct Beam<'a> {
    pub section: &'a PlacedSection,
    pub pair: CellPair,
    pub paths: u16,
}

/// Where samples go.
pub(crate) struct Depositor<'a> {
    pub camera: &'a Camera,
    pub distances: &'a DistanceTable,
    pub surfaces: &'a Surfaces,
    pub shadings: &'a Shadings,
    pub caster: Caster<'a>,
}

/// What samples are added to.
pub(crate) struct Deposits<'a> {
    pub sums: &'a mut [Sums],
    /// By block, how many samples there were with the last one that came into it.
    pub changes: &'a mut [u64],
    /// Of faces that are seen next to edges, but by no pixel's middle.
    pub narrow: &'a mut SideSums,
    /// Samples before these.
    pub samples: u64,
}

/// A sample's surface point, camera coordinates.
struct Place {
    point: DVec3,
    direction: DVec3,
    /// Half a step of the distance code, as a length.
    uncertainty: f64,
}

/// Where a sample next to an edge belongs.
enum Own {
    Pixel(usize),
    /// On a side of a triangle that no pixel's middle around sees: its counter-clockwise one or not.
    Narrow((u32, bool)),
}

impl Depositor<'_> {
    /// Adds a beam's samples; gives how many found a pixel.
    pub fn insert(&self, beam: &Beam, samples: &[Sample], to: &mut Deposits) -> u64 {
        let (entry, exit) = (beam.section.cell(beam.pair.entry), beam.section.cell(beam.pair.exit));
        let mut used = 0;
        for sample in samples {
            let code = sample.distance_code();
            if code == distance::NOTHING_HIT {
                continue;
            }
            let [entry_u, entry_v, exit_u, exit_v] = sample.coords.0.map(f64::from);
            let from = entry.0 + entry.1 * entry_u + entry.2 * entry_v;
            let direction = (exit.0 + exit.1 * exit_u + exit.2 * exit_v - from).normalize_or_zero();
            let diagonals = self.distances.of(code);
            let point = from + direction * (diagonals * beam.section.diagonal);
            let uncertainty = 2.5e-4 * beam.section.diagonal * diagonals.max(1.0);
            let place = Place { point, direction, uncertainty };
            for window in &self.surfaces.windows {
                if let Some(pixel) = self.place(window, &place, || sample.rgb(), beam.paths, to) {
                    used += 1;
                    to.changes[blocks::of(pixel, self.surfaces.size.0)] = to.samples + used;
                }
            }
        }
        used
    }

    /// Adds rays of the view itself, as [`insert`](Self::insert) a beam's samples.
    pub fn insert_live(&self, paths: u16, rays: &[LiveSample], to: &mut Deposits) -> u64 {
        let mut used = 0;
        for ray in rays.iter().filter(|ray| ray.distance.is_finite()) {
            let (point, direction) = ray.place(self.camera);
            // Their distance is exact but for rounding.
            let place = Place { point, direction, uncertainty: 0.0 };
            for window in &self.surfaces.windows {
                if let Some(pixel) = self.place(window, &place, || ray.radiance, paths, to) {
                    used += 1;
                    to.changes[blocks::of(pixel, self.surfaces.size.0)] = to.samples + used;
                }
            }
        }
        used
    }

    /// Adds one sample to the pixel that sees it in one image, and gives that.
    fn place(
        &self,
        window: &Window,
        place: &Place,
        radiance: impl Fn() -> [f32; 3],
        paths: u16,
        to: &mut Deposits,
    ) -> Option<usize> {
        let image = usize::from(window.image);
        let (mut point, mut direction) = (place.point.as_vec3(), place.direction.as_vec3());
        if image > 0 {
            let image = self.surfaces.images.get(image)?;
            (point, direction) = (image.point(point), image.direction(direction));
        }
        let (x, y) = self.camera.pixel(point)?;
        // Also refuses NaN.
        if !(x >= window.low.0 && x < window.high.0 && y >= window.low.1 && y < window.high.1) {
            return None;
        }
        let width = self.surfaces.size.0;
        let mut pixel = y as usize * width + x as usize;
        let lies_on = |seen: &Seen| {
            let tolerance = direction.dot(seen.normal).abs() * place.uncertainty as f32
                + ROUNDING * self.camera.reach(point);
            usize::from(seen.image) == image
                && !seen.is_sky()
                && (point - seen.position).dot(seen.normal).abs() <= tolerance
                && direction.dot(seen.normal) < 0.0
        };
        let mut narrow = None;
        if self.surfaces.edges[pixel] {
            match self.own_pixel(image, place, (x, y), lies_on) {
                Some(Own::Pixel(own)) => pixel = own,
                Some(Own::Narrow(side)) => narrow = Some(side),
                None => return None,
            }
        } else if !lies_on(&self.surfaces.seen[pixel]) {
            return None;
        }
        let material = narrow.map_or(self.surfaces.seen[pixel].material, |(triangle, _)| {
            self.caster.material(triangle)
        });
        let shading = self.shadings.materials.get(material as usize)?;
        let weight = shading.weight(direction, self.camera.sight(point))
            * u64::from(paths.clamp(1, MAX_PATHS));
        if weight == 0 {
            return None;
        }
        let rgb = radiance();
        let light = [0, 1, 2].map(|channel| {
            let steps = rgb[channel] / shading.scale[channel] / self.shadings.unit;
            steps.min(MOST_LIGHT)
        });
        match narrow {
            Some(side) => {
                to.narrow.entry(side).or_default().add(light, weight);
                None
            }
            None => {
                to.sums[pixel].add(light, weight);
                Some(pixel)
            }
        }
    }

    /// Next to an edge: the nearest of the pixels around that sees the very surface that the sample lies on, or the side of its triangle
    /// if none does and nothing hides it.
    fn own_pixel(
        &self,
        image: usize,
        place: &Place,
        at: (f32, f32),
        lies_on: impl Fn(&Seen) -> bool,
    ) -> Option<Own> {
        let (width, height) = self.surfaces.size;
        let (column, row) = (at.0 as usize, at.1 as usize);
        let around = |middle: usize, size: usize| middle.saturating_sub(1)..(middle + 2).min(size);
        let candidates = around(row, height)
            .flat_map(|row| around(column, width).map(move |column| (column, row)));
        let away = |column: usize, row: usize| {
            let (dx, dy) = (column as f32 + 0.5 - at.0, row as f32 + 0.5 - at.1);
            dx * dx + dy * dy
        };
        let mut fitting: [Option<(f32, usize)>; 9] = [None; 9];
        let mut count = 0;
        let mut farthest = 0.0_f32;
        for (column, row) in candidates {
            let pixel = row * width + column;
            let seen = &self.surfaces.seen[pixel];
            if lies_on(seen) {
                fitting[count] = Some((away(column, row), pixel));
                count += 1;
            }
            farthest = farthest.max(self.camera.reach(seen.position));
        }
        let fitting = &mut fitting[..count];
        if fitting.is_empty() && (image > 0 || self.camera.reach(place.point.as_vec3()) > farthest)
        {
            return None;
        }
        // The ray is cast only if some pixel may fit: most samples near an edge lie far behind it.
        let reach = 2.0 * place.uncertainty + f64::from(ROUNDING) * place.point.length();
        let triangle = self.caster.triangle_at(place.point, place.direction, reach)?;
        let image = self.surfaces.images.get(image)?;
        let (material, normal) =
            (self.caster.material(triangle), image.direction(self.caster.normal(triangle)));
        if fitting.is_empty() {
            let [along, eye] =
                [place.direction.as_vec3(), self.camera.sight(place.point.as_vec3())]
                    .map(|d| d.dot(normal));
            return (along * eye > 0.0).then_some(Own::Narrow((triangle, eye <= 0.0)));
        }
        fitting.sort_by(|a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
        let all = || fitting.iter().flatten().map(|&(_, pixel)| pixel);
        let is = |pixel: &usize| self.surfaces.seen[*pixel].triangle() == triangle;
        let continues = |pixel: &usize| {
            let seen = &self.surfaces.seen[*pixel];
            seen.material == material && seen.normal.dot(normal).abs() > SMOOTH
        };
        all().find(is).or_else(|| all().find(continues)).map(Own::Pixel)
    }
}

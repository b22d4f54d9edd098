//! Beam selection: from a view to the beams that its pixels want (Larson & Simmons 1999, §2.4.2).
//!
//! Jittered view rays at low density are intersected with the sections nearest to the viewer, and
//! counted by beam.
//!
//! Invariant: a weight is a number of pixels. The weights of a selection add up to the number of
//! covered pixels. If pixels have weights, their mean is 1, so this holds about for these as well.

use crate::candidates::candidates;
use crate::pixel_weights::PixelWeights;
use crate::random::split_mix;
use glam::DVec3;
use holo_picture::View;
use holo_section::{BeamKey, Section, Viewpoint};
use rayon::prelude::*;

/// Fewest rays per side, even for small pictures, because fewer would miss beams.
const MIN_RAYS_A_SIDE: u32 = 64;
/// Most rays per side, because beams are wider than the pixels of large pictures. In rooms of the
/// bundled interior at 1280 × 720, 230,000 rays take 60 ms. A quarter of them takes 20 ms, and
/// finds 99.98 % of the beams' weight.
const MAX_RAYS_A_SIDE: u32 = 256;

/// Distance of a parallel view's substitute eye behind the view, relative to the sections' reach.
/// Directions of rays through it then differ by less than ray coordinates can resolve in any grid.
const FAR_EYE: f64 = 1e6;
/// Largest rounding error of a ray, in steps of ray coordinates: both ends together. Each end is
/// off by up to half a step along both coordinates.
const ROUNDED_STEPS: f64 = std::f64::consts::SQRT_2;

/// The density of view rays, and how a pixel's weight is shared between sections.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SelectOptions {
    /// Side of the squares that get one view ray each, pixels; there are at least 64 × 64 rays and
    /// at most 256 × 256.
    ///
    /// An example is a picture of 320 × 240 pixels and a section of 24³ cells. With 4, the rays
    /// find 98.7 % of the beams' weight. With 2 they find over 99.5 %, in 2 ms.
    pub pixels_a_side: u32,
    /// Share of a pixel's weight for each section that meets its ray, except the best section; 0
    /// leaves these sections out.
    ///
    /// The share is small: their stored samples are useful, but the best section's new samples show
    /// the same surfaces.
    pub others_share: f32,
    /// Seed of the rays' jitter.
    pub seed: u64,
}

impl Default for SelectOptions {
    fn default() -> Self {
        Self { pixels_a_side: 2, others_share: 1.0 / 16.0, seed: 0 }
    }
}

/// A beam that a view wants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WantedBeam {
    /// The beam. Its section is an index into the sections that were passed.
    pub key: BeamKey,
    /// Expected number of pixels whose rays belong to this beam.
    pub weight: f32,
}

/// The part of a picture that the sections can show.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Coverage {
    /// Number of view rays tried.
    pub rays: u32,
    /// Number of view rays that meet some section.
    pub covered_rays: u32,
    /// Estimated number of covered pixels: the rays' share times the pixels of the picture.
    pub pixels: f64,
}

impl Coverage {
    /// Returns the share of the picture that is covered, 0 to 1.
    pub fn fraction(&self) -> f64 {
        f64::from(self.covered_rays) / f64::from(self.rays.max(1))
    }
}

/// The beams that a view wants, and how much of it they cover.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Selection {
    /// Wanted beams ordered by section and beam, each once.
    pub beams: Vec<WantedBeam>,
    /// The part of the picture that some section covers.
    pub covered: Coverage,
}

/// Returns the beams that the rays of `view` belong to, with their expected numbers of pixels in a
/// picture of `size` (§2.4.2).
///
/// The picture is divided into strata, each with one jittered ray. A ray's candidates are every
/// section that contains the eye, then the nearest ahead, then the nearest behind. Each candidate
/// except the first gets `others_share` of the stratum's weight, together at most half of it. The
/// first gets the rest. The jitter also finds cells that cover only a part of a stratum.
pub fn select_beams(
    sections: &[Section],
    view: &View,
    size: (u32, u32),
    options: &SelectOptions,
) -> Selection {
    select(sections, view, size, options, |_, _| 1.0)
}

/// Returns the same beams with weights that add up the weights of their pixels.
pub fn select_weighted_beams(
    sections: &[Section],
    view: &View,
    size: (u32, u32),
    options: &SelectOptions,
    weights: &PixelWeights,
) -> Vec<WantedBeam> {
    select(sections, view, size, options, |x, y| f64::from(weights.at(x, y))).beams
}

/// Selects the beams of a view. `weight` returns the weight of a pixel at a point of the picture.
fn select(
    sections: &[Section],
    view: &View,
    size: (u32, u32),
    options: &SelectOptions,
    weight: impl Fn(f64, f64) -> f64 + Sync,
) -> Selection {
    let (across, down) = (strata(size.0, options), strata(size.1, options));
    let pixels_per_ray =
        f64::from(size.0) * f64::from(size.1) / (f64::from(across) * f64::from(down));
    let of_row = |row: u32| {
        let (mut shares, mut found, mut covered) = (Vec::new(), Vec::new(), 0);
        for column in 0..across {
            let jitter = split_mix(options.seed ^ ((u64::from(row) << 32 | u64::from(column)) + 1));
            let x = (f64::from(column) + unit(jitter as u32)) / f64::from(across);
            let y = (f64::from(row) + unit((jitter >> 32) as u32)) / f64::from(down);
            let Some((eye, direction, _)) = view.clipped_ray(x, y) else { continue };
            candidates(sections, eye, direction, &mut found);
            let Some((best, others)) = found.split_first() else { continue };
            covered += 1;
            let each = f64::from(options.others_share).clamp(0.0, 0.5 / others.len().max(1) as f64);
            let weight = weight(x, y);
            shares.push((best.key, weight * (1.0 - each * others.len() as f64)));
            if each > 0.0 {
                shares.extend(others.iter().map(|other| (other.key, weight * each)));
            }
        }
        (shares, covered)
    };
    let rows: Vec<(Vec<(BeamKey, f64)>, u32)> = (0..down).into_par_iter().map(of_row).collect();
    let covered_rays = rows.iter().map(|(_, covered)| covered).sum();
    let mut covered = Coverage { rays: across * down, covered_rays, ..Coverage::default() };
    let mut shares: Vec<(BeamKey, f64)> = rows.into_iter().flat_map(|(shares, _)| shares).collect();
    covered.pixels = f64::from(covered.covered_rays) * pixels_per_ray;
    // A stable sort adds up a beam's shares in the order of the rays, so sums repeat to the bit.
    shares.par_sort_by_key(|&(key, _)| key);
    let beams = shares
        .chunk_by(|a, b| a.0 == b.0)
        .map(|same| WantedBeam {
            key: same[0].0,
            weight: (same.iter().map(|share| share.1).sum::<f64>() * pixels_per_ray) as f32,
        })
        .collect();
    Selection { beams, covered }
}

/// Returns the distance from the eye within which a ray must pass, scene units: the width of one
/// sample's footprint on the nearest visible surface.
///
/// `nearest_visible_distance` is in scene units along the view's axis. With four samples per pixel
/// the radius is half a pixel's width. Zero or fewer samples per pixel count as one.
pub fn viewpoint_radius(
    view: &View,
    size: (u32, u32),
    nearest_visible_distance: f64,
    samples_per_pixel: f64,
) -> f64 {
    let samples = if samples_per_pixel > 0.0 { samples_per_pixel } else { 1.0 };
    view.pixel_footprint(size, nearest_visible_distance) / samples.sqrt()
}

/// Returns the sphere that rays traced for a view must pass: `radius` around the view's eye.
///
/// `radius` is in scene units, from [`viewpoint_radius`] or from a driver. A parallel view has no
/// eye, so a sphere far behind the view takes its place. Rays through it differ from the view's own
/// rays by at most `radius` within the sections, or by the rounding of ray coordinates if larger.
pub fn viewpoint(sections: &[Section], view: &View, radius: f64) -> Viewpoint {
    if view.kind.has_eye() {
        return Viewpoint { eye: view.vp.to_array(), radius };
    }
    let (mut reach, mut rounding) = (view.extent().0, 0.0_f64);
    for section in sections {
        for corner in 0..8 {
            let corner = DVec3::new(
                f64::from(corner & 1),
                f64::from(corner >> 1 & 1),
                f64::from(corner >> 2),
            );
            reach = reach.max(section.local_to_world(corner).distance(view.eye()));
        }
        let spec = section.spec();
        let sides = spec.axes.map(|axis| DVec3::from_array(axis).length());
        let cells = [0, 1, 2].map(|axis| sides[axis] / f64::from(spec.grid[axis]));
        let shortest = sides.into_iter().fold(f64::INFINITY, f64::min);
        let longest_step = cells.into_iter().fold(0.0, f64::max) / 256.0;
        rounding = rounding.max(ROUNDED_STEPS * longest_step / shortest);
    }
    let eye = view.eye() - view.vd * (reach * FAR_EYE);
    Viewpoint { eye: eye.to_array(), radius: (radius / reach).max(rounding) * (reach * FAR_EYE) }
}

/// Returns the number of strata along a side of `pixels`.
fn strata(pixels: u32, options: &SelectOptions) -> u32 {
    pixels.div_ceil(options.pixels_a_side.max(1)).clamp(MIN_RAYS_A_SIDE, MAX_RAYS_A_SIDE)
}

/// Returns a uniform number in [0, 1) from 32 random bits.
fn unit(bits: u32) -> f64 {
    f64::from(bits) / 4_294_967_296.0
}

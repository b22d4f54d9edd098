//! Turns cells into surfels, and smooths the light of those with few samples along their surface.
//!
//! Each round replaces the light of a noisy surfel by a mean with its neighbours. A neighbour
//! counts less the more it differs beyond the noise of both, so shadows keep their edges where
//! samples show them. Light and surface colour are apart, so patterns stay sharp. The standard
//! error is that of the weighted mean: variances of neighbours add up by the squares of their
//! weights. A mean of means is no more certain than the mean of all its cells.

use glam::Vec3;
use holo_color::relative_luminance;
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use crate::{
    Surfel, SurfelCells,
    cells::{CellSums, SIDES, middle, neighbour, region, side_of},
    normals::plane_normal,
};

/// Rounds of smoothing: light reaches over as many cells.
const ROUNDS: usize = 20;

/// Standard error below which light is not smoothed any more.
const GOOD_ERROR: f32 = 0.02;

/// Rounds in which light with a great error is smoothed whatever its neighbours show.
const PLAIN_ROUNDS: usize = 2;

/// Standard error that is great, as a share of the light.
const GREAT_ERROR: f32 = 0.2;

/// Differences of this many standard errors are a real difference for the most part.
const TOLERANCE: f32 = 1.5;

/// Radius of a surfel over the spacing, on a surface that is sampled everywhere.
const RADIUS: f32 = 0.8;

/// Greatest radius over the spacing, where neighbours are missing.
const MOST_RADIUS: f32 = 1.6;

/// Most neighbours of a surfel that are used.
const MOST_NEIGHBOURS: usize = 12;

/// Cells by which the origin of a surfel's light grows with each round: 4π times the variance of
/// the weights of a round.
const CELLS_OF_ROUND: f32 = 6.9;

/// A cell is a spike if it is this many times as bright as its neighbours.
const SPIKE: f32 = 3.0;

/// Least ratio of a spike's variance to its square: light that is bright in every sample is none.
const SPIKE_SPREAD: f32 = 0.5;

/// Binary logarithm of the side, in cells, of the regions over which the light of spikes is spread.
const REGION: u32 = 4;

/// No neighbour.
const NOBODY: u32 = u32::MAX;

/// Share of the spacing by which a neighbour may lie off the plane of a surfel.
const OFF_PLANE: f32 = 0.5;

/// Least cosine between normals of neighbours.
const SAME_DIRECTION: f32 = 0.8;

/// A cell on its way to a surfel.
#[derive(Clone, Copy)]
struct SurfelDraft {
    position: Vec3,
    normal: Vec3,
    light: Vec3,
    /// Variance of the light's luminance.
    variance: f32,
    /// Mean variance of the cells that the light comes from.
    of_cell: f32,
}

impl SurfelCells {
    /// Makes a surfel of each cell.
    pub fn into_surfels(self) -> Vec<Surfel> {
        let spacing = self.spacing();
        let cells = self.into_sorted();
        let places: Vec<Vec3> = cells
            .par_iter()
            .map(|(key, sums)| middle(*key, spacing) + sums.position / sums.weight)
            .collect();
        let normals: Vec<Vec3> = cells
            .par_iter()
            .enumerate()
            .map(|(at, (key, sums))| match side_of(*key) < SIDES {
                true => sums.normal.normalize_or(Vec3::Z),
                false => plane_normal(&around(&cells, &places, at), sums.normal),
            })
            .collect();
        let near: Vec<[u32; MOST_NEIGHBOURS]> = (0..cells.len())
            .into_par_iter()
            .map(|at| neighbours(&cells, &places, &normals, at, spacing))
            .collect();
        let variances = variances(&cells, &near);
        let lights = without_spikes(&cells, &near);
        let draft = |at: usize| SurfelDraft {
            position: places[at],
            normal: normals[at],
            light: lights[at],
            variance: variances[at],
            of_cell: variances[at],
        };
        let mut drafts: Vec<SurfelDraft> = (0..cells.len()).into_par_iter().map(draft).collect();
        for round in 0..ROUNDS {
            drafts = (0..drafts.len())
                .into_par_iter()
                .map(|at| smoothed(&drafts, &near[at], at, spacing, round))
                .collect();
        }
        cells
            .par_iter()
            .zip(&drafts)
            .zip(&near)
            .map(|(((_, sums), draft), near)| surfel(sums, draft, &drafts, near, spacing))
            .collect()
    }
}

fn surfel(
    sums: &CellSums,
    draft: &SurfelDraft,
    drafts: &[SurfelDraft],
    near: &[u32; MOST_NEIGHBOURS],
    spacing: f32,
) -> Surfel {
    let colour = sums.drawn_colour / sums.weight;
    let light =
        draft.light * (sums.reflectance / sums.weight) / colour.max(Vec3::splat(f32::MIN_POSITIVE));
    let luminance = relative_luminance(draft.light.into());
    let error = match luminance > 0.0 {
        true => draft.variance.max(0.0).sqrt() / luminance,
        false => f32::INFINITY,
    };
    Surfel {
        position: draft.position,
        normal: draft.normal,
        radius: radius(draft, drafts, near, spacing),
        light: light.into(),
        colour: colour.into(),
        error,
        is_directional: sums.directional > 0.5 * sums.weight,
    }
}

/// Returns a radius by which a surfel meets its neighbours: greater where these are far or few.
fn radius(
    draft: &SurfelDraft,
    drafts: &[SurfelDraft],
    near: &[u32; MOST_NEIGHBOURS],
    spacing: f32,
) -> f32 {
    let mut distances: Vec<f32> = near
        .iter()
        .take_while(|&&other| other != NOBODY)
        .map(|&other| drafts[other as usize].position.distance(draft.position))
        .collect();
    distances.sort_unstable_by(f32::total_cmp);
    // A surface in a grid has about 8 neighbours; the sixth is a diagonal away.
    let reach = distances.get(5).copied().unwrap_or(2.0 * MOST_RADIUS * spacing);
    (0.5 * reach * 1.1).clamp(RADIUS * spacing, MOST_RADIUS * spacing)
}

/// Returns the number of a cell.
fn find(cells: &[(u64, CellSums)], key: u64, near: usize) -> Option<usize> {
    // Neighbours along x follow each other.
    if let Some(at) =
        (near.saturating_sub(1)..cells.len().min(near + 2)).find(|&at| cells[at].0 == key)
    {
        return Some(at);
    }
    cells.binary_search_by_key(&key, |(key, _)| *key).ok()
}

/// Calls `visit` with each cell of the same side that touches this one.
fn for_touching(cells: &[(u64, CellSums)], at: usize, mut visit: impl FnMut(usize)) {
    for z in -1..=1 {
        for y in -1..=1 {
            for x in -1..=1 {
                let key = neighbour(cells[at].0, [x, y, z]).filter(|_| (x, y, z) != (0, 0, 0));
                if let Some(other) = key.and_then(|key| find(cells, key, at)) {
                    visit(other);
                }
            }
        }
    }
}

/// Returns the places of a cell and of those that touch it.
fn around(cells: &[(u64, CellSums)], places: &[Vec3], at: usize) -> Vec<Vec3> {
    let mut found = vec![places[at]];
    for_touching(cells, at, |other| found.push(places[other]));
    found
}

/// Returns the neighbours of a cell on its surface, ended by [`NOBODY`].
fn neighbours(
    cells: &[(u64, CellSums)],
    places: &[Vec3],
    normals: &[Vec3],
    at: usize,
    spacing: f32,
) -> [u32; MOST_NEIGHBOURS] {
    let mut found = [NOBODY; MOST_NEIGHBOURS];
    let mut count = 0;
    for_touching(cells, at, |other| {
        let off = normals[at].dot(places[other] - places[at]).abs();
        let is_same = normals[at].dot(normals[other]) > SAME_DIRECTION;
        if is_same && off < OFF_PLANE * spacing && count < MOST_NEIGHBOURS {
            found[count] = other as u32;
            count += 1;
        }
    });
    found
}

/// Returns the light of each cell. Lamps and mirrors have their own. What single bright paths have
/// brought beyond the neighbours' light is spread over a region, so that the mean stays.
fn without_spikes(cells: &[(u64, CellSums)], near: &[[u32; MOST_NEIGHBOURS]]) -> Vec<Vec3> {
    let light = |at: usize| cells[at].1.light / cells[at].1.weight;
    let kept: Vec<f32> = (0..cells.len())
        .into_par_iter()
        .map(|at| {
            let (cell, own) = (&cells[at].1, relative_luminance(light(at).into()));
            let spread = cell.squares / cell.weight - own * own;
            let is_own = cell.shining + cell.directional > 0.5 * cell.weight;
            let is_steady = is_own || cell.samples > 1 && spread < SPIKE_SPREAD * own * own;
            let others = near[at].iter().take_while(|&&other| other != NOBODY);
            let (sum, count) = others.fold((0.0, 0.0), |(sum, count), &other| {
                (sum + relative_luminance(light(other as usize).into()), count + 1.0)
            });
            let around = sum / count;
            // What stays above the neighbours would be lost to them by smoothing, which trusts
            // noisy light less.
            if is_steady || count < 3.0 || own <= SPIKE * around { 1.0 } else { around / own }
        })
        .collect();
    let mut regions: FxHashMap<u64, (Vec3, f32)> = FxHashMap::default();
    for (at, ((key, _), kept)) in cells.iter().zip(&kept).enumerate() {
        let region = regions.entry(region(*key, REGION)).or_default();
        region.0 += light(at) * (1.0 - kept);
        region.1 += 1.0;
    }
    let spread = |at: usize| {
        let (sum, count) = regions.get(&region(cells[at].0, REGION)).copied().unwrap_or_default();
        light(at) * kept[at] + sum / count.max(1.0)
    };
    (0..cells.len()).into_par_iter().map(spread).collect()
}

/// Returns the variance of each cell's mean luminance. Few samples do not know their variance, so
/// it is that of the cell and its neighbours together.
fn variances(cells: &[(u64, CellSums)], near: &[[u32; MOST_NEIGHBOURS]]) -> Vec<f32> {
    let spread = |cell: &CellSums| {
        let mean = relative_luminance((cell.light / cell.weight).into());
        (cell.squares - cell.weight * mean * mean).max(0.0)
    };
    let variance = |at: usize| {
        let mut samples = 0.0;
        let (mut within, mut weight, mut first) = (0.0, 0.0, 0.0);
        let others = near[at].iter().take_while(|&&other| other != NOBODY);
        let all = others.map(|&other| other as usize).chain([at]);
        let mut means = Vec::with_capacity(MOST_NEIGHBOURS + 1);
        for other in all {
            let cell = &cells[other].1;
            let mean = relative_luminance((cell.light / cell.weight).into());
            samples += cell.samples as f32;
            within += spread(cell);
            weight += cell.weight;
            first += mean * cell.weight;
            means.push((mean, cell.weight));
        }
        // With few samples in each cell, most of their spread is between cells.
        let mean = first / weight;
        let between: f32 = means.iter().map(|(m, w)| w * (m - mean) * (m - mean)).sum();
        let cells_here = means.len() as f32;
        let freedom = samples - cells_here;
        let of_path = match freedom >= cells_here {
            true => within / freedom,
            false => (within + between) / (samples - 1.0).max(1.0),
        };
        let alone = samples < 2.0;
        if alone { mean * mean } else { of_path / cells[at].1.weight }
    };
    (0..cells.len()).into_par_iter().map(variance).collect()
}

/// Returns a draft with its light smoothed once.
fn smoothed(
    drafts: &[SurfelDraft],
    near: &[u32; MOST_NEIGHBOURS],
    at: usize,
    spacing: f32,
    round: usize,
) -> SurfelDraft {
    let own = drafts[at];
    let luminance = relative_luminance(own.light.into());
    if own.variance <= (GOOD_ERROR * luminance).powi(2) {
        return own;
    }
    // Where the noise is great, a single bright path is like no other, and spreads all the same.
    let is_plain = round < PLAIN_ROUNDS && own.variance > (GREAT_ERROR * luminance).powi(2);
    let mut sums = (own.light, 1.0, own.variance);
    let mut of_cell = own.of_cell;
    for &other in near.iter().take_while(|&&other| other != NOBODY) {
        let other = drafts[other as usize];
        let distance = other.position.distance_squared(own.position) / (spacing * spacing);
        let difference = relative_luminance(other.light.into()) - luminance;
        let noise = TOLERANCE * TOLERANCE * (own.variance + other.variance);
        let unlike = match is_plain {
            true => 0.0,
            false => difference * difference / noise.max(f32::MIN_POSITIVE),
        };
        // A neighbour that knows more counts more.
        let trust = match is_plain {
            true => 1.0,
            false => (own.variance / other.variance.max(f32::MIN_POSITIVE)).clamp(0.25, 4.0),
        };
        let weight = trust * (-0.5 * distance - 0.5 * unlike).exp();
        sums.0 += other.light * weight;
        sums.1 += weight;
        sums.2 += other.variance * weight * weight;
        of_cell += other.of_cell * weight;
    }
    let (light, weight, variance) = sums;
    let of_cell = of_cell / weight;
    let least = of_cell / (1.0 + CELLS_OF_ROUND * (round + 1) as f32);
    let variance = (variance / (weight * weight)).max(least);
    SurfelDraft { light: light / weight, variance, of_cell, ..own }
}

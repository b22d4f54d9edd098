//! The sky, prepared for sampling.
//!
//! A sky that differs by direction is sampled in two ways: by the cosine to the surface, as an even
//! sky is, and by a table of how bright its parts are. Both have a share of the samples, and their
//! densities add up.
//!
//! Invariants:
//! - An even sky has no table, and takes the same random numbers as it would without this module.
//! - Choosing and [`PreparedSky::mixed`] agree within f32 rounding.

use std::f32::consts::PI;

use glam::{DVec3, Vec3};
use holo_scene::{Scene, Sky, SkyAxes};

use crate::luminance::luminance;

/// Share of the samples that follow the table. The others find what a coarse table misses.
const AIMED: f32 = 0.75;

/// The sky of a scene.
#[derive(Clone, Debug)]
pub(crate) enum PreparedSky {
    Even(Vec3),
    Varying(Box<VaryingSky>),
}

/// A sky that differs by direction.
#[derive(Clone, Debug)]
pub(crate) struct VaryingSky {
    sky: Sky,
    table: SkyTable,
    /// Luminance of the mean radiance.
    mean: f32,
}

impl PreparedSky {
    pub(crate) fn new(scene: &Scene) -> Self {
        if let Some(radiance) = scene.sky.as_even() {
            return Self::Even(radiance.into());
        }
        let sky = scene.sky.clone();
        let (table, mean) = (SkyTable::new(&sky), luminance(sky.mean()));
        Self::Varying(Box::new(VaryingSky { sky, table, mean }))
    }

    /// Returns the radiance from a direction.
    #[inline]
    pub(crate) fn along(&self, direction: Vec3) -> Vec3 {
        match self {
            Self::Even(radiance) => *radiance,
            Self::Varying(_) => self.along_exactly(direction.as_dvec3().normalize_or_zero()),
        }
    }

    /// Returns the radiance from a unit direction.
    #[inline]
    pub(crate) fn along_exactly(&self, direction: DVec3) -> Vec3 {
        match self {
            Self::Even(radiance) => *radiance,
            Self::Varying(varying) => varying.sky.radiance(direction).into(),
        }
    }

    /// Returns true if it is the same in every direction.
    #[inline]
    pub(crate) fn is_even(&self) -> bool {
        matches!(self, Self::Even(_))
    }

    /// Returns the luminance of its mean radiance.
    pub(crate) fn mean(&self) -> f32 {
        match self {
            Self::Even(radiance) => luminance(radiance.to_array()),
            Self::Varying(varying) => varying.mean,
        }
    }

    /// Returns a direction by the table, if two uniform numbers choose the table. Otherwise makes
    /// the first number uniform again, for a direction by the cosine.
    #[inline]
    pub(crate) fn aim(&self, uniform: &mut [f32; 2]) -> Option<Vec3> {
        let Self::Varying(varying) = self else { return None };
        if uniform[0] < AIMED {
            return Some(varying.table.choose([uniform[0] / AIMED, uniform[1]]));
        }
        uniform[0] = ((uniform[0] - AIMED) / (1.0 - AIMED)).clamp(0.0, BELOW_ONE);
        None
    }

    /// Returns the density per solid angle of directions by the table and by the cosine together,
    /// for samples of which a `share` goes to the sky. `cosine` is that share of the density by the
    /// cosine alone.
    #[inline]
    pub(crate) fn mixed(&self, direction: Vec3, share: f32, cosine: f32) -> f32 {
        match self {
            Self::Even(_) => cosine,
            Self::Varying(varying) => {
                AIMED * share * varying.table.density(direction) + (1.0 - AIMED) * cosine
            }
        }
    }
}

/// The greatest number below 1.
const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

/// Probabilities of the parts of a sky: rows of equal angles from the zenith, and columns of equal
/// azimuth.
#[derive(Clone, Debug)]
struct SkyTable {
    axes: [Vec3; 3],
    rows: usize,
    columns: usize,
    /// Cumulative probabilities of rows.
    row_sums: Vec<f32>,
    /// Cumulative probabilities of the columns of each row.
    sums: Vec<f32>,
    /// Density per solid angle of each part.
    densities: Vec<f32>,
}

/// Most columns. Parts of 0.18° find the sun of a picture.
const MAX_COLUMNS: usize = 2048;
/// Columns for a formula, which has no detail.
const COLUMNS: usize = 256;

impl SkyTable {
    fn new(sky: &Sky) -> Self {
        let columns = sky.detail().unwrap_or(COLUMNS).clamp(4, MAX_COLUMNS) & !1;
        let rows = columns / 2;
        let axes = sky.axes();
        let mut sums = Vec::with_capacity(rows * columns);
        let mut densities = Vec::with_capacity(rows * columns);
        let mut row_sums = Vec::with_capacity(rows);
        let mut total = 0.0_f64;
        for row in 0..rows {
            let solid_angle = f64::from(solid_angle(row, rows, columns));
            let mut sum = 0.0_f64;
            let first = sums.len();
            for column in 0..columns {
                let weight = f64::from(weight(sky, axes, [row, column], [rows, columns]));
                sum += weight * solid_angle;
                sums.push(sum as f32);
                densities.push(weight as f32);
            }
            let scale = if sum > 0.0 { (1.0 / sum) as f32 } else { 0.0 };
            sums[first..].iter_mut().for_each(|s| *s *= scale);
            total += sum;
            row_sums.push(total as f32);
        }
        let scale = if total > 0.0 { (1.0 / total) as f32 } else { 0.0 };
        row_sums.iter_mut().for_each(|sum| *sum *= scale);
        densities.iter_mut().for_each(|density| *density *= scale);
        let axes = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| axes.to_scene(axis).as_vec3());
        Self { axes, rows, columns, row_sums, sums, densities }
    }

    /// Returns a direction from two uniform numbers.
    #[inline]
    fn choose(&self, [first, second]: [f32; 2]) -> Vec3 {
        let (row, down) = pick(&self.row_sums, first);
        let start = row * self.columns;
        let (column, across) = pick(&self.sums[start..start + self.columns], second);
        let [above, below] = heights(row, self.rows);
        let z = above + (below - above) * down;
        let level = (1.0 - z * z).max(0.0).sqrt();
        let azimuth = ((column as f32 + across) / self.columns as f32 - 0.5) * 2.0 * PI;
        let (sin, cos) = azimuth.sin_cos();
        self.axes[0] * (level * sin) + self.axes[1] * (level * cos) + self.axes[2] * z
    }

    /// Returns the density of [`choose`](Self::choose) per solid angle.
    #[inline]
    fn density(&self, direction: Vec3) -> f32 {
        let [east, north, up] = self.axes.map(|axis| axis.dot(direction));
        let across = (east.atan2(north) / (2.0 * PI) + 0.5) * self.columns as f32;
        let down = up.clamp(-1.0, 1.0).acos() / PI * self.rows as f32;
        let row = (down as usize).min(self.rows - 1);
        let column = (across as usize).min(self.columns - 1);
        self.densities[row * self.columns + column]
    }
}

/// Returns the place of a uniform number in cumulative probabilities, and what remains of it.
#[inline]
fn pick(sums: &[f32], uniform: f32) -> (usize, f32) {
    let at = sums.partition_point(|&sum| sum <= uniform).min(sums.len() - 1);
    let before = if at == 0 { 0.0 } else { sums[at - 1] };
    let share = sums[at] - before;
    let rest = if share > 0.0 { (uniform - before) / share } else { 0.5 };
    (at, rest.clamp(0.0, BELOW_ONE))
}

/// Returns the heights of a row's upper and lower edge above the horizon.
#[inline]
fn heights(row: usize, rows: usize) -> [f32; 2] {
    [row, row + 1].map(|edge| (PI * edge as f32 / rows as f32).cos())
}

fn solid_angle(row: usize, rows: usize, columns: usize) -> f32 {
    let [above, below] = heights(row, rows);
    (above - below) * 2.0 * PI / columns as f32
}

/// Returns the greatest luminance of a part: at its middle, its corners and its edges. Bright spots
/// of pictures reach half into the parts around them.
fn weight(sky: &Sky, axes: SkyAxes, [row, column]: [usize; 2], [rows, columns]: [usize; 2]) -> f32 {
    let at = |right: f64, below: f64| {
        let azimuth = ((column as f64 + right) / columns as f64 - 0.5) * std::f64::consts::TAU;
        let (z, level) = {
            let (sin, cos) = ((row as f64 + below) / rows as f64 * std::f64::consts::PI).sin_cos();
            (cos, sin)
        };
        let (sin, cos) = azimuth.sin_cos();
        let direction = DVec3::new(level * sin, level * cos, z);
        luminance(sky.radiance(axes.to_scene(direction)))
    };
    let steps = [0.001, 0.5, 0.999];
    steps.iter().flat_map(|&x| steps.map(|y| at(x, y))).fold(0.0, f32::max)
}

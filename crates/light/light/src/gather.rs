//! Gathering: rays over the hemisphere above a point, and the record that they make.
//!
//! Invariants: the rays are stratified in sectors, and in rings of equal projected solid angle. The
//! mean radiance times π is then an unbiased estimate of the irradiance. The gradients are those of
//! Ward and Heckbert (1992, equations 2 and 3).

use std::f32::consts::{PI, TAU};

use glam::Vec3;

use crate::record::{Record, luminance};

/// The result of one ray over the hemisphere.
#[derive(Clone, Copy, Debug, Default)]
pub struct Arrival {
    /// Radiance that arrives along the ray.
    pub radiance: Vec3,
    /// Distance to the first surface; infinity if the ray hits nothing.
    pub distance: f32,
}

/// The result of one ray aimed at a small source of indirect light.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Source {
    /// Its contribution to the irradiance.
    pub irradiance: Vec3,
    /// Vector from the record to the source.
    pub towards: Vec3,
    /// The source's unit normal if the source sends the same radiance in all directions. `None` for
    /// other sources, whose light gets no gradient.
    pub normal: Option<Vec3>,
}

/// Limits the light of each ray to a share `most` of the light of all rays; an infinite share
/// limits nothing.
///
/// One in thousands of records has a ray that hits something rare and very bright, such as a lamp
/// in a bottle. Alone, that ray would make a wall brighter by a quarter over the radius of the
/// record. The light that the limit removes is equally rare. The limit is never below a few times
/// the mean.
pub fn limit_outliers(arrivals: &mut [Arrival], most: f32) {
    /// Iterations of limiting and summing.
    const ROUNDS: usize = 4;
    /// Least limit, relative to the mean of all rays. In even light, a record with few rays would
    /// otherwise exceed the share with each of them.
    const FAIR: f32 = 4.0;
    if most.is_infinite() {
        return;
    }
    let most = most.max(FAIR / arrivals.len() as f32);
    let mut bound = f32::INFINITY;
    for _ in 0..ROUNDS {
        bound = most
            * arrivals.iter().map(|arrival| luminance(arrival.radiance).min(bound)).sum::<f32>();
    }
    for arrival in arrivals {
        let brought = luminance(arrival.radiance);
        if brought > bound {
            arrival.radiance *= bound / brought;
        }
    }
}

impl Record {
    /// Adds the light of sources. With the vector w towards a source, its contribution is
    /// proportional to (n·w)(n'·w)/|w|⁴.
    pub fn add(&mut self, sources: &[Source]) {
        if sources.is_empty() {
            return;
        }
        let normal = Vec3::from(self.normal);
        let (mut sum, mut squares) = (Vec3::ZERO, 0.0);
        let mut shift = self.shift.map(Vec3::from);
        let mut turn = self.turn.map(Vec3::from);
        for source in sources.iter().filter(|source| source.irradiance != Vec3::ZERO) {
            sum += source.irradiance;
            squares += luminance(source.irradiance).powi(2);
            let w = source.towards;
            let Some(there) = source.normal else { continue };
            let (here, across) = (normal.dot(w), there.dot(w));
            let step = w * (4.0 / w.length_squared()) - there / across;
            let step = step - normal * normal.dot(step);
            let turned = normal.cross(w) / here;
            if step.is_finite() && turned.is_finite() {
                (0..3).for_each(|c| {
                    shift[c] += step * source.irradiance[c];
                    turn[c] += turned * source.irradiance[c];
                });
            }
        }
        let count = sources.len() as f32;
        let before = luminance(Vec3::from(self.irradiance));
        let variance =
            (squares - luminance(sum).powi(2) / count).max(0.0) * count / (count - 1.0).max(1.0);
        let after = before + luminance(sum);
        self.error = if after > 0.0 {
            ((self.error * before).powi(2) + variance).sqrt() / after
        } else {
            0.0
        };
        self.irradiance = (Vec3::from(self.irradiance) + sum).to_array();
        self.shift = shift.map(|v| v.to_array());
        self.turn = turn.map(|v| v.to_array());
        self.rays += sources.len() as u32;
    }
}

/// The directions of one record's rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hemisphere {
    rings: u32,
    sectors: u32,
}

impl Hemisphere {
    /// Returns about `rays` directions, at least 12 and at most 65,536. Strata are about as wide as
    /// high.
    #[must_use]
    pub fn new(rays: u32) -> Self {
        let rings = (rays.clamp(12, 1 << 16) as f32 / PI).sqrt().round().max(2.0) as u32;
        Self { rings, sectors: (rings as f32 * PI).round() as u32 }
    }

    /// Returns the number of rays.
    #[must_use]
    pub fn rays(self) -> u32 {
        self.rings * self.sectors
    }

    /// Returns the unit direction of ray `index`, at `u` in its stratum; +z is the normal.
    #[must_use]
    #[inline]
    pub fn direction(self, index: u32, u: [f32; 2]) -> Vec3 {
        let (ring, sector) = (index / self.sectors, index % self.sectors);
        let sine2 = (ring as f32 + u[0]) / self.rings as f32;
        let (sin, cos) = (TAU * (sector as f32 + u[1]) / self.sectors as f32).sin_cos();
        let sine = sine2.sqrt();
        Vec3::new(sine * cos, sine * sin, (1.0 - sine2).max(0.0).sqrt())
    }

    /// Makes the record of these arrivals, in the order of the rays. `x`, `y` and `normal` are the
    /// axes of [`direction`](Self::direction). The radius is the harmonic mean of the distances;
    /// the caller must limit it. Point and id are 0.
    #[must_use]
    pub fn record(self, arrivals: &[Arrival], [x, y, normal]: [Vec3; 3]) -> Record {
        debug_assert_eq!(arrivals.len(), self.rays() as usize);
        let (rings, sectors) = (self.rings as usize, self.sectors as usize);
        let at = |j: usize, k: usize| &arrivals[j * sectors + k];
        let count = arrivals.len() as f32;
        let (mut sum, mut inverse, mut nearest) = (Vec3::ZERO, 0.0, f32::INFINITY);
        for arrival in arrivals {
            sum += arrival.radiance;
            inverse += 1.0 / arrival.distance;
            nearest = nearest.min(arrival.distance);
        }
        let mean = luminance(sum) / count;
        // Half the squared difference of neighbours is at least the variance within a stratum.
        // Differences between strata count as noise, but less than in the variance of all rays
        // (Wolter 1984, "An Investigation of Some Estimators of Variance for Systematic Sampling").
        let differences =
            (0..rings).flat_map(|j| (0..sectors).map(move |k| (j, k, (k + 1) % sectors)));
        let squares: f32 = differences
            .map(|(j, k, next)| luminance(at(j, next).radiance - at(j, k).radiance).powi(2))
            .sum();
        let variance = 0.5 * squares / (count * count);
        let mut shift = [Vec3::ZERO; 3];
        let mut turn = [Vec3::ZERO; 3];
        let add = |to: &mut [Vec3; 3], along: Vec3, by: Vec3| {
            (0..3).for_each(|c| to[c] += along * by[c]);
        };
        for k in 0..sectors {
            let before = (k + sectors - 1) % sectors;
            let axis = |angle: f32| x * angle.cos() + y * angle.sin();
            let step = TAU / sectors as f32;
            let outwards = axis(step * (k as f32 + 0.5));
            let around = axis(step * (k as f32 + 0.5) + 0.5 * PI);
            let across = axis(step * k as f32 + 0.5 * PI);
            let (mut radial, mut tangential, mut turning) = (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
            for j in 0..rings {
                let here = at(j, k);
                let below2 = j as f32 / rings as f32;
                let above = ((j + 1) as f32 / rings as f32).sqrt();
                if j > 0 {
                    let inner = at(j - 1, k);
                    let near = here.distance.min(inner.distance);
                    radial +=
                        (here.radiance - inner.radiance) * (below2.sqrt() * (1.0 - below2) / near);
                }
                let beside = at(j, before);
                let near = here.distance.min(beside.distance);
                tangential += (here.radiance - beside.radiance) * ((above - below2.sqrt()) / near);
                turning += here.radiance
                    * mean_tangent(j as f32 / rings as f32, (j + 1) as f32 / rings as f32);
            }
            add(&mut shift, outwards, radial * step);
            add(&mut shift, across, tangential);
            add(&mut turn, around, turning * (PI / count));
        }
        let irradiance = sum * (PI / count);
        Record {
            point: [0.0; 3],
            radius: if inverse > 0.0 { count / inverse } else { f32::INFINITY },
            normal: normal.to_array(),
            nearest,
            irradiance: irradiance.to_array(),
            error: if mean > 0.0 { variance.sqrt() / mean } else { 0.0 },
            shift: shift.map(|v| v.to_array()),
            turn: turn.map(|v| v.to_array()),
            rays: self.rays(),
            flags: 0,
            id: 0,
        }
    }
}

/// Returns the mean tangent of the angle from the normal over a ring, from the squared sines at its
/// borders. It uses the integral, because the tangent is unbounded at the rim.
fn mean_tangent(low: f32, high: f32) -> f32 {
    let integral = |sine2: f32| sine2.sqrt().asin() - (sine2 * (1.0 - sine2)).max(0.0).sqrt();
    (integral(high.min(1.0)) - integral(low)) / (high - low)
}

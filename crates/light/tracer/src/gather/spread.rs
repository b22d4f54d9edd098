//! Number of continuations of a path from its first surface, and of light samples there.
//!
//! They share the ray from the eye. Continuations pay where indirect light makes the noise, and
//! light samples where direct light does. Earlier paths of the same region decide: the numbers are
//! those for which variance × time would be least.
//!
//! Invariant: the numbers depend on earlier paths alone. So a path's expectation does not depend on
//! them.

use glam::Vec3;

use crate::engine::Spread;
use crate::policy::FirstSurface;
use holo_sobol::mix;
use parking_lot::{Mutex, MutexGuard};

/// Side of a region over the width of the widest cells. A region is then half as wide as rays are
/// long: as wide as a piece of furniture, or as the light around a lamp.
const SIDE: f32 = 8.0;

/// Number of regions that are distinguished; a power of two. Others share one at random.
const REGIONS: usize = 1 << 12;

/// The numbers of light samples and of continuations to choose from.
const LIGHTS: [u32; 2] = [2, 4];
const BRANCHES: [u32; 3] = [1, 2, 4];

/// The numbers where nothing is known.
const FIRST: [u32; 2] = [2, 2];

/// Time of a light sample, over that of a continuation: 0.2 to 0.35 in a cabin, an office and a
/// house.
const LIGHT_COST: f32 = 0.25;

/// Time of what all share, over that of a continuation: 0.7 to 1.9 there.
const SHARED_COST: f32 = 1.0;

/// Measured paths between two decisions about a region.
const DECIDES: u32 = 64;

/// Measured paths after which earlier ones count half.
const FADES: u32 = 1 << 12;

/// Where paths have one continuation, one in so many has two, so that the variance stays known.
const PROBES: u32 = 16;

/// What is known of the first surfaces of a region.
#[derive(Clone, Copy, Debug)]
struct Region {
    /// Paths that began there.
    paths: u32,
    /// Paths whose variances are in the sums.
    measured: u32,
    /// Sums of the relative variances of one light sample, and of one continuation.
    direct: f32,
    indirect: f32,
    /// Light samples and continuations.
    best: [u32; 2],
}

impl Region {
    const NEW: Region = Region { paths: 0, measured: 0, direct: 0.0, indirect: 0.0, best: FIRST };

    /// Adds relative variances.
    fn add(&mut self, direct: f32, indirect: f32) {
        self.measured += 1;
        self.direct += direct;
        self.indirect += indirect;
        if self.measured.is_multiple_of(DECIDES) {
            self.best = best(self.direct, self.indirect);
        }
        if self.measured == FADES {
            (self.measured, self.direct, self.indirect) =
                (FADES / 2, 0.5 * self.direct, 0.5 * self.indirect);
        }
    }
}

/// Returns the numbers for variances of one light sample and of one continuation.
fn best(direct: f32, indirect: f32) -> [u32; 2] {
    let cost = |[lights, branches]: [u32; 2]| {
        let (l, b) = (lights as f32, branches as f32);
        (direct / l + indirect / b) * (SHARED_COST + l * LIGHT_COST + b)
    };
    let all = LIGHTS.iter().flat_map(|&l| BRANCHES.iter().map(move |&b| [l, b]));
    all.min_by(|a, b| cost(*a).total_cmp(&cost(*b))).unwrap_or(FIRST)
}

/// What is known of all regions.
#[derive(Debug)]
pub(super) struct Spreads {
    side: f32,
    regions: Box<[Mutex<Region>]>,
}

impl Spreads {
    pub(super) fn new(widest_cell: f32) -> Self {
        let regions = (0..REGIONS).map(|_| Mutex::new(Region::NEW)).collect();
        Self { side: SIDE * widest_cell, regions }
    }

    fn region(&self, point: Vec3) -> MutexGuard<'_, Region> {
        let place = (point / self.side).floor().as_ivec3();
        let pair = |a: i32, b: i32| u64::from(a as u32) << 32 | u64::from(b as u32);
        let key = mix(mix(pair(place.x, place.y)) ^ pair(place.z, 0));
        // No panic leaves a region half changed.
        self.regions[key as usize % REGIONS].lock()
    }

    /// Returns the numbers for a path whose first surface is at `point`.
    #[inline]
    pub(super) fn at(&self, point: Vec3) -> Spread {
        let mut region = self.region(point);
        region.paths = region.paths.wrapping_add(1);
        let [lights, branches] = region.best;
        let is_probe = branches == 1 && region.paths.is_multiple_of(PROBES);
        Spread { lights, branches: if is_probe { 2 } else { branches }, is_probe }
    }

    /// Learns from a path with two or more continuations.
    #[inline]
    pub(super) fn learn(&self, point: Vec3, seen: &FirstSurface) {
        let light = seen.direct + seen.indirect;
        let scale = (light * light).recip();
        let (direct, indirect) = (seen.direct_variance * scale, seen.indirect_variance * scale);
        // Paths that find nothing say nothing.
        if direct.is_finite() && indirect.is_finite() {
            self.region(point).add(direct, indirect);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the numbers of light samples and of continuations after paths with these variances.
    fn after(direct_variance: f32, indirect_variance: f32) -> [u32; 2] {
        let spreads = Spreads::new(1.0);
        let seen = FirstSurface { direct: 1.0, direct_variance, indirect: 1.0, indirect_variance };
        (0..1000).for_each(|_| spreads.learn(Vec3::ONE, &seen));
        let (mut all, mut probes) = (Vec::new(), 0);
        for _ in 0..160 {
            let Spread { lights, branches, is_probe } = spreads.at(Vec3::ONE);
            if is_probe {
                assert_eq!(branches, 2);
                probes += 1;
            } else {
                all.push([lights, branches]);
            }
        }
        assert!(all.iter().all(|numbers| *numbers == all[0]));
        assert_eq!(probes, if all[0][1] == 1 { 10 } else { 0 });
        let elsewhere = spreads.at(Vec3::splat(-100.0));
        assert_eq!([elsewhere.lights, elsewhere.branches], FIRST, "other regions are unknown");
        all[0]
    }

    #[test]
    fn the_numbers_follow_the_variances_of_direct_and_of_indirect_light() {
        assert_eq!(after(1.0, 0.01), [4, 1], "nothing but direct light varies");
        assert_eq!(after(1.0, 0.6), [4, 2]);
        assert_eq!(after(1.0, 5.0), [4, 4]);
        assert_eq!(after(0.01, 1.0), [2, 4], "nothing but indirect light varies");
    }
}

//! Shared by the tests: a random stream, random beams, and the sections of the known scenes.
// Each test file uses some of it. Clippy allows `unwrap` in test functions only, not in helpers.
#![allow(dead_code, clippy::unwrap_used)]

use holo_section::{BeamId, CellPair, DVec3, RayCoords, Section, SectionSpec, ViewClass, seed};

/// A deterministic stream of random numbers.
pub struct Rng(pub u64);

impl Rng {
    pub fn next(&mut self) -> u64 {
        self.0 += 1;
        seed(7, BeamId(self.0), (self.0 >> 32) as u32)
    }

    pub fn below(&mut self, n: u64) -> u64 {
        ((u128::from(self.next()) * u128::from(n)) >> 64) as u64
    }

    /// Returns a number in [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    pub fn direction(&mut self) -> DVec3 {
        loop {
            let v = DVec3::new(
                self.between(-1.0, 1.0),
                self.between(-1.0, 1.0),
                self.between(-1.0, 1.0),
            );
            if (0.01..=1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }

    pub fn pair(&mut self, section: &Section) -> CellPair {
        section.cells(BeamId(self.below(section.beam_count()))).unwrap()
    }

    pub fn coords(&mut self) -> RayCoords {
        RayCoords(((self.next() >> 32) as u32).to_le_bytes())
    }
}

pub fn spec(origin: [f64; 3], axes: [[f64; 3]; 3], grid: [u32; 3]) -> SectionSpec {
    SectionSpec { origin, axes, grid, class: ViewClass::Interior, obstructions: true }
}

pub fn section(origin: [f64; 3], axes: [[f64; 3]; 3], grid: [u32; 3]) -> Section {
    Section::new(spec(origin, axes, grid)).unwrap()
}

pub const UNIT: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Axes that are neither perpendicular to each other nor along the world's, about as long as those
/// of [`UNIT`].
pub const SHEARED: [[f64; 3]; 3] = [[0.8, 0.5, -0.1], [-0.3, 1.1, 0.2], [0.25, 0.15, 0.9]];

pub fn scaled(axes: [[f64; 3]; 3], factor: f64) -> [[f64; 3]; 3] {
    axes.map(|axis| axis.map(|x| x * factor))
}

/// The section in front of the Cornell box.
pub fn cornell() -> Section {
    section([0.6, 0.6, -4.0], [[4.3, 0.0, 0.0], [0.0, 4.2, 0.0], [0.0, 0.0, 5.0]], [8; 3])
}

/// The living room of the paper's cabin (Figure 4), in feet.
pub fn living_room() -> Section {
    let axes = [[10.0, 0.0, 0.0], [0.0, 14.0, 0.0], [0.0, 0.0, 4.0]];
    section([14.0, 1.0, 3.0], axes, Section::default_grid(axes))
}

/// Returns a bound on a chi² statistic with many degrees of freedom, at 5 standard deviations
/// (Wilson & Hilferty 1931). Chance exceeds it once in 3.5 million.
pub fn chi2_limit(degrees: f64) -> f64 {
    let k = 2.0 / (9.0 * degrees);
    degrees * (1.0 - k + 5.0 * k.sqrt()).powi(3)
}

pub fn chi2(counts: &[u32], expected: f64) -> f64 {
    counts.iter().map(|&n| (f64::from(n) - expected).powi(2) / expected).sum()
}

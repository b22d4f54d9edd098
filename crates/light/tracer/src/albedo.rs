//! Tables of functions of a cosine, for one roughness. They hold the flux that a rough surface
//! loses if light may meet only one facet.
//!
//! Light that meets several facets is compensated (Kulla and Conty 2017, "Revisiting Physically
//! Based Shading at Imageworks"). The compensation needs the lost share by direction, and its mean.
//!
//! Invariant: [`mean`](AlbedoTable::mean) is the cosine-weighted mean of the table's interpolation,
//! not of the tabulated function. So the light lost in one direction is returned exactly over all
//! directions. The table is within 5e-4 of the function.

use glam::Vec3;

use holo_optics::Ggx;

/// Number of intervals of a table.
const STEPS: usize = 128;
/// Points of the quadrature over visible normals: azimuthal and radial.
const AROUND: usize = 32;
const OUTWARDS: usize = 128;

/// A function of the cosine to the normal, linear between entries.
#[derive(Clone, Debug)]
pub(crate) struct AlbedoTable {
    /// Entries are evenly spaced in the square root of ln(1 + cosine / alpha). Shadowing sets in
    /// where the cosine is about alpha, and is steepest at 0.
    entries: Vec<f32>,
    inverse_alpha: f32,
    /// Square of the number of entries per unit of the root.
    scale: f32,
    /// 2 ∫ f(μ) μ dμ.
    pub mean: f32,
}

impl AlbedoTable {
    pub(crate) fn new(ggx: Ggx, mut f: impl FnMut(f32) -> f64) -> Self {
        let alpha = f64::from(ggx.alpha());
        let range = (1.0 / alpha).ln_1p();
        let cosine = |t: f64| alpha * (range * (t / STEPS as f64).powi(2)).exp_m1();
        // Directions at cosine 0 have no half vector.
        let entries: Vec<f64> =
            (0..=STEPS).map(|i| f(cosine((i as f64).max(1e-2)).min(1.0) as f32)).collect();
        let mut mean = 0.0;
        for i in 0..STEPS {
            const PARTS: usize = 16;
            for k in 0..PARTS {
                let part = |k: usize| i as f64 + k as f64 / PARTS as f64;
                let (low, high) = (cosine(part(k)), cosine(part(k + 1)));
                let middle = (k as f64 + 0.5) / PARTS as f64;
                mean += (entries[i] + (entries[i + 1] - entries[i]) * middle)
                    * (high * high - low * low);
            }
        }
        Self {
            entries: entries.iter().map(|&e| e as f32).collect(),
            inverse_alpha: (1.0 / alpha) as f32,
            scale: ((STEPS * STEPS) as f64 / range) as f32,
            mean: mean as f32,
        }
    }

    /// Returns the value at a cosine in (0, 1].
    #[inline]
    pub(crate) fn at(&self, cosine: f32) -> f32 {
        let at = ((cosine * self.inverse_alpha).ln_1p() * self.scale).sqrt();
        let i = (at as usize).min(STEPS - 1);
        let (a, b) = (self.entries[i], self.entries[i + 1]);
        a + (b - a) * (at - i as f32).clamp(0.0, 1.0)
    }
}

/// Returns the mean of `f` over the normals visible from a direction of this cosine. Arguments of
/// `f` are the direction and a normal.
pub(crate) fn over_normals(ggx: Ggx, cosine: f32, mut f: impl FnMut(Vec3, Vec3) -> f32) -> f64 {
    let wo = Vec3::new((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine);
    let mut sum = 0.0;
    for j in 0..OUTWARDS {
        // Steep facets lose most, and fill only the last alpha² of the radial coordinate: stretch
        // it there.
        let s = (j as f32 + 0.5) / OUTWARDS as f32;
        let outwards = 1.0 - s.powi(3);
        let mut ring = 0.0;
        for i in 0..AROUND {
            // Half of the circle suffices, because the other half is its mirror image.
            let m = ggx.sample(wo, [0.5 * (i as f32 + 0.5) / AROUND as f32, outwards]);
            ring += f64::from(f(wo, m));
        }
        sum += ring * f64::from(3.0 * s.powi(2));
    }
    sum / (AROUND * OUTWARDS) as f64
}

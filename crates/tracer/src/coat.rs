//! A diffuse base below a rough dielectric coat.
//!
//! The coat reflects as GGX times Fresnel; what it lets through in both directions reaches the base (Ashikhmin and
//! Shirley 2000, Kelemen and Szirmay-Kalos 2001): kd (1 - E(wo)) (1 - E(wi)) / (π (1 - Ē)), where E is the share that the
//! coat reflects of light from a direction and Ē its cosine-weighted mean.
//!
//! Always true: it is reciprocal, and reflects at most what arrives, because E is tabulated for the very lobe that is
//! sampled and not taken from the smooth surface's Fresnel term.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use crate::bsdf::{Sampled, reflect, reflection};
use crate::fresnel::dielectric;
use crate::geometry::{cosine_hemisphere, cosine_pdf};
use crate::microfacet::Ggx;
use crate::sampler::Sampler;

/// Entries of the table of E by cosine, at the middle of equal steps.
const STEPS: usize = 64;
/// Directions per entry, squared: the table's error is about 1e-3 of E.
const GRID: usize = 24;

/// A coated diffuse surface.
#[derive(Clone, Debug)]
pub(crate) struct Coat {
    kd: Vec3,
    ks: Vec3,
    ior: f32,
    ggx: Ggx,
    /// Share reflected by a coat of colour 1, by cosine.
    reflected: [f32; STEPS],
    /// kd / (π (1 - ks Ē)).
    base: Vec3,
}

impl Coat {
    pub(crate) fn new(kd: Vec3, ks: Vec3, ior: f32, ggx: Ggx) -> Self {
        let mut reflected = [0.0; STEPS];
        let mut mean = 0.0;
        for (i, entry) in reflected.iter_mut().enumerate() {
            let z = (i as f32 + 0.5) / STEPS as f32;
            *entry = share(ggx, ior, Vec3::new((1.0 - z * z).sqrt(), 0.0, z));
            mean += *entry * 2.0 * z / STEPS as f32;
        }
        let below = (Vec3::ONE - ks * mean).max(Vec3::splat(1e-3));
        Self { kd, ks, ior, ggx, reflected, base: kd * FRAC_1_PI / below }
    }

    /// What the coat lets through, by cosine.
    fn through(&self, cosine: f32) -> Vec3 {
        let at = (cosine * STEPS as f32 - 0.5).clamp(0.0, (STEPS - 1) as f32);
        let i = (at as usize).min(STEPS - 2);
        let (a, b) = (self.reflected[i], self.reflected[i + 1]);
        Vec3::ONE - self.ks * (a + (b - a) * (at - i as f32))
    }

    /// Probability of sampling the coat rather than the base: what each is expected to return.
    fn coat_probability(&self, wo: Vec3) -> f32 {
        let through = self.through(wo.z);
        let coat = (Vec3::ONE - through).element_sum();
        let base = (self.kd * through).element_sum();
        // Never quite 0 or 1: the share of a wi may be far from the mean.
        if coat + base > 0.0 { (coat / (coat + base)).clamp(0.05, 0.95) } else { 0.5 }
    }

    pub(crate) fn evaluate(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        if wi.z <= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let probability = self.coat_probability(wo);
        let m = (wo + wi).normalize_or_zero();
        let (fresnel, _) = dielectric(wo.dot(m).max(0.0), self.ior);
        let (coat, coat_pdf) = reflection(self.ggx, wo, wi);
        let base = self.base * self.through(wo.z) * self.through(wi.z) * wi.z;
        (self.ks * (fresnel * coat) + base, probability * coat_pdf + (1.0 - probability) * cosine_pdf(wi.z))
    }

    pub(crate) fn sample(&self, wo: Vec3, sampler: &mut Sampler) -> Option<Sampled> {
        let wi = if sampler.one() < self.coat_probability(wo) {
            reflect(wo, self.ggx.sample(wo, sampler.two()))
        } else {
            cosine_hemisphere(sampler.two())
        };
        let (value, pdf) = self.evaluate(wo, wi);
        (pdf > 0.0).then(|| Sampled { wi, weight: value / pdf, pdf: Some(pdf), eta2: 1.0 })
    }
}

/// Share of light from `wo` that a coat of colour 1 reflects, by visible normals on a regular grid.
fn share(ggx: Ggx, ior: f32, wo: Vec3) -> f32 {
    let step = |i: usize| (i as f32 + 0.5) / GRID as f32;
    let mut sum = 0.0;
    for i in 0..GRID {
        for j in 0..GRID {
            let m = ggx.sample(wo, [step(i), step(j)]);
            let wi = reflect(wo, m);
            if wi.z > 0.0 {
                sum += dielectric(wo.dot(m).max(0.0), ior).0 * ggx.masking(wi, m);
            }
        }
    }
    sum / (GRID * GRID) as f32
}

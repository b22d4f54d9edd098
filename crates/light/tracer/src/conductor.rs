//! A rough metal whose reflectance is the same at all angles, with light that meets several facets.
//!
//! Light that meets one facet reflects as GGX. The lost share L(wo) is returned as F L(wo) L(wi) /
//! (π L̄) (Kulla and Conty 2017; Hill 2018). F = ks² (1 - L̄) / (1 - ks L̄) is the reflectance
//! after several facets.
//!
//! Invariant: it is reciprocal, and reflects all that arrives if `ks` is 1.

use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

use glam::Vec3;

use crate::albedo::{AlbedoTable, over_normals};
use crate::geometry::{cosine_hemisphere, cosine_pdf};
use crate::interface::reflection;
use crate::sampled::Sampled;
use crate::sampler::Sampler;
use holo_optics::{Ggx, reflect};

/// A rough metal.
#[derive(Clone, Debug)]
pub(crate) struct Conductor {
    ks: Vec3,
    ggx: Ggx,
    loss: Arc<AlbedoTable>,
    /// Reflectance of light that meets several facets, over π L̄.
    several: Vec3,
}

impl Conductor {
    /// Returns the share that light loses if it meets only one facet of a white metal, by cosine.
    pub(crate) fn loss(ggx: Ggx) -> AlbedoTable {
        AlbedoTable::new(ggx, |cosine| {
            over_normals(ggx, cosine, |wo, m| {
                let wi = reflect(wo, m);
                if wi.z > 0.0 { 1.0 - ggx.shadowing(wo, wi) } else { 1.0 }
            })
        })
    }

    /// `loss` is the table of [`loss`](Self::loss) for the same roughness.
    pub(crate) fn new(ks: Vec3, ggx: Ggx, loss: Arc<AlbedoTable>) -> Self {
        let reflectance = ks * ks * (1.0 - loss.mean) / (Vec3::ONE - ks * loss.mean);
        // In f32, a polished metal loses nothing.
        let several =
            if loss.mean > 1e-8 { reflectance * FRAC_1_PI / loss.mean } else { Vec3::ZERO };
        Self { ks, ggx, loss, several }
    }

    /// Returns the same metal with its colour multiplied by a texture's.
    pub(crate) fn tinted(&self, texture: Vec3) -> Self {
        Self::new(self.ks * texture, self.ggx, self.loss.clone())
    }

    /// Returns the probability of sampling the wide lobe: its share of the reflected light.
    #[inline]
    fn probability(&self, wo: Vec3) -> f32 {
        self.loss.at(wo.z).clamp(0.0, 0.99)
    }

    /// Returns value times cosine, and density.
    #[inline]
    pub(crate) fn evaluate(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        if wi.z <= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        self.with_several(reflection(self.ggx, wo, wi), wo, wi)
    }

    #[inline]
    fn with_several(&self, (value, pdf): (f32, f32), wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        let several = self.several * (self.loss.at(wo.z) * self.loss.at(wi.z) * wi.z);
        let probability = self.probability(wo);
        (self.ks * value + several, (1.0 - probability) * pdf + probability * cosine_pdf(wi.z))
    }

    #[inline]
    pub(crate) fn sample(&self, wo: Vec3, sampler: &mut Sampler) -> Option<Sampled> {
        let (wi, (value, pdf));
        if sampler.one() < self.probability(wo) {
            wi = cosine_hemisphere(sampler.two());
            (value, pdf) = self.evaluate(wo, wi);
        } else {
            let m = self.ggx.sample(wo, sampler.two());
            wi = reflect(wo, m);
            if wi.z <= 0.0 {
                return None;
            }
            // Uses the sampled facet: a half vector computed from the directions is less exact.
            let seen = self.ggx.pdf(wo, m) / (4.0 * wo.dot(m));
            (value, pdf) = self.with_several((seen * self.ggx.shadowing(wo, wi), seen), wo, wi);
        }
        (pdf > 0.0).then(|| Sampled { wi, weight: value / pdf, pdf: Some(pdf), eta2: 1.0 })
    }
}

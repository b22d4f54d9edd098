//! A diffuse base below a rough dielectric coat.
//!
//! The coat reflects as a rough boundary does, with light that meets several facets. Light that it
//! transmits in both directions reaches the base (Ashikhmin and Shirley 2000, Kelemen and
//! Szirmay-Kalos 2001). The base scatters `kd (1 - E(wo)) (1 - E(wi)) / (π (1 - Ē))`. E is the
//! share that the coat reflects of light from a direction, and Ē its cosine-weighted mean.
//!
//! The division by 1 - Ē returns the light that the coat reflects back to the base repeatedly. The
//! coat's inside reflects 1 - (1 - Ē) / n². So `kd` is the colour that is seen, inner reflections
//! included, as in Mitsuba 3's `roughplastic` without `nonlinear`.
//!
//! Invariant: the coat is reciprocal and reflects at most what arrives, and all of it if `kd` and
//! `ks` are 1. This holds because E is tabulated for the lobe that is sampled; Fresnel's term for
//! the smooth surface would not do.

use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

use glam::Vec3;

use crate::albedo::AlbedoTable;
use crate::geometry::{cosine_hemisphere, cosine_pdf};
use crate::interface::Interface;
use crate::sampled::Sampled;
use crate::sampler::Sampler;
use holo_optics::Ggx;

/// Most light that the coat reflects to a direction, over that of the base, for which a coated
/// surface counts as diffuse. The coat's share shows the surroundings; the base shows their mean.
const MOST_COAT: f32 = 0.25;

/// The tables that coats of one index and roughness share.
#[derive(Clone, Debug)]
pub(crate) struct CoatTables {
    interface: Interface,
    /// Reflected share of a coat of colour 1, by cosine.
    reflected: AlbedoTable,
}

impl CoatTables {
    pub(crate) fn new(ior: f32, ggx: Ggx) -> Self {
        let interface = Interface::new(ggx, ior);
        let reflected = interface.reflectance();
        Self { interface, reflected }
    }
}

/// A coated diffuse surface.
#[derive(Clone, Debug)]
pub(crate) struct Coat {
    kd: Vec3,
    ks: Vec3,
    layer: Arc<CoatTables>,
    /// kd / (π (1 - ks Ē)).
    base: Vec3,
}

impl Coat {
    pub(crate) fn new(kd: Vec3, ks: Vec3, layer: Arc<CoatTables>) -> Self {
        let below = (Vec3::ONE - ks * layer.reflected.mean).max(Vec3::splat(1e-3));
        Self { kd, ks, base: kd * FRAC_1_PI / below, layer }
    }

    /// Returns the same coat over a base whose colour is multiplied by a texture's.
    pub(crate) fn tinted(&self, texture: Vec3) -> Self {
        Self::new(self.kd * texture, self.ks, self.layer.clone())
    }

    /// Returns the share that the coat transmits at a cosine.
    fn through(&self, cosine: f32) -> Vec3 {
        Vec3::ONE - self.ks * self.layer.reflected.at(cosine)
    }

    /// Returns the share of light that goes to `wo` if most of it comes from the base.
    pub(crate) fn diffuse_albedo(&self, wo: Vec3) -> Option<Vec3> {
        let through = self.through(wo.z);
        let (coat, base) = (Vec3::ONE - through, self.kd * through);
        (coat.element_sum() <= MOST_COAT * base.element_sum()).then_some(coat + base)
    }

    /// Returns the probability of sampling the coat rather than the base: its share of the
    /// reflected light.
    fn coat_probability(&self, wo: Vec3) -> f32 {
        let through = self.through(wo.z);
        let coat = (Vec3::ONE - through).element_sum();
        let base = (self.kd * through).element_sum();
        // Bounded away from 0 and 1, because the share at one `wi` may be far from the mean.
        if coat + base > 0.0 { (coat / (coat + base)).clamp(0.05, 0.95) } else { 0.5 }
    }

    pub(crate) fn evaluate(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        if wi.z <= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let probability = self.coat_probability(wo);
        let (coat, coat_pdf) = self.layer.interface.evaluate_reflection(wo, wi);
        let base = self.base * self.through(wo.z) * self.through(wi.z) * wi.z;
        (self.ks * coat + base, probability * coat_pdf + (1.0 - probability) * cosine_pdf(wi.z))
    }

    pub(crate) fn sample(&self, wo: Vec3, sampler: &mut Sampler) -> Option<Sampled> {
        let wi = if sampler.one() < self.coat_probability(wo) {
            self.layer.interface.sample_reflection(wo, sampler)
        } else {
            cosine_hemisphere(sampler.two())
        };
        let (value, pdf) = self.evaluate(wo, wi);
        (pdf > 0.0).then(|| Sampled { wi, weight: value / pdf, pdf: Some(pdf), eta2: 1.0 })
    }
}

//! The rough boundary between two dielectrics, with light that meets several facets.
//!
//! Light that meets one facet scatters as in Walter et al. 2007. The flux that this loses is
//! returned by two wide lobes, reflected and transmitted (Kulla and Conty 2017). Let L be the lost
//! share on a side, L̄ its mean, and t the share of the loss that is transmitted. Then side a
//! reflects (1 - t) L(wo) L(wi) / (π L̄) of the flux. It transmits t L(wo) L(wi) / (π L̄ of b) to
//! side b.
//!
//! Invariant: both sides scatter exactly the flux that arrives, up to the error of the tables.
//! The product of f(wo, wi) and n² of `wi`'s side is symmetric in wo and wi (Veach 1997, §5.2).
//! This holds because t L̄ n² is the same for both sides.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use crate::albedo::{AlbedoTable, over_normals};
use crate::geometry::{cosine_hemisphere, cosine_pdf};
use crate::sampler::Sampler;
use holo_optics::{Ggx, dielectric, reflect, refract};

/// Mean loss below which nothing is returned: quotients of losses would be rounding noise.
const NO_LOSS: f32 = 1e-8;

/// The properties of one side.
#[derive(Clone, Debug)]
struct InterfaceSide {
    /// Index of refraction beyond the boundary over this side's.
    eta: f32,
    /// Share of flux that is lost if light meets only one facet.
    loss: Option<AlbedoTable>,
    /// Share of the loss that is returned as transmission.
    transmitted: f32,
}

/// A rough boundary.
#[derive(Clone, Debug)]
pub(crate) struct Interface {
    ggx: Ggx,
    front: InterfaceSide,
    back: InterfaceSide,
}

/// A direction that an interface scatters light from. Colours are up to the caller.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scattered {
    pub wi: Vec3,
    /// Value of radiance times cosine.
    pub value: f32,
    pub pdf: f32,
    /// Squared index of refraction on `wi`'s side over that on `wo`'s.
    pub eta2: f32,
}

impl Interface {
    /// Makes a boundary whose clockwise side has `eta` times the index of refraction of the other.
    pub(crate) fn new(ggx: Ggx, eta: f32) -> Self {
        let mut plain = Self::without_compensation(ggx, eta);
        let [front, back] = [&plain.front, &plain.back].map(|side| {
            let table = AlbedoTable::new(ggx, |cosine| {
                over_normals(ggx, cosine, |wo, m| plain.lost(side, wo, m))
            });
            (table.mean > NO_LOSS).then_some(table)
        });
        if let (Some(a), Some(b)) = (&front, &back) {
            let eta2 = eta * eta;
            // The transmitted share is that of diffuse light at a smooth boundary, limited by what
            // both sides lose.
            let through = 1.0 - mean_reflectance(eta);
            let share = (2.0 * through / (eta2 * (a.mean + b.mean)))
                .min(1.0 / (eta2 * b.mean))
                .min(1.0 / a.mean);
            plain.front.transmitted = share * eta2 * b.mean;
            plain.back.transmitted = share * a.mean;
        }
        (plain.front.loss, plain.back.loss) = (front, back);
        plain
    }

    /// Makes a boundary that does not return the lost light. For scenes with more pairs of media
    /// than [`Nesting`](crate::medium::Nesting) makes tables for.
    pub(crate) fn without_compensation(ggx: Ggx, eta: f32) -> Self {
        let side = |eta| InterfaceSide { eta, loss: None, transmitted: 0.0 };
        Self { ggx, front: side(eta), back: side(1.0 / eta) }
    }

    fn sides(&self, front: bool) -> (&InterfaceSide, &InterfaceSide) {
        if front { (&self.front, &self.back) } else { (&self.back, &self.front) }
    }

    /// Returns the share of the flux reaching a facet of normal `m` that then meets another facet.
    fn lost(&self, side: &InterfaceSide, wo: Vec3, m: Vec3) -> f32 {
        let (reflected, beyond) = dielectric(wo.dot(m).max(0.0), side.eta);
        let wi = reflect(wo, m);
        let mut kept = if wi.z > 0.0 { reflected * self.ggx.shadowing(wo, wi) } else { 0.0 };
        if reflected < 1.0 {
            let wi = refract(wo, m, beyond, side.eta);
            kept += if wi.z < 0.0 { (1.0 - reflected) * self.ggx.masking(wi) } else { 0.0 };
        }
        1.0 - kept
    }

    /// Returns the share of flux from the front that is reflected, by cosine. It counts all facets
    /// that light meets.
    pub(crate) fn reflectance(&self) -> AlbedoTable {
        let side = &self.front;
        AlbedoTable::new(self.ggx, |cosine| {
            let once = over_normals(self.ggx, cosine, |wo, m| {
                let wi = reflect(wo, m);
                if wi.z > 0.0 {
                    dielectric(wo.dot(m).max(0.0), side.eta).0 * self.ggx.shadowing(wo, wi)
                } else {
                    0.0
                }
            });
            let lost = side.loss.as_ref().map_or(0.0, |loss| loss.at(cosine));
            once + f64::from(lost * (1.0 - side.transmitted))
        })
    }

    /// Returns value times cosine, and the density of [`sample`](Self::sample).
    #[inline]
    pub(crate) fn evaluate(&self, wo: Vec3, wi: Vec3, front: bool) -> (f32, f32) {
        let eta = self.sides(front).0.eta;
        let once =
            if wi.z > 0.0 { self.reflection(wo, wi, eta) } else { self.transmission(wo, wi, eta) };
        self.with_several(once, wo, wi, front)
    }

    /// The same for directions on one side, with the density of
    /// [`sample_reflection`](Self::sample_reflection).
    #[inline]
    pub(crate) fn evaluate_reflection(&self, wo: Vec3, wi: Vec3) -> (f32, f32) {
        let (value, _) = self.evaluate(wo, wi, true);
        let m = (wo + wi).normalize_or_zero();
        let single = self.ggx.distribution(m) * self.ggx.masking(wo) / (4.0 * wo.z);
        let several = self.several(wo, true);
        (value, (1.0 - several) * single + several * cosine_pdf(wi.z))
    }

    /// Samples a direction on the front side, roughly as the front reflects: Fresnel's term is
    /// ignored.
    #[inline]
    pub(crate) fn sample_reflection(&self, wo: Vec3, sampler: &mut Sampler) -> Vec3 {
        if sampler.one() < self.several(wo, true) {
            cosine_hemisphere(sampler.two())
        } else {
            reflect(wo, self.ggx.sample(wo, sampler.two()))
        }
    }

    /// Samples the direction that light came from. `None` if it met a second facet.
    #[inline]
    pub(crate) fn sample(&self, wo: Vec3, front: bool, sampler: &mut Sampler) -> Option<Scattered> {
        let side = self.sides(front).0;
        let eta = side.eta;
        let (wi, value, pdf);
        if sampler.one() < self.several(wo, front) {
            let up = cosine_hemisphere(sampler.two());
            let through = sampler.one() < side.transmitted;
            wi = if through { Vec3::new(up.x, up.y, -up.z) } else { up };
            (value, pdf) = self.evaluate(wo, wi, front);
        } else {
            let m = self.ggx.sample(wo, sampler.two());
            let cosine = wo.dot(m).max(0.0);
            let (reflected, beyond) = dielectric(cosine, eta);
            let through = sampler.one() >= reflected;
            wi = if through { refract(wo, m, beyond, eta) } else { reflect(wo, m) };
            if through != (wi.z < 0.0) {
                return None;
            }
            // Uses the sampled facet: a half vector computed from the directions is less exact.
            let seen = self.ggx.pdf(wo, m);
            let once = if through {
                let pdf = (1.0 - reflected) * seen * jacobian(wo, wi, m, eta);
                (pdf * self.ggx.masking(wi) / (eta * eta), pdf)
            } else {
                let pdf = reflected * seen / (4.0 * cosine);
                (pdf * self.ggx.shadowing(wo, wi), pdf)
            };
            (value, pdf) = self.with_several(once, wo, wi, front);
        }
        let eta2 = if wi.z < 0.0 { eta * eta } else { 1.0 };
        (pdf > 0.0 && wi.z != 0.0).then_some(Scattered { wi, value, pdf, eta2 })
    }

    /// Returns the probability of sampling the wide lobes: their share of the flux.
    #[inline]
    fn several(&self, wo: Vec3, front: bool) -> f32 {
        self.sides(front).0.loss.as_ref().map_or(0.0, |loss| loss.at(wo.z).clamp(0.0, 0.99))
    }

    /// Adds light that meets several facets to value and density of light that meets one.
    #[inline]
    fn with_several(
        &self,
        (value, pdf): (f32, f32),
        wo: Vec3,
        wi: Vec3,
        front: bool,
    ) -> (f32, f32) {
        let (side, beyond) = self.sides(front);
        let (Some(here), Some(there)) = (&side.loss, &beyond.loss) else { return (value, pdf) };
        let lost = here.at(wo.z);
        let several = lost.clamp(0.0, 0.99);
        let (share, given_back) = if wi.z > 0.0 {
            let share = 1.0 - side.transmitted;
            (share, share * lost * here.at(wi.z) / here.mean)
        } else {
            let eta2 = side.eta * side.eta;
            (side.transmitted, side.transmitted * lost * there.at(-wi.z) / (there.mean * eta2))
        };
        let cosine = wi.z.abs();
        (
            value + given_back * cosine * FRAC_1_PI,
            (1.0 - several) * pdf + several * share * cosine_pdf(cosine),
        )
    }

    /// Returns value times cosine, and density, of reflection from one facet.
    #[inline]
    fn reflection(&self, wo: Vec3, wi: Vec3, eta: f32) -> (f32, f32) {
        let m = (wo + wi).normalize_or_zero();
        let (reflected, _) = dielectric(wo.dot(m).abs(), eta);
        let (value, pdf) = reflection(self.ggx, wo, wi);
        (value * reflected, pdf * reflected)
    }

    /// Returns value times cosine, and density, of transmission through one facet (Walter et al.
    /// 2007, eq. 21, for radiance).
    #[inline]
    fn transmission(&self, wo: Vec3, wi: Vec3, eta: f32) -> (f32, f32) {
        let m = (wo + wi * eta).normalize_or_zero();
        let m = if m.z < 0.0 { -m } else { m };
        // The facet must face both directions.
        if wo.dot(m) <= 0.0 || wi.dot(m) >= 0.0 || wi.z >= 0.0 {
            return (0.0, 0.0);
        }
        let (reflected, _) = dielectric(wo.dot(m), eta);
        let pdf = (1.0 - reflected) * self.ggx.pdf(wo, m) * jacobian(wo, wi, m, eta);
        (pdf * self.ggx.masking(wi) / (eta * eta), pdf)
    }
}

/// Returns value times cosine, and density by visible normals, of facets that reflect everything.
#[inline]
pub(crate) fn reflection(ggx: Ggx, wo: Vec3, wi: Vec3) -> (f32, f32) {
    let m = (wo + wi).normalize_or_zero();
    if m.z <= 0.0 || wo.dot(m) <= 0.0 || wi.z <= 0.0 {
        return (0.0, 0.0);
    }
    let pdf = ggx.distribution(m) * ggx.masking(wo) / (4.0 * wo.z);
    (pdf * ggx.shadowing(wo, wi), pdf)
}

/// Returns the solid angle of normals per solid angle of refracted directions (Walter et al. 2007,
/// eq. 17).
#[inline]
fn jacobian(wo: Vec3, wi: Vec3, m: Vec3, eta: f32) -> f32 {
    let denominator = wo.dot(m) + eta * wi.dot(m);
    eta * eta * wi.dot(m).abs() / (denominator * denominator)
}

/// Returns the share of diffuse light that a smooth boundary reflects.
fn mean_reflectance(eta: f32) -> f32 {
    const STEPS: u32 = 512;
    // Uniform in the square of the cosine.
    (0..STEPS).map(|i| dielectric(((i as f32 + 0.5) / STEPS as f32).sqrt(), eta).0).sum::<f32>()
        / STEPS as f32
}

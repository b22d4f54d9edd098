//! How surfaces scatter light: evaluation, sampling and density.
//!
//! Directions are local to the side that is seen: +z is the normal turned towards `wo`, so `wo.z > 0`. `wo` is where the
//! light goes (to the eye), `wi` where it comes from. Values include the cosine at `wi`.
//!
//! Always true: `sample`'s weight is value over density of the same `wi`; no opaque material reflects more than arrives;
//! what is transmitted into a solid carries radiance, so it is divided by the square of the relative index (Walter et al.
//! 2007, §5.1; the convention of Mitsuba 3's `dielectric` in radiance mode).

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;
use holo_scene::Bsdf;

use crate::coat::Coat;
use crate::fresnel::{dielectric, pane, refract};
use crate::geometry::{cosine_hemisphere, cosine_pdf};
use crate::microfacet::Ggx;
use crate::sampler::Sampler;

/// Relative index so near 1 that a boundary bends nothing: the half vector of a rough one would be noise.
const SAME_INDEX: f32 = 1e-4;

/// A material's scattering, prepared.
#[derive(Clone, Debug)]
pub(crate) enum Scatter {
    /// Absorbs everything.
    Black,
    Diffuse(Vec3),
    Mirror(Vec3),
    Conductor {
        ks: Vec3,
        ggx: Ggx,
    },
    Pane {
        ior: f32,
        transmittance: Vec3,
    },
    Smooth {
        ior: f32,
        transmittance: Vec3,
    },
    Rough {
        ior: f32,
        transmittance: Vec3,
        ggx: Ggx,
    },
    Coated(Box<Coat>),
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sampled {
    pub wi: Vec3,
    /// Value over density.
    pub weight: Vec3,
    /// Per solid angle; `None` for a direction without a density (mirror, smooth glass).
    pub pdf: Option<f32>,
    /// Square of the index beyond over the one before; 1 without refraction into a solid.
    pub eta2: f32,
}

impl Sampled {
    fn delta(wi: Vec3, weight: Vec3) -> Option<Self> {
        Some(Self { wi, weight, pdf: None, eta2: 1.0 })
    }
}

impl Scatter {
    pub(crate) fn new(bsdf: &Bsdf) -> Self {
        match *bsdf {
            Bsdf::Diffuse { kd } if kd == [0.0; 3] => Self::Black,
            Bsdf::Mirror { ks } | Bsdf::Conductor { ks, .. } if ks == [0.0; 3] => Self::Black,
            Bsdf::Diffuse { kd } => Self::Diffuse(kd.into()),
            Bsdf::Mirror { ks } => Self::Mirror(ks.into()),
            Bsdf::Conductor { ks, alpha } => Self::Conductor { ks: ks.into(), ggx: Ggx::new(alpha) },
            Bsdf::ThinGlass { ior, transmittance } => Self::Pane { ior, transmittance: transmittance.into() },
            Bsdf::Dielectric { ior, transmittance, alpha } if alpha == 0.0 || (ior - 1.0).abs() < SAME_INDEX => {
                Self::Smooth { ior, transmittance: transmittance.into() }
            }
            Bsdf::Dielectric { ior, transmittance, alpha } => {
                Self::Rough { ior, transmittance: transmittance.into(), ggx: Ggx::new(alpha) }
            }
            Bsdf::Coated { kd, ks, ior, alpha } => {
                Self::Coated(Box::new(Coat::new(kd.into(), ks.into(), ior, Ggx::new(alpha))))
            }
        }
    }

    /// Whether light is scattered into single directions only, so that sampling lights is useless.
    #[inline]
    pub(crate) fn is_delta(&self) -> bool {
        matches!(self, Self::Mirror(_) | Self::Pane { .. } | Self::Smooth { .. })
    }

    /// Whether light from behind can be scattered to `wo` with a density.
    #[inline]
    pub(crate) fn transmits(&self) -> bool {
        matches!(self, Self::Rough { .. })
    }

    /// Value times cosine, and the density with which [`sample`](Self::sample) makes `wi`. `front`: `wo` is on the
    /// counter-clockwise side.
    #[inline]
    pub(crate) fn evaluate(&self, wo: Vec3, wi: Vec3, front: bool) -> (Vec3, f32) {
        if wi.z <= 0.0 && !self.transmits() {
            return (Vec3::ZERO, 0.0);
        }
        match self {
            Self::Diffuse(kd) => (*kd * (wi.z * FRAC_1_PI), cosine_pdf(wi.z)),
            Self::Conductor { ks, ggx } => {
                let (value, pdf) = reflection(*ggx, wo, wi);
                (*ks * value, pdf)
            }
            Self::Coated(coat) => coat.evaluate(wo, wi),
            Self::Rough { ior, transmittance, ggx } => {
                let eta = if front { *ior } else { 1.0 / ior };
                if wi.z > 0.0 {
                    let m = (wo + wi).normalize();
                    let (reflected, _) = dielectric(wo.dot(m).abs(), eta);
                    let (value, pdf) = reflection(*ggx, wo, wi);
                    (Vec3::splat(value * reflected), pdf * reflected)
                } else {
                    let (value, pdf) = transmission(*ggx, wo, wi, eta);
                    (*transmittance * value, pdf)
                }
            }
            Self::Black | Self::Mirror(_) | Self::Pane { .. } | Self::Smooth { .. } => (Vec3::ZERO, 0.0),
        }
    }

    /// Chooses where the light that goes to `wo` came from. `None` if it is absorbed.
    #[inline]
    pub(crate) fn sample(&self, wo: Vec3, front: bool, sampler: &mut Sampler) -> Option<Sampled> {
        match self {
            Self::Black => None,
            Self::Diffuse(kd) => {
                let wi = cosine_hemisphere(sampler.two());
                (wi.z > 0.0).then(|| Sampled { wi, weight: *kd, pdf: Some(cosine_pdf(wi.z)), eta2: 1.0 })
            }
            Self::Mirror(ks) => Sampled::delta(mirrored(wo), *ks),
            Self::Conductor { ks, ggx } => {
                let m = ggx.sample(wo, sampler.two());
                let wi = reflect(wo, m);
                if wi.z <= 0.0 {
                    return None;
                }
                let pdf = ggx.pdf(wo, m) / (4.0 * wo.dot(m));
                Some(Sampled { wi, weight: *ks * ggx.masking(wi, m), pdf: Some(pdf), eta2: 1.0 })
            }
            Self::Pane { ior, transmittance } => {
                if sampler.one() < pane(wo.z, *ior) {
                    Sampled::delta(mirrored(wo), Vec3::ONE)
                } else {
                    Sampled::delta(-wo, *transmittance)
                }
            }
            Self::Smooth { ior, transmittance } => {
                let eta = if front { *ior } else { 1.0 / ior };
                let (reflected, beyond) = dielectric(wo.z, eta);
                if sampler.one() < reflected {
                    return Sampled::delta(mirrored(wo), Vec3::ONE);
                }
                let wi = refract(wo, Vec3::Z, beyond, eta);
                let eta2 = eta * eta;
                (wi.z < 0.0).then(|| Sampled { wi, weight: *transmittance / eta2, pdf: None, eta2 })
            }
            Self::Rough { ior, transmittance, ggx } => {
                let eta = if front { *ior } else { 1.0 / ior };
                let m = ggx.sample(wo, sampler.two());
                let (reflected, beyond) = dielectric(wo.dot(m).max(0.0), eta);
                if sampler.one() < reflected {
                    let wi = reflect(wo, m);
                    let pdf = reflected * ggx.pdf(wo, m) / (4.0 * wo.dot(m));
                    let weight = Vec3::splat(ggx.masking(wi, m));
                    return (wi.z > 0.0).then_some(Sampled { wi, weight, pdf: Some(pdf), eta2: 1.0 });
                }
                let wi = refract(wo, m, beyond, eta);
                let eta2 = eta * eta;
                let weight = *transmittance * (ggx.masking(wi, m) / eta2);
                let pdf = (1.0 - reflected) * ggx.pdf(wo, m) * jacobian(wo, wi, m, eta);
                (wi.z < 0.0).then_some(Sampled { wi, weight, pdf: Some(pdf), eta2 })
            }
            Self::Coated(coat) => coat.sample(wo, sampler),
        }
    }
}

#[inline]
fn mirrored(wo: Vec3) -> Vec3 {
    Vec3::new(-wo.x, -wo.y, wo.z)
}

#[inline]
pub(crate) fn reflect(wo: Vec3, m: Vec3) -> Vec3 {
    m * (2.0 * wo.dot(m)) - wo
}

/// Reflection from facets that reflect everything: value with cosine, and density by visible normals.
#[inline]
pub(crate) fn reflection(ggx: Ggx, wo: Vec3, wi: Vec3) -> (f32, f32) {
    let m = (wo + wi).normalize_or_zero();
    if m.z <= 0.0 || wo.dot(m) <= 0.0 {
        return (0.0, 0.0);
    }
    let seen = ggx.distribution(m) * ggx.masking(wo, m) / (4.0 * wo.z);
    (seen * ggx.masking(wi, m), seen)
}

/// Solid angle of normals per solid angle of refracted directions (Walter et al. 2007, eq. 17).
#[inline]
fn jacobian(wo: Vec3, wi: Vec3, m: Vec3, eta: f32) -> f32 {
    let denominator = wo.dot(m) + eta * wi.dot(m);
    eta * eta * wi.dot(m).abs() / (denominator * denominator)
}

/// Transmission through a rough boundary (Walter et al. 2007, eq. 21, for radiance): value with cosine, and density.
#[inline]
fn transmission(ggx: Ggx, wo: Vec3, wi: Vec3, eta: f32) -> (f32, f32) {
    let m = (wo + wi * eta).normalize_or_zero();
    let m = if m.z < 0.0 { -m } else { m };
    // The normal must be on the side of both.
    if wo.dot(m) <= 0.0 || wi.dot(m) >= 0.0 || wi.z >= 0.0 {
        return (0.0, 0.0);
    }
    let (reflected, _) = dielectric(wo.dot(m), eta);
    let pdf = (1.0 - reflected) * ggx.pdf(wo, m) * jacobian(wo, wi, m, eta);
    (pdf * ggx.masking(wi, m) / (eta * eta), pdf)
}

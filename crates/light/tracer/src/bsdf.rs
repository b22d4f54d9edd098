//! Scattering of light by surfaces: evaluation, sampling and density.
//!
//! Directions are local to the side that is seen: +z is the normal turned towards `wo`, so `wo.z >
//! 0`. Light travels to `wo` (towards the eye) and comes from `wi`. Values include the cosine at
//! `wi`.
//!
//! Invariant: `sample` returns value over density of its own `wi` as weight. No opaque material
//! reflects more than arrives. Radiance that is transmitted into a solid is divided by the square
//! of the relative index (Walter et al. 2007, §5.1). Mitsuba 3's `dielectric` does the same in
//! radiance mode.

use std::collections::HashMap;
use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

use glam::Vec3;
use holo_scene::Bsdf;

use crate::albedo::AlbedoTable;
use crate::coat::{Coat, CoatTables};
use crate::conductor::Conductor;
use crate::geometry::{cosine_hemisphere, cosine_pdf};
use crate::interface::Interface;
use crate::sampled::Sampled;
use crate::sampler::Sampler;
use holo_optics::{Ggx, dielectric, mirrored, pane, refract};

/// Difference of the relative index from 1 below which a boundary bends nothing. The half vector of
/// a rough boundary would be rounding noise.
pub(crate) const SAME_INDEX: f32 = 1e-4;

/// The scattering of a material, prepared for tracing.
#[derive(Clone, Debug)]
pub(crate) enum Scatter {
    /// Absorbs all light.
    Black,
    Diffuse(Vec3),
    Mirror(Vec3),
    Conductor(Box<Conductor>),
    Pane {
        ior: f32,
        transmittance: Vec3,
    },
    /// A boundary between equal indices: light goes straight through.
    Clear {
        transmittance: Vec3,
    },
    Smooth {
        /// Index of refraction on the clockwise side over that on the other.
        eta: f32,
        transmittance: Vec3,
    },
    Rough {
        interface: Arc<Interface>,
        transmittance: Vec3,
    },
    Coated(Box<Coat>),
}

/// Tables that materials may share, keyed by the bits of roughness and index. Each takes about 10
/// ms to compute.
#[derive(Debug, Default)]
pub(crate) struct Tables {
    losses: HashMap<[u32; 2], Arc<AlbedoTable>>,
    layers: HashMap<[u32; 2], Arc<CoatTables>>,
}

fn shared<T>(
    made: &mut HashMap<[u32; 2], Arc<T>>,
    key: [f32; 2],
    make: impl FnOnce() -> T,
) -> Arc<T> {
    made.entry(key.map(f32::to_bits)).or_insert_with(|| Arc::new(make())).clone()
}

impl Scatter {
    /// Prepares a material. `tables` collects the tables that materials share.
    pub(crate) fn new(bsdf: &Bsdf, tables: &mut Tables) -> Self {
        match *bsdf {
            Bsdf::Diffuse { kd } if kd == [0.0; 3] => Self::Black,
            Bsdf::Mirror { ks } | Bsdf::Conductor { ks, .. } if ks == [0.0; 3] => Self::Black,
            Bsdf::Diffuse { kd } => Self::Diffuse(kd.into()),
            Bsdf::Mirror { ks } => Self::Mirror(ks.into()),
            Bsdf::Conductor { ks, alpha } => {
                let ggx = Ggx::new(alpha);
                let loss = shared(&mut tables.losses, [alpha, 0.0], || Conductor::loss(ggx));
                Self::Conductor(Box::new(Conductor::new(ks.into(), ggx, loss)))
            }
            Bsdf::ThinGlass { ior, transmittance } => {
                Self::Pane { ior, transmittance: transmittance.into() }
            }
            Bsdf::Dielectric { ior, transmittance, alpha } => {
                Self::dielectric(ior, transmittance.into(), alpha, |ggx| {
                    Arc::new(Interface::new(ggx, ior))
                })
            }
            Bsdf::Coated { kd, ks, ior, alpha } => {
                let layer = shared(&mut tables.layers, [alpha, ior], || {
                    CoatTables::new(ior, Ggx::new(alpha))
                });
                Self::Coated(Box::new(Coat::new(kd.into(), ks.into(), layer)))
            }
        }
    }

    /// Returns the boundary of a solid that has `eta` times the index of refraction of its
    /// counter-clockwise side. `rough` makes the interface if the boundary is rough.
    #[inline]
    pub(crate) fn dielectric(
        eta: f32,
        transmittance: Vec3,
        alpha: f32,
        rough: impl FnOnce(Ggx) -> Arc<Interface>,
    ) -> Self {
        if (eta - 1.0).abs() < SAME_INDEX {
            Self::Clear { transmittance }
        } else if alpha == 0.0 {
            Self::Smooth { eta, transmittance }
        } else {
            Self::Rough { interface: rough(Ggx::new(alpha)), transmittance }
        }
    }

    /// Returns whether light is scattered into single directions only. Samples of lights are
    /// useless then.
    #[inline]
    pub(crate) fn is_delta(&self) -> bool {
        matches!(
            self,
            Self::Mirror(_) | Self::Pane { .. } | Self::Clear { .. } | Self::Smooth { .. }
        )
    }

    /// Returns whether light is scattered from all directions of a side, so that samples may be
    /// aimed.
    #[inline]
    pub(crate) fn is_wide(&self) -> bool {
        matches!(self, Self::Diffuse(_) | Self::Coated(_))
    }

    /// Returns the share of light from all directions that goes to `wo`, if the surface looks
    /// nearly the same from all directions. `None` for other surfaces.
    #[inline]
    pub(crate) fn diffuse_albedo(&self, wo: Vec3) -> Option<Vec3> {
        match self {
            Self::Diffuse(kd) => Some(*kd),
            Self::Coated(coat) => coat.diffuse_albedo(wo),
            _ => None,
        }
    }

    /// Returns whether light from behind can be scattered to `wo` with a density.
    #[inline]
    pub(crate) fn transmits(&self) -> bool {
        matches!(self, Self::Rough { .. })
    }

    /// Returns value times cosine, and the density with which [`sample`](Self::sample) gives `wi`.
    /// `front`: whether `wo` is on the counter-clockwise side.
    #[inline]
    pub(crate) fn evaluate(&self, wo: Vec3, wi: Vec3, front: bool) -> (Vec3, f32) {
        if wi.z <= 0.0 && !self.transmits() {
            return (Vec3::ZERO, 0.0);
        }
        match self {
            Self::Diffuse(kd) => (*kd * (wi.z * FRAC_1_PI), cosine_pdf(wi.z)),
            Self::Conductor(conductor) => conductor.evaluate(wo, wi),
            Self::Coated(coat) => coat.evaluate(wo, wi),
            Self::Rough { interface, transmittance } => {
                let (value, pdf) = interface.evaluate(wo, wi, front);
                (if wi.z > 0.0 { Vec3::splat(value) } else { *transmittance * value }, pdf)
            }
            Self::Black
            | Self::Mirror(_)
            | Self::Pane { .. }
            | Self::Clear { .. }
            | Self::Smooth { .. } => (Vec3::ZERO, 0.0),
        }
    }

    /// Returns a given direction as [`sample`](Self::sample) would have returned it. `None` if it
    /// could not.
    #[inline]
    pub(crate) fn towards(&self, wo: Vec3, wi: Vec3, front: bool) -> Option<Sampled> {
        let (value, pdf) = self.evaluate(wo, wi, front);
        (pdf > 0.0 && !self.transmits()).then(|| Sampled {
            wi,
            weight: value / pdf,
            pdf: Some(pdf),
            eta2: 1.0,
        })
    }

    /// Samples the direction of the light that is scattered to `wo`. `None` if it is absorbed.
    #[inline]
    pub(crate) fn sample(&self, wo: Vec3, front: bool, sampler: &mut Sampler) -> Option<Sampled> {
        match self {
            Self::Black => None,
            Self::Diffuse(kd) => {
                let wi = cosine_hemisphere(sampler.two());
                (wi.z > 0.0).then(|| Sampled {
                    wi,
                    weight: *kd,
                    pdf: Some(cosine_pdf(wi.z)),
                    eta2: 1.0,
                })
            }
            Self::Mirror(ks) => Sampled::delta(mirrored(wo), *ks),
            Self::Conductor(conductor) => conductor.sample(wo, sampler),
            Self::Pane { ior, transmittance } => {
                if sampler.one() < pane(wo.z, *ior) {
                    Sampled::delta(mirrored(wo), Vec3::ONE)
                } else {
                    Sampled::delta(-wo, *transmittance)
                }
            }
            Self::Clear { transmittance } => Sampled::delta(-wo, *transmittance),
            Self::Smooth { eta, transmittance } => {
                let eta = if front { *eta } else { 1.0 / eta };
                let (reflected, beyond) = dielectric(wo.z, eta);
                if sampler.one() < reflected {
                    return Sampled::delta(mirrored(wo), Vec3::ONE);
                }
                let wi = refract(wo, Vec3::Z, beyond, eta);
                let eta2 = eta * eta;
                (wi.z < 0.0).then(|| Sampled { wi, weight: *transmittance / eta2, pdf: None, eta2 })
            }
            Self::Rough { interface, transmittance } => {
                let s = interface.sample(wo, front, sampler)?;
                let colour = if s.wi.z > 0.0 { Vec3::ONE } else { *transmittance };
                Some(Sampled {
                    wi: s.wi,
                    weight: colour * (s.value / s.pdf),
                    pdf: Some(s.pdf),
                    eta2: s.eta2,
                })
            }
            Self::Coated(coat) => coat.sample(wo, sampler),
        }
    }
}

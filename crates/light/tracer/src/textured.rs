//! Textures and colours where a path meets a surface.
//!
//! Invariant: a scene without them calls none of these functions ([`PathEngine::is_shaded`]).

use glam::Vec3;
use holo_raycast::{Hit, Raycaster, is_in_share};

use crate::bsdf::Scatter;
use crate::engine::PathEngine;
use crate::surface::TracedMaterial;

impl PathEngine {
    /// Returns the scattering of a surface at a hit, if textures or colours determine it. `width`
    /// is the width of the path there, in scene units.
    pub(crate) fn textured(
        &self,
        raycaster: &Raycaster,
        hit: &Hit,
        surface: &TracedMaterial,
        width: f32,
    ) -> Option<Scatter> {
        let texture = raycaster.scene().base_texture(hit.triangle, hit.u, hit.v, width);
        let texture = texture.map(|t| Vec3::from(t).clamp(Vec3::ZERO, Vec3::ONE));
        if let Some(varied) = &surface.varied
            && let Some(finish) = raycaster.scene().finish(hit.triangle, hit.u, hit.v, width)
        {
            return Some(varied.at(finish, texture.unwrap_or(Vec3::ONE)));
        }
        let texture = texture?;
        match &surface.scatter {
            Scatter::Diffuse(kd) => Some(Scatter::Diffuse(*kd * texture)),
            Scatter::Mirror(ks) => Some(Scatter::Mirror(*ks * texture)),
            Scatter::Conductor(metal) => Some(Scatter::Conductor(Box::new(metal.tinted(texture)))),
            Scatter::Coated(coat) => Some(Scatter::Coated(Box::new(coat.tinted(texture)))),
            Scatter::Pane { ior, transmittance } => {
                Some(Scatter::Pane { ior: *ior, transmittance: *transmittance * texture })
            }
            _ => None,
        }
    }

    /// Returns the base of a surface that is glass in part, if this ray meets the base.
    #[inline]
    pub(crate) fn met_base<'s>(
        &self,
        raycaster: &Raycaster,
        hit: &Hit,
        surface: &'s TracedMaterial,
        direction: Vec3,
    ) -> Option<&'s TracedMaterial> {
        let base = surface.base.as_deref()?;
        let glass = raycaster.scene().glass_share(hit.triangle, hit.u, hit.v)?;
        (!is_in_share(hit, direction, glass)).then_some(base)
    }

    /// Returns the radiance that a sample of a lamp brings: that of a point, times the opacity
    /// there, unless another face at its place hides it. `direction` goes towards it.
    #[inline]
    pub(crate) fn sampled_emission_at(
        &self,
        raycaster: &Raycaster,
        triangle: u32,
        [u, v]: [f32; 2],
        direction: Vec3,
        surface: &TracedMaterial,
    ) -> Vec3 {
        let emission = self.emission_at(raycaster, triangle, [u, v], -direction, surface)
            * raycaster.shown(triangle, u, v, direction);
        match raycaster.has_covers() {
            true => emission * raycaster.scene().opacity(triangle, u, v),
            false => emission,
        }
    }

    /// Returns the radiance that a lamp emits at a point in a direction away from it, with its
    /// texture.
    #[inline]
    pub(crate) fn emission_at(
        &self,
        raycaster: &Raycaster,
        triangle: u32,
        [u, v]: [f32; 2],
        away: Vec3,
        surface: &TracedMaterial,
    ) -> Vec3 {
        let emission = surface.emission_towards(away);
        if !self.is_shaded {
            return emission;
        }
        let texture = raycaster.scene().emission_texture(triangle, u, v, 0.0);
        texture.map_or(emission, |texture| emission * Vec3::from(texture))
    }
}

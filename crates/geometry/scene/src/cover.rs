//! Covers: surfaces that are not there everywhere, or that are glass only in part.
//!
//! A surface of opacity a is there with probability a. Elsewhere light passes straight, without a
//! change. That is coverage, as of a curtain or a leaf. It is not tint: the colour of light that
//! passes glass belongs to [`Bsdf`].

use crate::shading::{Base, Cover, CutOut, WHOLE};
use crate::{Bsdf, Material, Scene, SceneError};

impl Scene {
    /// Returns the probability that a surface is there at a point, from 0 to 1. Without covers and
    /// cut-out parts it is 1.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    #[inline]
    pub fn opacity(&self, triangle: u32, u: f32, v: f32) -> f32 {
        let Some(shading) = &self.shading else { return 1.0 };
        let corners = self.opacities_of(shading, triangle).map_or(1.0, |[a, b, c]| {
            let [a, b, c] = [a, b, c].map(f32::from);
            ((a * (1.0 - u - v).max(0.0) + b * u + c * v) * (1.0 / 255.0)).clamp(0.0, 1.0)
        });
        let material = self.material_id(triangle) as usize;
        let of = |texture: u32| self.look_up(shading, texture, triangle, [u, v], 0.0)[3];
        let cut_out = shading.maps.get(material).and_then(|maps| maps.cut_out);
        if let Some(CutOut { texture, least }) = cut_out {
            return if of(texture) * corners < least { 0.0 } else { 1.0 };
        }
        let Some(cover) = shading.covers.get(material) else { return corners };
        let opacity = cover.opacity * corners * cover.texture.map_or(1.0, of);
        match cover.least > 0.0 {
            true if opacity < cover.least => 0.0,
            true => 1.0,
            false if opacity >= WHOLE => 1.0,
            false => opacity.clamp(0.0, 1.0),
        }
    }

    /// Returns whether any surface has parts that are cut out, or is not there with certainty.
    #[must_use]
    pub fn has_covers(&self) -> bool {
        self.has_cut_outs()
            || self.shading.as_ref().is_some_and(|shading| {
                shading.covers.iter().any(Cover::is_partial) || !shading.opacities.is_empty()
            })
    }

    /// Returns whether any surface has an opacity strictly between 0 and 1 somewhere.
    #[must_use]
    pub fn has_partial_covers(&self) -> bool {
        self.shading.as_ref().is_some_and(|shading| {
            let varies = |cover: &Cover| cover.is_partial() && cover.least == 0.0;
            shading.covers.iter().any(varies) || !shading.opacities.is_empty()
        })
    }

    /// Returns whether some light passes a surface: it is glass, or not opaque everywhere.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    pub fn passes_light(&self, triangle: u32) -> bool {
        let is_glass = |bsdf| matches!(bsdf, Bsdf::ThinGlass { .. } | Bsdf::Dielectric { .. });
        is_glass(self.material(triangle).bsdf)
            || self.shading.as_ref().is_some_and(|shading| {
                let material = self.material_id(triangle) as usize;
                shading.covers.get(material).is_some_and(Cover::is_partial)
                    || self.opacities_of(shading, triangle).is_some_and(|o| o != [u8::MAX; 3])
            })
    }

    /// Returns whether a triangle's opacity is the same everywhere, and it is not glass in part.
    pub(crate) fn looks_even(&self, triangle: u32) -> bool {
        let Some(shading) = &self.shading else { return true };
        let cover = shading.covers.get(self.material_id(triangle) as usize);
        cover.is_none_or(|cover| cover.texture.is_none() && cover.base.is_none())
            && self.opacities_of(shading, triangle).is_none_or(|[a, b, c]| a == b && b == c)
    }

    /// Returns the share of light at a point that meets glass, if the material is glass in part.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    #[inline]
    pub fn glass_share(&self, triangle: u32, u: f32, v: f32) -> Option<f32> {
        let shading = self.shading.as_ref()?;
        let base = shading.covers.get(self.material_id(triangle) as usize)?.base?;
        let texel = base.glass.texture.map_or(1.0, |texture| {
            let texel = self.look_up(shading, texture, triangle, [u, v], 0.0);
            texel[usize::from(base.glass.channel)].clamp(0.0, 1.0)
        });
        Some(base.glass.factor * texel)
    }

    /// Returns the surface that a material of glass is in part.
    #[must_use]
    pub fn base(&self, material: usize) -> Option<Base> {
        self.shading.as_ref()?.covers.get(material)?.base
    }

    /// Checks that no boundary of a solid has a cover: paths count the solids that they are in.
    pub(crate) fn check_covers(&self) -> Result<(), SceneError> {
        let covers = self.shading.iter().flat_map(|shading| &shading.covers);
        let is_solid = |material: &Material| matches!(material.bsdf, Bsdf::Dielectric { .. });
        let is_glass = |material: &Material| matches!(material.bsdf, Bsdf::ThinGlass { .. });
        let fits = |(cover, material): (&Cover, &Material)| {
            (!is_solid(material) || !cover.is_partial())
                && (cover.base.is_none() || is_solid(material) || is_glass(material))
        };
        match covers.zip(&self.materials).all(fits) {
            true => Ok(()),
            false => Err(SceneError::Shading { problem: "a solid or its base has a false cover" }),
        }
    }
}

//! Attributes of triangles that are not flat and plain: normals of curved surfaces, and textures.
//!
//! A scene without them has no [`Shading`], and pays nothing.

use glam::Vec3;
use holo_mapped::Array;

use crate::limits::MAX_MATERIALS;
use crate::texture::{Opacities, Texture};
use crate::{Bsdf, Material, SceneError};

/// Most textures of a scene.
pub const MAX_TEXTURES: usize = 4096;

/// Most bytes of memory of all textures of a scene, their files included. Pictures of one colour
/// take a thousandth of that in a file.
pub(crate) const MAX_BYTES_OF_TEXTURES: usize = 2 << 30;

/// Opacity below which a cut-out surface has a hole, if its file states no other.
pub const CUT_OUT: f32 = 0.5;

/// A unit vector as two shares of an octahedron (Cigolle et al. 2014), within 0.0001 rad.
pub type Octahedral = [i16; 2];

/// Attributes of a scene's triangles and materials.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shading {
    /// Texture coordinates of each triangle's corners; (0, 0) is a texture's top left corner. Empty
    /// if there is no texture.
    pub uvs: Array<[[f32; 2]; 3]>,
    /// Normals of each triangle's corners. Empty if all surfaces are faceted.
    pub normals: Array<[Octahedral; 3]>,
    /// Pictures.
    pub textures: Vec<Texture>,
    /// Textures of each material. Empty if there is no texture.
    pub maps: Vec<Maps>,
    /// Colours of each triangle's corners, as bytes of sRGB: factors to the material's colour.
    /// Empty if all are white.
    pub colours: Array<[[u8; 3]; 3]>,
    /// The covers of materials. Empty if all surfaces are whole.
    pub covers: Vec<Cover>,
    /// Opacities of each triangle's corners, as shares of 255: factors to the material's opacity.
    /// Empty if all are 255.
    pub opacities: Array<[u8; 3]>,
}

/// The colour of a corner that changes nothing.
pub const WHITE: [u8; 3] = [u8::MAX; 3];

/// The textures of a material, as indices into [`Shading::textures`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Maps {
    /// Factor to the colour: `kd` of diffuse and coated surfaces, `ks` of metals.
    pub base: Option<u32>,
    /// Factor to the emission.
    pub emission: Option<u32>,
    /// The surface has holes at points that are not opaque enough in this texture.
    pub cut_out: Option<CutOut>,
    /// Small changes of the normal.
    pub normal: Option<NormalMap>,
    /// Roughness and metalness of diffuse, coated and metal surfaces, instead of the material's.
    pub finish: Option<FinishMap>,
}

/// A texture whose opacity determines where a surface is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutOut {
    /// Its index.
    pub texture: u32,
    /// Opacity below which the surface has a hole, in (0, 1].
    pub least: f32,
}

/// A texture of normals: red points to the right in the picture, green up, and blue off the
/// surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalMap {
    /// Its index.
    pub texture: u32,
    /// Factor to red and green.
    pub strength: f32,
}

/// Roughness and metalness that change from point to point, both in [0, 1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FinishMap {
    /// Roughness; GGX's alpha is its square.
    pub roughness: Channel,
    /// Metalness.
    pub metalness: Channel,
}

/// A number from one channel of a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Channel {
    /// The texture; `None` is white.
    pub texture: Option<u32>,
    /// Its channel: 0 red, 1 green, 2 blue.
    pub channel: u8,
    /// Factor to the texture, in [0, 1].
    pub factor: f32,
}

/// Opacity from which a surface counts as whole: the highest byte of a texture, within rounding.
pub const WHOLE: f32 = 0.998;

/// Where the surfaces of a material are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cover {
    /// Opacity in [0, 1]: a factor to that of the texture and of the corners.
    pub opacity: f32,
    /// The texture whose opacity counts.
    pub texture: Option<u32>,
    /// If above 0, the surface is whole from this opacity on, and has a hole elsewhere.
    pub least: f32,
    /// What glass is besides glass.
    pub base: Option<Base>,
}

/// The surface that glass is in part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Base {
    /// Its scattering, which is not glass.
    pub bsdf: Bsdf,
    /// The share of light that meets glass; the rest meets the base.
    pub glass: Channel,
}

impl Default for Cover {
    fn default() -> Cover {
        Cover { opacity: 1.0, texture: None, least: 0.0, base: None }
    }
}

impl Cover {
    /// Takes the texture of a mask, unless each of its texels is opaque or a hole and nothing else
    /// makes the surface partly transparent.
    pub(crate) fn take_mask(&mut self, maps: &mut Maps, textures: &[Texture]) {
        let Some(CutOut { texture, .. }) = maps.cut_out else { return };
        match textures[texture as usize].opacities() {
            Opacities::Whole => maps.cut_out = None,
            Opacities::Mask if self.opacity >= 1.0 => {}
            Opacities::Mask | Opacities::Varied => {
                maps.cut_out = None;
                self.texture = Some(texture);
            }
        }
    }

    /// Returns it with this number added to the indices of its textures.
    pub(crate) fn moved(self, by: u32) -> Cover {
        let base = |base: Base| Base { glass: base.glass.moved(by), ..base };
        Cover { texture: self.texture.map(|at| at + by), base: self.base.map(base), ..self }
    }

    /// Returns its textures.
    pub(crate) fn textures(&self) -> [Option<u32>; 2] {
        [self.texture, self.base.and_then(|base| base.glass.texture)]
    }

    /// Returns whether it makes a surface partly transparent, except as glass.
    pub(crate) fn is_partial(&self) -> bool {
        Cover { base: None, ..*self } != Cover::default()
    }

    pub(crate) fn has_textures(&self) -> bool {
        self.textures() != [None; 2]
    }

    /// Returns whether all its numbers are plausible.
    pub(crate) fn is_plausible(&self) -> bool {
        let fits = |number: f32| (0.0..=1.0).contains(&number);
        let is_base = |base: Base| {
            let is_glass = matches!(base.bsdf, Bsdf::ThinGlass { .. } | Bsdf::Dielectric { .. });
            let material = Material { bsdf: base.bsdf, ..Material::grey("") };
            !is_glass
                && material.validate().is_ok()
                && base.glass.channel < 3
                && fits(base.glass.factor)
        };
        fits(self.opacity) && fits(self.least) && self.base.is_none_or(is_base)
    }
}

impl Channel {
    fn moved(self, by: u32) -> Channel {
        Channel { texture: self.texture.map(|at| at + by), ..self }
    }
}

impl Maps {
    /// Returns them with this number added to the indices of textures.
    pub(crate) fn moved(self, by: u32) -> Maps {
        let index = |at: u32| at + by;
        let finish = |finish: FinishMap| FinishMap {
            roughness: finish.roughness.moved(by),
            metalness: finish.metalness.moved(by),
        };
        Maps {
            base: self.base.map(index),
            emission: self.emission.map(index),
            cut_out: self.cut_out.map(|cut| CutOut { texture: index(cut.texture), ..cut }),
            normal: self.normal.map(|map| NormalMap { texture: index(map.texture), ..map }),
            finish: self.finish.map(finish),
        }
    }

    /// Returns all textures.
    pub(crate) fn all(&self) -> [Option<u32>; 6] {
        let [roughness, metalness] = self
            .finish
            .map_or([None; 2], |finish| [finish.roughness.texture, finish.metalness.texture]);
        let normal = self.normal.map(|normal| normal.texture);
        let cut_out = self.cut_out.map(|cut_out| cut_out.texture);
        [self.base, self.emission, cut_out, normal, roughness, metalness]
    }

    /// Returns whether all its numbers are plausible.
    fn is_plausible(&self) -> bool {
        let fits = |c: Channel| c.channel < 3 && (0.0..=1.0).contains(&c.factor);
        self.cut_out.is_none_or(|cut_out| cut_out.least > 0.0 && cut_out.least <= 1.0)
            && self.normal.is_none_or(|normal| normal.strength.is_finite())
            && self.finish.is_none_or(|finish| fits(finish.roughness) && fits(finish.metalness))
    }
}

impl Shading {
    /// Returns whether it has no attributes.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.normals.is_empty()
            && self.colours.is_empty()
            && self.covers.is_empty()
            && self.opacities.is_empty()
            && !self.has_maps()
    }

    /// Returns whether any material has a texture.
    pub(crate) fn has_maps(&self) -> bool {
        self.maps.iter().any(|maps| *maps != Maps::default())
    }

    /// Returns whether any material has a texture, or a cover that depends on one.
    pub(crate) fn has_textures(&self) -> bool {
        self.has_maps() || self.covers.iter().any(Cover::has_textures)
    }

    /// Checks that it fits a scene.
    pub(crate) fn validate(&self, triangles: usize, materials: usize) -> Result<(), SceneError> {
        let fits = |length: usize, count: usize| length == 0 || length == count;
        let has_maps = !self.maps.is_empty();
        let exists = |map: Option<u32>| map.is_none_or(|map| (map as usize) < self.textures.len());
        let finite = |uv: &[f32; 2]| uv.iter().all(|c| c.is_finite());
        let counts = [self.uvs.len(), self.normals.len(), self.colours.len(), self.opacities.len()];
        let problem = if !counts.iter().all(|&count| fits(count, triangles)) {
            "their number differs from the triangles'"
        } else if !fits(self.maps.len(), materials)
            || !fits(self.covers.len(), materials)
            || materials > MAX_MATERIALS
        {
            "their number differs from the materials'"
        } else if !self.covers.iter().all(Cover::is_plausible) {
            "an opacity is impossible"
        } else if (has_maps || self.covers.iter().any(Cover::has_textures))
            && self.uvs.is_empty()
            && triangles > 0
        {
            "textures have no coordinates"
        } else if !self.maps.iter().flat_map(Maps::all).all(exists)
            || !self.covers.iter().flat_map(Cover::textures).all(exists)
        {
            "a material names a texture that does not exist"
        } else if !self.maps.iter().all(Maps::is_plausible) {
            "a material's texture has an impossible strength"
        } else if self.textures.len() > MAX_TEXTURES {
            "there are too many textures"
        } else if !self.uvs.iter().flatten().all(finite) {
            "a texture coordinate is not finite"
        } else {
            return Ok(());
        };
        Err(SceneError::Shading { problem })
    }
}

/// Packs a unit vector.
#[must_use]
pub fn to_octahedral(v: Vec3) -> Octahedral {
    let sum = v.abs().element_sum().max(f32::MIN_POSITIVE);
    let (x, y) = (v.x / sum, v.y / sum);
    let folded = |a: f32, b: f32| (1.0 - b.abs()).copysign(a);
    let (x, y) = if v.z < 0.0 { (folded(x, y), folded(y, x)) } else { (x, y) };
    [x, y].map(|c| (c.clamp(-1.0, 1.0) * 32767.0).round() as i16)
}

/// Returns the unit vector of its packed form.
#[must_use]
#[inline]
pub fn from_octahedral(packed: Octahedral) -> Vec3 {
    let [x, y] = packed.map(|c| f32::from(c) * (1.0 / 32767.0));
    let z = 1.0 - x.abs() - y.abs();
    let fold = (-z).max(0.0);
    Vec3::new(x - fold.copysign(x), y - fold.copysign(y), z).normalize_or_zero()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packed_normals_are_nearly_exact() {
        for k in 0..10_000 {
            let (z, angle) = (-1.0 + k as f32 / 5000.0, k as f32 * 2.399);
            let level = (1.0 - z * z).max(0.0).sqrt();
            let v = Vec3::new(level * angle.cos(), level * angle.sin(), z);
            let error = from_octahedral(to_octahedral(v)).cross(v).length();
            assert!(error < 1e-4 && from_octahedral(to_octahedral(v)).dot(v) > 0.0, "{v} {error}");
        }
    }
}

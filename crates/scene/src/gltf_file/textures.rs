//! Textures and normals of a glTF file.

use glam::{DMat4, Vec3};
use gltf::material::AlphaMode;
use gltf::texture::{TextureTransform, WrappingMode};

use super::look::{Look, Placement};
use super::reading::Reading;
use super::{accessor, buffers};
use crate::Maps;
use crate::shading::CUT_OUT;
use crate::texture::{MAX_TEXTURE_BYTES, Texture, Wrap};
use crate::texture_files::Use;

impl Reading<'_> {
    /// Reads the textures of a material.
    pub(super) fn look(&mut self, material: &gltf::Material) -> Look {
        let pbr = material.pbr_metallic_roughness();
        let base = match material.pbr_specular_glossiness() {
            Some(specular) => specular.diffuse_texture(),
            None => pbr.base_color_texture(),
        };
        let emission = material.emissive_texture();
        let mut look = Look::default();
        for (first, info) in [&base, &emission].into_iter().flatten().enumerate() {
            let transform = info.texture_transform();
            let set = transform.as_ref().and_then(TextureTransform::tex_coord);
            let set = set.unwrap_or(info.tex_coord());
            let placement = Placement::new(transform);
            if first == 0 {
                (look.set, look.placement) = (set, placement);
            } else if (look.set, look.placement) != (set, placement) {
                self.count("emission textures with coordinates of their own lie as the colour's");
            }
        }
        look.maps.base = base.as_ref().and_then(|info| self.texture(&info.texture()));
        look.maps.emission = emission.as_ref().and_then(|info| self.texture(&info.texture()));
        if look.maps.base.is_some() {
            let is_uncommon = |cutoff: f32| (cutoff - CUT_OUT).abs() > 0.1;
            match material.alpha_mode() {
                AlphaMode::Opaque => {}
                AlphaMode::Mask => {
                    look.maps.cut_out = look.maps.base;
                    if material.alpha_cutoff().is_some_and(is_uncommon) {
                        self.count("masks are cut out at an alpha of a half");
                    }
                }
                AlphaMode::Blend => {
                    look.maps.cut_out = look.maps.base;
                    self.count("blended textures are cut out at an alpha of a half");
                }
            }
        }
        for (what, is_there) in [
            ("normal textures are not used", material.normal_texture().is_some()),
            (
                "occlusion textures are not used: light is traced",
                material.occlusion_texture().is_some(),
            ),
        ] {
            if is_there {
                self.count(what);
            }
        }
        look
    }

    /// Returns the mean metalness and roughness that a material's texture has, as factors.
    pub(super) fn mean_finish(&mut self, material: &gltf::Material) -> Option<[f32; 2]> {
        let info = material.pbr_metallic_roughness().metallic_roughness_texture()?;
        self.count("textures of metalness and roughness count with their mean");
        let bytes = self.picture(&info.texture()).ok()?;
        let texture = Texture::decode(bytes.into(), [Wrap::Repeat; 2], true, false).ok()?;
        let [_, roughness, metalness, _] = texture.at([0.5; 2], f32::MAX);
        Some([metalness, roughness])
    }

    fn texture(&mut self, texture: &gltf::Texture) -> Option<u32> {
        let sampler = texture.sampler();
        let wrap = [sampler.wrap_s(), sampler.wrap_t()].map(|mode| match mode {
            WrappingMode::Repeat => Wrap::Repeat,
            WrappingMode::ClampToEdge => Wrap::Clamp,
            WrappingMode::MirroredRepeat => Wrap::Mirror,
        });
        let how = Use { wrap, is_linear: false, is_mask: false };
        let number = texture.source().index();
        let bytes = self.picture(texture);
        self.files.embedded(number, || bytes, how).unwrap_or_else(|problem| {
            self.count(format!("textures are left out; image {number}: {problem}"));
            None
        })
    }

    /// Returns the file of a picture.
    fn picture(&self, texture: &gltf::Texture) -> Result<Vec<u8>, String> {
        match texture.source().source() {
            gltf::image::Source::View { view, .. } => Ok(self.buffers.view(&view)?.to_vec()),
            gltf::image::Source::Uri { uri, .. } => {
                buffers::bytes_of(self.path, uri, MAX_TEXTURE_BYTES as u64)
                    .map_err(|error| error.to_string())
            }
        }
    }

    /// Returns the texture coordinates of a primitive's vertices, if its material needs them.
    pub(super) fn coordinates(
        &mut self,
        primitive: &gltf::Primitive,
        material: u32,
    ) -> Result<Option<Vec<[f32; 2]>>, String> {
        let look = self.looks[material as usize];
        if look.maps == Maps::default() {
            return Ok(None);
        }
        let Some(accessor) = primitive.get(&gltf::Semantic::TexCoords(look.set)) else {
            self.count("textured meshes without coordinates show one texel");
            return Ok(None);
        };
        let uvs = accessor::floats::<2>(&accessor, &self.buffers)?;
        Ok(Some(uvs.into_iter().map(|uv| look.placement.of(uv)).collect()))
    }

    /// Returns the normals of a primitive's vertices, if it has any.
    pub(super) fn normals(
        &self,
        primitive: &gltf::Primitive,
        matrix: DMat4,
    ) -> Result<Option<Vec<Vec3>>, String> {
        let Some(accessor) = primitive.get(&gltf::Semantic::Normals) else { return Ok(None) };
        let normals = accessor::floats::<3>(&accessor, &self.buffers)?;
        let turn = matrix.inverse().transpose();
        let placed = normals.iter().map(|n| turn.transform_vector3(Vec3::from(*n).as_dvec3()));
        Ok(Some(placed.map(|n| n.normalize_or_zero().as_vec3()).collect()))
    }
}

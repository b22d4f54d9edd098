//! Textures and normals of a glTF file.

use std::collections::BTreeMap;

use glam::{DMat4, Vec3};
use gltf::material::AlphaMode;
use gltf::texture::{TextureTransform, WrappingMode};

use super::form::{Form, VertexTransforms};
use super::look::{MapTransform, MaterialTextures};
use super::reading::GltfReading;
use super::{accessor, buffers};
use crate::Bsdf;
use crate::shading::{Base, CUT_OUT, Channel, CutOut, FinishMap, NormalMap};
use crate::texture::{MAX_TEXTURE_BYTES, Wrap, srgb_byte};
use crate::texture_use::TextureUse;

impl GltfReading<'_> {
    /// Decodes the textures of all materials on all cores.
    pub(super) fn decode_textures(&mut self) {
        let mut pictures = BTreeMap::new();
        for material in self.document.materials() {
            let pbr = material.pbr_metallic_roughness();
            let (own, other) = (pbr.base_color_texture(), material.pbr_specular_glossiness());
            let base = other.map_or(own, |other| other.diffuse_texture());
            let finish = pbr.metallic_roughness_texture();
            let colours = [base, material.emissive_texture()].map(|info| info.map(|i| i.texture()));
            let normal = material.normal_texture().map(|info| info.texture());
            let numbers = [finish.map(|info| info.texture()), normal];
            for (textures, is_linear) in [(colours, false), (numbers, true)] {
                for texture in textures.into_iter().flatten() {
                    if let Some(image) = texture.source() {
                        let how = use_of(&texture, is_linear);
                        let key = (image.index(), how.is_linear, how.wrap.map(|wrap| wrap as u8));
                        pictures.insert(key, (image, how));
                    }
                }
            }
        }
        let pictures: Vec<(usize, TextureUse, Vec<u8>)> = pictures
            .into_values()
            .filter_map(|(image, how)| Some((image.index(), how, self.picture(&image).ok()?)))
            .collect();
        self.files.decode_embedded(pictures.into_iter());
    }

    /// Reads the textures of a material. `is_finished` states whether roughness and metalness
    /// matter.
    pub(super) fn look(
        &mut self,
        material: &gltf::Material,
        is_finished: bool,
    ) -> MaterialTextures {
        let pbr = material.pbr_metallic_roughness();
        let base = match material.pbr_specular_glossiness() {
            Some(specular) => specular.diffuse_texture(),
            None => pbr.base_color_texture(),
        };
        let emission = material.emissive_texture();
        let finish = pbr.metallic_roughness_texture().filter(|_| is_finished);
        let normal = material.normal_texture();
        let mut look = MaterialTextures::default();
        // The crate reads no transform for a texture of normals; that of the colours is used.
        let colour = base.as_ref().map(lies).map(|(_, transform)| transform);
        let own = normal.as_ref().map(|n| (n.tex_coord(), colour.unwrap_or(None)));
        let [base_lies, glow_lies, finish_lies] =
            [&base, &emission, &finish].map(|info| info.as_ref().map(lies));
        for (first, (set, transform)) in
            [base_lies, glow_lies, finish_lies, own].into_iter().flatten().enumerate()
        {
            let set = transform.as_ref().and_then(TextureTransform::tex_coord).unwrap_or(set);
            let placement = MapTransform::new(transform);
            if first == 0 {
                (look.set, look.placement) = (set, placement);
            } else if (look.set, look.placement) != (set, placement) {
                self.count(
                    "textures with coordinates of their own lie as the material's first one",
                );
            }
        }
        (look.lacks_colour, look.lacks_emission) = (base.is_some(), emission.is_some());
        let colour = base.map(|info| info.texture());
        look.maps.base = colour.and_then(|texture| self.texture(&texture, false));
        let glow = emission.map(|info| info.texture());
        look.maps.emission = glow.and_then(|texture| self.texture(&texture, false));
        look.lacks_colour &= look.maps.base.is_none();
        look.lacks_emission &= look.maps.emission.is_none();
        if look.lacks_colour {
            self.count("colours whose texture is left out are darkened as by grey 0.5");
        }
        look.maps.normal = normal.and_then(|normal| {
            let strength = Some(normal.scale()).filter(|scale| scale.is_finite()).unwrap_or(1.0);
            Some(NormalMap { texture: self.texture(&normal.texture(), true)?, strength })
        });
        look.maps.finish = finish.and_then(|info| {
            let texture = Some(self.texture(&info.texture(), true)?);
            let channel = |channel: u8, factor: f32| {
                let factor = if factor > 0.0 { factor.min(1.0) } else { 0.0 };
                Channel { texture, channel, factor }
            };
            let roughness = channel(1, pbr.roughness_factor());
            Some(FinishMap { roughness, metalness: channel(2, pbr.metallic_factor()) })
        });
        self.cover(material, &mut look);
        if material.occlusion_texture().is_some() {
            self.count("occlusion textures are not used: light is traced");
        }
        look
    }

    /// Finds where the surfaces of a material are, by its alpha.
    fn cover(&self, material: &gltf::Material, look: &mut MaterialTextures) {
        let pbr = material.pbr_metallic_roughness();
        let factor = match material.pbr_specular_glossiness() {
            Some(specular) => specular.diffuse_factor()[3],
            None => pbr.base_color_factor()[3],
        };
        let opacity = if factor > 0.0 { factor.min(1.0) } else { 0.0 };
        let MaterialTextures { maps, cover, .. } = look;
        match material.alpha_mode() {
            AlphaMode::Opaque => {}
            AlphaMode::Mask => {
                let cutoff = material.alpha_cutoff().unwrap_or(CUT_OUT);
                if opacity < cutoff {
                    cover.opacity = 0.0;
                } else if cutoff > 0.0 {
                    let least = cutoff / opacity;
                    match maps.base {
                        Some(texture) => maps.cut_out = Some(CutOut { texture, least }),
                        None => (cover.opacity, cover.least) = (opacity, cutoff),
                    }
                }
            }
            AlphaMode::Blend => {
                cover.opacity = opacity;
                maps.cut_out = maps.base.map(|texture| CutOut { texture, least: CUT_OUT });
                cover.take_mask(maps, &self.files.textures);
            }
        }
    }

    /// Returns the surface that glass is in part.
    pub(super) fn base(&mut self, material: &gltf::Material, bsdf: Bsdf) -> Base {
        let transmission = material.transmission();
        let factor = transmission.as_ref().map_or(0.0, |t| t.transmission_factor());
        let info = transmission.as_ref().and_then(|t| t.transmission_texture());
        let texture = info.and_then(|info| self.texture(&info.texture(), true));
        let factor = if factor > 0.0 { factor.min(1.0) } else { 0.0 };
        Base { bsdf, glass: Channel { texture, channel: 0, factor } }
    }

    /// Returns the opacities of a primitive's vertices, if its material uses them.
    pub(super) fn opacities(
        &mut self,
        primitive: &gltf::Primitive,
        material: u32,
    ) -> Result<Option<Vec<u8>>, String> {
        let mode = primitive.material().alpha_mode();
        let Some(accessor) = primitive.get(&gltf::Semantic::Colors(0)) else { return Ok(None) };
        let is_solid =
            matches!(self.model.materials[material as usize].bsdf, Bsdf::Dielectric { .. });
        if mode == AlphaMode::Opaque || is_solid || accessor.dimensions().multiplicity() < 4 {
            return Ok(None);
        }
        let colours = accessor::floats::<4>(&accessor, &self.buffers)?;
        let bytes = colours.iter().map(|colour| (colour[3].clamp(0.0, 1.0) * 255.0 + 0.5) as u8);
        let opacities: Vec<u8> = bytes.collect();
        if opacities.iter().all(|&opacity| opacity == u8::MAX) {
            return Ok(None);
        }
        // A product of opacities is no mask.
        let MaterialTextures { maps, cover, .. } = &mut self.looks[material as usize];
        if mode == AlphaMode::Blend
            && let Some(mask) = maps.cut_out.take()
        {
            cover.texture = Some(mask.texture);
        }
        Ok(Some(opacities))
    }

    /// Returns the mean metalness and roughness that a material's texture has, as factors. If the
    /// texture cannot be read, that is a rough surface without metal.
    pub(super) fn mean_finish(&mut self, material: &gltf::Material) -> Option<[f32; 2]> {
        let info = material.pbr_metallic_roughness().metallic_roughness_texture()?;
        let Some(id) = self.texture(&info.texture(), true) else { return Some([0.0, 1.0]) };
        let [_, roughness, metalness, _] = self.files.textures[id as usize].at([0.5; 2], f32::MAX);
        Some([metalness, roughness])
    }

    /// Returns the colours of a primitive's vertices, as bytes of sRGB, if it has any.
    pub(super) fn colours(
        &mut self,
        primitive: &gltf::Primitive,
    ) -> Result<Option<Vec<[u8; 3]>>, String> {
        let Some(accessor) = primitive.get(&gltf::Semantic::Colors(0)) else { return Ok(None) };
        let linear = accessor::floats::<3>(&accessor, &self.buffers)?;
        Ok(Some(linear.into_iter().map(|colour| colour.map(srgb_byte)).collect()))
    }

    /// Returns the index of a texture, whose bytes are linear numbers or colours of sRGB.
    fn texture(&mut self, texture: &gltf::Texture, is_linear: bool) -> Option<u32> {
        let how = use_of(texture, is_linear);
        let Some(image) = texture.source() else {
            self.count("textures without a picture are left out");
            return None;
        };
        let number = image.index();
        let bytes = self.picture(&image);
        self.files.embedded(number, || bytes, how).unwrap_or_else(|problem| {
            self.count(format!("textures are left out; image {number}: {problem}"));
            None
        })
    }

    /// Returns the file of a picture.
    fn picture(&self, image: &gltf::Image) -> Result<Vec<u8>, String> {
        match image.source() {
            gltf::image::Source::View { view, .. } => Ok(self.buffers.view(&view)?.to_vec()),
            gltf::image::Source::Uri { uri: "", .. } => Err("it names no file".to_owned()),
            gltf::image::Source::Uri { uri, .. } => {
                buffers::bytes_of(self.path, uri, MAX_TEXTURE_BYTES as u64)
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
        if look.maps == Default::default() && !look.cover.has_textures() {
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
        form: &Form,
        places: &VertexTransforms,
    ) -> Result<Option<Vec<Vec3>>, String> {
        let Some(accessor) = primitive.get(&gltf::Semantic::Normals) else { return Ok(None) };
        let mut normals = accessor::floats::<3>(&accessor, &self.buffers)?;
        form.morph(primitive, gltf::Semantic::Normals, &mut normals, &self.buffers)?;
        let turned = |matrix: DMat4| matrix.inverse().transpose();
        let one = turned(form.matrix);
        let place = |(vertex, normal): (usize, &[f32; 3])| {
            let turn = if form.is_posed() { turned(places.matrix(vertex)) } else { one };
            turn.transform_vector3(Vec3::from(*normal).as_dvec3())
        };
        let placed = normals.iter().enumerate().map(place);
        Ok(Some(placed.map(|n| n.normalize_or_zero().as_vec3()).collect()))
    }
}

/// Returns how a texture's picture is used.
fn use_of(texture: &gltf::Texture, is_linear: bool) -> TextureUse {
    let sampler = texture.sampler();
    let wrap = [sampler.wrap_s(), sampler.wrap_t()].map(|mode| match mode {
        WrappingMode::Repeat => Wrap::Repeat,
        WrappingMode::ClampToEdge => Wrap::Clamp,
        WrappingMode::MirroredRepeat => Wrap::Mirror,
    });
    TextureUse { wrap, is_linear, is_mask: false }
}

/// Returns the set of coordinates that a texture uses, and its transform.
fn lies<'a>(info: &gltf::texture::Info<'a>) -> (u32, Option<TextureTransform<'a>>) {
    (info.tex_coord(), info.texture_transform())
}

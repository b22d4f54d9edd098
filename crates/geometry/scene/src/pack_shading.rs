//! The part of a packed scene for normals, textures, colours, suns and punctual lights.
//!
//! The format is in [`crate::pack`].

use std::sync::Arc;

use bytemuck::Pod;

use crate::geometry::check_limit;
use crate::luminaire::Luminaire;
use crate::pack_luminaires::{pack_luminaires, unpack_luminaires};
use crate::pack_punctual::{pack_punctual_lights, unpack_punctual_lights};
use crate::shading::{
    Base, CUT_OUT, Channel, Cover, CutOut, FinishMap, MAX_BYTES_OF_TEXTURES, MAX_TEXTURES,
    NormalMap, WHITE,
};
use crate::sun::MAX_SUNS;
use crate::texture::MAX_TEXTURE_BYTES;
use crate::texture_decode::decode_all;
use crate::texture_use::TextureUse;
use crate::{Bsdf, Maps, PackedError, PunctualLight, SceneError, Shading, Sun, Texture, Wrap};

const HAS_UVS: u32 = 1;
const HAS_NORMALS: u32 = 2;
const HAS_DETAILS: u32 = 4;
const HAS_COLOURS: u32 = 8;
const HAS_SUNS: u32 = 16;
const HAS_CUTS: u32 = 32;
const HAS_COVERS: u32 = 64;
const HAS_OPACITIES: u32 = 128;
const HAS_PUNCTUAL_LIGHTS: u32 = 256;
const HAS_LUMINAIRES: u32 = 512;
const ALL: u32 = 2 * HAS_LUMINAIRES - 1;
const NO_TEXTURE: u32 = u32::MAX;

/// Four bytes of a number.
type Word = [u8; 4];

/// A normal map and a finish of a material, as seven words.
type Details = [Word; 7];

/// A cover without its base, as three words.
type PackedCover = [Word; 3];

/// The kind, eight parameters, texture, factor and channel of a base.
type PackedBase = [Word; 12];

pub(crate) fn pack_shading(
    shading: &Shading,
    (suns, lights, luminaires): (&[Sun], &[PunctualLight], &[Luminaire]),
    out: &mut Vec<u8>,
) {
    let has_uvs = shading.has_textures();
    let has_details =
        shading.maps.iter().any(|maps| maps.normal.is_some() || maps.finish.is_some());
    let flags = [
        (has_uvs, HAS_UVS),
        (!shading.normals.is_empty(), HAS_NORMALS),
        (has_details, HAS_DETAILS),
        (!shading.colours.is_empty(), HAS_COLOURS),
        (!suns.is_empty(), HAS_SUNS),
        (has_cuts(shading), HAS_CUTS),
        (!shading.covers.is_empty(), HAS_COVERS),
        (!shading.opacities.is_empty(), HAS_OPACITIES),
        (!lights.is_empty(), HAS_PUNCTUAL_LIGHTS),
        (!luminaires.is_empty(), HAS_LUMINAIRES),
    ];
    let flags: u32 = flags.iter().filter(|(has, _)| *has).map(|(_, flag)| flag).sum();
    let textures = if has_uvs { &shading.textures[..] } else { &[] };
    out.extend(flags.to_le_bytes());
    out.extend((textures.len() as u32).to_le_bytes());
    if has_uvs {
        let numbers = shading.uvs.as_flattened().as_flattened();
        numbers.iter().for_each(|c| out.extend(c.to_le_bytes()));
    }
    let numbers = shading.normals.as_flattened().as_flattened();
    numbers.iter().for_each(|c| out.extend(c.to_le_bytes()));
    let some_maps = if has_uvs { &shading.maps[..] } else { &[] };
    for maps in some_maps {
        let cut_out = maps.cut_out.map(|cut_out| cut_out.texture);
        let three = [maps.base, maps.emission, cut_out];
        three.iter().for_each(|map| out.extend(map.unwrap_or(NO_TEXTURE).to_le_bytes()));
    }
    if has_details {
        shading.maps.iter().for_each(|maps| out.extend(details(maps).as_flattened()));
    }
    out.extend(shading.colours.as_flattened().as_flattened());
    if !suns.is_empty() {
        out.extend((suns.len() as u32).to_le_bytes());
        let numbers = suns.iter().flat_map(|sun| sun.towards.into_iter().chain(sun.irradiance));
        numbers.for_each(|c| out.extend(c.to_le_bytes()));
    }
    if has_cuts(shading) {
        shading.maps.iter().for_each(|maps| out.extend(least_opacity(maps).to_le_bytes()));
    }
    for cover in &shading.covers {
        out.extend(packed_cover(cover).as_flattened());
        out.extend([u8::from(cover.base.is_some())]);
        cover.base.iter().for_each(|base| out.extend(packed_base(base).as_flattened()));
    }
    out.extend(shading.opacities.as_flattened());
    if !lights.is_empty() {
        pack_punctual_lights(lights, out);
    }
    if !luminaires.is_empty() {
        pack_luminaires(luminaires, out);
    }
    for texture in textures {
        out.extend((texture.encoded.len() as u32).to_le_bytes());
        out.extend(texture.wrap.map(|wrap| match wrap {
            Wrap::Repeat => 0,
            Wrap::Clamp => 1,
            Wrap::Mirror => 2,
        }));
        out.extend([u8::from(texture.is_linear), u8::from(texture.is_mask)]);
        out.extend_from_slice(&texture.encoded);
    }
}

fn packed_cover(cover: &Cover) -> PackedCover {
    [
        cover.opacity.to_le_bytes(),
        cover.texture.unwrap_or(NO_TEXTURE).to_le_bytes(),
        cover.least.to_le_bytes(),
    ]
}

fn packed_base(base: &Base) -> PackedBase {
    let (kind, numbers) = match base.bsdf {
        Bsdf::Diffuse { kd: [a, b, c] } => (0, [a, b, c, 0.0, 0.0, 0.0, 0.0, 0.0]),
        Bsdf::Mirror { ks: [a, b, c] } => (1, [a, b, c, 0.0, 0.0, 0.0, 0.0, 0.0]),
        Bsdf::Conductor { ks: [a, b, c], alpha } => (2, [a, b, c, alpha, 0.0, 0.0, 0.0, 0.0]),
        Bsdf::Coated { kd: [a, b, c], ks: [d, e, f], ior, alpha } => {
            (5, [a, b, c, d, e, f, ior, alpha])
        }
        // No base is glass.
        Bsdf::ThinGlass { .. } | Bsdf::Dielectric { .. } => (u32::MAX, [0.0; 8]),
    };
    let mut words = [[0; 4]; 12];
    words[0] = u32::to_le_bytes(kind);
    words[1..9].iter_mut().zip(numbers).for_each(|(word, number)| *word = number.to_le_bytes());
    words[9] = base.glass.texture.unwrap_or(NO_TEXTURE).to_le_bytes();
    words[10] = base.glass.factor.to_le_bytes();
    words[11] = u32::from(base.glass.channel).to_le_bytes();
    words
}

/// Reads a base. Values that have another packing are refused.
fn unpacked_base(packed: &PackedBase) -> Result<Base, PackedError> {
    let [a, b, c, d, e, f, ior, alpha] = std::array::from_fn(|k| f32::from_le_bytes(packed[k + 1]));
    let first = [a, b, c];
    let bsdf = match u32::from_le_bytes(packed[0]) {
        0 => Bsdf::Diffuse { kd: first },
        1 => Bsdf::Mirror { ks: first },
        2 => Bsdf::Conductor { ks: first, alpha: d },
        5 => Bsdf::Coated { kd: first, ks: [d, e, f], ior, alpha },
        _ => return Err(PackedError::Shading),
    };
    let (factor, channel) = (f32::from_le_bytes(packed[10]), packed[11][0]);
    let base = Base { bsdf, glass: Channel { texture: map(packed[9]), channel, factor } };
    if packed_base(&base) == *packed { Ok(base) } else { Err(PackedError::Shading) }
}

/// Reads the covers of `count` materials.
fn unpack_covers(bytes: &mut &[u8], count: usize) -> Result<Vec<Cover>, PackedError> {
    let mut covers = Vec::with_capacity(count.min(bytes.len()));
    for _ in 0..count {
        let [opacity, texture, least] = one::<PackedCover>(bytes)?;
        let base = match one::<u8>(bytes)? {
            0 => None,
            1 => Some(unpacked_base(&one::<PackedBase>(bytes)?)?),
            _ => return Err(PackedError::Shading),
        };
        let [opacity, least] = [opacity, least].map(f32::from_le_bytes);
        covers.push(Cover { opacity, texture: map(texture), least, base });
    }
    if covers.iter().all(|cover| *cover == Cover::default()) {
        return Err(PackedError::Shading);
    }
    Ok(covers)
}

/// Returns whether any surface is cut out at another opacity than the usual one.
fn has_cuts(shading: &Shading) -> bool {
    shading.maps.iter().any(|maps| least_opacity(maps) != CUT_OUT)
}

fn least_opacity(maps: &Maps) -> f32 {
    maps.cut_out.map_or(CUT_OUT, |cut_out| cut_out.least)
}

fn details(maps: &Maps) -> Details {
    let none = Channel { texture: None, channel: 0, factor: 0.0 };
    let finish = maps.finish.unwrap_or(FinishMap { roughness: none, metalness: none });
    let word = |texture: Option<u32>| texture.unwrap_or(NO_TEXTURE).to_le_bytes();
    let [rough, metal] = [finish.roughness, finish.metalness];
    [
        word(maps.normal.map(|normal| normal.texture)),
        maps.normal.map_or(0.0, |normal| normal.strength).to_le_bytes(),
        word(rough.texture),
        rough.factor.to_le_bytes(),
        word(metal.texture),
        metal.factor.to_le_bytes(),
        [rough.channel, metal.channel, u8::from(maps.finish.is_some()), 0],
    ]
}

/// Returns a texture's index of its packed form.
fn map(word: Word) -> Option<u32> {
    Some(u32::from_le_bytes(word)).filter(|&map| map != NO_TEXTURE)
}

/// Adds a normal map and a finish of their packed form. Values that have another packing are
/// refused.
fn add_details(maps: &mut Maps, packed: &Details) -> Result<(), PackedError> {
    let [normal, strength, rough, rough_factor, metal, metal_factor, last] = *packed;
    let strength = f32::from_le_bytes(strength);
    maps.normal = map(normal).map(|texture| NormalMap { texture, strength });
    let channel = |texture, factor, channel| Channel {
        texture: map(texture),
        channel,
        factor: f32::from_le_bytes(factor),
    };
    let roughness = channel(rough, rough_factor, last[0]);
    let metalness = channel(metal, metal_factor, last[1]);
    maps.finish = (last[2] == 1).then_some(FinishMap { roughness, metalness });
    if details(maps) == *packed { Ok(()) } else { Err(PackedError::Shading) }
}

/// Takes `count` values off the front of `bytes`.
fn take<'a, T: Pod>(bytes: &mut &'a [u8], count: usize) -> Result<&'a [T], PackedError> {
    let length = count.checked_mul(size_of::<T>()).ok_or(PackedError::Shading)?;
    let (head, rest) = bytes.split_at_checked(length).ok_or(PackedError::Shading)?;
    *bytes = rest;
    bytemuck::try_cast_slice(head).map_err(|_| PackedError::Shading)
}

/// Takes one value off the front of `bytes`.
fn one<T: Pod>(bytes: &mut &[u8]) -> Result<T, PackedError> {
    take::<T>(bytes, 1)?.first().copied().ok_or(PackedError::Shading)
}

/// The lights of a packed scene that are no surfaces.
pub(crate) type UnpackedLights = (Vec<Sun>, Vec<PunctualLight>, Vec<Luminaire>);

pub(crate) fn unpack_shading(
    mut bytes: &[u8],
    triangles: usize,
    materials: usize,
) -> Result<(Shading, UnpackedLights), SceneError> {
    let [flags, count] = one::<[Word; 2]>(&mut bytes)?.map(u32::from_le_bytes);
    let has = |flag: u32| flags & flag != 0;
    let needs_uvs = count > 0 || has(HAS_DETAILS) || has(HAS_CUTS);
    if flags & !ALL != 0 || count as usize > MAX_TEXTURES || (needs_uvs && !has(HAS_UVS)) {
        return Err(PackedError::Shading.into());
    }
    let mut shading = Shading::default();
    if has(HAS_UVS) {
        let corners = take::<[[Word; 2]; 3]>(&mut bytes, triangles)?;
        shading.uvs = corners.iter().map(|c| c.map(|uv| uv.map(f32::from_le_bytes))).collect();
    }
    if has(HAS_NORMALS) {
        let corners = take::<[[[u8; 2]; 2]; 3]>(&mut bytes, triangles)?;
        shading.normals = corners.iter().map(|c| c.map(|n| n.map(i16::from_le_bytes))).collect();
    }
    if has(HAS_UVS) {
        let all = take::<[Word; 3]>(&mut bytes, materials)?;
        let three = all.iter().map(|m| m.map(map));
        let maps = three.map(|[base, emission, cut_out]| Maps {
            base,
            emission,
            cut_out: cut_out.map(|texture| CutOut { texture, least: CUT_OUT }),
            ..Maps::default()
        });
        shading.maps = maps.collect();
    }
    if has(HAS_DETAILS) {
        let all = take::<Details>(&mut bytes, materials)?;
        shading
            .maps
            .iter_mut()
            .zip(all)
            .try_for_each(|(maps, packed)| add_details(maps, packed))?;
        if shading.maps.iter().all(|maps| maps.normal.is_none() && maps.finish.is_none()) {
            return Err(PackedError::Shading.into());
        }
    }
    if has(HAS_COLOURS) {
        shading.colours = take::<[[u8; 3]; 3]>(&mut bytes, triangles)?.to_vec().into();
    }
    // Attributes without an effect have no packing.
    let is_white = shading.colours.as_flattened().iter().all(|colour| *colour == WHITE);
    if has(HAS_COLOURS) && is_white {
        return Err(PackedError::Shading.into());
    }
    let suns = if has(HAS_SUNS) { unpack_suns(&mut bytes)? } else { Vec::new() };
    if has(HAS_CUTS) {
        unpack_cuts(&mut bytes, &mut shading)?;
    }
    if has(HAS_COVERS) {
        shading.covers = unpack_covers(&mut bytes, materials)?;
    }
    if has(HAS_OPACITIES) {
        shading.opacities = take::<[u8; 3]>(&mut bytes, triangles)?.to_vec().into();
        if shading.opacities.as_flattened().iter().all(|&opacity| opacity == u8::MAX) {
            return Err(PackedError::Shading.into());
        }
    }
    if has(HAS_UVS) != shading.has_textures() {
        return Err(PackedError::Shading.into());
    }
    let lights = match has(HAS_PUNCTUAL_LIGHTS) {
        true => unpack_punctual_lights(&mut bytes)?,
        false => Vec::new(),
    };
    let luminaires = match has(HAS_LUMINAIRES) {
        true => unpack_luminaires(&mut bytes)?,
        false => Vec::new(),
    };
    shading.textures = unpack_textures(bytes, count as usize, MAX_BYTES_OF_TEXTURES)?;
    Ok((shading, (suns, lights, luminaires)))
}

/// Reads the least opacity of each material. Values that have another packing are refused.
fn unpack_cuts(bytes: &mut &[u8], shading: &mut Shading) -> Result<(), PackedError> {
    let all = take::<Word>(bytes, shading.maps.len())?;
    for (maps, &least) in shading.maps.iter_mut().zip(all) {
        let least = f32::from_le_bytes(least);
        match &mut maps.cut_out {
            Some(cut_out) => cut_out.least = least,
            None if least == CUT_OUT => {}
            None => return Err(PackedError::Shading),
        }
    }
    if has_cuts(shading) { Ok(()) } else { Err(PackedError::Shading) }
}

fn unpack_suns(bytes: &mut &[u8]) -> Result<Vec<Sun>, PackedError> {
    let count = u32::from_le_bytes(one::<Word>(bytes)?) as usize;
    if !(1..=MAX_SUNS).contains(&count) {
        return Err(PackedError::Shading);
    }
    let suns = take::<[[Word; 3]; 2]>(bytes, count)?;
    let vectors = suns.iter().map(|sun| sun.map(|vector| vector.map(f32::from_le_bytes)));
    Ok(vectors.map(|[towards, irradiance]| Sun { towards, irradiance }).collect())
}

/// Reads all textures to the end of `bytes`. None is decoded before all lengths are known to fit,
/// and only a few after those before them take more memory than `limit`.
fn unpack_textures(
    mut bytes: &[u8],
    count: usize,
    limit: usize,
) -> Result<Vec<Texture>, SceneError> {
    let mut encoded = Vec::new();
    for _ in 0..count {
        let [a, b, c, d, across, down, linear, mask] = one::<[u8; 8]>(&mut bytes)?;
        let wrap = |code: u8| match code {
            0 => Ok(Wrap::Repeat),
            1 => Ok(Wrap::Clamp),
            2 => Ok(Wrap::Mirror),
            _ => Err(PackedError::Shading),
        };
        let length = u32::from_le_bytes([a, b, c, d]) as usize;
        if mask > 1 || linear > 1 || length > MAX_TEXTURE_BYTES {
            return Err(PackedError::Shading.into());
        }
        let file = take::<u8>(&mut bytes, length)?;
        let wrap = [wrap(across)?, wrap(down)?];
        let how = TextureUse { wrap, is_linear: linear == 1, is_mask: mask == 1 };
        encoded.push((Arc::from(file), how));
    }
    if !bytes.is_empty() {
        return Err(PackedError::Shading.into());
    }
    let mut textures = Vec::with_capacity(encoded.len());
    let mut memory = 0;
    decode_all(&encoded, |id, texture| {
        let texture = texture.map_err(|_| PackedError::Texture(id))?;
        memory += texture.bytes();
        check_limit("bytes of textures", memory, limit)?;
        textures.push(texture);
        Ok::<(), SceneError>(())
    })?;
    Ok(textures)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    /// A few bytes of file can take megabytes of memory, so the sum counts, and not the bytes.
    #[test]
    fn textures_that_take_too_much_memory_are_refused() {
        let mut file = Cursor::new(Vec::new());
        image::GrayImage::new(256, 256).write_to(&mut file, image::ImageFormat::Png).unwrap();
        let file = file.into_inner();
        let one = [&(file.len() as u32).to_le_bytes()[..], &[0; 4], &file].concat();
        let memory = Texture::decode(file.into(), [Wrap::Repeat; 2], false, false).unwrap().bytes();
        assert!(memory > 200 * one.len(), "{memory}");
        let three = one.repeat(3);
        assert_eq!(unpack_textures(&three, 3, 3 * memory).unwrap().len(), 3);
        let error = unpack_textures(&three, 3, 3 * memory - 1).unwrap_err();
        let (memory, limit) = (3 * memory, 3 * memory - 1);
        let words = format!("{memory} bytes of textures are more than the limit of {limit}");
        assert_eq!(error.to_string(), words);
    }
}

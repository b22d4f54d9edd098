//! The packed scene: the bytes that are sent to workers and stored in a holodeck file.
//!
//! All numbers are little-endian, nothing is aligned beyond what is said, floats are IEEE 754.
//!
//! ```text
//! offset          bytes  what
//! 0               8      magic "holoscn\n" (the newline shows transfers that translate line ends)
//! 8               4      version, u32: 1, 2 or 3
//! 12              4      zero
//! 16              8      P, number of positions, u64
//! 24              8      T, number of triangles, u64
//! 32              8      M, number of materials, u64
//! 40              8      B, bytes of all materials, u64
//! 48              24     origin, 3 × f64
//! 72              12     sky, 3 × f32; zero if it differs by direction
//! 84              4      S, bytes of the sky at the end of all, u32; 0 if it is the same in every
//!                        direction and has no sun
//! 88              12·P   positions, 3 × f32 each, relative to the origin
//! 88 + 12P        12·T   triangles, 3 × u32 each
//! 88 + 12P + 12T  4·T    material ids, u32 each
//! 88 + 12P + 16T  B      materials, one after another; then the end
//!
//! a material:
//! 0               4      n, bytes of its name, u32
//! 4               1      kind, u8
//! 5               1      flags, u8: bit 0 emits on both sides, the others zero
//! 6               2      zero
//! 8               12     emission, 3 × f32
//! 20              4·k    the kind's parameters, f32 each
//! 20 + 4k         n      name, UTF-8
//!
//! kind            k      parameters
//! 0 diffuse       3      kd
//! 1 mirror        3      ks
//! 2 conductor     4      ks, alpha
//! 3 thin glass    4      ior, transmittance
//! 4 dielectric    5      ior, transmittance, alpha
//! 5 coated        8      kd, ks, ior, alpha
//! ```
//!
//! Version 2 follows the materials with normals, textures, colours, covers, suns, punctual lights
//! and luminaires. Scenes without them have version 1.
//!
//! Scenes with instances have version 3. Their arrays begin with the triangles that belong to no
//! instance, and those of the meshes follow. The triangles of a mesh count its own positions from
//! 0, in its own coordinates. Meshes and instances follow the materials. All that version 2 adds
//! comes after them; its flags may then be 0.
//!
//! ```text
//! 0               4      K, number of meshes, u32: at least 1
//! 4               4      I, number of instances, u32: at least 1
//! 8               8·K    numbers of positions and triangles of each mesh, u32 each
//! 8 + 8K          100·I  instances: mesh, u32, and the rows of its map, 3 × 4 × f64
//! ```
//!
//! The part of version 2:
//!
//! ```text
//! 0               4      flags, u32: bit 0 texture coordinates, bit 1 normals, bit 2 normal maps
//!                        or finishes, bit 3 colours of corners, bit 4 suns, bit 5 least
//!                        opacities, bit 6 covers, bit 7 opacities of corners, bit 8 punctual lights,
//!                        bit 9 luminaires
//! 4               4      N, number of textures, u32
//! 8               24·T   if bit 0: coordinates, 3 corners × 2 × f32 for each triangle
//!                 12·T   if bit 1: normals, 3 corners × 2 × i16 for each triangle (octahedral)
//!                 12·M   if bit 0: base, emission and cut-out texture of each material, u32 each;
//!                        2³²-1 for none
//!                 28·M   if bit 2: for each material
//!                          normal map, u32, and its strength, f32
//!                          texture of roughness, u32, and its factor, f32
//!                          texture of metalness, u32, and its factor, f32
//!                          channels of roughness and metalness, u8 each: 0 to 2
//!                          1 if it has a finish, else 0, u8; zero, u8
//!                 9·T    if bit 3: colours, 3 corners × 3 × u8 of sRGB for each triangle
//!                 4      if bit 4: S, number of suns, u32
//!                 24·S   if bit 4: direction towards it, 3 × f32, and irradiance, 3 × f32
//!                 4·M    if bit 5: opacity from which the cut-out surfaces of each material are
//!                        there, f32; 0.5 without this bit
//!                 M ×    if bit 6: covers, one after another
//!                 3·T    if bit 7: opacities, 3 corners × u8 of 255 for each triangle
//!                 4      if bit 8: L, number of punctual lights, u32
//!                 L ×    if bit 8: punctual lights, one after another
//!                 4      if bit 9: W, number of webs, u32: different ones, in the order of first use
//!                 W ×    if bit 9: webs, one after another
//!                 4      if bit 9: L, number of luminaires, u32
//!                 L ×    if bit 9: luminaires, one after another
//!                 N ×    textures, one after another; then the end
//!
//! a punctual light:
//! 0               12     its place relative to the origin, 3 × f32
//! 12              12     intensity, 3 × f32
//! 24              4      radius, f32
//! 28              4      1 if it has a cone, else 0, u32
//! 32              20     axis, 3 × f32, inner and outer half angle, f32 each; zero without a cone
//! 52              8      n and m, bytes of its name and of its group's name, u32 each
//! 60              n + m  both names, UTF-8
//!
//! a web (r rows by the angle from its pole, c columns by longitude):
//! 0               4      pole, u32: 0 nadir, 1 length, 2 width
//! 4               8      r and c, u32 each
//! 12              4·r    angles from the pole, radians, f32 each
//! 12 + 4r         4·c    longitudes, radians, f32 each
//! 12 + 4r + 4c    4·r·c  luminous intensities, cd, f32 each: those of the first longitude first
//!
//! a luminaire:
//! 0               4      its web, u32
//! 4               4      the material of its faces, u32
//! 8               36     directions of its axes, 3 × 3 × f32
//! 44              8      n and m, bytes of its name and of its group's name, u32 each
//! 52              n + m  both names, UTF-8
//!
//! a texture:
//! 0               4      n, bytes of its file, u32
//! 4               2      wrap across and down, u8 each: 0 repeat, 1 clamp, 2 mirror
//! 6               1      1 if its bytes are linear, 0 if they are sRGB
//! 7               1      1 if its brightness is an opacity, else 0
//! 8               n      its file: PNG, JPEG, Radiance HDR, EXR, BMP or TGA
//! ```
//!
//! a cover:
//! 0               4      opacity, f32
//! 4               4      texture whose opacity is a factor, u32; 2³²-1 for none
//! 8               4      opacity from which the surface is whole, f32; 0 if it is there with the
//!                        probability of its opacity
//! 12              1      1 if the material is glass only in part, else 0
//! 13              48     in that case: kind of the base, u32; its parameters, 8 × f32, 0 beyond
//!                        the kind's; share of glass: texture, u32, factor, f32, and channel, u32
//!
//! A sky of S bytes, after everything else:
//!
//! ```text
//! 0               4      kind, u32: 0 even, 1 to 4 by a formula (even, overcast, gradation,
//!                        intermediate) above an even ground, 16 a picture
//! 4               4      1 if it has a sun, else 0, u32
//! 8               24     direction towards the sun, 3 × f32, and irradiance, 3 × f32; zero without
//! 32              72     directions of east, north and up in the scene, 3 × f64 each; zero for 0
//! 104             12     by a formula: radiance of the ground, 3 × f32
//! 116             12     factors of the formula's radiance, 3 × f32
//! 128             8      radiance where the formula is 1, f64
//! 136             24     direction of its sun in the horizon's frame, 3 × f64
//! 160             48     factors a, b, k, c, d, e of a gradation, f64 each; else zero
//!
//! 104             4      a picture: w, its width in pixels, u32; it is half as high
//! 108             4      factor of its numbers, f32
//! 112             6·w²   rows of pixels, the zenith first, 3 × f32 each
//! ```
//!
//! A scene has exactly one packing. Damage is found by the content hash, not here. `unpack` returns
//! a valid scene or an error for any bytes.

use crate::limits::{MAX_MATERIALS, MAX_NAME_BYTES, MAX_POSITIONS, MAX_TRIANGLES};
use crate::pack_instances::{pack_instances, unpack_instances};
use crate::pack_shading::{pack_shading, unpack_shading};
use crate::pack_sky::{pack_sky, unpack_sky};
use crate::pack_values::split;
use crate::{Bsdf, Material, PackedError, Rgb, Scene, SceneError, Shading, Sky};
use bytemuck::{Pod, Zeroable};
use glam::DVec3;

/// The first bytes of a packed scene.
pub const MAGIC: [u8; 8] = *b"holoscn\n";

/// The versions of the format that this program writes and reads: of plain scenes, of scenes with
/// normals or textures, and of scenes with instances.
pub const VERSION: u32 = 1;

/// See [`VERSION`].
pub const SHADED_VERSION: u32 = 2;

/// See [`VERSION`].
pub const SHARED_VERSION: u32 = 3;

/// Bytes of a packed scene before its arrays.
pub const HEADER_BYTES: usize = 88;

/// The header as in memory and in the file: bytes only, so that alignment and byte order do not
/// matter.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct PackHeader {
    magic: [u8; 8],
    version: [u8; 4],
    reserved: [u8; 4],
    positions: [u8; 8],
    triangles: [u8; 8],
    materials: [u8; 8],
    material_bytes: [u8; 8],
    origin: [[u8; 8]; 3],
    sky: [[u8; 4]; 3],
    sky_bytes: [u8; 4],
}
const _: () = assert!(size_of::<PackHeader>() == HEADER_BYTES);

/// A material's bytes before its parameters and name.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct MaterialHeader {
    name_bytes: [u8; 4],
    kind: u8,
    flags: u8,
    reserved: [u8; 2],
    emission: [[u8; 4]; 3],
}
const _: () = assert!(size_of::<MaterialHeader>() == 20);

/// The bytes of three 32-bit words.
type Words3 = [[u8; 4]; 3];

const TWO_SIDED: u8 = 1;

impl Scene {
    /// Returns the scene as bytes (format: [`crate::pack`]): 12 per position, 16 per triangle, and
    /// a few more.
    pub fn pack(&self) -> Vec<u8> {
        let mut materials = Vec::new();
        for material in &self.materials {
            pack_material(material, &mut materials);
        }
        let has_lights = !(self.suns.is_empty() && self.punctual_lights.is_empty());
        let is_plain = self.shading.is_none() && !has_lights && self.luminaires.is_none();
        let version = match (&self.shared, is_plain) {
            (Some(_), _) => SHARED_VERSION,
            (None, true) => VERSION,
            (None, false) => SHADED_VERSION,
        };
        let sky = pack_sky(&self.sky);
        let header = PackHeader {
            magic: MAGIC,
            version: version.to_le_bytes(),
            reserved: [0; 4],
            positions: (self.positions.len() as u64).to_le_bytes(),
            triangles: (self.triangles.len() as u64).to_le_bytes(),
            materials: (self.materials.len() as u64).to_le_bytes(),
            material_bytes: (materials.len() as u64).to_le_bytes(),
            origin: self.origin.to_array().map(f64::to_le_bytes),
            sky: self.sky.as_even().unwrap_or_default().map(f32::to_le_bytes),
            sky_bytes: (sky.len() as u32).to_le_bytes(),
        };
        let arrays = 12 * self.positions.len() + 16 * self.triangles.len();
        let mut packed = Vec::with_capacity(HEADER_BYTES + arrays + materials.len());
        packed.extend_from_slice(bytemuck::bytes_of(&header));
        self.positions
            .iter()
            .for_each(|p| packed.extend_from_slice(bytemuck::bytes_of(&p.map(f32::to_le_bytes))));
        self.triangles
            .iter()
            .for_each(|t| packed.extend_from_slice(bytemuck::bytes_of(&t.map(u32::to_le_bytes))));
        self.material_ids.iter().for_each(|id| packed.extend_from_slice(&id.to_le_bytes()));
        packed.extend_from_slice(&materials);
        if let Some(shared) = &self.shared {
            pack_instances(shared, &mut packed);
        }
        if version != VERSION {
            pack_shading(
                self.shading.as_deref().unwrap_or(&Shading::default()),
                (&self.suns, &self.punctual_lights, self.luminaires()),
                &mut packed,
            );
        }
        packed.extend(sky);
        packed
    }

    /// Reads the sky of a packed scene without reading the rest.
    ///
    /// # Errors
    /// As [`unpack`](Self::unpack), as far as the sky is concerned.
    pub fn unpack_sky(packed: &[u8]) -> Result<Sky, SceneError> {
        let too_short =
            PackedError::Length { expected: HEADER_BYTES as u64, found: packed.len() as u64 };
        let (header, rest) = split::<PackHeader>(packed).ok_or(too_short)?;
        let (sky, _) = Self::split_sky(&header, rest)?;
        sky.validate()?;
        Ok(sky)
    }

    /// Takes the sky off the end of the bytes after the header, and returns the rest.
    fn split_sky<'a>(header: &PackHeader, rest: &'a [u8]) -> Result<(Sky, &'a [u8]), SceneError> {
        let radiance = header.sky.map(f32::from_le_bytes);
        let length = u32::from_le_bytes(header.sky_bytes) as usize;
        let at = rest.len().checked_sub(length).ok_or(PackedError::Sky)?;
        let (rest, bytes) = rest.split_at(at);
        let sky = unpack_sky(bytes, Sky::from(radiance))?;
        if sky.as_even().is_none() && header.sky != [[0; 4]; 3] {
            return Err(PackedError::Sky.into());
        }
        Ok((sky, rest))
    }

    /// Reads a packed scene, and checks all of it.
    ///
    /// # Errors
    /// [`SceneError::Packed`] if the bytes are malformed. [`SceneError::Limit`] if their counts
    /// exceed a limit (before memory is allocated). Otherwise as [`Scene::new`].
    pub fn unpack(packed: &[u8]) -> Result<Scene, SceneError> {
        let too_short =
            PackedError::Length { expected: HEADER_BYTES as u64, found: packed.len() as u64 };
        if !packed.starts_with(&MAGIC[..packed.len().min(MAGIC.len())]) {
            return Err(PackedError::Magic.into());
        }
        let (header, rest) = split::<PackHeader>(packed).ok_or(too_short)?;
        let version = u32::from_le_bytes(header.version);
        if ![VERSION, SHADED_VERSION, SHARED_VERSION].contains(&version) {
            return Err(PackedError::Version { found: version, known: VERSION }.into());
        }
        if header.reserved != [0; 4] {
            return Err(PackedError::Reserved.into());
        }
        let (sky, rest) = Self::split_sky(&header, rest)?;
        let positions = bounded("positions", header.positions, MAX_POSITIONS)?;
        let triangles = bounded("triangles", header.triangles, MAX_TRIANGLES)?;
        let materials = bounded("materials", header.materials, MAX_MATERIALS)?;
        let longest = size_of::<MaterialHeader>() + 8 * 4 + MAX_NAME_BYTES;
        let material_bytes =
            bounded("bytes of materials", header.material_bytes, MAX_MATERIALS * longest)?;

        // At most 12·2²⁸ + 16·2²⁸ + 2²⁷. This fits into u64, and into usize once it equals a
        // length.
        let expected = 12 * positions as u64 + 16 * triangles as u64 + material_bytes as u64;
        let has_shading = version != VERSION;
        if (rest.len() as u64) < expected || (!has_shading && rest.len() as u64 != expected) {
            let (expected, found) = (expected + HEADER_BYTES as u64, packed.len() as u64);
            return Err(PackedError::Length { expected, found }.into());
        }
        let (position_bytes, rest) = rest.split_at(12 * positions);
        let (triangle_bytes, rest) = rest.split_at(12 * triangles);
        let (id_bytes, rest) = rest.split_at(4 * triangles);
        let (material_bytes, mut rest) = rest.split_at(material_bytes);
        let instances = match version {
            SHARED_VERSION => Some(unpack_instances(&mut rest, positions, triangles)?),
            _ => None,
        };
        let scene = Scene::unchecked(
            DVec3::from_array(header.origin.map(f64::from_le_bytes)),
            bytemuck::cast_slice::<u8, Words3>(position_bytes)
                .iter()
                .map(|p| p.map(f32::from_le_bytes))
                .collect(),
            bytemuck::cast_slice::<u8, Words3>(triangle_bytes)
                .iter()
                .map(|t| t.map(u32::from_le_bytes))
                .collect(),
            bytemuck::cast_slice::<u8, [u8; 4]>(id_bytes)
                .iter()
                .map(|id| u32::from_le_bytes(*id))
                .collect(),
            unpack_materials(material_bytes, materials)?,
            sky,
        );
        let scene = match instances {
            Some(instances) => instances.share(scene)?,
            None => scene.validated()?,
        };
        if !has_shading {
            return Ok(scene);
        }
        let (shading, (suns, lights, luminaires)) = unpack_shading(rest, triangles, materials)?;
        let scene = scene.with_shading(shading)?.with_suns(suns)?.with_punctual_lights(lights)?;
        let scene = scene.with_luminaires(luminaires)?;
        // A plain scene has another packing.
        let has_lights = !(scene.suns.is_empty() && scene.punctual_lights.is_empty())
            || scene.luminaires.is_some();
        match scene.shading.is_none() && !has_lights && scene.shared.is_none() {
            true => Err(PackedError::Shading.into()),
            false => Ok(scene),
        }
    }

    /// Returns the BLAKE3 hash of the positions, triangles and instances, in this machine's byte
    /// order. Scenes
    /// that differ in materials or light alone have the same.
    pub fn geometry_hash(&self) -> [u8; 32] {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&(self.positions.len() as u64).to_ne_bytes());
        hasher.update(bytemuck::cast_slice(&self.positions));
        hasher.update(bytemuck::cast_slice(&self.triangles));
        if let Some(shared) = &self.shared {
            let mut instances = Vec::new();
            pack_instances(shared, &mut instances);
            hasher.update(&instances);
        }
        *hasher.finalize().as_bytes()
    }

    /// Returns the BLAKE3 hash of a packed scene. Processes use it to identify the scene.
    pub fn content_hash(packed: &[u8]) -> [u8; 32] {
        *blake3::hash(packed).as_bytes()
    }
}

fn bounded(what: &'static str, count: [u8; 8], limit: usize) -> Result<usize, SceneError> {
    let count = u64::from_le_bytes(count);
    usize::try_from(count).ok().filter(|&n| n <= limit).ok_or(SceneError::Limit {
        what,
        count,
        limit: limit as u64,
    })
}

fn pack_material(material: &Material, out: &mut Vec<u8>) {
    let mut parameters = Vec::with_capacity(8);
    let kind = match material.bsdf {
        Bsdf::Diffuse { kd } => {
            parameters.extend(kd);
            0
        }
        Bsdf::Mirror { ks } => {
            parameters.extend(ks);
            1
        }
        Bsdf::Conductor { ks, alpha } => {
            parameters.extend(ks.into_iter().chain([alpha]));
            2
        }
        Bsdf::ThinGlass { ior, transmittance } => {
            parameters.extend([ior].into_iter().chain(transmittance));
            3
        }
        Bsdf::Dielectric { ior, transmittance, alpha } => {
            parameters.extend([ior].into_iter().chain(transmittance).chain([alpha]));
            4
        }
        Bsdf::Coated { kd, ks, ior, alpha } => {
            parameters.extend(kd.into_iter().chain(ks).chain([ior, alpha]));
            5
        }
    };
    let header = MaterialHeader {
        name_bytes: (material.name.len() as u32).to_le_bytes(),
        kind,
        flags: if material.two_sided_emission { TWO_SIDED } else { 0 },
        reserved: [0; 2],
        emission: material.emission.map(f32::to_le_bytes),
    };
    out.extend_from_slice(bytemuck::bytes_of(&header));
    parameters.iter().for_each(|p: &f32| out.extend_from_slice(&p.to_le_bytes()));
    out.extend_from_slice(material.name.as_bytes());
}

fn unpack_materials(mut bytes: &[u8], count: usize) -> Result<Vec<Material>, SceneError> {
    // A material takes at least 32 bytes, so a false count does not allocate memory.
    let mut materials = Vec::with_capacity(count.min(bytes.len() / 32));
    for id in 0..count {
        let (material, rest) = unpack_material(bytes).ok_or(PackedError::Material(id))?;
        materials.push(material);
        bytes = rest;
    }
    if !bytes.is_empty() {
        return Err(PackedError::Material(count).into());
    }
    Ok(materials)
}

fn unpack_material(bytes: &[u8]) -> Option<(Material, &[u8])> {
    let (header, mut rest) = split::<MaterialHeader>(bytes)?;
    if header.flags & !TWO_SIDED != 0 || header.reserved != [0; 2] {
        return None;
    }
    let bsdf = match header.kind {
        0 => Bsdf::Diffuse { kd: colour(&mut rest)? },
        1 => Bsdf::Mirror { ks: colour(&mut rest)? },
        2 => Bsdf::Conductor { ks: colour(&mut rest)?, alpha: number(&mut rest)? },
        3 => Bsdf::ThinGlass { ior: number(&mut rest)?, transmittance: colour(&mut rest)? },
        4 => Bsdf::Dielectric {
            ior: number(&mut rest)?,
            transmittance: colour(&mut rest)?,
            alpha: number(&mut rest)?,
        },
        5 => Bsdf::Coated {
            kd: colour(&mut rest)?,
            ks: colour(&mut rest)?,
            ior: number(&mut rest)?,
            alpha: number(&mut rest)?,
        },
        _ => return None,
    };
    let name_bytes = u32::from_le_bytes(header.name_bytes) as usize;
    if name_bytes > MAX_NAME_BYTES {
        return None;
    }
    let (name, rest) = rest.split_at_checked(name_bytes)?;
    let material = Material {
        name: str::from_utf8(name).ok()?.to_owned(),
        bsdf,
        emission: header.emission.map(f32::from_le_bytes),
        two_sided_emission: header.flags & TWO_SIDED != 0,
    };
    Some((material, rest))
}

fn number(bytes: &mut &[u8]) -> Option<f32> {
    let (number, rest) = split::<[u8; 4]>(bytes)?;
    *bytes = rest;
    Some(f32::from_le_bytes(number))
}

fn colour(bytes: &mut &[u8]) -> Option<Rgb> {
    let (colour, rest) = split::<Words3>(bytes)?;
    *bytes = rest;
    Some(colour.map(f32::from_le_bytes))
}

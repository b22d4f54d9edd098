//! Metallic-roughness materials, as materials of the tracer.
//!
//! | glTF | material |
//! | --- | --- |
//! | `KHR_materials_transmission` 1 with a volume | solid dielectric of `KHR_materials_ior` |
//! | the same without a volume | thin pane of the base colour |
//! | transmission t below 1, or by a texture | the share t of light meets glass, and the rest the rows below |
//! | metallic ≥ 0.5 | mirror if roughness < 0.03, else GGX metal, alpha = roughness² |
//! | `KHR_materials_clearcoat` ≥ 0.5 | diffuse base below a coat of the clearcoat's roughness |
//! | roughness < 0.75 | diffuse base below a coat of alpha = roughness² |
//! | else | diffuse |
//!
//! `alphaMode` `BLEND` is coverage: the surface is there with the probability of its alpha, and
//! elsewhere light passes without a change. `MASK` is there from the cutoff on. Alpha is the
//! product of the factor, the texture and the vertices' colours. Solid glass is always there.
//!
//! Metalness and roughness are the means of their texture here. Tracers make the same decisions at
//! each point from the texture's own values, for all materials except glass and clearcoats.
//!
//! Emission is in cd/m², which 179 lm/W converts to radiance. It is on both sides if the material
//! is double sided.

use std::collections::BTreeMap;

use crate::limits::{MAX_IOR, MAX_NAME_BYTES, MAX_RADIANCE, MIN_IOR};
use crate::units::EFFICACY;
use crate::{Bsdf, LoadOptions, Material, Rgb};

/// Extensions that are read, at least in part.
pub(super) const READ_EXTENSIONS: [&str; 11] = [
    "KHR_lights_punctual",
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

/// Roughness below which a metal is a mirror, and roughness above which a plastic is diffuse.
const MIRROR: f32 = 0.03;
const DIFFUSE: f32 = 0.75;

/// Makes a material. `finish` are factors to its metalness and roughness. `counts` collects what is
/// not represented. Also returns the surface that glass is in part.
pub(super) fn make(
    material: &gltf::Material,
    finish: Option<[f32; 2]>,
    options: &LoadOptions,
    counts: &mut BTreeMap<String, usize>,
) -> (Material, Option<Bsdf>) {
    let mut name = material.name().unwrap_or("default").to_owned();
    while name.len() > MAX_NAME_BYTES {
        name.pop();
    }
    let mut count = |what: &str| *counts.entry(what.to_owned()).or_default() += 1;
    if material.unlit() {
        count("materials without lighting are taken as diffuse");
    }
    let strength = material.emissive_strength().unwrap_or(1.0);
    let emission = material.emissive_factor().map(|c| f64::from(c * strength) / EFFICACY);
    let emission = emission.map(|c| share(c as f32, MAX_RADIANCE));
    let two_sided = material.double_sided() || options.two_sided_lights;
    let two_sided_emission = two_sided && emission.iter().any(|&c| c > 0.0);
    let (bsdf, base) = bsdf(material, finish, &mut count);
    (Material { name, bsdf, emission, two_sided_emission }, base)
}

/// Returns whether a texture of metalness and roughness changes how a material looks.
pub(super) fn has_finish(material: &gltf::Material, made: &Material) -> bool {
    let is_clear = matches!(made.bsdf, Bsdf::ThinGlass { .. } | Bsdf::Dielectric { .. });
    let has_coat = clearcoat(material, "clearcoatFactor") >= 0.5;
    !is_clear && !has_coat && material.pbr_specular_glossiness().is_none()
}

/// Returns a number of `KHR_materials_clearcoat`; 0 if the number is absent.
fn clearcoat(material: &gltf::Material, name: &str) -> f32 {
    let coat = material.extension_value("KHR_materials_clearcoat");
    coat.and_then(|coat| coat.get(name)?.as_f64()).map_or(0.0, |number| number as f32)
}

/// Returns a number clamped to 0 and `most`; 0 for NaN.
fn share(value: f32, most: f32) -> f32 {
    if value > 0.0 { value.min(most) } else { 0.0 }
}

fn bsdf(
    material: &gltf::Material,
    finish: Option<[f32; 2]>,
    count: &mut impl FnMut(&str),
) -> (Bsdf, Option<Bsdf>) {
    let transmission = material.transmission();
    let share = transmission.as_ref().map_or(0.0, |t| share(t.transmission_factor(), 1.0));
    let is_even = transmission.is_none_or(|t| t.transmission_texture().is_none());
    let opaque = opaque(material, finish, share > 0.0, count);
    match share > 0.0 {
        false => (opaque, None),
        true => (glass(material, count), (share < 1.0 || !is_even).then_some(opaque)),
    }
}

/// Returns the scattering of a material as if it transmitted nothing. `is_glass`: it transmits
/// something.
fn opaque(
    material: &gltf::Material,
    finish: Option<[f32; 2]>,
    is_glass: bool,
    count: &mut impl FnMut(&str),
) -> Bsdf {
    let pbr = material.pbr_metallic_roughness();
    let mut base = pbr.base_color_factor();
    let [metalness, rough] = finish.unwrap_or([1.0; 2]);
    let (mut metallic, mut roughness) =
        (pbr.metallic_factor() * metalness, pbr.roughness_factor() * rough);
    if let Some(specular) = material.pbr_specular_glossiness() {
        count("specular-glossiness materials are taken as plastic or metal");
        (base, roughness) = (specular.diffuse_factor(), 1.0 - specular.glossiness_factor());
        metallic = 0.0;
        let shine = specular.specular_factor();
        if shine.iter().any(|&c| c > 0.5) {
            metallic = 1.0;
            base[..3].copy_from_slice(&shine);
        }
    }
    let base: Rgb = [base[0], base[1], base[2]].map(|c| share(c, 1.0));
    let roughness = share(roughness, 1.0);
    let ior = share(material.ior().unwrap_or(1.5), MAX_IOR).max(MIN_IOR);
    let alpha = (roughness * roughness).max(1e-4);
    if (0.05..0.95).contains(&metallic) && finish.is_none() && !is_glass {
        count("materials that are partly metal are taken as metal from a half on");
    }
    if metallic >= 0.5 {
        return match roughness < MIRROR {
            true => Bsdf::Mirror { ks: base },
            false => Bsdf::Conductor { ks: base, alpha },
        };
    }
    if clearcoat(material, "clearcoatFactor") >= 0.5 {
        let alpha = share(clearcoat(material, "clearcoatRoughnessFactor"), 1.0).powi(2).max(1e-4);
        return Bsdf::Coated { kd: base, ks: [1.0; 3], ior: 1.5, alpha };
    }
    let specular = material.specular();
    let strength = specular.as_ref().map_or(1.0, |s| s.specular_factor());
    let tint = specular.as_ref().map_or([1.0; 3], |s| s.specular_color_factor());
    let ks = tint.map(|c| share(c * strength, 1.0));
    if roughness >= DIFFUSE || ks == [0.0; 3] || ior <= 1.0 {
        return Bsdf::Diffuse { kd: base };
    }
    Bsdf::Coated { kd: base, ks, ior, alpha }
}

fn glass(material: &gltf::Material, count: &mut impl FnMut(&str)) -> Bsdf {
    let pbr = material.pbr_metallic_roughness();
    let [r, g, b, _] = pbr.base_color_factor();
    let base: Rgb = [r, g, b].map(|c| share(c, 1.0));
    let roughness = share(pbr.roughness_factor(), 1.0);
    let ior = share(material.ior().unwrap_or(1.5), MAX_IOR).max(MIN_IOR);
    let volume = material.volume().filter(|volume| volume.thickness_factor() > 0.0);
    let Some(volume) = volume else {
        if roughness >= MIRROR {
            count("rough panes are taken as clear ones");
        }
        return Bsdf::ThinGlass { ior, transmittance: base };
    };
    // Half of the absorption on each of the two boundaries that light crosses.
    let lengths = volume.thickness_factor() / volume.attenuation_distance();
    let colour = volume.attenuation_color();
    let absorbed = |k: usize| share(colour[k], 1.0).powf(0.5 * share(lengths, 100.0));
    let transmittance = std::array::from_fn(|k| share(base[k] * absorbed(k), 1.0));
    let alpha = if roughness < MIRROR { 0.0 } else { roughness * roughness };
    Bsdf::Dielectric { ior, transmittance, alpha }
}

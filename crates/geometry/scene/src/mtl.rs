//! The meaning of MTL files: converts their statements to materials.
//!
//! | `illum` | surface |
//! | --- | --- |
//! | 3 | mirror of colour `Ks` if `Ns` ≥ 999 or absent; else a GGX conductor, alpha = √(2/(`Ns`+2)), no Fresnel. Without `Ks`: diffuse, with a warning |
//! | 3, in a file of Blender | a metal of colour `Kd`, as with `Pm` 1 |
//! | 4 | thin pane of index `Ni` (1.5 if absent) and transmission `Tf` (1 if absent); `Kd`, `Ks`, `d` do not count |
//! | 7 | solid dielectric of `Ni`, `Tf`; smooth if `Ns` ≥ 999 or absent, else rough with alpha as above |
//! | any, with `Pm` ≥ 0.5 | GGX conductor of colour `Kd`, alpha = `Pr`² (a mirror below 0.03) |
//! | any but 3 to 7, with `Pr` < 0.75 | diffuse `Kd` under a coat of colour 1, alpha = `Pr`² |
//! | 2 | with `Ks` above zero: diffuse `Kd` under a coat of colour `Ks`, index `Ni` (1.5 if absent or, with a warning, ≤ 1), alpha as above (absent `Ns` = 0, the broadest highlight) |
//! | else | diffuse `Kd` |
//!
//! - **`d` and `Tr` = 1 - `d`** (`d` counts if both exist) is coverage: the surface is there with
//!   probability `d`, and elsewhere light passes without a change. `Tr` of 1 without `d` is opaque,
//!   because programs that write this mean `d`. `d` of 0 beside `map_d` is a program's default, and
//!   does not count. With `illum` 4 and 7, `d` does not count.
//! - **`Tf` in colour beside `d`** below 1 colours the light that passes: the share 1 - `d` of
//!   light meets a thin pane of `Tf`. Beside `d`, a grey `Tf` does not count.
//! - **Blender** states roughness r as `Ns` = 1000 (1 - r)², so alpha is r². It states reflection
//!   at right angles as `Ks` in units of 0.08, 0.5 by default, so the coat's colour is twice `Ks`.
//!   Its files are recognised by their first comment.
//! - **Maya** writes `illum 4` for everything, and `Tf` = 1 - transparency. `illum 4` with `Ni` 1
//!   and `Tf` 1 would be invisible, so `Kd` is diffuse. `illum 4` with `Tf` 0 is clear glass. Where
//!   all materials of a file have Maya's order of statements and one is such paint, any `Tf` is
//!   taken so. Each gives a warning.
//! - **Cinema 4D** writes `illum 7` for everything: it counts as 1, with a warning. Its files are
//!   recognised by their first comment.
//! - **A single sheet of `illum 7`** with open edges is no solid. It is a pane, with a warning.
//! - **A thin slab of `illum 7`** is a pane in its middle, with a warning (module `slabs`).
//! - **One number** stands for three equal ones. `spectral` and `xyz` colours are ignored with a
//!   warning.
//! - **`Kd` absent** is 0.5, with a warning if it matters, but 0 for a lamp (`Ke` above zero).
//! - **Implausible values** are clamped with a warning. A statement is left out with a warning if a
//!   value is not a finite number, or if their number is wrong.
//! - **`Ke`** is radiance, on the counter-clockwise side. `Ka` and `sharpness` have no effect.
//!   `map_Kd` and `map_Ke` are textures that multiply `Kd` and `Ke`, and `map_d` one of `d`.
//!   `Kd` or `Ke` of zero beside its texture is 1. `map_Pr` and `map_Pm` multiply `Pr` and `Pm`,
//!   which are 1 if zero or absent. The rows with `Pr` and `Pm` then hold at each point. `norm` and
//!   `map_Bump` bend normals. `ies lamp.ies` makes luminaires of the material's faces, and
//!   `ies -turn 90 lamp.ies` turns them about their axis. Other textures and unknown statements are
//!   ignored with a warning.
//!   Keywords may be in upper or lower case.

use crate::exporter::{DEFAULT_ROUGHNESS, Exporter};
use crate::limits::{MAX_IOR, MAX_RADIANCE, MIN_IOR};
use crate::mtl_maps::{MapSlot, MapStatement};
use crate::shading::{Base, Channel, Cover};
use crate::text::{excerpt, printable};
use crate::warnings::Warnings;
use crate::{Bsdf, Material, Rgb};
use std::path::PathBuf;

/// A value, and the line that states it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stated<T> {
    pub value: T,
    pub line: usize,
}

/// The statements of an MTL file about one material, before they are interpreted.
#[derive(Debug)]
pub(crate) struct MtlMaterial {
    pub name: String,
    /// The program that wrote the file.
    pub program: Exporter,
    pub path: PathBuf,
    pub line: usize,
    pub kd: Option<Stated<[f64; 3]>>,
    pub ks: Option<Stated<[f64; 3]>>,
    pub ke: Option<Stated<[f64; 3]>>,
    pub tf: Option<Stated<[f64; 3]>>,
    pub ns: Option<Stated<f64>>,
    pub ni: Option<Stated<f64>>,
    pub d: Option<Stated<f64>>,
    pub tr: Option<Stated<f64>>,
    pub illum: Option<Stated<u8>>,
    /// Roughness and metalness, an extension of Blender and others.
    pub pr: Option<Stated<f64>>,
    pub pm: Option<Stated<f64>>,
    pub maps: Vec<MapStatement>,
    /// A photometric file for its faces, with the turn of its luminaires in degrees.
    pub ies: Option<Stated<(String, f64)>>,
}

/// Least `Ns` of a mirror.
const MIRROR_NS: f64 = 999.0;
const DEFAULT_IOR: f64 = 1.5;
/// Least `Pm` of a metal.
const METAL: f32 = 0.5;
/// `Pr` below which a metal is a mirror, and `Pr` above which a plastic is diffuse.
const SMOOTH: f32 = 0.03;
const MATT: f32 = 0.75;
const GREY: f64 = 0.5;

impl MtlMaterial {
    /// Returns the stated roughness and metalness.
    pub(crate) fn finish(&self) -> [Option<f32>; 2] {
        [self.pr, self.pm].map(|stated| stated.map(|n| n.value.clamp(0.0, 1.0) as f32))
    }

    /// Returns the material of the scene and its cover, by the table of this module. `mean` are
    /// roughness and metalness if textures give them.
    pub(crate) fn resolve(
        &self,
        mean: Option<[f32; 2]>,
        two_sided_lights: bool,
        warnings: &mut Warnings,
    ) -> (Material, Cover) {
        let mut warn = |line: usize, text: String| warnings.push(&self.path, Some(line), text);
        let has_map = self.has_map(MapSlot::Emission);
        let is_dark = |ke: &Stated<[f64; 3]>| ke.value.iter().all(|&c| c <= 0.0);
        let ke = self.ke.filter(|ke| !(has_map && is_dark(ke)));
        // A texture of emission without `Ke` emits its own values.
        let plain = if has_map { [1.0; 3] } else { [0.0; 3] };
        let emission = ke.map_or(plain, |ke| clamped("Ke", ke, f64::from(MAX_RADIANCE), &mut warn));
        let emits = emission.iter().any(|&e| e > 0.0) || self.ies.is_some();
        let finish = mean.map_or_else(|| self.finish(), |mean| mean.map(Some));
        let (bsdf, cover) = self.covered(self.bsdf(finish, emits, &mut warn), &mut warn);
        let two_sided_emission = emits && two_sided_lights;
        (Material { name: printable(&self.name), bsdf, emission, two_sided_emission }, cover)
    }

    fn bsdf(
        &self,
        finish: [Option<f32>; 2],
        emits: bool,
        warn: &mut impl FnMut(usize, String),
    ) -> Bsdf {
        let illum = self.illum.map(|illum| illum.value);
        let is_idle = self.is_of(Exporter::Cinema4d) && illum == Some(7);
        let illum = if is_idle { Some(1) } else { illum };
        let illum_line = self.illum.map_or(self.line, |illum| illum.line);
        let finish = self.of_blender(finish, illum);
        if let Some(pbr) = self.metal_or_plastic(finish, illum, emits, warn) {
            return pbr;
        }
        let illum = if self.is_invisible(illum) {
            let text = "`illum 4` with `Ni` 1 and `Tf` 1 is taken as opaque: nobody would see it";
            warn(illum_line, format!("{}: {text}", self.called()));
            Some(1)
        } else {
            illum
        };
        let shines = self.ks.is_some_and(|ks| ks.value.iter().any(|&c| c > 0.0));
        match (illum, self.ks) {
            (Some(3), Some(ks)) => {
                let ks = clamped("Ks", ks, 1.0, warn);
                match self.ns.filter(|ns| ns.value < MIRROR_NS) {
                    None => Bsdf::Mirror { ks },
                    Some(ns) => Bsdf::Conductor { ks, alpha: alpha(ns, warn) },
                }
            }
            (Some(4), _) => {
                Bsdf::ThinGlass { ior: self.ior(warn), transmittance: self.transmittance(warn) }
            }
            (Some(7), _) => {
                let rough = self.ns.filter(|ns| ns.value < MIRROR_NS);
                let alpha = rough.map_or(0.0, |ns| alpha(ns, warn));
                Bsdf::Dielectric {
                    ior: self.ior(warn),
                    transmittance: self.transmittance(warn),
                    alpha,
                }
            }
            (Some(2), Some(ks)) if shines => {
                let ns = self.ns.unwrap_or(Stated { value: 0.0, line: self.line });
                let mut ks = clamped("Ks", ks, 1.0, warn);
                if self.is_of(Exporter::Blender) {
                    ks = ks.map(|c| (2.0 * c).min(1.0));
                }
                let alpha = match self.blender_roughness().filter(|_| self.is_of(Exporter::Blender))
                {
                    Some(roughness) => (roughness * roughness).max(1e-4),
                    None => alpha(ns, warn),
                };
                Bsdf::Coated { kd: self.kd(emits, warn), ks, ior: self.coat_ior(warn), alpha }
            }
            (None, _) => {
                if shines {
                    warn(self.line, format!("{}: `Ks` is ignored without `illum`", self.called()));
                }
                Bsdf::Diffuse { kd: self.kd(emits, warn) }
            }
            _ => {
                let text = match illum {
                    Some(0..=2) => None,
                    Some(3) => Some("`illum 3` without `Ks` is taken as diffuse"),
                    _ => Some("`illum` of this kind is taken as diffuse"),
                };
                if let Some(text) = text {
                    warn(illum_line, format!("{}: {text}", self.called()));
                }
                Bsdf::Diffuse { kd: self.kd(emits, warn) }
            }
        }
    }

    /// Returns roughness and metalness, including those of metals that Blender states in another
    /// way.
    fn of_blender(&self, finish: [Option<f32>; 2], illum: Option<u8>) -> [Option<f32>; 2] {
        let [rough, metal] = finish;
        let is_metal = self.is_of(Exporter::Blender) && illum == Some(3) && metal.is_none();
        if is_metal { [rough.or(self.blender_roughness()), Some(1.0)] } else { finish }
    }

    /// Returns the roughness that Blender means by `Ns`.
    fn blender_roughness(&self) -> Option<f32> {
        self.ns.map(|ns| (1.0 - (ns.value.clamp(0.0, 1000.0) / 1000.0).sqrt()) as f32)
    }

    /// Returns whether it is a pane that neither bends nor reflects nor colours light.
    fn is_invisible(&self, illum: Option<u8>) -> bool {
        let is_air = self.ni.is_some_and(|ni| (ni.value - 1.0).abs() < 1e-6);
        let is_white = self.tf.is_some_and(|tf| tf.value.iter().all(|&c| c >= 1.0));
        let is_paint = is_white && (is_air || self.is_of(Exporter::Maya));
        illum == Some(4) && is_paint && self.opacity().is_none()
    }

    fn is_of(&self, program: Exporter) -> bool {
        self.program == program
    }

    /// Returns whether `Ke` states light.
    pub(crate) fn states_emission(&self) -> bool {
        self.ke.is_some_and(|ke| ke.value.iter().any(|&c| c > 0.0))
    }

    fn has_map(&self, slot: MapSlot) -> bool {
        self.maps.iter().any(|map| map.slot == slot)
    }

    fn called(&self) -> String {
        format!("material `{}`", excerpt(&self.name))
    }

    /// Returns the scattering by roughness and metalness, if these are stated.
    fn metal_or_plastic(
        &self,
        [rough, metal]: [Option<f32>; 2],
        illum: Option<u8>,
        emits: bool,
        warn: &mut impl FnMut(usize, String),
    ) -> Option<Bsdf> {
        let (roughness, metal) = (rough.unwrap_or(DEFAULT_ROUGHNESS), metal.unwrap_or(0.0));
        let alpha = (roughness * roughness).max(1e-4);
        if metal >= METAL {
            let ks = self.kd(emits, warn);
            let is_mirror = roughness < SMOOTH;
            return Some(if is_mirror {
                Bsdf::Mirror { ks }
            } else {
                Bsdf::Conductor { ks, alpha }
            });
        }
        let is_plain = !matches!(illum, Some(3..=7));
        (is_plain && rough.is_some_and(|rough| rough < MATT)).then(|| Bsdf::Coated {
            kd: self.kd(emits, warn),
            ks: [1.0; 3],
            ior: self.coat_ior(warn),
            alpha,
        })
    }

    /// Returns the stated `d`, or that of `Tr`, unless it is opaque.
    fn opacity(&self) -> Option<Stated<f64>> {
        let from_tr = self
            .tr
            .filter(|tr| tr.value != 1.0)
            .map(|tr| Stated { value: 1.0 - tr.value, line: tr.line });
        let has_map = self.has_map(MapSlot::Opacity);
        self.d.or(from_tr).filter(|d| d.value < 1.0 && !(has_map && d.value <= 0.0))
    }

    /// Returns a scattering with its cover, by `d`, `Tr` and `Tf`. Glass is not covered.
    fn covered(&self, bsdf: Bsdf, warn: &mut impl FnMut(usize, String)) -> (Bsdf, Cover) {
        let is_glass = matches!(bsdf, Bsdf::ThinGlass { .. } | Bsdf::Dielectric { .. });
        let Some(d) = self.opacity().filter(|_| !is_glass) else { return (bsdf, Cover::default()) };
        let opacity = d.value.clamp(0.0, 1.0) as f32;
        let is_coloured = |tf: &Stated<[f64; 3]>| tf.value.iter().any(|&c| c != tf.value[0]);
        if let Some(tf) = self.tf.filter(is_coloured) {
            let transmittance = clamped("Tf", tf, 1.0, warn);
            let glass = Channel { texture: None, channel: 0, factor: 1.0 - opacity };
            let base = (opacity > 0.0).then_some(Base { bsdf, glass });
            let pane = Bsdf::ThinGlass { ior: self.ior(warn), transmittance };
            return (pane, Cover { base, ..Cover::default() });
        }
        if opacity == 0.0 {
            let text = "it is nowhere: its `d` is 0, so all light passes";
            warn(d.line, format!("{}: {text}", self.called()));
        }
        (bsdf, Cover { opacity, ..Cover::default() })
    }

    fn kd(&self, emits: bool, warn: &mut impl FnMut(usize, String)) -> Rgb {
        let is_black = |kd: &Stated<[f64; 3]>| kd.value == [0.0; 3];
        match self.kd {
            // Exporters write a black `Kd` beside a texture, or none, and mean the texture.
            None if self.has_map(MapSlot::Base) => [1.0; 3],
            Some(kd) if is_black(&kd) && self.has_map(MapSlot::Base) => [1.0; 3],
            Some(kd) => clamped("Kd", kd, 1.0, warn),
            None if emits => [0.0; 3],
            None => {
                warn(
                    self.line,
                    format!("{}: it has no RGB `Kd`; grey {GREY} is taken", self.called()),
                );
                [GREY as f32; 3]
            }
        }
    }

    fn transmittance(&self, warn: &mut impl FnMut(usize, String)) -> Rgb {
        let Some(tf) = self.tf else { return [1.0; 3] };
        let clear = clamped("Tf", tf, 1.0, warn);
        // No pane transmits nothing: `Tf 0` with `illum 4` is Maya's clear glass.
        let is_pane = self.illum.is_some_and(|illum| illum.value == 4);
        let is_opacity = self.is_of(Exporter::Maya) || (is_pane && clear == [0.0; 3]);
        if is_pane && is_opacity {
            warn(
                tf.line,
                format!("{}: `Tf` is taken as 1 - transparency, as Maya writes it", self.called()),
            );
            return clear.map(|c| 1.0 - c);
        }
        clear
    }

    fn ior(&self, warn: &mut impl FnMut(usize, String)) -> f32 {
        let ni = self.ni.unwrap_or(Stated { value: DEFAULT_IOR, line: self.line });
        let within = ni.value.clamp(f64::from(MIN_IOR), f64::from(MAX_IOR));
        if within != ni.value {
            warn(ni.line, format!("`Ni` {} is impossible; {within} is taken", ni.value));
        }
        (within as f32).clamp(MIN_IOR, MAX_IOR)
    }

    /// Returns the index of refraction of a coat. Exporters write `Ni 1` as a default, with which
    /// the coat would not exist.
    fn coat_ior(&self, warn: &mut impl FnMut(usize, String)) -> f32 {
        match self.ni.filter(|ni| ni.value <= 1.0) {
            Some(ni) => {
                let text = format!(
                    "`Ni` {} would make a coat invisible; {DEFAULT_IOR} is taken",
                    ni.value
                );
                warn(ni.line, text);
                DEFAULT_IOR as f32
            }
            None => self.ior(warn),
        }
    }
}

/// Returns the GGX roughness of a Phong exponent.
fn alpha(ns: Stated<f64>, warn: &mut impl FnMut(usize, String)) -> f32 {
    if ns.value < 0.0 {
        warn(ns.line, format!("`Ns` {} is impossible; 0 is taken", ns.value));
    }
    ((2.0 / (ns.value.max(0.0) + 2.0)).sqrt() as f32).clamp(f32::MIN_POSITIVE, 1.0)
}

fn clamped(
    keyword: &str,
    stated: Stated<[f64; 3]>,
    most: f64,
    warn: &mut impl FnMut(usize, String),
) -> Rgb {
    let clamped = stated.value.map(|c| c.clamp(0.0, most));
    if clamped != stated.value {
        let [r, g, b] = stated.value;
        warn(
            stated.line,
            format!("`{keyword} {r} {g} {b}` is implausible; it is clamped to [0, {most}]"),
        );
    }
    // Rounding to f32 must not exceed the limit again.
    clamped.map(|c| (c as f32).min(most as f32) + 0.0)
}

//! The materials of the interior, for an MTL library.
//!
//! Invariant: reflectances lie within [0, 1]. `illum 3` is a mirror (Ns ≥ 999) or a rough metal,
//! `illum 4` a thin pane, `illum 7` solid glass; everything else is diffuse. Radiances of lights
//! are in W·sr⁻¹·m⁻²: luminous flux / 179 / (π · area).

use std::fmt::{self, Display};

/// A named material.
#[derive(Debug)]
pub struct NamedMaterial {
    /// Its name in the library.
    pub name: &'static str,
    /// How it scatters light.
    pub kind: Scattering,
}

/// How a material scatters light; colours are linear RGB.
#[derive(Clone, Copy, Debug)]
pub enum Scattering {
    /// Lambertian reflection with this albedo.
    Diffuse([f64; 3]),
    /// A metal of this colour and shininess; a perfect mirror from shininess 999.
    Metal([f64; 3], f64),
    /// A thin pane with this transmittance, apart from the reflection of its faces.
    Pane([f64; 3]),
    /// Solid glass.
    Glass([f64; 3]),
    /// Emits this radiance on the outside of its faces.
    Light([f64; 3]),
}

impl NamedMaterial {
    /// Returns whether it emits light.
    #[cfg(test)]
    pub fn is_light(&self) -> bool {
        matches!(self.kind, Scattering::Light(_))
    }
}

/// Writes the material's entry in an MTL library.
impl Display for NamedMaterial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rgb = |key: &str, [r, g, b]: [f64; 3]| format!("{key} {r} {g} {b}\n");
        writeln!(f, "newmtl {}", self.name)?;
        match self.kind {
            Scattering::Diffuse(kd) => writeln!(f, "{}illum 1", rgb("Kd", kd)),
            Scattering::Metal(ks, ns) => writeln!(f, "Kd 0 0 0\n{}Ns {ns}\nillum 3", rgb("Ks", ks)),
            Scattering::Pane(tf) => writeln!(f, "Kd 0 0 0\n{}Ni 1.5\nillum 4", rgb("Tf", tf)),
            Scattering::Glass(tf) => writeln!(f, "Kd 0 0 0\n{}Ni 1.5\nillum 7", rgb("Tf", tf)),
            Scattering::Light(ke) => writeln!(f, "Kd 0.5 0.5 0.5\n{}illum 1", rgb("Ke", ke)),
        }
    }
}

macro_rules! materials {
    ($($id:ident = $name:literal $kind:ident $value:tt;)*) => {
        $(pub static $id: NamedMaterial = NamedMaterial { name: $name, kind: Scattering::$kind $value };)*
        /// All materials, in the order of the library.
        pub static ALL: &[&NamedMaterial] = &[$(&$id),*];
    };
}

materials! {
    PLASTER = "plaster" Diffuse([0.82, 0.80, 0.77]);
    CEILING = "ceiling" Diffuse([0.86, 0.86, 0.84]);
    FACADE = "facade" Diffuse([0.55, 0.52, 0.48]);
    WALL_WARM = "wall_warm" Diffuse([0.74, 0.67, 0.56]);
    WALL_SAGE = "wall_sage" Diffuse([0.52, 0.59, 0.47]);
    WALL_BLUE = "wall_blue" Diffuse([0.42, 0.52, 0.62]);
    TRIM = "trim" Diffuse([0.80, 0.79, 0.76]);
    OAK = "oak" Diffuse([0.50, 0.33, 0.19]);
    OAK_LIGHT = "oak_light" Diffuse([0.57, 0.40, 0.24]);
    OAK_DARK = "oak_dark" Diffuse([0.43, 0.27, 0.15]);
    WALNUT = "walnut" Diffuse([0.24, 0.13, 0.07]);
    BIRCH = "birch" Diffuse([0.68, 0.55, 0.38]);
    LACQUER = "lacquer" Diffuse([0.78, 0.78, 0.76]);
    CABINET = "cabinet" Diffuse([0.16, 0.26, 0.27]);
    STONE = "stone" Diffuse([0.62, 0.60, 0.57]);
    STONE_DARK = "stone_dark" Diffuse([0.10, 0.10, 0.11]);
    TILE_FLOOR = "tile_floor" Diffuse([0.48, 0.46, 0.43]);
    TILE_FLOOR_DARK = "tile_floor_dark" Diffuse([0.34, 0.33, 0.32]);
    TILE_WHITE = "tile_white" Diffuse([0.82, 0.83, 0.82]);
    TILE_SEA = "tile_sea" Diffuse([0.20, 0.50, 0.50]);
    TILE_SEA_DEEP = "tile_sea_deep" Diffuse([0.12, 0.38, 0.42]);
    GROUT = "grout" Diffuse([0.55, 0.54, 0.52]);
    CERAMIC = "ceramic" Diffuse([0.85, 0.85, 0.84]);
    CERAMIC_BLUE = "ceramic_blue" Diffuse([0.08, 0.16, 0.38]);
    CLAY = "clay" Diffuse([0.52, 0.24, 0.13]);
    FABRIC = "fabric" Diffuse([0.46, 0.45, 0.43]);
    FABRIC_DARK = "fabric_dark" Diffuse([0.16, 0.17, 0.19]);
    LEATHER = "leather" Diffuse([0.36, 0.16, 0.07]);
    LINEN = "linen" Diffuse([0.80, 0.77, 0.71]);
    SHEET = "sheet" Diffuse([0.84, 0.84, 0.85]);
    CURTAIN = "curtain" Diffuse([0.72, 0.68, 0.60]);
    CURTAIN_BLUE = "curtain_blue" Diffuse([0.20, 0.28, 0.42]);
    MUSTARD = "mustard" Diffuse([0.68, 0.42, 0.07]);
    TEAL = "teal" Diffuse([0.06, 0.34, 0.36]);
    CORAL = "coral" Diffuse([0.72, 0.25, 0.18]);
    RUG = "rug" Diffuse([0.62, 0.55, 0.46]);
    RUG_RED = "rug_red" Diffuse([0.42, 0.09, 0.08]);
    RUG_NAVY = "rug_navy" Diffuse([0.07, 0.10, 0.20]);
    LEAF = "leaf" Diffuse([0.10, 0.30, 0.06]);
    LEAF_LIGHT = "leaf_light" Diffuse([0.22, 0.42, 0.10]);
    LEAF_DARK = "leaf_dark" Diffuse([0.05, 0.18, 0.06]);
    LAWN = "lawn" Diffuse([0.09, 0.17, 0.05]);
    SLATE = "slate" Diffuse([0.26, 0.26, 0.27]);
    SOIL = "soil" Diffuse([0.09, 0.06, 0.04]);
    PAPER = "paper" Diffuse([0.78, 0.75, 0.68]);
    INK = "ink" Diffuse([0.05, 0.05, 0.06]);
    LIME = "lime" Diffuse([0.45, 0.56, 0.08]);
    STEEL = "brushed_steel" Metal([0.62, 0.61, 0.60], 120.0);
    BRASS = "brushed_brass" Metal([0.78, 0.56, 0.26], 200.0);
    COPPER = "satin_copper" Metal([0.80, 0.45, 0.33], 60.0);
    CHROME = "chrome" Metal([0.70, 0.71, 0.72], 300.0);
    MIRROR = "mirror" Metal([0.90, 0.92, 0.91], 10000.0);
    WINDOW = "window_glass" Pane([0.96, 0.98, 0.97]);
    TABLE_GLASS = "table_glass" Pane([0.86, 0.95, 0.92]);
    CRYSTAL = "crystal" Glass([0.99, 0.99, 0.99]);
    AMBER = "amber_glass" Glass([0.95, 0.62, 0.22]);
    AQUA = "aqua_glass" Glass([0.55, 0.86, 0.88]);
    PANEL = "light_panel" Light([9.0, 8.3, 7.2]);
    SPOT = "light_spot" Light([110.0, 94.0, 72.0]);
    GLOBE = "light_globe" Light([17.0, 13.2, 8.6]);
    BULB = "light_bulb" Light([60.0, 44.0, 26.0]);
    SHADE = "light_shade" Light([4.2, 3.0, 1.75]);
    STRIP = "light_strip" Light([20.0, 16.4, 11.8]);
    STRIP_COOL = "light_strip_cool" Light([22.0, 22.5, 22.0]);
    FLAME = "light_flame" Light([75.0, 38.0, 11.0]);
}

/// Colours of book spines.
pub static BOOKS: &[&NamedMaterial] = &[
    &CORAL,
    &TEAL,
    &MUSTARD,
    &RUG_NAVY,
    &PAPER,
    &LEATHER,
    &RUG_RED,
    &FABRIC_DARK,
    &LINEN,
    &CERAMIC_BLUE,
    &WALL_SAGE,
];

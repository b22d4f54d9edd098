//! The bundled scenes: a Cornell box, a corridor that is lit only indirectly, and a furnished
//! interior; models as other programs write them; scenes for measurements; and a teapot. This crate
//! generates all of them.
//!
//! Invariant: a scene has the same bytes each time that it is made. A bundled one is closed except
//! for its windows. Lights shine on the counter-clockwise side of their faces, into the rooms.

mod building;
mod config;
mod cornell;
mod corridor;
mod furniture;
mod garden;
mod material;
mod mesh;
mod models;
mod obj;
mod papers;
mod random;
mod reflections;
mod rooms;
mod shapes;
mod teapot;
#[cfg(test)]
mod tests;

pub use models::{MODELS, write_model};
pub use papers::write_papers;
pub use reflections::write_reflections;
pub use teapot::write_teapot;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// A scene that this crate makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bundled {
    /// The Cornell box: 32 triangles, one lamp, units of 100 mm, +Y up.
    Cornell,
    /// A corridor with a bend and an open door to a lit room, from which the lamp is not visible:
    /// 70 triangles, metres, +Z up.
    Corridor,
    /// A house of five rooms and a hallway with about 300,000 triangles and 90 lamps, metres, +Z
    /// up.
    Interior,
}

/// The files that [`write()`] made.
#[derive(Clone, Debug)]
pub struct Written {
    /// The OBJ file; its MTL file is beside it.
    pub obj: PathBuf,
    /// The configuration for `holodeck --config`.
    pub config: PathBuf,
}

impl Bundled {
    /// All scenes.
    pub const ALL: [Self; 3] = [Self::Cornell, Self::Corridor, Self::Interior];

    /// Returns the scene's name, which is also the name of its files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cornell => "cornell",
            Self::Corridor => "corridor",
            Self::Interior => "interior",
        }
    }

    /// Returns the scene with this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|scene| scene.name() == name)
    }
}

/// Writes NAME.obj, NAME.mtl and NAME.toml into `dir`, which is created if it does not exist.
///
/// # Errors
/// Those of the file system.
pub fn write(scene: Bundled, dir: &Path) -> io::Result<Written> {
    fs::create_dir_all(dir)?;
    let path = |extension: &str| dir.join(format!("{}.{extension}", scene.name()));
    let (obj, mtl) = obj_and_mtl(scene);
    fs::write(path("mtl"), mtl)?;
    fs::write(path("toml"), config(scene))?;
    fs::write(path("obj"), obj)?;
    Ok(Written { obj: path("obj"), config: path("toml") })
}

/// Returns the texts of the OBJ file and of the MTL file that it names.
pub fn obj_and_mtl(scene: Bundled) -> (String, String) {
    match scene {
        Bundled::Cornell => (cornell::obj(), cornell::MTL.to_owned()),
        Bundled::Corridor => (corridor::obj(), corridor::MTL.to_owned()),
        Bundled::Interior => {
            let library = material::ALL
                .iter()
                .map(|material| material.to_string())
                .collect::<Vec<_>>()
                .join("\n");
            (obj::write(&rooms::interior(), "interior.mtl"), library)
        }
    }
}

/// Returns the text of the configuration: scene, up axis, unit, sections and views. The first view
/// is the initial one.
pub fn config(scene: Bundled) -> String {
    match scene {
        Bundled::Cornell => cornell::CONFIG.to_owned(),
        Bundled::Corridor => corridor::CONFIG.to_owned(),
        Bundled::Interior => config::interior(),
    }
}

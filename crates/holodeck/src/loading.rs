//! Loading the scene: how far it is, and what is wrong with it.

use std::{path::Path, time::Instant};

use anyhow::Result;
use holo_progress::{HumanBytes, HumanCount, Meter};
use holo_scene::{Bsdf, LoadOptions, LoadProgress, Loaded, Material, Scene, load_watched};

use crate::{config::Config, scene_args::scene_path};

/// Albedo from which a material is named. Paints stay below, and light in a closed room takes as many
/// reflections as 1 / (1 - albedo).
const WHITE_ALBEDO: f32 = 0.95;

/// Loads the configuration's scene. Warnings go to standard error, and unless `quiet`, how far it
/// is.
///
/// # Errors
/// If there is no scene or it cannot be loaded.
pub fn load(config: &Config, quiet: bool) -> Result<Loaded> {
    let path = scene_path(config)?;
    let loaded = load_file(path, config, quiet)?;
    for (name, albedo) in white_materials(&loaded.scene) {
        eprintln!(
            "{}: material `{name}` reflects {:.0} % of the light, more than any paint: rooms closed by \
             it are too bright, and stay noisy for long; use a `Kd` below {WHITE_ALBEDO}",
            path.display(),
            100.0 * albedo
        );
    }
    Ok(loaded)
}

/// Loads the configuration's scene, and says nothing: the caller has the warnings.
pub fn load_quietly(config: &Config) -> Result<Loaded> {
    Ok(holo_scene::load(scene_path(config)?, &options(config))?)
}

fn options(config: &Config) -> LoadOptions {
    LoadOptions {
        sky: config.sky.unwrap_or([0.0; 3]),
        two_sided_lights: config.two_sided_lights.unwrap_or(false),
    }
}

/// Returns the names and albedos of diffuse materials on faces that absorb hardly any light.
fn white_materials(scene: &Scene) -> Vec<(&str, f32)> {
    let is_used = |index: usize| scene.material_ids.iter().any(|&id| id as usize == index);
    let albedo = |material: &Material| match material.bsdf {
        Bsdf::Diffuse { kd } | Bsdf::Coated { kd, .. } => kd.into_iter().fold(0.0, f32::max),
        _ => 0.0,
    };
    let materials = scene.materials.iter().enumerate();
    // Under a texture, white is a factor.
    let maps = |index: usize| scene.shading.as_ref()?.maps.get(index)?.base;
    let has_colours = scene.shading.as_ref().is_some_and(|shading| !shading.colours.is_empty());
    let white = materials.filter(|(index, material)| {
        let is_factor = has_colours || maps(*index).is_some();
        albedo(material) >= WHITE_ALBEDO && !is_factor && is_used(*index)
    });
    white.map(|(_, material)| (material.name.as_str(), albedo(material))).collect()
}

/// Loads any OBJ file with the configuration's options.
pub fn load_file(path: &Path, config: &Config, quiet: bool) -> Result<Loaded> {
    let options = options(config);
    let mut meter = Meter::new(quiet);
    let start = Instant::now();
    let mut watch = |progress: LoadProgress| {
        let share = progress.bytes as f64 / progress.total_bytes as f64;
        meter.show(share, &progress_words(path, progress, start.elapsed().as_secs_f64()));
    };
    let loaded = load_watched(path, &options, &mut watch);
    meter.finish();
    let loaded = loaded?;
    for warning in &loaded.warnings {
        eprintln!("{warning}");
    }
    Ok(loaded)
}

fn progress_words(path: &Path, progress: LoadProgress, seconds: f64) -> String {
    format!(
        "reading {}: {} of {}, {} triangles, {}/s",
        path.display(),
        HumanBytes(progress.bytes),
        HumanBytes(progress.total_bytes),
        HumanCount(progress.triangles),
        HumanBytes((progress.bytes as f64 / seconds.max(1e-3)) as u64)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn materials_that_absorb_nothing_are_named_if_they_are_used() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("room.obj");
        let mtl = "newmtl snow\nKd 0.9 0.96 0.9\nnewmtl paint\nKd 0.94 0.94 0.94\nnewmtl spare\nKd 1 1 1\n";
        std::fs::write(folder.path().join("room.mtl"), mtl).unwrap();
        let obj = "mtllib room.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n\
                   usemtl snow\nf 1 2 3\nusemtl paint\nf 1 2 4\n";
        std::fs::write(&path, obj).unwrap();
        let scene = load_file(&path, &Config::default(), true).unwrap().scene;
        assert_eq!(white_materials(&scene), [("snow", 0.96)]);
    }

    #[test]
    fn a_long_load_says_how_far_it_is_and_how_fast() {
        let progress = LoadProgress { bytes: 30 << 20, total_bytes: 120 << 20, triangles: 450_000 };
        assert_eq!(
            progress_words(Path::new("a.obj"), progress, 2.0),
            "reading a.obj: 30.00 MiB of 120.00 MiB, 450,000 triangles, 15.00 MiB/s"
        );
    }
}

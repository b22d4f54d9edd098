//! Loading the scene: how far it is, and what is wrong with it.

use std::{path::Path, time::Instant};

use anyhow::Result;
use holo_progress::{HumanBytes, HumanCount, Meter};
use holo_scene::{Bsdf, LoadOptions, LoadProgress, Loaded, Material, Scene, load_watched};

use crate::{config::Config, scene_args::scene_path};

/// Greatest albedo that gives no warning. Above, the tracer does not promise a finite variance.
const MOST_ALBEDO: f32 = 0.99;

/// Loads the configuration's scene. Warnings go to standard error, and unless `quiet`, how far it
/// is.
///
/// # Errors
/// If there is no scene or it cannot be loaded.
pub fn load(config: &Config, quiet: bool) -> Result<Loaded> {
    let path = scene_path(config)?;
    let loaded = load_file(path, config, quiet)?;
    for name in white_materials(&loaded.scene) {
        eprintln!(
            "{}: material `{name}` reflects all light, which no paint does: rooms closed by it stay \
             noisy for long; use a `Kd` of at most 0.95",
            path.display()
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

/// Returns the names of diffuse materials whose faces absorb less than 1 % of some channel.
fn white_materials(scene: &Scene) -> Vec<&str> {
    let is_used = |index: usize| scene.material_ids.iter().any(|&id| id as usize == index);
    let is_white = |material: &Material| match material.bsdf {
        Bsdf::Diffuse { kd } | Bsdf::Coated { kd, .. } => kd.iter().any(|&kd| kd > MOST_ALBEDO),
        _ => false,
    };
    let materials = scene.materials.iter().enumerate();
    // Under a texture, white is a factor.
    let maps = |index: usize| scene.shading.as_ref()?.maps.get(index)?.base;
    let white = materials.filter(|(index, material)| {
        is_white(material) && is_used(*index) && maps(*index).is_none()
    });
    white.map(|(_, material)| material.name.as_str()).collect()
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
        let mtl = "newmtl snow\nKd 1 1 1\nnewmtl paint\nKd 0.9 0.9 0.9\nnewmtl spare\nKd 1 1 1\n";
        std::fs::write(folder.path().join("room.mtl"), mtl).unwrap();
        let obj = "mtllib room.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n\
                   usemtl snow\nf 1 2 3\nusemtl paint\nf 1 2 4\n";
        std::fs::write(&path, obj).unwrap();
        let scene = load_file(&path, &Config::default(), true).unwrap().scene;
        assert_eq!(white_materials(&scene), ["snow"]);
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

//! Loads the scene, and reports progress and warnings.

use std::{path::Path, time::Instant};

use anyhow::Result;
use holo_progress::{HumanBytes, HumanCount, Meter};
use holo_scene::{LoadOptions, LoadProgress, Loaded, load_watched};
use holo_survey::white_materials;

use crate::{config::HolodeckConfig, settings::scene_path};

/// Loads the configuration's scene. Warnings go to standard error, and so does the progress unless
/// `quiet`.
///
/// # Errors
/// If there is no scene or it cannot be loaded.
pub fn load(config: &HolodeckConfig, quiet: bool) -> Result<Loaded> {
    let path = scene_path(config)?;
    let loaded = load_file(path, config, quiet)?;
    for (name, albedo) in white_materials(&loaded.scene) {
        eprintln!(
            "{}: material `{name}` reflects {:.0} % of the light, more than any paint: rooms closed by \
             it are too bright, and stay noisy for long; use a reflectance below 0.95",
            path.display(),
            100.0 * albedo
        );
    }
    Ok(loaded)
}

/// Loads the configuration's scene without output. The caller gets the warnings.
pub fn load_quietly(config: &HolodeckConfig) -> Result<Loaded> {
    Ok(holo_scene::load(scene_path(config)?, &options(config))?)
}

fn options(config: &HolodeckConfig) -> LoadOptions {
    LoadOptions {
        sky: config.light().radiance().unwrap_or([0.0; 3]),
        two_sided_lights: config.two_sided_lights.unwrap_or(false),
    }
}

/// Loads any OBJ file with the configuration's options.
pub fn load_file(path: &Path, config: &HolodeckConfig, quiet: bool) -> Result<Loaded> {
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
        let scene = load_file(&path, &HolodeckConfig::default(), true).unwrap().scene;
        assert_eq!(white_materials(&scene), [("snow", 0.96)]);
    }

    #[test]
    fn a_long_load_reports_progress_and_speed() {
        let progress = LoadProgress { bytes: 30 << 20, total_bytes: 120 << 20, triangles: 450_000 };
        assert_eq!(
            progress_words(Path::new("a.obj"), progress, 2.0),
            "reading a.obj: 30.00 MiB of 120.00 MiB, 450,000 triangles, 15.00 MiB/s"
        );
    }
}

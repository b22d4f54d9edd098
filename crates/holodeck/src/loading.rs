//! Loading the scene: how far it is, and what is wrong with it.

use std::{path::Path, time::Instant};

use anyhow::Result;
use holo_progress::{HumanBytes, HumanCount, Meter};
use holo_scene::{LoadOptions, LoadProgress, Scene, load_obj_watched};

use crate::{config::Config, scene_args::scene_path};

/// Loads the configuration's scene. Warnings go to standard error, and unless `quiet`, how far it
/// is.
///
/// # Errors
/// If there is no scene or it cannot be loaded.
pub fn load(config: &Config, quiet: bool) -> Result<Scene> {
    let path = scene_path(config)?;
    let scene = load_file(path, config, quiet)?;
    let features = scene.features();
    if features.emitters == 0 && !features.sky {
        eprintln!(
            "{}: nothing gives light, so all pictures will be black: give a material `Ke` in the \
             MTL file, or add a sky, such as --sky 1,1,1",
            path.display()
        );
    }
    Ok(scene)
}

/// Loads any OBJ file with the configuration's options.
pub fn load_file(path: &Path, config: &Config, quiet: bool) -> Result<Scene> {
    let options = LoadOptions {
        sky: config.sky.unwrap_or([0.0; 3]),
        two_sided_lights: config.two_sided_lights.unwrap_or(false),
    };
    let mut meter = Meter::new(quiet);
    let start = Instant::now();
    let mut watch = |progress: LoadProgress| {
        let share = progress.bytes as f64 / progress.total_bytes as f64;
        meter.show(share, &progress_words(path, progress, start.elapsed().as_secs_f64()));
    };
    let loaded = load_obj_watched(path, &options, &mut watch);
    meter.finish();
    let loaded = loaded?;
    for warning in &loaded.warnings {
        eprintln!("{warning}");
    }
    Ok(loaded.scene)
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
    fn a_long_load_says_how_far_it_is_and_how_fast() {
        let progress = LoadProgress { bytes: 30 << 20, total_bytes: 120 << 20, triangles: 450_000 };
        assert_eq!(
            progress_words(Path::new("a.obj"), progress, 2.0),
            "reading a.obj: 30.00 MiB of 120.00 MiB, 450,000 triangles, 15.00 MiB/s"
        );
    }
}

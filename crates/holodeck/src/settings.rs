//! What a configuration means: its scene, and the settings of samples.

use std::path::PathBuf;

use anyhow::{Result, ensure};
use holo_proto::control::{Engine, RenderSettings};

use crate::config::{self, HolodeckConfig};

/// Wrong usage, in words for people: no scene is named, or options exclude each other.
#[derive(Debug)]
pub struct Usage(pub String);

impl std::fmt::Display for Usage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Usage {}

/// Returns the settings of samples. `engine` is the default for a configuration without an engine.
pub fn settings(config: &HolodeckConfig, engine: Engine) -> RenderSettings {
    RenderSettings {
        engine: config.engine.unwrap_or(engine),
        bounces: config.bounces,
        paths_per_sample: config.paths_per_sample.unwrap_or(1).max(1),
        seed: config.seed.unwrap_or(0),
        virtual_distance: config.virtual_distance.unwrap_or(false),
    }
}

/// Returns the path of the scene.
///
/// # Errors
/// If the configuration has no scene.
pub fn scene_path(config: &HolodeckConfig) -> Result<&PathBuf> {
    let path = config.scene.as_ref();
    path.ok_or_else(|| {
        Usage(
            "no scene: name a model (.obj, .gltf, .glb), or a configuration with a `scene`".into(),
        )
        .into()
    })
}

/// Checks that the unit and the up axis can be used.
pub fn check_units(config: &HolodeckConfig) -> Result<()> {
    ensure!(
        config.unit.is_none_or(|unit| unit.0.is_finite() && unit.0 > 0.0),
        "`unit` must be a positive number of metres"
    );
    let usable = |config::Up(up)| up.iter().all(|x| x.is_finite()) && up.iter().any(|&x| x != 0.0);
    ensure!(config.up.is_none_or(usable), "`up` must be a direction");
    Ok(())
}

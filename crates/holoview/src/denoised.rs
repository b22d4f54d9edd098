//! Denoising of traced pictures by Open Image Denoise.

use std::sync::Arc;

use anyhow::Result;
use holo_driver_surfaces::{Materials, View};
use holo_picture::Picture;
use holo_raycast::Raycaster;

use crate::args::DenoiseArg;

/// Denoises a traced picture of a scene. Its view tells what pixels see. Returns whether there is a
/// denoiser.
///
/// # Errors
/// If the library that was named cannot be loaded, or fails.
pub fn denoise(
    wanted: &DenoiseArg,
    raycaster: Arc<Raycaster>,
    picture: &mut Picture,
) -> Result<bool> {
    let (Some(mut denoiser), Some(eye)) = (wanted.load()?, picture.view) else {
        return Ok(false);
    };
    let materials = Arc::new(Materials::new(raycaster.scene()));
    let view = View::new(raycaster, materials, &eye, (picture.width, picture.height));
    let (albedo, normals) = view.features();
    denoiser.denoise(&mut picture.pixels, &albedo, &normals, view.size)?;
    picture.pixels.iter_mut().flatten().for_each(|c| *c = c.max(0.0));
    Ok(true)
}

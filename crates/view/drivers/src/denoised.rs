//! Denoising of traced pictures by Open Image Denoise.

use std::sync::Arc;

use anyhow::Result;
use holo_denoise::Denoiser;
use holo_driver_surfaces::{Materials, SurfaceView};
use holo_picture::Picture;
use holo_raycast::Raycaster;

/// Denoises a traced picture of a scene. Albedo and normals of its pixels follow from its view; a
/// picture without a view stays as it is.
///
/// # Errors
/// If the library fails.
pub fn denoise(
    denoiser: &mut Denoiser,
    raycaster: Arc<Raycaster>,
    picture: &mut Picture,
) -> Result<()> {
    let Some(eye) = picture.view else { return Ok(()) };
    let materials = Arc::new(Materials::new(raycaster.scene()));
    let view = SurfaceView::new(raycaster, materials, &eye, (picture.width, picture.height));
    let (albedo, normals) = view.features();
    denoiser.denoise(&mut picture.pixels, &albedo, &normals, view.size, &|| true)?;
    picture.pixels.iter_mut().flatten().for_each(|c| *c = c.max(0.0));
    Ok(())
}

//! Open Image Denoise (OIDN 2), loaded at run time if it is installed.
//!
//! The program is not linked to the library, so it also runs on a machine without the library.
//!
//! Invariants:
//! - Every call into the library is checked. A failure is an error and leaves the picture
//!   unchanged.
//! - Only the processor is used, and no thread is pinned to a core.

#![allow(unsafe_code)]

mod api;
mod error;
mod places;
mod quality;

use std::path::{Path, PathBuf};

pub use api::GoesOn;
use api::{Api, Device, Filter};
pub use error::DenoiseError;
use places::NAME;
pub use quality::Quality;

/// Returns the library that [`Denoiser::load`] finds without a path: its file, or the name by which
/// the system finds it.
#[must_use]
pub fn installed() -> Option<PathBuf> {
    let mut files = std::iter::once(PathBuf::from(NAME)).chain(places::candidates());
    files.find(|file| Api::load(file).is_ok())
}

/// The denoiser.
pub struct Denoiser {
    filter: Filter,
    /// A grey of 0.5, for light without texture.
    grey: Vec<[f32; 3]>,
    output: Vec<[f32; 3]>,
}

impl Denoiser {
    /// Loads the library from `path`. If `path` is `None`, looks in the system's library folders,
    /// among the packages of Python, and in Blender's folder.
    ///
    /// # Errors
    /// If the library is not found, is not version 2, or cannot use this processor.
    pub fn load(path: Option<&Path>, quality: Quality) -> Result<Denoiser, DenoiseError> {
        let Some(path) = path else { return Self::find(quality) };
        let device = Device::new(Api::load(path)?)?;
        let filter = Filter::new(device, quality)?;
        Ok(Denoiser { filter, grey: Vec::new(), output: Vec::new() })
    }

    /// Loads the first library that can be used. Returns the error of the system's own library if
    /// there is none.
    fn find(quality: Quality) -> Result<Denoiser, DenoiseError> {
        let system = match Self::load(Some(Path::new(NAME)), quality) {
            Ok(denoiser) => return Ok(denoiser),
            Err(error) => error,
        };
        let mut others = places::candidates().into_iter();
        others.find_map(|file| Self::load(Some(&file), quality).ok()).ok_or(system)
    }

    /// Denoises light on surfaces, which has no texture. See [`denoise`](Self::denoise).
    ///
    /// # Errors
    /// If the sizes differ, or the library fails. `light` is then unchanged.
    pub fn denoise_light(
        &mut self,
        light: &mut [[f32; 3]],
        normals: &[[f32; 3]],
        size: (usize, usize),
        goes_on: GoesOn<'_>,
    ) -> Result<(), DenoiseError> {
        let mut grey = std::mem::take(&mut self.grey);
        grey.resize(light.len(), [0.5; 3]);
        let denoised = self.denoise(light, &grey, normals, size, goes_on);
        self.grey = grey;
        denoised
    }

    /// Denoises `light`, in rows of `size.0` pixels. Values are finite, not negative, and in any
    /// unit. `albedo` is between 0 and 1. `normals` are unit vectors, or 0 where there is no
    /// surface. Ends early once `goes_on` returns false.
    ///
    /// # Errors
    /// If the sizes differ, the library fails, or the work ends early. `light` is then unchanged.
    pub fn denoise(
        &mut self,
        light: &mut [[f32; 3]],
        albedo: &[[f32; 3]],
        normals: &[[f32; 3]],
        size: (usize, usize),
        goes_on: GoesOn<'_>,
    ) -> Result<(), DenoiseError> {
        let (width, height) = size;
        let lengths =
            [("light", light.len()), ("albedo", albedo.len()), ("normals", normals.len())];
        for (what, found) in lengths {
            if width.checked_mul(height) != Some(found) {
                return Err(DenoiseError::Size { what, found, width, height });
            }
        }
        if light.is_empty() {
            return Ok(());
        }
        self.output.clear();
        self.output.resize(light.len(), [0.0; 3]);
        self.filter.run(light, albedo, normals, &mut self.output, size, goes_on)?;
        light.copy_from_slice(&self.output);
        Ok(())
    }
}

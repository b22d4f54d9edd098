//! The denoiser with the library, and its error without.

#![allow(clippy::unwrap_used, missing_docs)]

use std::path::Path;

use holo_denoise::{DenoiseError, Denoiser, GoesOn, Quality};

const SIZE: (usize, usize) = (64, 48);

/// Work that nobody ends early.
const GOES_ON: GoesOn<'_> = &|| true;

#[test]
fn a_library_that_is_not_there_is_named() {
    let error =
        Denoiser::load(Some(Path::new("/nowhere/liboidn.so")), Quality::High).err().unwrap();
    assert!(matches!(error, DenoiseError::Load { .. }));
    assert!(error.to_string().contains("/nowhere/liboidn.so"), "{error}");
}

#[test]
fn another_library_is_refused() {
    let libraries = ["libc.so.6", "libSystem.dylib", "kernel32.dll"];
    let errors =
        libraries.map(|name| Denoiser::load(Some(Path::new(name)), Quality::High).err().unwrap());
    assert!(errors.iter().all(|error| matches!(error, DenoiseError::Load { .. })));
}

/// Light of 1 on the left and 2 on the right, with noise of 50 %.
fn noisy() -> Vec<[f32; 3]> {
    let random = |n: usize| (n as u32).wrapping_mul(2_654_435_761).wrapping_add(12345);
    let pixel = |n: usize| {
        let noise = 0.5 + f32::from((random(n * n + 7) >> 16) as u16) / 65536.0;
        [noise * if n % SIZE.0 < SIZE.0 / 2 { 1.0 } else { 2.0 }; 3]
    };
    (0..SIZE.0 * SIZE.1).map(pixel).collect()
}

#[test]
fn where_the_library_is_installed_noise_goes_and_edges_stay() {
    let path = std::env::var_os("HOLODECK_TEST_OIDN");
    let Ok(mut denoiser) = Denoiser::load(path.as_deref().map(Path::new), Quality::High) else {
        println!("skipped: Open Image Denoise is not installed");
        return;
    };
    let mut light = noisy();
    let normals = vec![[0.0, 0.0, 1.0]; light.len()];
    let error = |light: &[[f32; 3]]| {
        let off = |(n, pixel): (usize, &[f32; 3])| {
            let wanted = if n % SIZE.0 < SIZE.0 / 2 { 1.0 } else { 2.0 };
            f64::from(pixel[1] - wanted).powi(2)
        };
        light.iter().enumerate().map(off).sum::<f64>() / light.len() as f64
    };
    let before = error(&light);
    denoiser.denoise_light(&mut light, &normals, SIZE, GOES_ON).unwrap();
    assert!(error(&light) < 0.1 * before, "{} of {before}", error(&light));
    // Pictures of another size, and wrong numbers of pixels.
    let mut few = vec![[1.0; 3]; 12];
    denoiser.denoise_light(&mut few, &[[0.0; 3]; 12], (4, 3), GOES_ON).unwrap();
    assert!(few.iter().flatten().all(|c| c.is_finite() && *c > 0.0), "{few:?}");
    let wrong = denoiser.denoise_light(&mut few, &[[0.0; 3]; 11], (4, 3), GOES_ON);
    assert!(matches!(wrong, Err(DenoiseError::Size { what: "normals", found: 11, .. })));
    // Work that is ended early leaves the picture, and the denoiser works again afterwards.
    let noise = noisy();
    let mut light = noise.clone();
    let ended = denoiser.denoise_light(&mut light, &normals, SIZE, &|| false);
    assert!(matches!(ended, Err(DenoiseError::Ended)), "{ended:?}");
    assert!(light == noise);
    denoiser.denoise_light(&mut light, &normals, SIZE, GOES_ON).unwrap();
    assert!(error(&light) < 0.1 * before);
}

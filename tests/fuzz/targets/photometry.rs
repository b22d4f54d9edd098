//! A photometric file: what is read has a finite flux, and an intensity in every direction.
#![no_main]

use glam::Vec3;
use holo_photometry::Photometry;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let Ok(read) = Photometry::read(bytes) else { return };
    assert!(read.web.flux() >= 0.0 && read.web.flux().is_finite(), "{}", read.web.flux());
    let (_, _, _, candela) = read.web.parts();
    let greatest = candela.iter().copied().fold(0.0, f32::max);
    assert!(read.web.brightest().is_normalized());
    for away in [Vec3::X, Vec3::NEG_Y, Vec3::NEG_Z, Vec3::Z, Vec3::ONE.normalize()] {
        let intensity = read.web.intensity(away);
        assert!((0.0..=greatest).contains(&intensity), "{away}: {intensity}");
    }
    let mesh = read.opening.mesh(read.web.halves());
    assert!(mesh.areas().iter().all(|area| area.is_finite()));
});

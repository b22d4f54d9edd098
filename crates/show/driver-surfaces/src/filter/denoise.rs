//! Open Image Denoise in place of the filter's light.

use super::{Filtered, OfSquares};
use crate::behind::BehindPanes;
use crate::coats::mean_of_samples;
use crate::estimate::Estimate;
use crate::squares::Squares;
use glam::Vec3;
use holo_denoise::Denoiser;
use holo_display::Interrupt;

/// Fixed-point steps that the denoiser sees as 1.
const SCALE: f32 = 1024.0;

impl Squares {
    /// Replaces the filtered light by the denoised means of all samples. If a square has no
    /// samples, its filtered light is denoised. If the library fails or is interrupted, the light
    /// stays filtered.
    pub fn denoise(
        &self,
        OfSquares { towards_eye, from_all }: &OfSquares,
        behind: &BehindPanes,
        Filtered { mut lights, beyond }: Filtered,
        denoiser: &mut Denoiser,
        interrupt: &Interrupt,
    ) -> Vec<Estimate> {
        let goes_on = || !interrupt.is_set();
        let of_samples = |number: usize| {
            let own = &towards_eye[number];
            match from_all {
                Some(all) => mean_of_samples(own, &all[number], &beyond[number]),
                None => (own.count > 0).then(|| own.mean()),
            }
        };
        let light = |number: usize| {
            let light = match of_samples(number) {
                None => lights[number].light,
                Some(mean) => behind.of(number).map_or(mean, |pane| pane.light(mean)),
            };
            (light.max(Vec3::ZERO) / SCALE).to_array()
        };
        let mut pixels: Vec<[f32; 3]> = (0..towards_eye.len()).map(light).collect();
        let normals: Vec<[f32; 3]> = self.seen.iter().map(|seen| seen.normal.to_array()).collect();
        if denoiser.denoise_light(&mut pixels, &normals, self.size, &goes_on).is_ok() {
            for (light, pixel) in lights.iter_mut().zip(pixels) {
                light.light = Vec3::from_array(pixel).max(Vec3::ZERO) * SCALE;
            }
        }
        lights
    }
}

//! Traces the rays and pictures of a walk on all cores.

use crate::drivers::{Answer, Wanted};
use glam::DVec3;
use holo_picture::{Picture, View};
use holo_tracer::Tracer;

pub struct Engine {
    tracer: Tracer,
    paths: u32,
    /// Standard deviation of one path divided by the mean, used if the engine has no estimate.
    relative_noise: f32,
}

fn threads() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

impl Engine {
    /// `tracer` traces `paths` for each sample. Measures the paths' noise with rays of `view`.
    pub fn new(tracer: Tracer, paths: u32, view: &View) -> Self {
        let mut relative = Vec::new();
        for try_ray in 0..1000_u64 {
            let at = |salt: u64| (mix(try_ray * 2 + salt) >> 11) as f64 / (1_u64 << 53) as f64;
            let (origin, along) = view.ray(at(0), at(1));
            let each: Vec<f64> = (0..4)
                .map(|path| {
                    f64::from(largest(
                        tracer.trace_path(origin, along, mix(try_ray), path).radiance,
                    ))
                })
                .collect();
            let mean = each.iter().sum::<f64>() / 4.0;
            if mean > 0.0 {
                let variance = each.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / 3.0;
                relative.push((variance / (mean * mean)).sqrt());
            }
        }
        let noise = relative.iter().sum::<f64>() / relative.len().max(1) as f64;
        Self { tracer, paths, relative_noise: noise as f32 }
    }

    /// Traces rays. The answers depend only on the rays and `frame`.
    pub fn answer(&self, rays: &[Wanted], frame: usize) -> Vec<Answer> {
        let one = |index: usize, ray: &Wanted| {
            let seed = mix((frame as u64) << 32 | index as u64);
            if self.paths == 1 {
                let traced = self.tracer.trace(ray.origin, ray.direction, seed);
                // A path without any light does not show how much light other paths find.
                let largest = largest(traced.radiance);
                let noise =
                    if largest > 0.0 { self.relative_noise * largest } else { f32::INFINITY };
                return Answer { radiance: traced.radiance, distance: traced.distance, noise };
            }
            let (traced, variance) =
                self.tracer.trace_with_variance(ray.origin, ray.direction, seed);
            let variance =
                variance.map_or(0.0, |channels| channels.into_iter().fold(0.0, f64::max));
            Answer {
                radiance: traced.radiance,
                distance: traced.distance,
                noise: variance.sqrt() as f32,
            }
        };
        let share = rays.len().div_ceil(threads()).max(1);
        std::thread::scope(|scope| {
            let parts: Vec<_> = rays
                .chunks(share)
                .enumerate()
                .map(|(part, rays)| {
                    let work = move || -> Vec<Answer> {
                        rays.iter()
                            .enumerate()
                            .map(|(index, ray)| one(part * share + index, ray))
                            .collect()
                    };
                    scope.spawn(work)
                })
                .collect();
            parts.into_iter().filter_map(|part| part.join().ok()).flatten().collect()
        })
    }

    /// Adds paths to a picture until it averages `until` paths per pixel instead of `done`.
    pub fn add_picture(
        &self,
        view: &View,
        picture: &mut Picture,
        done: u32,
        until: u32,
        seed: u64,
    ) {
        let (width, height) = picture.size();
        let rows = (height as usize).div_ceil(threads()) * width as usize;
        std::thread::scope(|scope| {
            for (part, pixels) in picture.pixels.chunks_mut(rows).enumerate() {
                scope.spawn(move || {
                    for (index, pixel) in (part * rows..).zip(pixels) {
                        let (column, row) = (index % width as usize, index / width as usize);
                        let mut sum = pixel.map(|channel| f64::from(channel) * f64::from(done));
                        let turn = mix(index as u64 ^ seed << 40);
                        for path in done..until {
                            let jitter = |salt: u64, step: f64| {
                                let offset = (mix(turn ^ salt) >> 11) as f64 / (1_u64 << 53) as f64;
                                (offset + step * f64::from(path)).fract()
                            };
                            // The R2 sequence (Roberts 2018), shifted by an offset of the pixel.
                            let dx = jitter(1, 0.754_877_666_246_692_8);
                            let dy = jitter(2, 0.569_840_290_998_053_3);
                            let x = (column as f64 + dx) / f64::from(width);
                            let y = 1.0 - (row as f64 + dy) / f64::from(height);
                            let (origin, along): (DVec3, DVec3) = view.ray(x, y);
                            let radiance = self
                                .tracer
                                .trace_path(origin, along, turn, u64::from(path))
                                .radiance;
                            (0..3).for_each(|channel| sum[channel] += f64::from(radiance[channel]));
                        }
                        *pixel = sum.map(|channel| (channel / f64::from(until)) as f32);
                    }
                });
            }
        });
    }
}

fn largest(rgb: [f32; 3]) -> f32 {
    rgb[0].max(rgb[1]).max(rgb[2])
}

/// The finaliser of SplitMix64 (Steele, Lea & Flood 2014).
fn mix(x: u64) -> u64 {
    let mut z = x.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

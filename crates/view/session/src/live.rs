//! Rays through pixels outside all sections. Workers trace them for one view, and nothing stores
//! them.
//!
//! Invariants:
//! - The view and a ray's number determine the ray. Every ray counts once.
//! - No more rays are under way than the server accepts.

use glam::DVec3;
use holo_display::{LiveSample, split_mix};
use holo_picture::View;
use holo_proto::bulk::{self, LiveRay, MAX_LIVE_RAYS, MAX_LIVE_RAYS_HELD};
use rustc_hash::FxHashSet;

/// Least number of rays in a request. A message of few rays would cost more than tracing them.
const LEAST_ASKED: usize = 4096;

/// Most rays per pixel, so that a forgotten view does not occupy workers for ever.
const MAX_ROUNDS: u64 = 1024;

/// Steps of a sequence whose points spread evenly over a square from any start (Roberts 2018,
/// "R2").
const STEPS: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2];

/// Golden section. It determines the order of the pixels, so that the first rays spread over all of
/// them.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// The live rays of one view.
pub struct LiveRays {
    view: View,
    size: (u32, u32),
    /// Paths that each ray averages.
    paths: u16,
    /// The pixels outside all sections.
    pixels: Vec<u32>,
    /// Step from one pixel to the next. It has no common divisor with the number of pixels.
    stride: u64,
    /// Rays so far. Each round has one ray through each pixel.
    next: u64,
    under_way: FxHashSet<u64>,
    /// Number of rays that have arrived.
    arrived: u64,
}

impl LiveRays {
    /// Returns the rays through these pixels; `None` if the list is empty.
    pub fn new(pixels: Vec<u32>, view: View, size: (u32, u32), paths: u16) -> Option<LiveRays> {
        if pixels.is_empty() {
            return None;
        }
        let stride = stride(pixels.len() as u64);
        let under_way = FxHashSet::default();
        Some(LiveRays { view, size, paths, pixels, stride, next: 0, under_way, arrived: 0 })
    }

    /// Returns how many pixels the rays pass through.
    pub fn pixels(&self) -> u32 {
        self.pixels.len() as u32
    }

    /// Returns how many paths each ray averages.
    pub fn paths(&self) -> u16 {
        self.paths
    }

    /// Returns how many rays have arrived.
    pub fn arrived(&self) -> u64 {
        self.arrived
    }

    /// Returns the rays to request now; none while enough are under way.
    pub fn wanted(&mut self) -> Vec<LiveRay> {
        let room = MAX_LIVE_RAYS_HELD - self.under_way.len();
        if room < LEAST_ASKED {
            return Vec::new();
        }
        let last = self.pixels.len() as u64 * MAX_ROUNDS;
        let mut rays = Vec::new();
        while rays.len() < room.min(MAX_LIVE_RAYS) && self.next < last {
            let number = self.number(self.next);
            self.next += 1;
            // At the border of a fisheye, a point of a pixel may have no ray.
            if let Some((origin, direction, _)) = self.ray(number) {
                rays.push(LiveRay {
                    origin: origin.to_array(),
                    direction: direction.to_array(),
                    number,
                });
                self.under_way.insert(number);
            }
        }
        rays
    }

    /// Receives traced rays, and returns those that were under way.
    pub fn take(&mut self, samples: &[bulk::LiveResult]) -> Vec<LiveSample> {
        let mut fresh = Vec::with_capacity(samples.len());
        for sample in samples {
            if !self.under_way.remove(&sample.number) {
                continue;
            }
            let Some((origin, direction, reach)) = self.ray(sample.number) else { continue };
            let (mut radiance, mut distance) =
                (sample.hit.radiance, f64::from(sample.hit.distance));
            // Everything beyond the aft clipping surface is black, including the sky.
            if distance > reach {
                (radiance, distance) = ([0.0; 3], f64::INFINITY);
            }
            fresh.push(LiveSample { origin, direction, radiance, distance });
        }
        self.arrived += fresh.len() as u64;
        fresh
    }

    /// Returns the number of the ray after `rays` others.
    fn number(&self, rays: u64) -> u64 {
        let count = self.pixels.len() as u64;
        let (round, place) = (rays / count, rays % count);
        LiveRay::number(self.pixels[(place * self.stride % count) as usize], round as u32)
    }

    /// Returns a ray's origin, its direction, and the distance at which the view ends.
    fn ray(&self, number: u64) -> Option<(DVec3, DVec3, f64)> {
        let (pixel, round) = LiveRay::pixel_and_round(number);
        let (column, row) = (f64::from(pixel % self.size.0), f64::from(pixel / self.size.0));
        let random = split_mix(u64::from(pixel) + 1);
        let begin = [random >> 32, random & 0xffff_ffff].map(|bits| bits as f64 / 4_294_967_296.0);
        let [right, down] =
            [0, 1].map(|axis| (begin[axis] + STEPS[axis] * f64::from(round)).fract());
        let (width, height) = (f64::from(self.size.0), f64::from(self.size.1));
        let (origin, direction, reach) =
            self.view.clipped_ray((column + right) / width, 1.0 - (row + down) / height)?;
        Some((origin, direction.normalize(), reach))
    }
}

/// Returns a step near the golden section of `count` that has no common divisor with it.
fn stride(count: u64) -> u64 {
    let divides = |mut a: u64, mut b: u64| {
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a > 1
    };
    let first = ((count as f64 * GOLDEN) as u64).max(1);
    // 1 divides nothing else, so the search ends.
    (first..=count).find(|&stride| !divides(stride, count)).unwrap_or(1)
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use holo_picture::ViewSpec;
    use holo_proto::bulk::LiveHit;

    use super::*;

    const SIZE: (u32, u32) = (160, 120);

    /// Returns rays through every third pixel of a view.
    fn live_rays() -> (LiveRays, View) {
        let mut spec = ViewSpec::default();
        spec.apply_line("-vp -5 4 2 -vd 1 0 0 -vu 0 0 1 -vh 60").unwrap();
        let (view, size) = spec.resolve(SIZE).unwrap();
        let pixels = (0..SIZE.0 * SIZE.1).step_by(3).collect();
        (LiveRays::new(pixels, view, size, 1).unwrap(), view)
    }

    fn answer(rays: &[LiveRay]) -> Vec<bulk::LiveResult> {
        let hit = LiveHit { radiance: [0.5, 1.0, 2.0], distance: 3.0 };
        rays.iter().map(|ray| bulk::LiveResult { number: ray.number, hit }).collect()
    }

    #[test]
    fn rays_are_spread_evenly_over_the_given_pixels_and_no_others() {
        let (mut live, view) = live_rays();
        let pixels = live.pixels.clone();
        let mut rays_of: HashMap<u32, u64> = HashMap::new();
        let mut first_rows = [0; 4];
        let mut rays = 0;
        while rays < 12 * pixels.len() as u64 {
            let wanted = live.wanted();
            assert!(!wanted.is_empty());
            for ray in &wanted {
                let direction = DVec3::from_array(ray.direction);
                assert!((direction.length() - 1.0).abs() < 1e-12);
                let (x, y, _) = view.project(DVec3::from_array(ray.origin) + direction).unwrap();
                let pixel = ((1.0 - y) * 120.0) as u32 * 160 + (x * 160.0) as u32;
                *rays_of.entry(pixel).or_default() += 1;
                if rays < pixels.len() as u64 / 4 {
                    first_rows[(pixel / 160 / 30) as usize] += 1;
                }
                rays += 1;
            }
            assert_eq!(live.take(&answer(&wanted)).len(), wanted.len());
        }
        let mut seen: Vec<u32> = rays_of.keys().copied().collect();
        seen.sort_unstable();
        assert_eq!(seen, pixels);
        let (least, most) = (rays_of.values().min().unwrap(), rays_of.values().max().unwrap());
        assert!(most - least <= 1, "{least} to {most}");
        let least_row = first_rows.iter().min().unwrap();
        assert!(8 * least_row > pixels.len() as u64 / 4, "spread from the start: {first_rows:?}");
        assert_eq!(live.arrived(), rays);
    }

    #[test]
    fn rays_under_way_are_limited_and_every_ray_counts_once() {
        let (mut live, _) = live_rays();
        let mut under_way = Vec::new();
        loop {
            let wanted = live.wanted();
            assert!(wanted.len() <= MAX_LIVE_RAYS);
            if wanted.is_empty() {
                break;
            }
            under_way.extend(wanted);
        }
        let most = MAX_LIVE_RAYS_HELD;
        assert!(under_way.len() <= most && under_way.len() > most - LEAST_ASKED);
        live.take(&answer(&under_way[..10_000]));
        assert_eq!(live.arrived(), 10_000);
        // The same answers again, and one that was never requested.
        assert!(live.take(&answer(&under_way[..10_000])).is_empty());
        let hit = LiveHit { radiance: [1.0; 3], distance: 1.0 };
        assert!(live.take(&[bulk::LiveResult { number: u64::MAX, hit }]).is_empty());
        assert_eq!(live.arrived(), 10_000);
        // The next request replaces those that have arrived.
        assert_eq!(live.wanted().len(), 10_000 + most - under_way.len());
    }

    #[test]
    fn strides_meet_every_place() {
        for count in [1, 2, 3, 4, 6, 8, 30, 97, 210, 1024, 2310] {
            let stride = stride(count);
            let places: FxHashSet<u64> = (0..count).map(|place| place * stride % count).collect();
            assert_eq!(places.len() as u64, count, "{count}: {stride}");
        }
    }
}

//! Pixels of a view that no section covers: rays through them are traced by workers, shown here and stored nowhere.
//!
//! What always holds:
//! - no covered pixel is changed: there a replay of the file shows the session's picture;
//! - which ray a number means is a function of the view and the number, and every ray counts once;
//! - so many rays are under way as the server takes, and no more.

use glam::DVec3;
use holo_display::{Frame, LiveSample, Quadtree, QuadtreeParams, Voronoi};
use holo_picture::View;
use holo_proto::bulk::{self, LiveRay, MAX_LIVE_RAYS, MAX_LIVE_RAYS_HELD};
use holo_section::{BeamId, Sample};
use rustc_hash::FxHashSet;

use crate::canvas::Canvas;

/// Rays asked for at a time at least: a message of a few would cost more than they do.
const LEAST_ASKED: usize = 4096;

/// Rays of a pixel at the most: a view that somebody forgot must not occupy workers for ever.
const MAX_ROUNDS: u64 = 1024;

/// Steps of a sequence whose points are spread over a square, wherever they begin (Roberts 2018, "R2").
const STEPS: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2];

/// Golden section, by which one goes through the pixels: what is asked for first is spread over all of them.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Draws the pixels, from live rays and what else it knows of them.
enum Overlay {
    /// With all samples of the view, too: they are of the same surfaces.
    Voronoi(Box<Voronoi>),
    Quadtree(Box<Quadtree>),
}

/// The live rays of one view.
pub struct Live {
    view: View,
    size: (u32, u32),
    sky: [f32; 3],
    /// Paths of each ray.
    paths: u16,
    /// The pixels.
    pixels: Vec<u32>,
    /// From one pixel to the next; has no divisor in common with how many there are.
    stride: u64,
    /// Number of the next ray: in each round one through each pixel.
    next: u64,
    under_way: FxHashSet<u64>,
    /// `None` before the first ray has come.
    overlay: Option<Overlay>,
    /// Rays that have come.
    shown: u64,
}

impl Live {
    /// Of a view with this canvas. `None` if every pixel is covered, or the driver cannot show them.
    pub fn new(
        canvas: &Canvas,
        view: View,
        size: (u32, u32),
        sky: [f32; 3],
        paths: u16,
    ) -> Option<Live> {
        let pixels = match canvas {
            Canvas::Voronoi(driver) => driver.uncovered(),
            Canvas::Quadtree(trees) => trees.own(Quadtree::uncovered),
            Canvas::Points(_) => Vec::new(),
        };
        if pixels.is_empty() {
            return None;
        }
        let stride = stride(pixels.len() as u64);
        let under_way = FxHashSet::default();
        Some(Live {
            view,
            size,
            sky,
            paths,
            pixels,
            stride,
            next: 0,
            under_way,
            overlay: None,
            shown: 0,
        })
    }

    /// How many pixels it is about.
    pub fn pixels(&self) -> u32 {
        self.pixels.len() as u32
    }

    /// Rays that have come.
    pub fn shown(&self) -> u64 {
        self.shown
    }

    /// Rays to ask for now; none while enough are under way.
    pub fn wanted(&mut self) -> Vec<LiveRay> {
        let room = MAX_LIVE_RAYS_HELD - self.under_way.len();
        if room < LEAST_ASKED {
            return Vec::new();
        }
        let last = self.pixels.len() as u64 * MAX_ROUNDS;
        let mut rays = Vec::new();
        while rays.len() < room.min(MAX_LIVE_RAYS) && self.next < last {
            let number = self.next;
            self.next += 1;
            // Next to the border of a fisheye a point of a pixel may look nowhere.
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

    /// Takes what rays saw.
    pub fn insert(&mut self, canvas: &Canvas, samples: &[bulk::LiveSample]) {
        let mut fresh = Vec::with_capacity(samples.len());
        for sample in samples {
            if !self.under_way.remove(&sample.number) {
                continue;
            }
            let Some((origin, direction, reach)) = self.ray(sample.number) else { continue };
            let (mut radiance, mut distance) =
                (sample.hit.radiance, f64::from(sample.hit.distance));
            // Beyond the aft clipping surface all is black, the sky too.
            if distance > reach {
                (radiance, distance) = ([0.0; 3], f64::INFINITY);
            }
            fresh.push(LiveSample { origin, direction, radiance, distance });
        }
        if fresh.is_empty() {
            return;
        }
        self.shown += fresh.len() as u64;
        let overlay = self.overlay.get_or_insert_with(|| match canvas {
            Canvas::Voronoi(driver) => Overlay::Voronoi(Box::new(driver.copied())),
            Canvas::Quadtree(_) | Canvas::Points(_) => {
                let params = QuadtreeParams { sky: self.sky, ..QuadtreeParams::default() };
                Overlay::Quadtree(Box::new(Quadtree::of_live_rays(self.view, self.size, params)))
            }
        });
        match overlay {
            Overlay::Voronoi(driver) => driver.insert_live(self.paths, &fresh),
            Overlay::Quadtree(driver) => driver.insert_live(self.paths, &fresh),
        }
    }

    /// Takes samples that the canvas has been given.
    pub fn insert_samples(&mut self, section: u16, beam: BeamId, paths: u16, samples: &[Sample]) {
        if let Some(Overlay::Voronoi(driver)) = &mut self.overlay {
            driver.insert(section, beam, paths, samples);
        }
    }

    /// Draws the pixels, if any ray has come.
    pub fn paint(&self, frame: &mut Frame) {
        let drawn = match &self.overlay {
            Some(Overlay::Voronoi(driver)) => driver.draw().frame,
            Some(Overlay::Quadtree(driver)) => driver.draw(),
            None => return,
        };
        for pixel in self.pixels.iter().map(|&pixel| pixel as usize) {
            frame.picture.pixels[pixel] = drawn.picture.pixels[pixel];
            frame.depth[pixel] = drawn.depth[pixel];
        }
    }

    /// Where a ray begins, where it goes, and at which distance its view ends.
    fn ray(&self, number: u64) -> Option<(DVec3, DVec3, f64)> {
        let count = self.pixels.len() as u64;
        let (round, place) = (number / count, number % count);
        let pixel = self.pixels[(place * self.stride % count) as usize];
        let (column, row) = (f64::from(pixel % self.size.0), f64::from(pixel / self.size.0));
        let random = shuffled(u64::from(pixel));
        let begin = [random >> 32, random & 0xffff_ffff].map(|bits| bits as f64 / 4_294_967_296.0);
        let [right, down] = [0, 1].map(|axis| (begin[axis] + STEPS[axis] * round as f64).fract());
        let (width, height) = (f64::from(self.size.0), f64::from(self.size.1));
        let (origin, direction, reach) =
            self.view.clipped_ray((column + right) / width, 1.0 - (row + down) / height)?;
        Some((origin, direction.normalize(), reach))
    }
}

/// About the golden section of `count`, and without a common divisor.
fn stride(count: u64) -> u64 {
    let divides = |mut a: u64, mut b: u64| {
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a > 1
    };
    let first = ((count as f64 * GOLDEN) as u64).max(1);
    // One divides nothing, so this ends.
    (first..=count).find(|&stride| !divides(stride, count)).unwrap_or(1)
}

/// The finaliser of SplitMix64 (Steele, Lea & Flood 2014).
fn shuffled(number: u64) -> u64 {
    let mut z = number.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use std::{collections::HashMap, sync::Arc};

    use holo_picture::ViewSpec;
    use holo_proto::bulk::LiveHit;
    use holo_section::{Section, SectionSpec, ViewClass};

    use super::*;
    use crate::kept::Trees;
    use holo_display::Resolution;

    /// A view past the side of a section: of which some pixels are covered.
    fn past(size: (u32, u32)) -> (Canvas, View) {
        let axes = [[1.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 4.0]];
        let spec = SectionSpec {
            origin: [0.0; 3],
            axes,
            grid: [2; 3],
            class: ViewClass::Interior,
            obstructions: true,
        };
        let sections: Arc<[Section]> = Arc::new([Section::new(spec).unwrap()]);
        let mut spec = ViewSpec::default();
        spec.apply_line("-vp -5 4 2 -vd 1 0 0 -vu 0 0 1 -vh 60").unwrap();
        let (view, size) = spec.resolve(size).unwrap();
        let trees = Trees::default();
        trees.look(sections, view, size, [0.0; 3], Resolution::Full);
        (Canvas::Quadtree(trees), view)
    }

    fn answer(rays: &[LiveRay]) -> Vec<bulk::LiveSample> {
        let hit = LiveHit { radiance: [0.5, 1.0, 2.0], distance: 3.0 };
        rays.iter().map(|ray| bulk::LiveSample { number: ray.number, hit }).collect()
    }

    #[test]
    fn every_uncovered_pixel_gets_as_many_rays_as_any_other_and_no_other_pixel_one() {
        let size = (160, 120);
        let (canvas, view) = past(size);
        let Canvas::Quadtree(trees) = &canvas else { panic!("a quadtree") };
        let uncovered = trees.own(Quadtree::uncovered);
        assert!(uncovered.len() > 2000 && uncovered.len() < 19_200 - 2000, "{}", uncovered.len());
        let mut live = Live::new(&canvas, view, size, [0.0; 3], 1).unwrap();
        let mut rays_of: HashMap<u32, u64> = HashMap::new();
        let mut first_rows = [0; 4];
        let mut rays = 0;
        while rays < 12 * uncovered.len() as u64 {
            let wanted = live.wanted();
            assert!(!wanted.is_empty());
            for ray in &wanted {
                let direction = DVec3::from_array(ray.direction);
                assert!((direction.length() - 1.0).abs() < 1e-12);
                let (x, y, _) = view.project(DVec3::from_array(ray.origin) + direction).unwrap();
                let pixel = ((1.0 - y) * 120.0) as u32 * 160 + (x * 160.0) as u32;
                *rays_of.entry(pixel).or_default() += 1;
                if rays < uncovered.len() as u64 / 4 {
                    first_rows[(pixel / 160 / 30) as usize] += 1;
                }
                rays += 1;
            }
            live.insert(&canvas, &answer(&wanted));
        }
        let mut seen: Vec<u32> = rays_of.keys().copied().collect();
        seen.sort_unstable();
        assert_eq!(seen, uncovered);
        let (least, most) = (rays_of.values().min().unwrap(), rays_of.values().max().unwrap());
        assert!(most - least <= 1, "{least} to {most}");
        let least_row = first_rows.iter().min().unwrap();
        assert!(
            4 * least_row > rays.min(uncovered.len() as u64 / 4) / 2,
            "spread from the start: {first_rows:?}"
        );
        assert_eq!(live.shown(), rays);
    }

    #[test]
    fn no_more_is_under_way_than_the_server_takes_and_every_ray_counts_once() {
        let size = (160, 120);
        let (canvas, view) = past(size);
        let mut live = Live::new(&canvas, view, size, [0.0; 3], 1).unwrap();
        let mut under_way = Vec::new();
        loop {
            let wanted = live.wanted();
            assert!(wanted.len() <= MAX_LIVE_RAYS);
            if wanted.is_empty() {
                break;
            }
            under_way.extend(wanted);
        }
        assert!(
            under_way.len() <= MAX_LIVE_RAYS_HELD
                && under_way.len() > MAX_LIVE_RAYS_HELD - LEAST_ASKED
        );
        live.insert(&canvas, &answer(&under_way[..10_000]));
        assert_eq!(live.shown(), 10_000);
        // Again, and what nobody asked for.
        live.insert(&canvas, &answer(&under_way[..10_000]));
        let hit = LiveHit { radiance: [1.0; 3], distance: 1.0 };
        live.insert(&canvas, &[bulk::LiveSample { number: u64::MAX, hit }]);
        assert_eq!(live.shown(), 10_000);
        // As much more as has come.
        assert_eq!(live.wanted().len(), 10_000 + MAX_LIVE_RAYS_HELD - under_way.len());
    }

    #[test]
    fn uncovered_pixels_show_what_their_rays_saw_and_covered_ones_do_not_change() {
        let size = (80, 60);
        let (canvas, view) = past(size);
        let mut live = Live::new(&canvas, view, size, [0.0; 3], 1).unwrap();
        let (before, ..) = canvas.draw();
        let mut frame = before.clone();
        live.paint(&mut frame);
        assert_eq!(frame.picture.pixels, before.picture.pixels, "no ray has come");
        let wanted = live.wanted();
        live.insert(&canvas, &answer(&wanted));
        live.paint(&mut frame);
        for (pixel, (colour, old)) in
            (0..).zip(frame.picture.pixels.iter().zip(&before.picture.pixels))
        {
            if live.pixels.contains(&pixel) {
                assert!((colour[1] - 1.0).abs() < 1e-2, "{pixel}: {colour:?}");
            } else {
                assert_eq!(colour, old, "{pixel}");
            }
        }
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

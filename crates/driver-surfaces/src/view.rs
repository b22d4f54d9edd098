//! What a view's pixels see: the surfaces behind mirrors and panes, found once for a view.
//!
//! Invariant: what a pixel sees is a function of the view and the scene.

use crate::cell::Face;
use crate::materials::{Kind, Materials};
use crate::trail::{AtPanes, End, Follower, Shown};
use glam::Vec3;
use holo_picture::View as Eye;
use holo_raycast::{Hit, MAX_TILE, Ray, Raycaster};
use holo_scene::Rgb;
use rayon::prelude::*;
use std::sync::Arc;

/// Pixels a side of a tile that is cast together.
const SIDE: usize = 8;
const _: () = assert!(SIDE * SIDE == MAX_TILE);

/// The number of no material: the sky, or nothing.
pub(crate) const NO_MATERIAL: u32 = u32::MAX;

/// The number of no way: the surface is seen through nothing, and only reflects.
pub(crate) const PLAIN: u32 = 0;

/// A surface point that a pixel sees, relative to the scene's origin.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// Where it is.
    pub point: Vec3,
    /// Unit, on the side that is seen.
    pub normal: Vec3,
    /// How wide a pixel is there, scene units.
    pub width: f32,
    /// The material's number; `u32::MAX` where there is no surface.
    pub material: u32,
    /// Which [`Way`]; 0 if it is seen through nothing and does not shine.
    pub way: u32,
}

/// How a surface is seen that is not plain.
#[derive(Clone, Copy, Debug)]
pub struct Way {
    /// Share of the surface's light that comes back through mirrors and panes.
    pub share: Rgb,
    /// Radiance besides: of the sky, or of a lamp.
    pub radiance: Rgb,
    /// Where the ray went when it met the surface.
    pub direction: Vec3,
}

/// The surfaces of a view.
#[derive(Debug)]
pub struct View {
    raycaster: Arc<Raycaster>,
    materials: Arc<Materials>,
    eye: Eye,
    /// Columns and rows.
    pub size: (usize, usize),
    /// By pixel.
    pub seen: Vec<Seen>,
    /// By number; the first one is not used.
    pub ways: Vec<Way>,
    /// What panes mirror, besides what is seen through them: pixels and what they see.
    pub mirrored: Vec<(u32, Seen)>,
}

impl Seen {
    /// No surface.
    pub const NOTHING: Seen = Seen {
        point: Vec3::ZERO,
        normal: Vec3::ZERO,
        width: 0.0,
        material: NO_MATERIAL,
        way: PLAIN,
    };

    /// Whether there is a surface.
    #[must_use]
    pub fn is_surface(&self) -> bool {
        self.material != NO_MATERIAL
    }
}

/// Pixels of some rows that need more than a cast, in the order of the pixels.
struct Special {
    pixel: usize,
    ray: Ray,
    hit: Option<Hit>,
}

impl View {
    /// Casts the rays of all pixels; `size` as from [`View::resolve`](Eye::resolve).
    #[must_use]
    pub fn new(
        raycaster: Arc<Raycaster>,
        materials: Arc<Materials>,
        eye: &Eye,
        size: (u32, u32),
    ) -> View {
        let size = (size.0 as usize, size.1 as usize);
        let mut view = View {
            raycaster,
            materials,
            eye: *eye,
            size,
            seen: Vec::new(),
            ways: vec![Way { share: [1.0; 3], radiance: [0.0; 3], direction: Vec3::ZERO }],
            mirrored: Vec::new(),
        };
        let mut seen = vec![Seen::NOTHING; size.0 * size.1];
        let special: Vec<Special> = seen
            .par_chunks_mut(size.0 * SIDE)
            .enumerate()
            .flat_map_iter(|(part, rows)| view.cast_rows(part * SIDE, rows))
            .collect();
        view.seen = seen;
        view.follow_special(&special);
        view
    }

    pub(crate) fn follower(&self) -> Follower<'_> {
        Follower { raycaster: &self.raycaster, materials: &self.materials }
    }

    /// The ray through the middle of a pixel, and how wide a pixel is at distance 1.
    pub fn ray(&self, column: f64, row: f64) -> Ray {
        let (x, y) = (column / self.size.0 as f64, 1.0 - row / self.size.1 as f64);
        let (origin, direction) = self.eye.ray(x, y);
        let local = self.raycaster.localize(origin, direction);
        local.map_or(Ray::new(Vec3::ZERO, Vec3::ZERO), |(ray, _)| ray)
    }

    fn cast_rows(&self, top: usize, rows: &mut [Seen]) -> Vec<Special> {
        let width = self.size.0;
        let count = rows.len() / width;
        let pixel_width = self.eye.pixel_footprint((width as u32, self.size.1 as u32), 1.0) as f32;
        let mut special = Vec::new();
        for left in (0..width).step_by(SIDE) {
            let across = SIDE.min(width - left);
            let mut rays = [Ray::new(Vec3::ZERO, Vec3::ZERO); MAX_TILE];
            let mut hits = [None; MAX_TILE];
            for (number, ray) in rays.iter_mut().enumerate().take(across * count) {
                let (x, y) = (left + number % across, top + number / across);
                *ray = self.ray(x as f64 + 0.5, y as f64 + 0.5);
            }
            let used = across * count;
            self.raycaster.nearest_tile(&rays[..used], &mut hits[..used]);
            for number in 0..used {
                let at = number / across * width + left + number % across;
                let (ray, hit) = (rays[number], hits[number]);
                let plain = hit.and_then(|hit| {
                    let finish = self.follower().finish(self.follower().material(hit.triangle));
                    let is_plain = finish.kind == Kind::Diffuse && !finish.emits;
                    is_plain.then(|| self.follower().end(&ray, hit, [1.0; 3], 0.0))
                });
                match plain {
                    Some(end) => rows[at] = seen(&end, pixel_width, PLAIN),
                    None => special.push(Special { pixel: top * width + at, ray, hit }),
                }
            }
        }
        special.sort_unstable_by_key(|special| special.pixel);
        special
    }

    fn follow_special(&mut self, special: &[Special]) {
        let pixel_width =
            self.eye.pixel_footprint((self.size.0 as u32, self.size.1 as u32), 1.0) as f32;
        let follower = self.follower();
        let shown: Vec<(Shown, Option<Shown>)> = special
            .par_iter()
            .map(|&Special { ray, hit, .. }| {
                let Some(hit) = hit else { return (Shown::Sky([1.0; 3]), None) };
                let through = follower.follow(ray, hit, AtPanes::Pass);
                let finish = follower.finish(follower.material(hit.triangle));
                let in_pane = matches!(finish.kind, Kind::Pane { .. })
                    .then(|| follower.follow(ray, hit, AtPanes::ReflectFirst));
                (through, in_pane)
            })
            .collect();
        for (special, (through, in_pane)) in special.iter().zip(shown) {
            self.seen[special.pixel] = self.special(through, pixel_width);
            if let Some(in_pane) = in_pane {
                let seen = self.special(in_pane, pixel_width);
                self.mirrored.push((special.pixel as u32, seen));
            }
        }
    }

    fn special(&mut self, shown: Shown, pixel_width: f32) -> Seen {
        let way = self.ways.len() as u32;
        let times = |a: Rgb, b: Rgb| [0, 1, 2].map(|channel: usize| a[channel] * b[channel]);
        let (mut share, mut radiance, mut direction) = ([1.0; 3], [0.0; 3], Vec3::ZERO);
        let mut at = Seen { way, ..Seen::NOTHING };
        match shown {
            Shown::Surface(end) => {
                let finish = self.follower().finish(end.material);
                (share, direction) = (end.share, end.direction);
                if finish.shines(end.front) {
                    radiance = times(end.share, finish.emission);
                } else {
                    at = seen(&end, pixel_width, way);
                }
            }
            Shown::Sky(share) => radiance = times(share, self.materials.sky),
            Shown::Unknown => {}
        }
        self.ways.push(Way { share, radiance, direction });
        at
    }

    /// What cells of this surface have in common.
    pub(crate) fn face(&self, seen: &Seen) -> Face {
        let is_glossy = self.follower().finish(seen.material).kind == Kind::Glossy;
        let leaving = is_glossy.then(|| self.ways[seen.way as usize].direction);
        Face::new(seen.normal, seen.material, leaving)
    }

    /// What light on a surface is multiplied by to be what its pixel shows, and what is added.
    #[must_use]
    pub fn paint(&self, seen: &Seen) -> (Rgb, Rgb) {
        let way = &self.ways[seen.way as usize];
        if !seen.is_surface() {
            return ([0.0; 3], way.radiance);
        }
        let finish = self.follower().finish(seen.material);
        let scale = [0, 1, 2].map(|c| finish.reflectance[c] * way.share[c]);
        (scale, way.radiance)
    }

    /// Light of one fixed-point step.
    #[must_use]
    pub fn unit(&self) -> f32 {
        self.materials.unit
    }
}

fn seen(end: &End, pixel_width: f32, way: u32) -> Seen {
    Seen {
        point: end.point,
        normal: end.normal,
        width: end.length * pixel_width,
        material: end.material,
        way,
    }
}

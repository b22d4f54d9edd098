//! Casting the rays of all pixels, and following those that meet mirrors and panes.
//!
//! Invariant: what a pixel sees is a function of the view and the scene; layers cover only what they show.

use super::labels::{Labelled, label};
use super::surfaces::{Caster, Image, Seen, Surfaces, number_of};
use crate::parts::for_parts;
use crate::pointimage::isa::Isa;
use crate::pointimage::zeroed;
use glam::Vec3;
use holo_raycast::{Hit, MAX_TILE, Ray};
use holo_scene::Rgb;
use rustc_hash::FxHashMap;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// Pixels a side of a tile traced together.
const SIDE: usize = 8;
const _: () = assert!(SIDE * SIDE == MAX_TILE);

/// Different mirror images in one picture, the scene itself among them.
const MAX_IMAGES: usize = 12;

/// Pixels that must look into a triangle of a mirror for its image to get samples of its own: every sample is tried in every
/// image. What smaller ones show has the light of where else it is seen.
const LEAST_MIRROR: u32 = 400;

/// A ray that meets nothing.
const NOWHERE: Ray = Ray { origin: Vec3::ZERO, direction: Vec3::ZERO, t_min: 0.0, t_max: 0.0 };

/// A pixel whose ray meets a mirror or pane.
type Special = (usize, Ray, Hit);

/// What one of them shows, and how much of its light comes back.
type Shown = (usize, Seen, Rgb);

impl Caster<'_> {
    /// What every pixel's middle sees. If there are mirrors or panes in the picture, then what is seen in panes besides what
    /// is seen through them, and then the mirrors and panes themselves.
    pub fn surfaces(&self) -> Vec<Surfaces> {
        let (width, height) = self.size;
        let mut seen: Vec<Seen> = zeroed(width * height);
        let special = Mutex::new(Vec::new());
        for_parts(&mut seen, width, SIDE, |part, rows| {
            let found = self.cast_rows(part * SIDE, rows);
            if !found.is_empty() {
                special.lock().unwrap_or_else(PoisonError::into_inner).extend(found);
            }
        });
        let mut special: Vec<Special> = special.into_inner().unwrap_or_else(PoisonError::into_inner);
        if special.is_empty() {
            return vec![self.layer(seen, &(0..height), vec![Image::ITSELF], FxHashMap::default())];
        }
        // Threads finish in any order; images are numbered in the order of the pixels.
        special.sort_unstable_by_key(|&(pixel, ..)| pixel);
        let row = |special: Option<&Special>| special.map_or(0, |&(pixel, ..)| pixel / width);
        let rows = row(special.first())..row(special.last()) + 1;
        let (through, images) = self.follow_all(&special, false);
        let (in_panes, pane_images) = self.follow_all(&special, true);
        let mut polished: Vec<Seen> = zeroed(width * height);
        let mut throughput = FxHashMap::default();
        for (pixel, behind, share) in through {
            polished[pixel] = std::mem::replace(&mut seen[pixel], behind);
            throughput.insert(pixel as u32, share);
        }
        let mut reflected: Vec<Seen> = zeroed(width * height);
        let mut pane_throughput = FxHashMap::default();
        for (pixel, there, share) in in_panes {
            // Where the way through was too long there is nothing to add to.
            if throughput.contains_key(&(pixel as u32)) {
                reflected[pixel] = there;
                pane_throughput.insert(pixel as u32, share);
            }
        }
        vec![
            self.layer(seen, &(0..height), images, throughput),
            self.layer(reflected, &rows, pane_images, pane_throughput),
            self.layer(polished, &rows, vec![Image::ITSELF], FxHashMap::default()),
        ]
    }

    /// What these pixels show through mirrors and panes, or in panes, and the images that they see it in.
    fn follow_all(&self, special: &[Special], off_pane: bool) -> (Vec<Shown>, Vec<Image>) {
        let mut looking_into: FxHashMap<u32, u32> = FxHashMap::default();
        for (_, _, hit) in special {
            *looking_into.entry(hit.triangle).or_default() += 1;
        }
        let is_large = |triangle| looking_into.get(&triangle).is_some_and(|&pixels| pixels >= LEAST_MIRROR);
        let mut ends = vec![None; special.len()];
        for_parts(&mut ends, 1, 256, |part, ends| {
            for (end, &(_, ray, hit)) in ends.iter_mut().zip(&special[part * 256..]) {
                *end = self.follow(ray, hit, off_pane);
            }
        });
        let mut images = vec![Image::ITSELF];
        let mut shown = Vec::with_capacity(special.len());
        for (&(pixel, ..), end) in special.iter().zip(ends) {
            let Some(end) = end else { continue };
            let reach = end.seen.position.length();
            let mut number = number_of(&images, &end.image, reach);
            let has_room = images.len() < MAX_IMAGES && !end.seen.is_sky();
            if number.is_none() && has_room && end.mirrors().iter().all(|&mirror| is_large(mirror)) {
                number = Some(images.len());
                images.push(end.image);
            }
            shown.push((pixel, end.placed(number), end.share));
        }
        (shown, images)
    }

    /// A layer of which only these rows see anything.
    fn layer(
        &self,
        seen: Vec<Seen>,
        rows: &Range<usize>,
        images: Vec<Image>,
        throughput: FxHashMap<u32, Rgb>,
    ) -> Surfaces {
        let pixel_width = self.camera.pixel_width;
        let Labelled { labels, edges, windows } = label(&seen, self.size.0, rows, pixel_width, images.len());
        Surfaces { size: self.size, seen, labels, edges, images, windows, throughput, pixel_width }
    }

    /// The rays through the middles of a tile's pixels, `across` of them in a row.
    fn tile_rays(&self, (left, top): (usize, usize), across: usize, rays: &mut [Ray]) {
        let middle = |number: usize| {
            let (x, y) = (left + number % across, top + number / across);
            (x as f64 + 0.5, y as f64 + 0.5)
        };
        // Rays of one eye near the scene differ in their directions alone, which are then found many at once.
        let one = self.is_plain_perspective().then(|| self.ray(middle(0).0, middle(0).1)).flatten();
        if let Some((first, 0.0)) = one {
            let mut points = [(0.0, 0.0); MAX_TILE];
            points.iter_mut().zip(0..rays.len()).for_each(|(point, number)| *point = middle(number));
            let directions = Isa::best().run(self.directions(&points));
            rays.iter_mut().zip(directions).for_each(|(ray, towards)| *ray = Ray::new(first.origin, towards));
            return;
        }
        for (number, ray) in rays.iter_mut().enumerate() {
            let (x, y) = middle(number);
            *ray = self.ray(x, y).map_or(NOWHERE, |(ray, _)| ray);
        }
    }

    /// Some rows from `top`; gives the pixels that look at a mirror or pane.
    fn cast_rows(&self, top: usize, rows: &mut [Seen]) -> Vec<Special> {
        let mut found = Vec::new();
        let width = self.size.0;
        let count = rows.len() / width.max(1);
        for left in (0..width).step_by(SIDE) {
            let across = SIDE.min(width - left);
            let mut rays = [NOWHERE; MAX_TILE];
            let mut hits = [None; MAX_TILE];
            let used = across * count;
            let places = (0..count).flat_map(|y| (left..left + across).map(move |x| (x, y)));
            self.tile_rays((left, top), across, &mut rays[..used]);
            self.nearest_tile(&rays[..used], &mut hits[..used]);
            for ((ray, hit), (x, y)) in rays.iter().zip(&hits).zip(places) {
                let Some(hit) = hit else { continue };
                let pixel = y * width + x;
                let seen = self.first(ray, hit);
                if self.is_beyond(x as f64 + 0.5, (top + y) as f64 + 0.5, &seen) {
                    continue;
                }
                rows[pixel] = seen;
                if self.is_polished(hit.triangle) {
                    found.push((top * width + pixel, *ray, *hit));
                }
            }
        }
        found
    }
}

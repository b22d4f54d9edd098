//! Casting the rays of all pixels, and following those that meet mirrors and panes.
//!
//! Invariant: what a pixel sees is a function of the view and the scene; layers cover only what they show.

use super::follow::{End, number_of};
use super::labels::{Labelled, label};
use super::surfaces::{Caster, Face, Image, Seen, Surfaces};
use bytemuck::zeroed_vec;
use glam::Vec3;
use holo_cpu::Isa;
use holo_cpu::{filled, zeroed};
use holo_display::for_bands;
use holo_raycast::{Hit, MAX_TILE, MAX_TOGETHER, Ray};
use holo_scene::Rgb;
use rustc_hash::{FxBuildHasher, FxHashMap, FxHashSet};
use std::ops::Range;

/// Pixels a side of a tile traced together.
const SIDE: usize = 8;
const _: () = assert!(SIDE * SIDE == MAX_TILE);

/// Different mirror images in one picture, the scene itself among them.
const MAX_IMAGES: usize = 12;

/// Pixels that must look into a triangle of a mirror for its image to get samples of its own: every sample is tried in every
/// image. What smaller ones show has the light of where else it is seen.
const LEAST_MIRROR: u32 = 400;

/// Rays of one piece of work that are followed through mirrors and panes.
const FOLLOWED: usize = 12 * MAX_TOGETHER;

/// A ray that meets nothing.
const NOWHERE: Ray = Ray { origin: Vec3::ZERO, direction: Vec3::ZERO, t_min: 0.0, t_max: 0.0 };

/// A pixel whose ray meets a mirror or pane.
type Special = (usize, Ray, Hit);

/// What one of them shows, and how much of its light comes back.
type Shown = (usize, Seen, Rgb);

/// What pixels see, and the [key](Seen::key) of each: where edges are is found by those, which are a quarter of the memory.
struct Pixels {
    seen: Vec<Seen>,
    keys: Vec<u64>,
}

impl Pixels {
    fn unseen(count: usize) -> Pixels {
        Pixels { seen: zeroed(count), keys: zeroed(count) }
    }

    /// The same, of which few are going to see anything: in small pages, only those are touched.
    fn mostly_unseen(count: usize) -> Pixels {
        Pixels { seen: zeroed_vec(count), keys: zeroed_vec(count) }
    }

    fn set(&mut self, pixel: usize, seen: Seen) {
        (self.seen[pixel], self.keys[pixel]) = (seen, seen.key());
    }
}

impl Caster<'_> {
    /// What every pixel's middle sees. If there are mirrors or panes in the picture, then what is seen in panes besides what
    /// is seen through them, and then the mirrors and panes themselves.
    pub fn surfaces(&self) -> Vec<Surfaces> {
        let (width, height) = self.size;
        let mut seen = Pixels::unseen(width * height);
        let size = (width * SIDE).max(1);
        let parts = seen.seen.chunks_mut(size).zip(seen.keys.chunks_mut(size));
        let mut parts: Vec<_> = parts.map(|rows| (rows, Vec::new())).collect();
        for_bands(&mut parts, 1, 1, |part, rows| {
            for ((seen, keys), special) in rows {
                *special = self.cast_rows(part * SIDE, seen, keys);
                // Tiles cross rows; images are numbered in the order of the pixels.
                special.sort_unstable_by_key(|&(pixel, ..)| pixel);
            }
        });
        let special: Vec<Special> = parts.into_iter().flat_map(|(_, special)| special).collect();
        if special.is_empty() {
            return vec![self.layer(seen, &(0..height), vec![Image::ITSELF], FxHashMap::default())];
        }
        let row = |special: Option<&Special>| special.map_or(0, |&(pixel, ..)| pixel / width);
        let rows = row(special.first())..row(special.last()) + 1;
        let [through, in_panes] = [false, true].map(|off_pane| self.follow_all(&special, off_pane));
        let is_large = &is_large(&special);
        // What cannot be shared out pixel by pixel is done for both kinds at once.
        std::thread::scope(|scope| {
            let in_panes = scope.spawn(|| {
                let (shown, images) = number(&special, &in_panes, is_large);
                // Where the way through was too long there is nothing to add to.
                let shown =
                    shown.into_iter().zip(&through).filter(|(_, through)| through.is_some());
                let mut reflected = Pixels::mostly_unseen(width * height);
                let mut throughput =
                    FxHashMap::with_capacity_and_hasher(special.len(), FxBuildHasher);
                for (pixel, there, share) in shown.filter_map(|(shown, _)| shown) {
                    reflected.set(pixel, there);
                    throughput.insert(pixel as u32, share);
                }
                self.layer(reflected, &rows, images, throughput)
            });
            let (shown, images) = number(&special, &through, is_large);
            let mut polished = Pixels::mostly_unseen(width * height);
            let mut throughput = FxHashMap::with_capacity_and_hasher(special.len(), FxBuildHasher);
            for (pixel, behind, share) in shown.into_iter().flatten() {
                polished.set(pixel, seen.seen[pixel]);
                seen.set(pixel, behind);
                throughput.insert(pixel as u32, share);
            }
            let main = self.layer(seen, &(0..height), images, throughput);
            let polished = self.layer(polished, &rows, vec![Image::ITSELF], FxHashMap::default());
            let in_panes = in_panes.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            vec![main, in_panes, polished]
        })
    }

    /// Where these pixels' rays end behind mirrors and panes, or in panes.
    fn follow_all(&self, special: &[Special], off_pane: bool) -> Vec<Option<End>> {
        let mut ends = filled(None, special.len());
        for_bands(&mut ends, 1, FOLLOWED, |part, ends| {
            let special = special[part * FOLLOWED..].chunks(MAX_TOGETHER);
            for (ends, special) in ends.chunks_mut(MAX_TOGETHER).zip(special) {
                self.follow_together(
                    special.iter().map(|&(_, ray, hit)| (ray, hit)),
                    off_pane,
                    ends,
                );
            }
        });
        ends
    }

    /// A layer of which only these rows see anything.
    fn layer(
        &self,
        Pixels { seen, keys }: Pixels,
        rows: &Range<usize>,
        images: Vec<Image>,
        throughput: FxHashMap<u32, Rgb>,
    ) -> Surfaces {
        let pixel_width = self.camera.pixel_width;
        let Labelled { labels, edges, windows } =
            label((&seen, &keys), self.size.0, rows, pixel_width, images.len());
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
            points
                .iter_mut()
                .zip(0..rays.len())
                .for_each(|(point, number)| *point = middle(number));
            return Isa::best().run(self.fan(first.origin, &points, rays));
        }
        for (number, ray) in rays.iter_mut().enumerate() {
            let (x, y) = middle(number);
            *ray = self.ray(x, y).map_or(NOWHERE, |(ray, _)| ray);
        }
    }

    /// Some rows from `top`; gives the pixels that look at a mirror or pane.
    fn cast_rows(&self, top: usize, rows: &mut [Seen], keys: &mut [u64]) -> Vec<Special> {
        let mut found = Vec::new();
        let mut known: Option<Face> = None;
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
                // Neighbours mostly see the same.
                if !known.as_ref().is_some_and(|face| face.is_met(ray, hit.triangle)) {
                    known = Some(self.face(ray, hit.triangle));
                }
                let Some(face) = &known else { continue };
                let seen = self.on(face, hit);
                if self.is_beyond(x as f64 + 0.5, (top + y) as f64 + 0.5, &seen) {
                    continue;
                }
                (rows[pixel], keys[pixel]) = (seen, seen.key());
                if face.is_polished {
                    found.push((top * width + pixel, *ray, *hit));
                }
            }
        }
        found
    }
}

/// The mirrors' triangles, and panes', that many pixels look into.
fn is_large(special: &[Special]) -> FxHashSet<u32> {
    let mut looking_into: FxHashMap<u32, u32> = FxHashMap::default();
    for (_, _, hit) in special {
        *looking_into.entry(hit.triangle).or_default() += 1;
    }
    let large = looking_into.into_iter().filter(|&(_, pixels)| pixels >= LEAST_MIRROR);
    large.map(|(triangle, _)| triangle).collect()
}

/// What pixels show whose rays end there, and the images that they see it in, numbered in the order of the pixels.
fn number(
    special: &[Special],
    ends: &[Option<End>],
    is_large: &FxHashSet<u32>,
) -> (Vec<Option<Shown>>, Vec<Image>) {
    let mut images = vec![Image::ITSELF];
    let shown = special.iter().zip(ends).map(|(&(pixel, ..), end)| {
        let end = end.as_ref()?;
        let reach = end.seen.position.length();
        let mut number = number_of(&images, &end.image, reach);
        let has_room = images.len() < MAX_IMAGES && !end.seen.is_sky();
        if number.is_none()
            && has_room
            && end.mirrors().iter().all(|mirror| is_large.contains(mirror))
        {
            number = Some(images.len());
            images.push(end.image);
        }
        Some((pixel, end.placed(number), end.share))
    });
    (shown.collect(), images)
}

//! Smooth edges: pixels next to an edge are the mean of several points, each lit by its own surface's light.
//!
//! Invariant: a point's light comes from one of the 3 × 3 pixels around that see the same surface, or from what is known of
//! such surfaces as a whole; never from another surface.

use super::surfaces::{Caster, Seen, Surfaces};
use crate::parts::for_parts;
use holo_raycast::{Hit, MAX_TILE, Ray};
use holo_scene::Rgb;

/// Points of an edge pixel.
const POINTS: usize = 8;
const _: () = assert!(POINTS <= MAX_TILE);

/// Pixels of one piece of work.
const PIECE: usize = 256;

/// Places of the points: eight rooks, each in a column and a row of its own, well apart.
const PLACES: [(f64, f64); POINTS] = [
    (0.0625, 0.4375),
    (0.1875, 0.8125),
    (0.3125, 0.1875),
    (0.4375, 0.5625),
    (0.5625, 0.9375),
    (0.6875, 0.3125),
    (0.8125, 0.6875),
    (0.9375, 0.0625),
];

/// What a point shows, as far as samples do not change it.
#[derive(Clone, Debug)]
pub(crate) enum Shows {
    Sky,
    /// A material in the light of a pixel that sees the same surface.
    Lit {
        by: u32,
        material: u32,
    },
    /// What is behind a mirror or pane, and what is reflected in a pane.
    Through(Box<[Option<Behind>; 2]>),
    /// A surface that no pixel around sees.
    Other,
    /// What lies beyond a portal: has no part in the pixel.
    Beyond,
}

/// What a point shows through mirrors and panes.
#[derive(Clone, Debug)]
pub(crate) struct Behind {
    pub seen: Seen,
    /// What of its light comes through.
    pub share: Rgb,
    /// A pixel that sees the same surface.
    pub by: Option<usize>,
}

/// The pixels next to an edge, and what their points meet: found once for a view, since samples do not change it.
pub(crate) struct EdgePoints {
    pixels: Vec<u32>,
    points: Vec<[(Shows, Option<Hit>); POINTS]>,
}

impl EdgePoints {
    /// Casts the rays of all these pixels' points.
    pub fn cast(
        caster: &Caster,
        edges: &[bool],
        width: usize,
        shows: impl Fn(usize, (f64, f64), &Ray, &Option<Hit>) -> Shows + Sync,
    ) -> EdgePoints {
        let pixels: Vec<u32> = (0..).zip(edges).filter(|(_, edge)| **edge).map(|(pixel, _)| pixel).collect();
        let mut points = vec![[const { (Shows::Other, None) }; POINTS]; pixels.len()];
        for_parts(&mut points, 1, PIECE, |part, points| {
            for (points, &pixel) in points.iter_mut().zip(&pixels[part * PIECE..]) {
                let rays = PLACES.map(|place| ray(caster, width, pixel as usize, place));
                let mut hits = [None; POINTS];
                caster.nearest_tile(&rays, &mut hits);
                for (((point, ray), hit), place) in points.iter_mut().zip(&rays).zip(hits).zip(PLACES) {
                    *point = (shows(pixel as usize, place, ray, &hit), hit);
                }
            }
        });
        EdgePoints { pixels, points }
    }

    /// The pixels as means over their points. `colour` gives the colour of what a point shows, and `point` that of what a ray in a
    /// pixel meets, if it is known.
    pub fn smooth(
        &self,
        caster: &Caster,
        width: usize,
        colour: impl Fn(usize, &Shows) -> Option<[f32; 3]> + Sync,
        point: impl Fn(usize, &Ray, Option<Hit>) -> Option<[f32; 3]> + Sync,
    ) -> impl Iterator<Item = (usize, [f32; 3])> {
        let mut means = vec![None; self.pixels.len()];
        for_parts(&mut means, 1, PIECE, |part, means| {
            let first = part * PIECE;
            for (mean, at) in means.iter_mut().zip(first..) {
                let pixel = self.pixels[at] as usize;
                let (mut sum, mut count) = ([0.0_f32; 3], 0.0_f32);
                for ((shows, hit), place) in self.points[at].iter().zip(PLACES) {
                    if matches!(shows, Shows::Beyond) {
                        continue;
                    }
                    let known = colour(pixel, shows).or_else(|| point(pixel, &ray(caster, width, pixel, place), *hit));
                    if let Some(colour) = known {
                        sum = [0, 1, 2].map(|channel| sum[channel] + colour[channel]);
                        count += 1.0;
                    }
                }
                *mean = (count > 0.0).then(|| sum.map(|channel| channel / count));
            }
        });
        self.pixels.iter().zip(means).filter_map(|(&pixel, mean)| Some((pixel as usize, mean?)))
    }
}

/// The ray through a point of a pixel.
fn ray(caster: &Caster, width: usize, pixel: usize, (x, y): (f64, f64)) -> Ray {
    let (column, row) = ((pixel % width) as f64, (pixel / width) as f64);
    let nowhere = || Ray::new(glam::Vec3::ZERO, glam::Vec3::ZERO);
    caster.ray(column + x, row + y).map_or_else(nowhere, |(ray, _)| ray)
}

/// The pixel of the 3 × 3 around that sees the point's surface in the same image: the same triangle if there is one, else one
/// that continues it.
pub(crate) fn alike(surfaces: &Surfaces, pixel: usize, point: &Seen) -> Option<usize> {
    let rank = |other: usize| {
        let seen = &surfaces.seen[other];
        if seen.side() == point.side() && seen.image == point.image && seen.through == point.through {
            Some(0)
        } else {
            point.continues(seen, surfaces.pixel_width).then_some(1)
        }
    };
    least(surfaces, pixel, rank)
}

/// A pixel of the 3 × 3 around that looks through a mirror or pane.
pub(crate) fn polished(surfaces: &Surfaces, pixel: usize) -> Option<usize> {
    least(surfaces, pixel, |other| surfaces.throughput.contains_key(&(other as u32)).then_some(0))
}

/// Of the 3 × 3 pixels around, the first of least rank, the one in the middle before others.
fn least(surfaces: &Surfaces, pixel: usize, rank: impl Fn(usize) -> Option<u32>) -> Option<usize> {
    let (width, height) = surfaces.size;
    let (column, row) = (pixel % width, pixel / width);
    let mut best: Option<(u32, usize)> = None;
    for y in row.saturating_sub(1)..(row + 2).min(height) {
        for x in column.saturating_sub(1)..(column + 2).min(width) {
            let other = y * width + x;
            let Some(rank) = rank(other) else { continue };
            let rank = rank * 2 + u32::from(other != pixel);
            if best.is_none_or(|(least, _)| rank < least) {
                best = Some((rank, other));
            }
        }
    }
    best.map(|(_, pixel)| pixel)
}

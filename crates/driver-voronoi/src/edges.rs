//! Smooth edges: pixels next to an edge are the mean of several points, each lit by its own surface's light.
//!
//! Invariant: a point's light comes from one of the 3 × 3 pixels around that see the same surface, or from what is known of
//! such surfaces as a whole; never from another surface.

use super::surfaces::{Caster, Seen, Surfaces};
use holo_display::for_bands;
use holo_raycast::{Hit, MAX_TILE, Ray};
use holo_scene::Rgb;

/// Points of an edge pixel that are always looked through.
const FIRST: usize = 8;

/// Points of a pixel of which the first show several things: half the error of an edge's place.
const POINTS: usize = 16;
const _: () = assert!(POINTS == 2 * FIRST && FIRST <= MAX_TILE);

/// Pixels of one piece of work.
const PIECE: usize = 256;

/// Places of the points: the first of Sobol's sequence in two dimensions, each in a column and a row of its own, well apart; so are the
/// first half of them.
const PLACES: [(f64, f64); POINTS] = [
    (0.03125, 0.03125),
    (0.53125, 0.53125),
    (0.28125, 0.78125),
    (0.78125, 0.28125),
    (0.15625, 0.65625),
    (0.65625, 0.15625),
    (0.40625, 0.40625),
    (0.90625, 0.90625),
    (0.09375, 0.96875),
    (0.59375, 0.46875),
    (0.34375, 0.21875),
    (0.84375, 0.71875),
    (0.21875, 0.34375),
    (0.71875, 0.84375),
    (0.46875, 0.59375),
    (0.96875, 0.09375),
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

impl Shows {
    /// Whether both have one colour. What is looked through, or is nobody's else, is asked for point by point.
    fn is_same(&self, other: &Shows) -> bool {
        match (self, other) {
            (Shows::Lit { by, material }, Shows::Lit { by: its, material: of }) => {
                (by, material) == (its, of)
            }
            (Shows::Sky, Shows::Sky) | (Shows::Beyond, Shows::Beyond) => true,
            _ => false,
        }
    }
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

/// Points of a pixel that show the same.
struct Group {
    shows: Shows,
    /// What the first of them meets.
    hit: Option<Hit>,
    place: u8,
    count: u8,
}

/// Some pixels' groups, one pixel after the other.
#[derive(Default)]
struct Piece {
    groups: Vec<Group>,
    /// By pixel, the number of groups up to and with its own.
    ends: Vec<u32>,
}

/// The pixels next to an edge, and what their points meet: found once for a view, since samples do not change it.
///
/// Most pixels' points show two surfaces, each in one light: kept by groups they take a quarter of the memory that a picture reads.
pub(crate) struct EdgePoints {
    pixels: Vec<u32>,
    pieces: Vec<Piece>,
}

impl EdgePoints {
    /// Casts the rays of all these pixels' points.
    pub fn cast(
        caster: &Caster,
        edges: &[bool],
        width: usize,
        shows: impl Fn(usize, (f64, f64), &Ray, &Option<Hit>) -> Shows + Sync,
    ) -> EdgePoints {
        let pixels: Vec<u32> =
            (0..).zip(edges).filter(|(_, edge)| **edge).map(|(pixel, _)| pixel).collect();
        let mut pieces: Vec<Piece> = Vec::new();
        pieces.resize_with(pixels.len().div_ceil(PIECE), Piece::default);
        for_bands(&mut pieces, 1, 1, |part, piece| {
            for Piece { groups, ends } in piece {
                for &pixel in pixels.iter().skip(part * PIECE).take(PIECE) {
                    let first = groups.len();
                    for places in [0..FIRST, FIRST..POINTS] {
                        if groups.len() == first + 1 {
                            // The whole pixel shows one thing.
                            break;
                        }
                        let rays: [Ray; FIRST] = std::array::from_fn(|i| {
                            ray(caster, width, pixel as usize, PLACES[places.start + i])
                        });
                        let mut hits = [None; FIRST];
                        caster.nearest_tile(&rays, &mut hits);
                        for (place, (ray, hit)) in places.zip(rays.iter().zip(hits)) {
                            let shows = shows(pixel as usize, PLACES[place], ray, &hit);
                            match groups[first..]
                                .iter_mut()
                                .find(|group| group.shows.is_same(&shows))
                            {
                                Some(group) => group.count += 1,
                                None => {
                                    groups.push(Group { shows, hit, place: place as u8, count: 1 })
                                }
                            }
                        }
                    }
                    ends.push(groups.len() as u32);
                }
            }
        });
        EdgePoints { pixels, pieces }
    }

    /// The pixels as means over their points, in their order. `colour` gives the colour of what a point shows, and `point` that of what a ray in a
    /// pixel meets, if it is known.
    pub fn smooth(
        &self,
        caster: &Caster,
        width: usize,
        colour: impl Fn(usize, &Shows) -> Option<[f32; 3]> + Sync,
        point: impl Fn(usize, &Ray, Option<Hit>) -> Option<[f32; 3]> + Sync,
    ) -> Vec<Option<[f32; 3]>> {
        let mut means = vec![None; self.pixels.len()];
        for_bands(&mut means, 1, PIECE, |part, means| {
            let Piece { groups, ends } = &self.pieces[part];
            let mut first = 0;
            for ((mean, &pixel), &end) in
                means.iter_mut().zip(&self.pixels[part * PIECE..]).zip(ends)
            {
                let (mut sum, mut count) = ([0.0_f32; 3], 0.0_f32);
                for group in &groups[first..end as usize] {
                    if matches!(group.shows, Shows::Beyond) {
                        continue;
                    }
                    let pixel = pixel as usize;
                    let known = colour(pixel, &group.shows).or_else(|| {
                        point(
                            pixel,
                            &ray(caster, width, pixel, PLACES[usize::from(group.place)]),
                            group.hit,
                        )
                    });
                    if let Some(colour) = known {
                        let points = f32::from(group.count);
                        sum = [0, 1, 2].map(|channel| sum[channel] + points * colour[channel]);
                        count += points;
                    }
                }
                first = end as usize;
                *mean = (count > 0.0).then(|| sum.map(|channel| channel / count));
            }
        });
        means
    }

    /// The pixels, each once.
    pub fn pixels(&self) -> &[u32] {
        &self.pixels
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
        if seen.side() == point.side() && seen.image == point.image && seen.through == point.through
        {
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

/// A pixel of the 3 × 3 around that sees nothing of the scene.
pub(crate) fn open(surfaces: &Surfaces, pixel: usize) -> Option<usize> {
    least(surfaces, pixel, |other| surfaces.seen[other].is_sky().then_some(0))
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

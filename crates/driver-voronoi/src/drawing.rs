//! Colours of pixels and of points at edges: light on what is seen, times its material, times what comes through mirrors and
//! panes before it.
//!
//! Invariant: a colour is a function of the samples' sums and the scene alone.

use super::Voronoi;
use super::edges::{Behind, EdgePoints, Shows, alike, open, polished};
use super::follow::number_of;
use super::indirect::Indirect;
use super::lit::{BLOCK, Lit, plain};
use super::reconstruct;
use super::surfaces::{Caster, NO_IMAGE, Seen};
use holo_display::for_bands;
use holo_raycast::{Hit, Ray};
use rustc_hash::FxHashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// The layer of what is seen in panes, besides what is seen through them.
const IN_PANES: usize = 1;

/// The layer of mirrors and panes themselves.
const POLISHED: usize = 2;

/// Samples along the eye's ray that what a metal reflects by geometry counts for.
const REFLECTION_COUNTS: f32 = 4.0;

/// Pixels to the right and down at which a surface is looked for that something before it may hide, nearest first.
const AROUND: [(f32, f32); 57] = [
    (0.0, 0.0),
    (1.0, 0.0),
    (-1.0, 0.0),
    (0.0, 1.0),
    (0.0, -1.0),
    (0.7, 0.7),
    (-0.7, 0.7),
    (0.7, -0.7),
    (-0.7, -0.7),
    (2.0, 0.0),
    (-2.0, 0.0),
    (0.0, 2.0),
    (0.0, -2.0),
    (1.4, 1.4),
    (-1.4, 1.4),
    (1.4, -1.4),
    (-1.4, -1.4),
    (4.0, 0.0),
    (-4.0, 0.0),
    (0.0, 4.0),
    (0.0, -4.0),
    (2.8, 2.8),
    (-2.8, 2.8),
    (2.8, -2.8),
    (-2.8, -2.8),
    (8.0, 0.0),
    (-8.0, 0.0),
    (0.0, 8.0),
    (0.0, -8.0),
    (5.7, 5.7),
    (-5.7, 5.7),
    (5.7, -5.7),
    (-5.7, -5.7),
    (16.0, 0.0),
    (-16.0, 0.0),
    (0.0, 16.0),
    (0.0, -16.0),
    (11.3, 11.3),
    (-11.3, 11.3),
    (11.3, -11.3),
    (-11.3, -11.3),
    (32.0, 0.0),
    (-32.0, 0.0),
    (0.0, 32.0),
    (0.0, -32.0),
    (22.6, 22.6),
    (-22.6, 22.6),
    (22.6, -22.6),
    (-22.6, -22.6),
    (64.0, 0.0),
    (-64.0, 0.0),
    (0.0, 64.0),
    (0.0, -64.0),
    (45.3, 45.3),
    (-45.3, 45.3),
    (45.3, -45.3),
    (-45.3, -45.3),
];

/// A view's layers with their light.
pub(crate) struct Drawing<'a> {
    voronoi: &'a Voronoi,
    caster: Caster<'a>,
    layers: Vec<Lit<'a>>,
}

/// What is known of the light on surfaces without samples near, by layer and the first pixel of the block that sees them: asking the
/// records for each pixel took a second for a picture without samples.
type Known = FxHashMap<(usize, usize), Option<[f32; 3]>>;

/// What a pixel's middle shows.
struct Middle {
    colour: [f32; 3],
    is_guess: bool,
}

impl<'a> Drawing<'a> {
    /// Reconstructs the light of all layers.
    pub fn new(voronoi: &'a Voronoi) -> Self {
        let caster = voronoi.caster();
        let mut drawing = Self {
            voronoi,
            caster,
            layers: voronoi.layers.iter().map(|layer| Lit::new(voronoi, layer)).collect(),
        };
        if drawing.layers.first().is_some_and(|main| main.is_new) {
            drawing.reflect();
        }
        drawing.layers.iter().filter(|lit| lit.is_new).for_each(Lit::keep);
        drawing
    }

    /// Fills in what pixels' middles show; gives how many pixels have no samples of their own, and of how many nothing at all is known.
    pub fn paint(&self, pixels: &mut [[f32; 3]]) -> (u64, u64) {
        let Some(main) = self.layers.first() else { return (0, 0) };
        let (width, _) = main.layer.surfaces.size;
        let guessed = AtomicU64::new(0);
        let plain = self.voronoi.once.plain.get_or_init(|| plain(&main.layer.surfaces));
        for_bands(pixels, width, BLOCK, |part, rows| {
            let mut guesses = 0;
            let mut known = Known::default();
            let first = part * BLOCK * width;
            let mut others = Vec::new();
            main.paint_plain(first, &plain[first..first + rows.len()], rows, &mut others);
            for pixel in others {
                let middle = self.middle(pixel, &mut known);
                guesses += u64::from(middle.is_guess);
                rows[pixel - first] = middle.colour;
            }
            guessed.fetch_add(guesses, Ordering::Relaxed);
        });
        (main.light.without(), guessed.into_inner())
    }

    /// Makes pixels next to edges means of several points.
    pub fn smooth(&self, pixels: &mut [[f32; 3]]) {
        let Some(main) = self.layers.first() else { return };
        let (width, _) = main.layer.surfaces.size;
        let points = self.voronoi.once.edge_points.get_or_init(|| {
            EdgePoints::cast(&self.caster, &self.edges(), width, |pixel, place, ray, hit| {
                let at = ((pixel % width) as f64 + place.0, (pixel / width) as f64 + place.1);
                self.look(at, pixel, ray, hit)
            })
        });
        let middles: &[[f32; 3]] = pixels;
        let colour = |pixel: usize, shows: &Shows| self.shown(pixel, shows, middles);
        let point = |pixel: usize, ray: &Ray, hit: Option<Hit>| self.point(pixel, ray, hit);
        let means = points.smooth(&self.caster, width, colour, point);
        for (&pixel, mean) in points.pixels().iter().zip(means) {
            if let Some(mean) = mean {
                pixels[pixel as usize] = mean;
            }
        }
    }

    /// A pixel in or beside this one that sees nothing of the scene, but perhaps what is beyond a portal.
    pub fn open(&self, pixel: usize) -> Option<usize> {
        self.layers.first().and_then(|main| open(&main.layer.surfaces, pixel))
    }

    pub fn caster(&self) -> &Caster<'a> {
        &self.caster
    }

    /// Pixels that have something else beside them.
    pub fn edges(&self) -> Vec<bool> {
        let edges = |number: usize| self.layers.get(number).map(|lit| &lit.layer.surfaces.edges);
        let mut all = edges(0).cloned().unwrap_or_default();
        if let Some(panes) = edges(IN_PANES) {
            all.iter_mut().zip(panes).for_each(|(edge, other)| *edge |= other);
        }
        all
    }

    /// What a ray shows through a point of the picture, in pixels.
    pub fn look(
        &self,
        (column, row): (f64, f64),
        pixel: usize,
        ray: &Ray,
        hit: &Option<Hit>,
    ) -> Shows {
        let seen = hit.map_or(Seen::NOTHING, |hit| self.caster.first(ray, &hit));
        if self.caster.is_beyond(column, row, &seen) {
            Shows::Beyond
        } else {
            self.shows(pixel, ray, hit)
        }
    }

    /// The colour of what a point in or beside a pixel shows, if that is known; `middles` has those of all pixels.
    pub fn shown(&self, pixel: usize, shows: &Shows, middles: &[[f32; 3]]) -> Option<[f32; 3]> {
        let main = self.layers.first()?;
        match shows {
            Shows::Sky => Some(self.voronoi.shadings.nothing),
            // Without samples near, its middle has the light that is known of such surfaces.
            Shows::Lit { by, material } => {
                main.light.at(*by as usize).map_or(Some(middles[*by as usize]), |light| {
                    Some(main.shadings.lit(*material, light))
                })
            }
            // Where only the pane or mirror itself has samples, a neighbour's are as good.
            Shows::Through(behind) => {
                let near = || polished(&main.layer.surfaces, pixel);
                let is_unplaced =
                    behind[0].as_ref().is_some_and(|behind| main.is_unplaced(&behind.seen));
                let plain =
                    if is_unplaced { near().and_then(|near| self.plainly(near)) } else { None };
                plain.or_else(|| self.through(behind)).or_else(|| near().map(|near| middles[near]))
            }
            Shows::Other | Shows::Beyond => None,
        }
    }

    /// The colour of a material in light between that of those of the pixels that see the same surface as pixel `by`.
    pub fn between(&self, by: usize, material: u32, around: &[(usize, f32)]) -> Option<[f32; 3]> {
        let main = self.layers.first()?;
        let labels = &main.layer.surfaces.labels;
        let (mut sum, mut whole) = ([0.0; 3], 0.0);
        for &(pixel, part) in around.iter().filter(|(pixel, _)| labels[*pixel] == labels[by]) {
            if let Some(light) = main.light.at(pixel) {
                sum = plus(sum, [part; 3], light);
                whole += part;
            }
        }
        (whole > 0.0).then(|| self.voronoi.shadings.lit(material, sum.map(|sum| sum / whole)))
    }

    /// What of a point next to an edge does not depend on samples.
    fn shows(&self, pixel: usize, ray: &Ray, hit: &Option<Hit>) -> Shows {
        let Some((main, hit)) = self.layers.first().zip(hit.as_ref()) else { return Shows::Sky };
        if self.caster.is_polished(hit.triangle) {
            return Shows::Through(Box::new(
                [0, IN_PANES].map(|layer| self.behind(layer, pixel, ray, hit)),
            ));
        }
        let seen = self.caster.first(ray, hit);
        match alike(&main.layer.surfaces, pixel, &seen) {
            Some(by) => Shows::Lit { by: by as u32, material: seen.material },
            None => Shows::Other,
        }
    }

    fn middle(&self, pixel: usize, known: &mut Known) -> Middle {
        if let Some(colour) = self.plainly(pixel) {
            return Middle { colour, is_guess: false };
        }
        let mut middle = Middle { colour: [0.0; 3], is_guess: false };
        // Most pixels look through nothing.
        let count = match self.layers.first() {
            Some(main) if !main.layer.surfaces.seen[pixel].through => 1,
            _ => POLISHED,
        };
        for (number, lit) in self.layers.iter().enumerate().take(count) {
            let seen = &lit.layer.surfaces.seen[pixel];
            let Some(share) = lit.share(pixel, number > 0) else { continue };
            let light = match lit.light.at(pixel) {
                _ if seen.image == NO_IMAGE => self.light(number, seen, Some(pixel)),
                Some(light) => Some(light),
                None => *known.entry((number, lit.first_alike(pixel))).or_insert_with_key(
                    |&(_, first)| self.light(number, &lit.layer.surfaces.seen[first], Some(first)),
                ),
            };
            if light.is_none() && !lit.is_certain(seen) {
                if !self.voronoi.is_covered(pixel) {
                    continue;
                }
                middle.is_guess = true;
            }
            middle.colour = plus(middle.colour, share, lit.colour(seen, light));
        }
        middle
    }

    /// The colour of what a ray next to an edge meets, if it is no mirror or pane; `None` if nothing is known of it.
    pub fn point(&self, pixel: usize, ray: &Ray, hit: Option<Hit>) -> Option<[f32; 3]> {
        let (main, hit) = self.layers.first().zip(hit)?;
        if self.caster.is_polished(hit.triangle) {
            return None;
        }
        let seen = self.caster.first(ray, &hit);
        let light = self.lit(main, &seen, alike(&main.layer.surfaces, pixel, &seen));
        (light.is_some() || main.is_certain(&seen)).then(|| main.colour(&seen, light))
    }

    /// What a ray shows of a layer that meets a mirror or pane.
    fn behind(&self, layer: usize, pixel: usize, ray: &Ray, hit: &Hit) -> Option<Behind> {
        let surfaces = &self.layers.get(layer)?.layer.surfaces;
        let end = self.caster.follow(*ray, *hit, layer == IN_PANES)?;
        let known = number_of(&surfaces.images, &end.image, end.seen.position.length());
        let seen = end.placed(known);
        Some(Behind { seen, share: end.share, by: alike(surfaces, pixel, &seen) })
    }

    /// The colour of what a point shows behind mirrors and panes and in panes; `None` if something is not known.
    fn through(&self, behind: &[Option<Behind>; 2]) -> Option<[f32; 3]> {
        let mut colour = [0.0; 3];
        for (number, (lit, behind)) in self.layers.iter().zip(behind).enumerate() {
            let Some(Behind { seen, share, by }) = behind else {
                if number == IN_PANES {
                    continue;
                }
                return None;
            };
            if number == 0 && lit.is_unknown(seen) {
                return None;
            }
            let light = match by.and_then(|by| lit.light.at(by)) {
                _ if seen.image == NO_IMAGE => self.light(number, seen, *by),
                light => light,
            };
            if light.is_none() && !lit.is_certain(seen) {
                return None;
            }
            colour = plus(colour, *share, lit.colour(seen, light));
        }
        Some(colour)
    }

    /// Light on what is seen in a layer, by a pixel that sees it.
    fn light(&self, layer: usize, seen: &Seen, pixel: Option<usize>) -> Option<[f32; 3]> {
        match self.layers.first().filter(|_| seen.image == NO_IMAGE) {
            Some(main) => self.lit(main, seen, self.directly(seen)),
            None => self.lit(self.layers.get(layer)?, seen, pixel),
        }
    }

    /// Light on a surface: that of a pixel that sees it, else what is known of such surfaces.
    fn lit(&self, lit: &Lit, seen: &Seen, pixel: Option<usize>) -> Option<[f32; 3]> {
        let voronoi = self.voronoi;
        let near = pixel.and_then(|pixel| lit.light.at(pixel));
        near.or_else(|| {
            let store = voronoi.records.as_deref().filter(|store| !store.is_empty());
            let indirect = store.map(|store| Indirect {
                store,
                caster: &self.caster,
                shadings: &voronoi.shadings,
            });
            lit.guess(seen, indirect.as_ref())
        })
    }

    /// The pixel that sees directly what is seen in a mirror without samples of its own, or the nearest around that sees the
    /// same side of its triangle: the mirror itself often hides it.
    fn directly(&self, seen: &Seen) -> Option<usize> {
        let main = self.layers.first()?;
        let surfaces = &main.layer.surfaces;
        let (x, y) = self.voronoi.camera.pixel(seen.position)?;
        let (width, height) = surfaces.size;
        AROUND.iter().find_map(|&(right, down)| {
            let (x, y) = (x + right, y + down);
            let inside = x >= 0.0 && y >= 0.0 && x < width as f32 && y < height as f32;
            let pixel = inside.then(|| y as usize * width + x as usize)?;
            let there = &surfaces.seen[pixel];
            let is_it = there.triangle() == seen.triangle() && there.image == 0 && !there.through;
            (is_it && main.light.at(pixel).is_some()).then_some(pixel)
        })
    }

    /// What samples of the mirror or pane itself show along the eye's ray, for a pixel that looks through one at something of
    /// which there is no sample: stored rays end at panes, so what stands behind all panes has none, and curved mirrors show no
    /// image that samples could be put into.
    fn plainly(&self, pixel: usize) -> Option<[f32; 3]> {
        let (main, polished) = self.layers.first().zip(self.layers.get(POLISHED))?;
        let behind = &main.layer.surfaces.seen[pixel];
        if !main.is_unplaced(behind) && !main.is_unknown(behind) {
            return None;
        }
        let seen = &polished.layer.surfaces.seen[pixel];
        polished.light.at(pixel).map(|light| polished.colour(seen, Some(light)))
    }

    /// Smooth metals: few samples look along the eye's ray, but what is reflected is mostly seen elsewhere, so it counts as some
    /// samples of the pixel.
    fn reflect(&mut self) {
        let Some(main) = self.layers.first() else { return };
        let surfaces = &main.layer.surfaces;
        let (width, _) = surfaces.size;
        let is_metal = |seen: &Seen| {
            !seen.through && !seen.is_sky() && self.voronoi.shadings.reflects(seen.material)
        };
        let metals = self.voronoi.once.metals.get_or_init(|| {
            let pixels = (0..).zip(&surfaces.seen);
            pixels.filter(|(_, seen)| is_metal(seen)).map(|(pixel, _)| pixel).collect()
        });
        let mut metals: Vec<(usize, Option<[f32; 3]>)> =
            metals.iter().map(|&pixel| (pixel, None)).collect();
        for_bands(&mut metals, 1, 64, |_, metals| {
            for (pixel, light) in metals {
                let (column, row) = (*pixel % width, *pixel / width);
                let reflected = self.reflection(column as f64 + 0.5, row as f64 + 0.5);
                *light = reflected.map(|colour| {
                    let sums = &main.layer.sums[*pixel];
                    let one = reconstruct::weight_of_one(self.voronoi.paths);
                    let weight = sums.weight as f32 / one + REFLECTION_COUNTS;
                    let steps = self.voronoi.shadings.unit.recip();
                    [0, 1, 2].map(|channel| {
                        (sums.light[channel] as f32 / one
                            + REFLECTION_COUNTS * colour[channel] * steps)
                            / weight
                    })
                });
            }
        });
        // Nobody else has it yet.
        let Some(main) = self.layers.first_mut().and_then(|main| Arc::get_mut(&mut main.light))
        else {
            return;
        };
        for (pixel, light) in metals {
            if let Some(light) = light {
                main.set(pixel, light);
            }
        }
    }

    /// Radiance that a smooth metal at a point of the picture reflects, if what is reflected is known.
    fn reflection(&self, column: f64, row: f64) -> Option<[f32; 3]> {
        let main = self.layers.first()?;
        let (ray, _) = self.caster.ray(column, row)?;
        let (seen, share) = self.caster.glance(ray, self.caster.nearest(&ray)?)?;
        let light = self.lit(main, &seen, self.directly(&seen));
        if light.is_none() && !main.is_certain(&seen) {
            return None;
        }
        Some(plus([0.0; 3], share, main.colour(&seen, light)))
    }
}

fn plus(sum: [f32; 3], share: [f32; 3], part: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|channel| sum[channel] + part[channel] * share[channel])
}

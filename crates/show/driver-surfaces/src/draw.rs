//! Draws pictures: interpolates the light of squares at every pixel, and multiplies it by the
//! material.
//!
//! Invariant: the best picture of a view is a function of the store and the view. The number of
//! threads changes no bit.

use crate::ambient::AmbientGuess;
use crate::behind::BehindPanes;
use crate::estimate::Estimate;
use crate::filter::OfSquares;
use crate::gather::Gathered;
use crate::known::LightMemory;
use crate::light_store::{FaceClass, LightStore, Reflections, Sums, luminance};
use crate::squares::{SquareLayer, Squares};
use crate::view::SurfaceView;
use crate::visible::{Edge, EdgePiece};
use crate::visible::{InPane, VisiblePoint};
use holo_denoise::Denoiser;
use holo_display::Interrupt;
use rayon::prelude::*;

/// A drawn view.
#[derive(Clone, Debug, Default)]
pub struct Drawn {
    /// Radiance of each pixel, rows from the top.
    pub pixels: Vec<[f32; 3]>,
    /// Standard error of each pixel's luminance; infinite if nothing is known of the pixel.
    pub errors: Vec<f32>,
}

/// Samples per pixel from which squares have sides of 2 pixels. In the best picture, a denoiser
/// always has such squares, because wider ones stand in where samples are few.
const SPARSE: f32 = 0.3;

/// Samples per pixel from which squares have sides of 1 pixel in the best picture.
const DENSE: f32 = 4.0;

/// The same for a picture that further ones soon replace. Such squares take three times as long.
/// In the cabin with 4 samples per pixel, they gain 0.3 dB.
const VERY_DENSE: f32 = 16.0;

/// Share of pixels with samples from which a denoiser makes better pictures from all pixels than
/// from squares of 2 × 2. It takes four times as long.
const COVERED: f32 = 0.7;

/// Greatest side of a square that a denoiser sees, pixels.
pub(crate) const WIDEST_DENOISED: usize = 16;

/// Greatest side of a square, pixels.
const MOST_STEP: usize = 4;

/// Expected relative difference between the light of a piece and that of the squares around it.
const SPREAD: f32 = 0.1;

/// The same if no square around the piece shows its surface.
const WIDE_SPREAD: f32 = 0.5;

/// How densely the samples of a view lie.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Density {
    /// Samples per pixel that shows a surface.
    pub samples: f32,
    /// The share of these pixels that have samples.
    pub covered: f32,
}

/// Light of a refined picture besides that of its squares.
struct RefinedLight<'a> {
    /// The sums of the view's pieces.
    pieces: &'a [Sums],
    /// The light that panes mirror and that covered surfaces show, by rank.
    in_panes: &'a [SquareLayer],
}

/// Light that earlier pictures found.
pub(crate) struct KnownLight {
    layer: SquareLayer,
    /// The light that panes mirror.
    in_panes: Option<SquareLayer>,
}

/// Stands for no pane.
const NO_PANE: u32 = u32::MAX;

/// Reflections in panes and covered surfaces with a layer of light each, one behind the other.
/// Those farther behind use the light of the last of these.
const MOST_RANKS: usize = 4;

impl Gathered {
    /// Draws the view, and stores the light found in `known`. `step` is the side of the filtered
    /// squares, pixels.
    ///
    /// If no pixel nearby has light, `store` provides a mean over a larger place. A denoiser
    /// replaces the filter's light, but not its standard errors. `None` if it was interrupted.
    #[must_use]
    pub(crate) fn draw_and_learn(
        &self,
        (view, store): (&SurfaceView, &LightStore),
        step: usize,
        denoiser: Option<&mut Denoiser>,
        known: &mut LightMemory,
        interrupt: &Interrupt,
    ) -> Option<Drawn> {
        let last_rank = view.in_panes.iter().map(|pane| pane.rank).max();
        let ranks = 0..last_rank.map_or(0, |last| (last + 1).min(MOST_RANKS));
        let panes: Vec<Vec<u32>> = ranks.map(|rank| view.panes_of_rank(rank)).collect();
        let mut in_panes = Vec::with_capacity(panes.len());
        for panes in &panes {
            in_panes.push(self.layer_of_panes((view, store), panes, step, interrupt)?);
        }
        let first = panes.first().map(Vec::as_slice).zip(in_panes.first());
        let (squares, lights) = self.squares((view, store), step, first, denoiser, interrupt)?;
        interrupt.check()?;
        let refined = RefinedLight { pieces: self.pieces(), in_panes: &in_panes };
        let layer = view.layer(store, squares, lights);
        let learn = || known.learn(view, &layer.squares, &layer.lights);
        Some(rayon::join(|| view.lit(store, &layer, &refined), learn).0)
    }

    /// Returns squares with sides of `step` pixels, and their light. `in_panes` has the first panes
    /// of pixels, and the light that they mirror. `None` if it was interrupted.
    ///
    /// A denoiser takes lone samples among squares without any for features of the picture. Where
    /// samples are few, the light is that of wider squares.
    fn squares(
        &self,
        (view, store): (&SurfaceView, &LightStore),
        step: usize,
        in_panes: Option<(&[u32], &SquareLayer)>,
        denoiser: Option<&mut Denoiser>,
        interrupt: &Interrupt,
    ) -> Option<(Squares, Vec<Estimate>)> {
        let squares = Squares::new(|pixel| view.seen[pixel], view.size, step);
        let pixels = self.pixels();
        let mut sums = OfSquares {
            towards_eye: squares.sums(view.size, |at| Some((&view.seen[at], &pixels[at]))),
            from_all: self.has_coats().then(|| {
                let all = |at| Some((&view.seen[at], self.of_all_directions(at)));
                squares.sums(view.size, all)
            }),
        };
        let behind = match in_panes {
            None => BehindPanes::default(),
            Some((panes, layer)) => {
                let mirrored = &view.squares_in_panes(panes, step).seen;
                let lit = (layer, &AmbientGuess::new(view, store));
                BehindPanes::new(view, (&squares, mirrored), lit, &mut sums)
            }
        };
        if sums.are_empty() {
            let unknown = vec![Estimate::UNKNOWN; squares.seen.len()];
            return Some((squares, unknown));
        }
        let once = denoiser.is_some();
        let filtered = squares.filter((view, store), &sums, &behind, once, interrupt)?;
        let Some(denoiser) = denoiser else { return Some((squares, filtered.lights)) };
        let mut lights = squares.denoise(&sums, &behind, filtered, denoiser, interrupt);
        if step < WIDEST_DENOISED
            && let Some(weights) = squares.weights_of_wider(&sums)
        {
            let (wider, of_wider) =
                self.squares((view, store), 2 * step, in_panes, Some(denoiser), interrupt)?;
            let wider = SquareLayer::new(wider, of_wider, |_| Estimate::UNKNOWN);
            lights.par_iter_mut().enumerate().for_each(|(number, light)| {
                let weight = weights[number];
                if weight > 0.0
                    && let Some(wide) = wider.at(squares.middle(number), &squares.seen[number])
                {
                    light.light = light.light.lerp(wide.light, weight);
                }
            });
        }
        Some((squares, lights))
    }

    /// Returns the light that panes mirror, in a picture whose squares have sides of `step` pixels.
    /// `None` if it was interrupted.
    ///
    /// Panes mirror a small share of light, so the squares of mirrored light have twice this side.
    /// With the same side, filtering them took as long as filtering everything else in rooms with
    /// windows.
    fn layer_of_panes(
        &self,
        (view, store): (&SurfaceView, &LightStore),
        panes: &[u32],
        step: usize,
        interrupt: &Interrupt,
    ) -> Option<SquareLayer> {
        let of_pixel = |pixel: usize| {
            let pane = panes[pixel] as usize;
            Some((&view.in_panes.get(pane)?.seen, self.in_panes().get(pane)?))
        };
        let squares = view.squares_in_panes(panes, (2 * step).min(MOST_STEP));
        let sums = OfSquares { towards_eye: squares.sums(view.size, of_pixel), from_all: None };
        let behind = BehindPanes::default();
        let filtered = squares.filter((view, store), &sums, &behind, false, interrupt)?;
        Some(view.layer(store, squares, filtered.lights))
    }

    /// Draws the view at rest.
    #[must_use]
    pub fn draw(
        &self,
        view: &SurfaceView,
        store: &LightStore,
        denoiser: Option<&mut Denoiser>,
    ) -> Drawn {
        let step = self.density(view).step(true, denoiser.is_some());
        let (known, interrupt) = (&mut LightMemory::default(), &Interrupt::default());
        let drawn = self.draw_and_learn((view, store), step, denoiser, known, interrupt);
        // Nobody else has the interrupt, so there is a picture.
        drawn.unwrap_or_default()
    }

    /// Returns how densely the view's samples lie.
    pub(crate) fn density(&self, view: &SurfaceView) -> Density {
        let of_pixels = self.pixels().par_iter().zip(&view.seen);
        let (samples, covered, pixels) = of_pixels
            .filter(|(_, seen)| seen.is_surface())
            .map(|(sums, _)| (u64::from(sums.count), usize::from(sums.count > 0), 1))
            .reduce(|| (0, 0, 0), |a, b| (a.0 + b.0, a.1 + b.1, a.2 + b.2));
        let pixels = pixels.max(1) as f32;
        Density { samples: samples as f32 / pixels, covered: covered as f32 / pixels }
    }
}

impl Density {
    /// Returns the side of the filtered squares, pixels. Squares are wider if samples are few. If
    /// the picture need not be the best, it appears soon.
    pub fn step(&self, is_best: bool, has_denoiser: bool) -> usize {
        let dense = if is_best || has_denoiser { DENSE } else { VERY_DENSE };
        if self.samples < SPARSE && !(is_best && has_denoiser) {
            MOST_STEP
        } else if self.samples >= dense || (is_best && has_denoiser && self.covered >= COVERED) {
            1
        } else {
            2
        }
    }
}

impl SurfaceView {
    /// Returns the light that earlier pictures found, in squares of side `step`, and elsewhere the
    /// mean light around. `None` if more than the share `unknown` of the squares is unknown.
    pub(crate) fn known(
        &self,
        (store, known, reflections): (&LightStore, &LightMemory, Option<&Reflections>),
        step: usize,
        unknown: f32,
    ) -> Option<KnownLight> {
        let squares = Squares::new(|pixel| self.seen[pixel], self.size, step);
        let lights = known.lights(self, &squares, reflections, unknown)?;
        let in_panes = (!self.in_panes.is_empty()).then(|| {
            let squares = self.squares_in_panes(&self.panes_of_rank(0), step);
            let unknown = vec![Estimate::UNKNOWN; squares.seen.len()];
            self.layer(store, squares, unknown)
        });
        Some(KnownLight { layer: self.layer(store, squares, lights), in_panes })
    }

    /// Returns squares with their light. Where it is unknown, the guess is the mean light around.
    fn layer(&self, store: &LightStore, squares: Squares, lights: Vec<Estimate>) -> SquareLayer {
        let around = &AmbientGuess::new(self, store);
        SquareLayer::new(squares, lights, |seen| self.mean_around(around, seen))
    }

    /// Returns the number of the reflection in a pane or covered surface of this rank that each
    /// pixel's middle shows; [`NO_PANE`] where there is none.
    fn panes_of_rank(&self, rank: usize) -> Vec<u32> {
        let mut panes = vec![NO_PANE; self.seen.len()];
        for (number, pane) in (0..).zip(&self.in_panes[..self.panes_of_middles]) {
            if pane.rank == rank {
                panes[pane.pixel] = number;
            }
        }
        panes
    }

    /// Returns the squares of what panes mirror. `panes` are the panes of pixels.
    fn squares_in_panes(&self, panes: &[u32], step: usize) -> Squares {
        let in_pane = |pixel: usize| self.in_panes.get(panes[pixel] as usize);
        let seen = |pixel| in_pane(pixel).map_or(VisiblePoint::NOTHING, |pane| pane.seen);
        Squares::new(seen, self.size, step)
    }

    /// Draws the view from known light.
    pub(crate) fn draw_known(&self, store: &LightStore, known: &KnownLight) -> Drawn {
        let refined = RefinedLight { pieces: &[], in_panes: known.in_panes.as_slice() };
        self.lit(store, &known.layer, &refined)
    }

    /// Draws the view with the light of `layer`.
    fn lit(&self, store: &LightStore, layer: &SquareLayer, refined: &RefinedLight) -> Drawn {
        let (width, height) = self.size;
        let around = &AmbientGuess::new(self, store);
        let mut pixels = vec![[0.0; 3]; width * height];
        let mut errors = vec![0.0; width * height];
        let rows = pixels.par_chunks_mut(width).zip(errors.par_chunks_mut(width)).enumerate();
        rows.for_each(|(y, (pixels, errors))| {
            for x in 0..width {
                let seen = &self.seen[y * width + x];
                let light = self.light_at(around, Some(layer), (x as f32, y as f32), seen);
                (pixels[x], errors[x]) = self.painted(seen, light);
            }
        });
        let on_edge = |edge: &Edge| {
            let sums = refined.pieces.get(edge.pieces.clone())?;
            Some((edge.pixel, self.on_edge(around, layer, &self.pieces[edge.pieces.clone()], sums)))
        };
        let on_edges: Vec<_> = self.edges.par_iter().filter_map(on_edge).collect();
        for (pixel, shown) in on_edges {
            (pixels[pixel], errors[pixel]) = shown;
        }
        let in_pane = |InPane { pixel, seen, rank, .. }: &InPane| {
            let at = ((pixel % width) as f32, (pixel / width) as f32);
            let layer = refined.in_panes.get(*rank).or(refined.in_panes.last());
            self.painted(seen, self.light_at(around, layer, at, seen))
        };
        let in_panes: Vec<_> = self.in_panes.par_iter().map(in_pane).collect();
        for (&InPane { pixel, share, .. }, (more, error)) in self.in_panes.iter().zip(in_panes) {
            (0..3).for_each(|c| pixels[pixel][c] += share * more[c]);
            errors[pixel] += share * error;
        }
        Drawn { pixels, errors }
    }

    /// Returns the radiance of a surface in this light, and its standard error.
    fn painted(&self, seen: &VisiblePoint, light: Estimate) -> ([f32; 3], f32) {
        let (scale, radiance) = self.paint(seen);
        let unit = self.unit();
        let colour = [0, 1, 2].map(|c| radiance[c] + scale[c] * light.light[c] * unit);
        let bright = luminance(scale);
        (colour, if seen.is_surface() { bright * light.error * unit } else { 0.0 })
    }

    /// Returns the light at a point of the picture: that of nearby squares that show the same
    /// surface, or else the mean light around.
    pub(crate) fn light_at(
        &self,
        around: &AmbientGuess,
        layer: Option<&SquareLayer>,
        at: (f32, f32),
        seen: &VisiblePoint,
    ) -> Estimate {
        if !seen.is_surface() {
            return Estimate::default();
        }
        // Guesses of squares serve many pixels, because looking around takes long.
        let near = layer.and_then(|layer| layer.at(at, seen).or_else(|| layer.guess_at(at, seen)));
        near.unwrap_or_else(|| self.mean_around(around, seen))
    }

    /// Returns the radiance of a pixel on an edge, and its standard error.
    fn on_edge(
        &self,
        around: &AmbientGuess,
        layer: &SquareLayer,
        pieces: &[EdgePiece],
        sums: &[Sums],
    ) -> ([f32; 3], f32) {
        let (mut colour, mut error) = ([0.0; 3], 0.0);
        for (piece, sums) in pieces.iter().zip(sums) {
            let light = self.on_piece(around, layer, piece, sums);
            let (shown, more) = self.painted(&piece.seen, light);
            colour.iter_mut().zip(shown).for_each(|(sum, c)| *sum += piece.share * c);
            error += piece.share * more;
        }
        (colour, error)
    }

    /// Returns the light of a piece: that of squares around it, improved by the piece's own
    /// samples.
    fn on_piece(
        &self,
        around: &AmbientGuess,
        layer: &SquareLayer,
        piece: &EdgePiece,
        sums: &Sums,
    ) -> Estimate {
        if !piece.seen.is_surface() {
            return Estimate::default();
        }
        match layer.at(piece.at, &piece.seen) {
            // Samples through panes also contain what the panes mirror.
            Some(near) if self.way(&piece.seen).pane > 0.0 => near,
            Some(near) => near.improved(sums, SPREAD),
            None => self.mean_around(around, &piece.seen).improved(sums, WIDE_SPREAD),
        }
    }

    /// Returns the mean light around a surface. If nothing is known there, it is the mean of all
    /// light, which is more plausible than black.
    fn mean_around(&self, around: &AmbientGuess, seen: &VisiblePoint) -> Estimate {
        if !seen.is_surface() {
            return Estimate::UNKNOWN;
        }
        let direction = self.way(seen).direction;
        let serves = |face: FaceClass| face.serves(seen.normal, seen.material, direction);
        let sums = around.store.around(seen.point, serves);
        if sums.count == 0 {
            return Estimate { light: around.of(seen), ..Estimate::UNKNOWN };
        }
        let light = sums.mean();
        let bright = luminance(light.to_array());
        let variance = (sums.mean_square() - bright * bright).max(bright * bright);
        Estimate { light, error: (variance / sums.count as f32).sqrt(), variance }
    }
}

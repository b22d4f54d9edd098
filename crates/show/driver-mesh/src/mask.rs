//! Which pixels of a picture show something: those that a section covers, those whose beam cannot
//! hit anything, and those with live rays.

use std::collections::HashSet;

use holo_display::{Frame, SkyView, best_beam, covered, uncovered_pixels};
use holo_picture::View;
use holo_section::{BeamKey, Section};
use rayon::prelude::*;

/// What is known of a view's pixels beside their colours.
pub struct PixelMask {
    /// Whether a section covers the pixel's middle.
    covered: Vec<bool>,
    /// Whether the pixel has samples of this view.
    sampled: Vec<bool>,
    /// Whether live rays have arrived. Empty before the first one.
    live: Vec<bool>,
    /// Beams whose rays hit nothing.
    pub unseen: HashSet<BeamKey>,
    /// The best beam of each pixel's middle. Empty while no unseen beam is known.
    best: Vec<Option<BeamKey>>,
}

impl PixelMask {
    pub fn new(sections: &[Section], view: &View, size: (u32, u32)) -> PixelMask {
        let covered = covered(sections, view, size);
        let (live, best) = (Vec::new(), Vec::new());
        PixelMask {
            sampled: vec![false; covered.len()],
            covered,
            live,
            unseen: HashSet::new(),
            best,
        }
    }

    /// Marks the pixel of a sample.
    pub fn note_sample(&mut self, pixel: usize) {
        self.sampled[pixel] = true;
    }

    /// Marks the pixel of a live ray.
    pub fn note_live(&mut self, pixel: usize) {
        self.live.resize(self.covered.len(), false);
        self.live[pixel] = true;
    }

    /// Marks a beam as unseen. Ignores unknown sections and beams.
    pub fn note_unseen(
        &mut self,
        sections: &[Section],
        view: &View,
        size: (u32, u32),
        key: BeamKey,
    ) {
        if key.section_in(sections).is_none() {
            return;
        }
        if self.best.is_empty() {
            let best = |pixel: u32| {
                let (x, y) = View::pixel_centre(size, pixel % size.0, pixel / size.0);
                let (origin, direction, _) = view.clipped_ray(x, y)?;
                best_beam(sections, origin, direction)
            };
            self.best = (0..self.covered.len() as u32).into_par_iter().map(best).collect();
        }
        self.unseen.insert(key);
    }

    /// Returns the pixels that no section covers.
    pub fn uncovered(&self, view: &View, size: (u32, u32)) -> Vec<u32> {
        uncovered_pixels(&self.covered, view, size)
    }

    /// Shows the sky in pixels of unseen beams and nothing in pixels without light, and counts both.
    pub fn apply(&self, frame: &mut Frame, view: &View, sky: &SkyView) {
        let size = (frame.picture.width, frame.picture.height);
        let sky_of = |pixel: u32| {
            let (x, y) = View::pixel_centre(size, pixel % size.0, pixel / size.0);
            match view.try_ray(x, y) {
                Some((_, direction)) if !view.clips_sky() => sky.along(direction),
                _ => [0.0; 3],
            }
        };
        for (number, (pixel, depth)) in
            frame.picture.pixels.iter_mut().zip(&mut frame.depth).enumerate()
        {
            let is_live = self.live.get(number) == Some(&true);
            let best = self.best.get(number).copied().flatten();
            if !self.covered[number] {
                frame.uncovered_pixels += 1;
                if !is_live {
                    (*pixel, *depth) = ([0.0; 3], 0.0);
                }
            } else if best.is_some_and(|best| self.unseen.contains(&best)) {
                frame.unseen_pixels += 1;
                (*pixel, *depth) = (sky_of(number as u32), f32::INFINITY);
            } else if !self.sampled[number] {
                frame.empty_pixels += 1;
            }
        }
    }
}

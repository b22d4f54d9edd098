//! What is seen through portals: surfaces, themselves invisible, beyond which the scene at hand lacks geometry, so that nothing there can
//! be told from its depth (Larson & Simmons 1999, §2.4.4).
//!
//! Invariant: only pixels that look through a portal are touched.

use super::surfaces::{Caster, Seen};
use holo_display::for_bands;
use crate::quadtree::{Frame, Quadtree, QuadtreeParams};
use holo_picture::View;
use holo_section::{BeamId, Sample, Section};
use std::sync::Arc;

/// Rows of one piece of work.
const ROWS: usize = 16;

/// The pixels that look through portals, and what draws them: samples alone.
pub(crate) struct Beyond {
    pub(super) pixels: Vec<bool>,
    pub(super) driver: Quadtree,
}

impl Beyond {
    /// `None` if no pixel looks through a portal. Those that do see nothing of the scene.
    pub fn new(
        caster: &Caster,
        seen: &[Seen],
        (sections, view, size): (&Arc<[Section]>, View, (u32, u32)),
        sky: [f32; 3],
    ) -> Option<Beyond> {
        let width = caster.size.0;
        let mut pixels = vec![false; seen.len()];
        for_bands(&mut pixels, width, ROWS, |part, pixels| {
            for (is_beyond, pixel) in pixels.iter_mut().zip(part * ROWS * width..) {
                let middle = ((pixel % width) as f64 + 0.5, (pixel / width) as f64 + 0.5);
                *is_beyond =
                    seen[pixel].is_sky() && caster.is_beyond(middle.0, middle.1, &seen[pixel]);
            }
        });
        if !pixels.contains(&true) {
            return None;
        }
        let params = QuadtreeParams { sky, ..QuadtreeParams::default() };
        Some(Beyond { pixels, driver: Quadtree::new(Arc::clone(sections), view, size, params) })
    }

    /// Adds samples of one beam.
    pub fn insert(&mut self, section: u16, beam: BeamId, paths: u16, samples: &[Sample]) {
        self.driver.insert(section, beam, paths, samples);
    }

    /// A beam that sees nothing shows the sky.
    pub fn insert_unseen(&mut self, section: u16, beam: BeamId) {
        self.driver.insert_unseen(section, beam);
    }

    /// Draws the pixels that look through portals.
    pub fn paint(&self, frame: &mut Frame) {
        let there = self.driver.draw();
        let colours = frame.picture.pixels.iter_mut().zip(&there.picture.pixels);
        let depths = frame.depth.iter_mut().zip(&there.depth);
        for (((to, from), (depth, its)), _) in
            colours.zip(depths).zip(&self.pixels).filter(|(_, beyond)| **beyond)
        {
            (*to, *depth) = (*from, *its);
            frame.empty_pixels += u64::from(*its == 0.0);
        }
    }
}

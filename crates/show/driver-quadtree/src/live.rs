//! Pixels that no section covers, drawn from live rays, which are rays of the view itself.
//!
//! Invariant: covered pixels use no live rays, so a replay of the file draws them as the session
//! does.

use crate::bins::{FAR, depth_bin};
use crate::reproject::FULL_WEIGHT;
use crate::sums::{Colour, NEAR_CLASSES};
use crate::tree::{MAX_PATHS, Quadtree, QuadtreeParams};
use holo_display::{Frame, LiveSample};
use holo_picture::View;
use std::sync::Arc;

/// A picture of live rays alone, and the pixels that show it.
pub(crate) struct Overlay {
    pixels: Vec<u32>,
    tree: Quadtree,
}

impl Overlay {
    /// Returns an overlay without rays for some pixels of a picture of `size`.
    pub fn new(pixels: Vec<u32>, view: View, size: (u32, u32)) -> Self {
        let mut tree = Quadtree::new(Arc::new([]), view, size, QuadtreeParams::default());
        tree.covered.fill(true);
        Self { pixels, tree }
    }

    /// Adds rays of the view, each the mean of `paths` paths.
    pub fn insert(&mut self, paths: u16, rays: &[LiveSample]) {
        let weight = FULL_WEIGHT * u32::from(paths.clamp(1, MAX_PATHS));
        let tree = &mut self.tree;
        let (width, height) = (f64::from(tree.size.0), f64::from(tree.size.1));
        for ray in rays {
            let (point, _) = ray.place(&tree.camera);
            let Some((x, y)) = tree.camera.project(point) else { continue };
            // Also refuses NaN.
            if !(x >= 0.0 && x < width && y >= 0.0 && y < height) {
                continue;
            }
            let distance_squared = (point - tree.camera.eye_of(point)).length_squared();
            let bin = if ray.distance.is_finite() { depth_bin(distance_squared) } else { FAR };
            let pixel = y as usize * tree.size.0 as usize + x as usize;
            let colour = Colour::from_rgbe(ray.rgbe());
            tree.aligned.add(pixel, bin, &colour, weight, Some(NEAR_CLASSES - 1));
        }
    }

    /// Draws the pixels over those of a frame.
    pub fn paint(&self, frame: &mut Frame) {
        let drawn = self.tree.draw();
        for pixel in self.pixels.iter().map(|&pixel| pixel as usize) {
            frame.picture.pixels[pixel] = drawn.picture.pixels[pixel];
            frame.depth[pixel] = drawn.depth[pixel];
        }
    }
}

//! A picture of rays that were traced for it, in place of samples of sections: pixels that no section covers.
//!
//! Invariant: as in every quadtree, rays are summed, so that their order changes no bit.

use super::bins::{FAR, depth_bin};
use super::reproject::FULL_WEIGHT;
use super::sums::{Colour, NEAR_CLASSES};
use super::{MAX_PATHS, Quadtree, QuadtreeParams};
use holo_display::LiveSample;
use holo_picture::View;
use std::sync::Arc;

impl Quadtree {
    /// An empty picture without sections: of live rays alone, which may show any of its pixels.
    pub fn of_live_rays(view: View, size: (u32, u32), params: QuadtreeParams) -> Self {
        let mut tree = Self::new(Arc::new([]), view, size, params);
        tree.covered.fill(true);
        tree.uncovered_pixels = 0;
        tree
    }

    /// Adds rays of the view itself, each the mean of `paths` paths.
    pub fn insert_live(&mut self, paths: u16, rays: &[LiveSample]) {
        let weight = FULL_WEIGHT * u32::from(paths.clamp(1, MAX_PATHS));
        let (width, height) = (self.size.0 as usize, self.size.1 as usize);
        for ray in rays {
            let (point, _) = ray.place(&self.camera);
            let Some((x, y)) = self.camera.project(point) else { continue };
            // Also refuses NaN.
            if !(x >= 0.0 && x < width as f64 && y >= 0.0 && y < height as f64) {
                continue;
            }
            let eye = self.camera.eye_of(point);
            let bin = if ray.distance.is_finite() {
                depth_bin((point - eye).length_squared())
            } else {
                FAR
            };
            let pixel = y as usize * width + x as usize;
            self.narrow.add(
                pixel,
                bin,
                &Colour::from_rgbe(ray.rgbe()),
                weight,
                Some(NEAR_CLASSES - 1),
            );
            self.changes += 1;
            if self.drawing.as_mut().is_some_and(|drawing| !drawing.has_landed([pixel].into_iter()))
            {
                self.give_up_drawing();
            }
        }
    }

    /// The pixels that look somewhere and that no section covers, by their number, row by row from the top.
    pub fn uncovered(&self) -> Vec<u32> {
        let (width, _) = self.size;
        let looks = |pixel: &u32| {
            let (x, y) = View::pixel_centre(self.size, pixel % width, pixel / width);
            self.view.try_ray(x, y).is_some()
        };
        (0..)
            .zip(&self.covered)
            .filter(|(_, covered)| !**covered)
            .map(|(pixel, _)| pixel)
            .filter(looks)
            .collect()
    }
}

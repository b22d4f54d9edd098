//! Pixels that look through portals: invisible surfaces beyond which the stand-in lacks parts of
//! the scene (Larson & Simmons 1999, §2.4.4). Another driver draws these pixels from samples alone.
//!
//! Invariant: a portal behind a surface has no effect.

use holo_display::{Driver, Frame, FramePhase, Interrupt};
use holo_picture::View;
use holo_raycast::{Ray, Raycaster};
use rayon::prelude::*;

/// Draws the pixels that look through portals.
pub(crate) struct PortalPixels {
    pub driver: Driver,
    /// For each pixel, true if it looks through a portal.
    pub pixels: Vec<bool>,
}

/// Returns, for each pixel of a picture, true if its ray hits a portal but none of the geometry.
pub(crate) fn looking_beyond(
    geometry: &Raycaster,
    portals: &Raycaster,
    view: &View,
    size: (u32, u32),
) -> Vec<bool> {
    let is_beyond = |pixel: u32| {
        let (x, y) = View::pixel_centre(size, pixel % size.0, pixel / size.0);
        let Some((origin, direction, reach)) = view.clipped_ray(x, y) else { return false };
        let meets = |raycaster: &Raycaster| {
            let near = raycaster.localize(origin, direction);
            near.is_some_and(|(ray, skipped)| {
                let t_max = (reach - skipped) as f32;
                raycaster.nearest(&Ray { t_max, ..ray }).is_some()
            })
        };
        meets(portals) && !meets(geometry)
    };
    (0..size.0 * size.1).into_par_iter().map(is_beyond).collect()
}

impl PortalPixels {
    /// Copies the pixels that look through portals into a frame. `None` if it was interrupted.
    pub fn paint(
        &mut self,
        frame: &mut Frame,
        phase: FramePhase,
        interrupt: &Interrupt,
    ) -> Option<()> {
        let drawn = self.driver.renderer.draw(phase, interrupt, &mut |_| {})?;
        for (pixel, _) in self.pixels.iter().enumerate().filter(|(_, is_beyond)| **is_beyond) {
            frame.picture.pixels[pixel] = drawn.picture.pixels[pixel];
            frame.depth[pixel] = drawn.depth[pixel];
            frame.empty_pixels += u64::from(drawn.depth[pixel] == 0.0);
        }
        Some(())
    }
}

//! Pixels that no section covers, by rays that were traced for them and are stored nowhere.
//!
//! They are shown by a copy of the driver ([`Voronoi::copied`]) that has these rays besides all samples: light is averaged along surfaces, and what
//! is seen next to the covered pixels must not change those, which samples alone decide.

use super::portals::Beyond;
use super::shade::Shadings;
use super::{Layer, Voronoi};
use holo_display::DistanceTable;
use crate::{LiveSample, Quadtree, QuadtreeParams};
use holo_picture::View;
use std::sync::{Arc, Mutex};

impl Voronoi {
    /// Another driver of the same view that has the same samples. What the view sees is shared by the two.
    pub fn copied(&self) -> Voronoi {
        let copied = |layer: &Layer| Layer {
            surfaces: Arc::clone(&layer.surfaces),
            sums: layer.sums.clone(),
            samples: layer.samples,
            changes: layer.changes.clone(),
            narrow: layer.narrow.clone(),
            made: Mutex::default(),
        };
        Voronoi {
            sections: Arc::clone(&self.sections),
            placed: self.placed.clone(),
            raycaster: Arc::clone(&self.raycaster),
            portals: self.portals.clone(),
            beyond: self
                .beyond
                .as_ref()
                .map(|beyond| beyond.of_live_rays(self.view, self.size, self.shadings.sky)),
            shadings: Shadings::new(self.raycaster.scene(), self.view.clips_sky()),
            view: self.view,
            camera: self.camera.clone(),
            size: self.size,
            scale: self.scale.clone(),
            distances: DistanceTable::new(),
            layers: self.layers.iter().map(copied).collect(),
            covered: self.covered.clone(),
            uncovered: self.uncovered,
            samples: self.samples,
            paths: self.paths,
            records: self.records.clone(),
            once: Arc::clone(&self.once),
            scratch: Mutex::default(),
            painted: Mutex::default(),
        }
    }

    /// Adds rays of the view itself, each the mean of `paths` paths.
    pub fn insert_live(&mut self, paths: u16, rays: &[LiveSample]) {
        self.deposit(paths, |_, depositor, to| depositor.insert_live(paths, rays, to));
        if let Some(beyond) = &mut self.beyond {
            beyond.insert_live(paths, rays);
        }
    }

    /// The pixels that no section covers and that see something, by their number, row by row from the top: the sky is known, and
    /// corners of fisheyes look nowhere. None at a lower resolution: that is for views that are soon left.
    pub fn uncovered(&self) -> Vec<u32> {
        if self.scale.is_some() {
            return Vec::new();
        }
        let (width, _) = self.size;
        let sees = |&(pixel, _): &(u32, &bool)| {
            let is_beyond = self.beyond.as_ref().is_some_and(|beyond| beyond.has(pixel as usize));
            let sees = |layer: &Layer| {
                layer.surfaces.seen.get(pixel as usize).is_some_and(|seen| !seen.is_sky())
            };
            is_beyond || self.layers.iter().any(sees)
        };
        let looks = |pixel: &u32| {
            let (x, y) = View::pixel_centre(self.size, pixel % width, pixel / width);
            self.view.try_ray(x, y).is_some()
        };
        let pixels = (0..).zip(&self.covered).filter(|(_, covered)| !**covered).filter(sees);
        pixels.map(|(pixel, _)| pixel).filter(looks).collect()
    }
}

impl Beyond {
    /// The same pixels, of live rays alone.
    fn of_live_rays(&self, view: View, size: (u32, u32), sky: [f32; 3]) -> Beyond {
        let params = QuadtreeParams { sky, ..QuadtreeParams::default() };
        Beyond { pixels: self.pixels.clone(), driver: Quadtree::of_live_rays(view, size, params) }
    }

    fn insert_live(&mut self, paths: u16, rays: &[LiveSample]) {
        self.driver.insert_live(paths, rays);
    }

    fn has(&self, pixel: usize) -> bool {
        self.pixels.get(pixel).copied().unwrap_or(false)
    }
}

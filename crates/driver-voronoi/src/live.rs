//! Pixels that no section covers, drawn from rays that were traced for them and are stored nowhere.
//!
//! A copy of the driver draws them ([`Voronoi::copied`]): it has these rays besides all samples.
//! Light is averaged along surfaces, and live rays must not change covered pixels.

use super::shade::Shadings;
use super::{Layer, Voronoi};
use holo_display::{DistanceTable, LiveSample, uncovered_pixels};
use std::sync::{Arc, Mutex};

impl Voronoi {
    /// Returns another driver of the same view with the same samples. The two share the surfaces
    /// that the view sees.
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
            beyond: self.beyond.clone(),
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
    }

    /// Returns the pixels that no section covers and that see something, by number, row by row
    /// from the top. The sky is known. None at a lower resolution, which is for views that are
    /// soon left.
    pub fn uncovered(&self) -> Vec<u32> {
        if self.scale.is_some() {
            return Vec::new();
        }
        let mut pixels = uncovered_pixels(&self.covered, &self.view, self.size);
        pixels.retain(|&pixel| {
            let pixel = pixel as usize;
            let sees =
                |layer: &Layer| layer.surfaces.seen.get(pixel).is_some_and(|seen| !seen.is_sky());
            self.beyond.get(pixel) == Some(&true) || self.layers.iter().any(sees)
        });
        pixels
    }

    /// Returns, by pixel of the picture, whether it looks through a portal; empty if none does.
    pub fn beyond_portals(&self) -> Vec<bool> {
        match &self.scale {
            Some(scale) if !self.beyond.is_empty() => scale.spread(&self.beyond),
            _ => self.beyond.clone(),
        }
    }

    /// Returns the distance from the eye to what the middle of a pixel of the picture sees first,
    /// and its triangle; `None` if that is the sky.
    pub fn hit_at(&self, column: u32, row: u32) -> Option<(f32, u32)> {
        let (width, height) = self
            .scale
            .as_ref()
            .map_or((self.size.0 as usize, self.size.1 as usize), |scale| scale.fine);
        let along = |at: u32, picture: usize, cast: u32| {
            (f64::from(at) + 0.5) / picture as f64 * f64::from(cast)
        };
        let (x, y) = (along(column, width, self.size.0), along(row, height, self.size.1));
        let (ray, skipped) = self.caster().ray(x, y)?;
        let hit = self.raycaster.nearest(&ray)?;
        Some(((skipped + f64::from(hit.t)) as f32, hit.triangle))
    }
}

//! The results of a frame: the picture, and the rays that would improve the next picture most.
//!
//! A display can request the rays from a holoserver as single rays of beams, or as weights of beams
//! (Larson & Simmons 1999, §2.4.2).

use std::collections::BTreeMap;

use glam::DVec3;
use holo_display::{WantedBeam, best_beam};
use holo_picture::Picture;
use holo_section::{BeamKey, RayCoords, Section};

use crate::cache::CacheFrame;
use crate::{Tag, colour};

impl<'a> CacheFrame<'a> {
    /// Returns the picture, with its view.
    pub fn picture(&self) -> Picture {
        let planes = &self.cache.planes;
        let mut picture = Picture::new(planes.width as u32, planes.height as u32);
        picture.pixels.copy_from_slice(&planes.picture);
        picture.view = self.cache.view;
        picture
    }

    /// Returns the depth of the nearest point of each pixel, rows from the top; 0 if the pixel has
    /// no point, or a culled one.
    ///
    /// The depth is measured along the view's direction in a perspective, and along the pixel's ray
    /// in other views. Infinitely far points, and points that the view clips, have huge depths:
    /// those of `map::far_depth` and more.
    pub fn depth(&self) -> impl Iterator<Item = f32> + 'a {
        let planes = &self.cache.planes;
        let shown = |(&depth, &colour): (&f32, &u32)| {
            if colour == colour::NONE { 0.0 } else { depth.abs() }
        };
        planes.depth.iter().zip(&planes.colour).map(shown)
    }

    /// Returns the requested rays, those for the predicted view first: tag, origin and direction.
    /// The renderer returns the tag with the sample.
    ///
    /// Rays begin on the view's fore clipping surface. The direction has length 1. In the corners
    /// of a fisheye, which show nothing, it has length 0.
    pub fn requests(&self) -> impl Iterator<Item = (Tag, DVec3, DVec3)> + 'a {
        let cache = self.cache;
        cache.requests.iter().filter_map(move |request| {
            let view =
                if request.predicted { cache.predicted.as_ref() } else { cache.view.as_ref() };
            let (origin, direction) = request.ray(view?, cache.origin);
            Some((request.tag, origin, direction))
        })
    }

    /// Returns the number of requested rays, and the number of those for the predicted view.
    pub fn request_counts(&self) -> (usize, usize) {
        let requests = &self.cache.requests;
        (requests.len(), requests.iter().filter(|request| request.predicted).count())
    }

    /// Returns the requests as stored rays: the nearest ray of the best beam of each, with the tag
    /// of its sample. Requests that no section covers are left out.
    pub fn rays(&self, sections: &[Section]) -> Vec<(Tag, BeamKey, RayCoords)> {
        let ray = |(tag, eye, direction)| {
            let key = best_beam(sections, eye, direction)?;
            let hit = sections.get(usize::from(key.section))?.line(eye, direction)?;
            Some((tag, key, hit.coords))
        };
        self.requests().filter_map(ray).collect()
    }

    /// Returns a view's beams with new weights. The requests of this frame share `share` of the
    /// total weight (0 to 1) equally. The rest stays as before. The sum of the weights does not
    /// change.
    ///
    /// Beams of requests for the predicted view are added. The result is ordered by section and
    /// beam, and names each beam once.
    pub fn weigh(&self, sections: &[Section], beams: &[WantedBeam], share: f32) -> Vec<WantedBeam> {
        let asked: Vec<_> = (self.requests())
            .filter_map(|(_, eye, direction)| best_beam(sections, eye, direction))
            .collect();
        if asked.is_empty() {
            return beams.to_vec();
        }
        let total: f64 = beams.iter().map(|beam| f64::from(beam.weight)).sum();
        let each = (total * f64::from(share) / asked.len() as f64) as f32;
        let mut weights: BTreeMap<BeamKey, f32> = BTreeMap::new();
        for beam in asked {
            *weights.entry(beam).or_default() += each;
        }
        for beam in beams {
            *weights.entry(beam.key).or_default() += (1.0 - share) * beam.weight;
        }
        let weights = weights.into_iter();
        weights.map(|(key, weight)| WantedBeam { key, weight }).collect()
    }
}

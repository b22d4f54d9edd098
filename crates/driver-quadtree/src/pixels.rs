//! What is known of each pixel besides what a picture shows. [`Cells`](crate::Cells) ask for it.
//!
//! Invariant: a function of the view and of the set of samples, as the picture is.

use crate::Quadtree;
use crate::bins::{FAR, depth_bin};
use crate::paint::Shown;
use crate::sums::{NEAR_CLASSES, Sums};
use crate::surface::adjacent;
use holo_display::Frame;

/// Samples of a pixel up to which it has few.
const FEW: u64 = 3;

/// What a pixel's samples are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Known {
    /// No section covers the pixel.
    Uncovered,
    /// The pixel shows the sky, because its beam sees nothing.
    Unseen,
    /// The pixel has no samples.
    Nothing,
    /// The pixel has samples, and none passes near the eye.
    Afar,
    /// Some samples pass near the eye: they see the pixel itself.
    Near,
    /// Samples near the eye are of several surfaces: the pixel shows a mixture.
    Mixture,
}

/// Returns the depth bin of a distance.
pub(crate) fn bin_of(depth: f32) -> u16 {
    if depth.is_finite() { depth_bin(f64::from(depth).powi(2)) } else { FAR }
}

impl Quadtree {
    /// Returns what a pixel shows whose beam sees nothing.
    pub(crate) fn sky(&self) -> Shown {
        let colour = if self.view.clips_sky() { [0.0; 3] } else { self.params.sky };
        Shown { colour, depth: f32::INFINITY }
    }

    /// Returns a picture that shows no sample, but the sky where that is known.
    pub(crate) fn frame_of(&self, known: &[Known]) -> Frame {
        let mut frame = self.empty_frame();
        let sky = self.sky();
        for (pixel, known) in known.iter().enumerate() {
            match known {
                Known::Unseen => {
                    (frame.picture.pixels[pixel], frame.depth[pixel]) = (sky.colour, sky.depth);
                    frame.unseen_pixels += 1;
                }
                Known::Nothing => frame.empty_pixels += 1,
                Known::Uncovered | Known::Afar | Known::Near | Known::Mixture => {}
            }
        }
        frame
    }

    /// Returns how wide a pixel is on what it sees at a depth, as a share of that depth: the larger
    /// of the two directions.
    pub(crate) fn pixel_share(&self, depth: f32) -> f32 {
        let width = self.camera.pixel_width;
        width.width as f32 / if width.grows { 1.0 } else { depth.max(f32::MIN_POSITIVE) }
    }

    /// Returns what is known of every pixel, row by row.
    pub(crate) fn known(&self) -> Vec<Known> {
        let unseen = self.unseen_pixels();
        let known = |(pixel, &covered): (usize, &bool)| {
            if !covered {
                Known::Uncovered
            } else if unseen.get(pixel) == Some(&true) {
                Known::Unseen
            } else {
                self.known_by_samples(pixel)
            }
        };
        self.covered.iter().enumerate().map(known).collect()
    }

    /// Returns whether each pixel has samples, but too few to tell much of their mean.
    pub(crate) fn has_few(&self) -> Vec<bool> {
        let has_few = |pixel: usize| {
            let count: u64 = self.bins(pixel).map(|(_, sums)| u64::from(sums.count)).sum();
            (1..=FEW).contains(&count)
        };
        (0..self.covered.len()).map(has_few).collect()
    }

    /// Returns a pixel's bins of aligned samples, then those of all others.
    pub(crate) fn bins(&self, pixel: usize) -> impl Iterator<Item = (u16, &Sums)> {
        let oblique = self.oblique.iter().flat_map(move |oblique| oblique.of(pixel));
        self.aligned.of(pixel).chain(oblique)
    }

    fn known_by_samples(&self, pixel: usize) -> Known {
        let (mut known, mut near_bin) = (Known::Nothing, None);
        for (bin, sums) in self.bins(pixel) {
            let is_near = sums.near != [0; NEAR_CLASSES];
            known = match (known, near_bin) {
                _ if !is_near && known != Known::Nothing => known,
                _ if !is_near => Known::Afar,
                (_, Some(other)) if !adjacent(bin.min(other), bin.max(other), 1) => Known::Mixture,
                (Known::Mixture, _) => Known::Mixture,
                _ => Known::Near,
            };
            if is_near {
                near_bin = Some(bin);
            }
        }
        known
    }
}

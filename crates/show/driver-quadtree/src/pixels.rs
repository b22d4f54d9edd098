//! The state of each pixel: whether it is covered, unseen, empty, or has samples near the eye.
//! [`Cells`](crate::ViewCells) use it.
//!
//! Invariant: the state is a function of the view and of the set of samples, as the picture is.

use crate::Quadtree;
use crate::bins::{FAR, depth_bin};
use crate::paint::PixelContent;
use crate::sums::{BinSums, NEAR_CLASSES};
use crate::surface::adjacent;
use holo_display::Frame;

/// Largest number of samples of a pixel that counts as few.
const FEW: u64 = 3;

/// The state of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PixelState {
    /// No section covers the pixel.
    Uncovered,
    /// The pixel shows the sky, because its beam sees nothing.
    Unseen,
    /// The pixel has no samples.
    Nothing,
    /// The pixel has samples, and no sample's ray passes near the eye.
    Afar,
    /// The rays of some samples pass near the eye. They see exactly this pixel.
    Near,
    /// The rays of samples of several surfaces pass near the eye. The pixel shows a mixture.
    Mixture,
}

/// Returns the depth bin of a distance.
pub(crate) fn bin_of(depth: f32) -> u16 {
    if depth.is_finite() { depth_bin(f64::from(depth).powi(2)) } else { FAR }
}

impl Quadtree {
    /// Returns what a pixel of an unseen beam shows.
    pub(crate) fn sky(&self, pixel: usize) -> PixelContent {
        let colour = match self.view.clips_sky() {
            true => [0.0; 3],
            false => self.params.sky.at_pixel(&self.view, self.size, pixel),
        };
        PixelContent { colour, depth: f32::INFINITY }
    }

    /// Returns a picture without samples. Pixels of unseen beams show the sky.
    pub(crate) fn frame_of(&self, known: &[PixelState]) -> Frame {
        let mut frame = self.empty_frame();
        for (pixel, known) in known.iter().enumerate() {
            match known {
                PixelState::Unseen => {
                    let sky = self.sky(pixel);
                    (frame.picture.pixels[pixel], frame.depth[pixel]) = (sky.colour, sky.depth);
                    frame.unseen_pixels += 1;
                }
                PixelState::Nothing => frame.empty_pixels += 1,
                PixelState::Uncovered
                | PixelState::Afar
                | PixelState::Near
                | PixelState::Mixture => {}
            }
        }
        frame
    }

    /// Returns the width of a pixel's footprint at a depth, as a share of that depth. It is the
    /// larger of width and height.
    pub(crate) fn pixel_share(&self, depth: f32) -> f32 {
        let width = self.camera.pixel_width;
        width.width as f32 / if width.grows { 1.0 } else { depth.max(f32::MIN_POSITIVE) }
    }

    /// Returns the state of every pixel, row by row.
    pub(crate) fn known(&self) -> Vec<PixelState> {
        let unseen = self.unseen_pixels();
        let known = |(pixel, &covered): (usize, &bool)| {
            if !covered {
                PixelState::Uncovered
            } else if unseen.get(pixel) == Some(&true) {
                PixelState::Unseen
            } else {
                self.known_by_samples(pixel)
            }
        };
        self.covered.iter().enumerate().map(known).collect()
    }

    /// Returns for each pixel whether it has samples, but too few for a good mean.
    pub(crate) fn has_few(&self) -> Vec<bool> {
        let has_few = |pixel: usize| {
            let count: u64 = self.bins(pixel).map(|(_, sums)| u64::from(sums.count)).sum();
            (1..=FEW).contains(&count)
        };
        (0..self.covered.len()).map(has_few).collect()
    }

    /// Returns a pixel's bins of aligned samples, then those of all others.
    pub(crate) fn bins(&self, pixel: usize) -> impl Iterator<Item = (u16, &BinSums)> {
        let oblique = self.oblique.iter().flat_map(move |oblique| oblique.of(pixel));
        self.aligned.of(pixel).chain(oblique)
    }

    fn known_by_samples(&self, pixel: usize) -> PixelState {
        let (mut known, mut near_bin) = (PixelState::Nothing, None);
        for (bin, sums) in self.bins(pixel) {
            let is_near = sums.near != [0; NEAR_CLASSES];
            known = match (known, near_bin) {
                _ if !is_near && known != PixelState::Nothing => known,
                _ if !is_near => PixelState::Afar,
                (_, Some(other)) if !adjacent(bin.min(other), bin.max(other), 1) => {
                    PixelState::Mixture
                }
                (PixelState::Mixture, _) => PixelState::Mixture,
                _ => PixelState::Near,
            };
            if is_near {
                near_bin = Some(bin);
            }
        }
        known
    }
}

//! What is known of each pixel of a picture besides what it shows.
//!
//! Invariant: a function of the view and of the set of samples, as the picture is.

use super::bins::depth_bin;
use super::paint::UnseenPixels;
use super::reproject::Landing;
use super::sums::Summed;
use super::surface::adjacent;
use super::{Frame, Quadtree};
use holo_section::{BeamId, Sample};

/// Pixels whose sums are asked for ahead.
const AHEAD: usize = 12;

/// Samples of a pixel up to which it has few.
const FEW: u64 = 3;

/// What a pixel's samples are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Known {
    /// No section covers it.
    Uncovered,
    /// It shows the sky, since its beam sees nothing.
    Unseen,
    /// It has no samples.
    Nothing,
    /// It has some, and none passes near the eye.
    Afar,
    /// Some pass near the eye: they see the pixel itself.
    Near,
    /// These are of several surfaces: the pixel shows a mixture.
    Mixture,
}

/// The depth bin of a distance.
pub(crate) fn bin_of(depth: f32) -> u16 {
    if depth.is_finite() { depth_bin(f64::from(depth).powi(2)) } else { super::bins::FAR }
}

impl Quadtree {
    /// As [`insert`](Self::insert), telling of each sample that landed its pixel, where in it, and its colour.
    pub(crate) fn insert_and_tell(
        &mut self,
        section: u16,
        beam: BeamId,
        paths: u16,
        samples: &[Sample],
        also: &mut impl FnMut(usize, &Landing, [u8; 4]),
    ) {
        if self.sections.get(usize::from(section)).is_some_and(|known| beam.0 < known.beam_count())
        {
            self.kept.add(section, beam, paths, samples, self.params.keep);
            self.land(section, beam, paths, samples, also);
        }
    }

    /// Width and height in pixels.
    pub(crate) fn size(&self) -> (u32, u32) {
        self.size
    }

    /// Samples and unseen beams that came since the last picture.
    pub(crate) fn changes(&self) -> u64 {
        self.changes
    }

    /// Takes them for shown.
    pub(crate) fn forget_changes(&mut self) {
        self.changes = 0;
    }

    /// A picture that shows no sample, but the sky where that is known.
    pub(crate) fn frame_of(&self, known: &[Known]) -> Frame {
        let mut frame = self.empty_frame();
        let sky = if self.view.clips_sky() { [0.0; 3] } else { self.params.sky };
        for (pixel, known) in known.iter().enumerate() {
            match known {
                Known::Unseen => {
                    (frame.picture.pixels[pixel], frame.depth[pixel]) = (sky, f32::INFINITY);
                    frame.unseen_pixels += 1;
                }
                Known::Nothing => frame.empty_pixels += 1,
                Known::Uncovered | Known::Afar | Known::Near | Known::Mixture => {}
            }
        }
        frame
    }

    /// How wide a pixel is on what it sees at a depth, as a share of that: the larger of the two directions.
    pub(crate) fn pixel_share(&self, depth: f32) -> f32 {
        let width = self.camera.pixel_width;
        width.width as f32 / if width.grows { 1.0 } else { depth.max(f32::MIN_POSITIVE) }
    }

    /// What is known of every pixel, row by row.
    pub(crate) fn known(&self) -> Vec<Known> {
        let mut unseen = UnseenPixels::default();
        let known = |(pixel, &covered): (usize, &bool)| {
            self.prefetch(pixel + AHEAD);
            if !covered {
                Known::Uncovered
            } else if unseen.has(self, pixel) {
                Known::Unseen
            } else {
                self.known_by_samples(pixel)
            }
        };
        self.covered.iter().enumerate().map(known).collect()
    }

    /// Which pixels have samples, but not more than tell little of their mean.
    pub(crate) fn has_few(&self) -> Vec<bool> {
        let has_few = |pixel: usize| {
            self.prefetch(pixel + AHEAD);
            let bins = self.narrow.of(pixel).chain(self.wide.of(pixel));
            (1..=FEW).contains(&bins.map(|(_, sums)| u64::from(sums.count())).sum())
        };
        (0..self.covered.len()).map(has_few).collect()
    }

    fn known_by_samples(&self, pixel: usize) -> Known {
        let (mut known, mut near_bin) = (Known::Nothing, None);
        for (bin, sums) in self.narrow.of(pixel).chain(self.wide.of(pixel)) {
            let is_near = sums.near().iter().any(|&count| count > 0);
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

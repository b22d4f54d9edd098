//! Frameless rendering (Bishop, Fuchs, McMillan & Scher Zagier 1994): pixels are refreshed in
//! random order, each from the newest view.
//!
//! There is no frame to wait for. A picture in motion is a mixture of the last views. It becomes
//! sharp once the view rests.
//!
//! Invariants:
//! - Every pixel is requested once before any is requested again.
//! - At rest a pixel is the mean of its rays since the view came to rest. It tends to the box
//!   filter.
//! - A ray for an older view than the one that the pixel shows changes nothing.

use glam::DVec3;
use holo_display::{mix, pair};
use holo_picture::{Picture, PictureError, View};

use crate::planes::nearest;

/// Rounds of the permutation. Four are enough to look random (Luby & Rackoff 1988).
const ROUNDS: u32 = 4;

/// Identifies a request. The renderer returns it with the ray's radiance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelTag {
    pixel: u32,
    /// The number of the view.
    epoch: u64,
}

/// One radiance per pixel, refreshed in random order.
#[derive(Clone, Debug)]
pub struct Frameless {
    picture: Picture,
    view: View,
    /// The number of the current view.
    epoch: u64,
    /// The number of the first view of this size.
    first: u64,
    /// For each pixel, the number of the view that it shows, and the number of rays in its mean.
    shown: Vec<(u64, u32)>,
    /// Position of the next request in the order of pixels, and the number of completed rounds.
    next: u32,
    round: u32,
    seed: u32,
}

impl Frameless {
    /// Returns a black picture of `size` pixels. `seed` chooses order and jitter.
    ///
    /// # Errors
    /// If the size is outside the limits of [`Picture::check_size`].
    pub fn new(size: (u32, u32), view: View, seed: u32) -> Result<Self, PictureError> {
        Picture::check_size(size.0, size.1)?;
        let mut picture = Picture::new(size.0, size.1);
        picture.view = Some(view);
        let shown = vec![(0, 0); picture.pixels.len()];
        Ok(Self { picture, view, epoch: 1, first: 1, shown, next: 0, round: 0, seed })
    }

    /// Changes the size. Each pixel shows what the nearest pixel showed, until it is refreshed.
    ///
    /// # Errors
    /// If the size is outside the limits of [`Picture::check_size`]. Nothing is changed then.
    pub fn resize(&mut self, size: (u32, u32)) -> Result<(), PictureError> {
        Picture::check_size(size.0, size.1)?;
        if self.picture.size() == size {
            return Ok(());
        }
        let sizes = [self.picture.size(), size].map(|(w, h)| (w as usize, h as usize));
        let mut picture = Picture::new(size.0, size.1);
        picture.pixels = nearest(&self.picture.pixels, sizes[0], sizes[1]);
        picture.view = self.picture.view;
        self.shown = nearest(&self.shown, sizes[0], sizes[1]);
        self.picture = picture;
        // The pixels of earlier tags are other pixels now.
        (self.epoch, self.first) = (self.epoch + 1, self.epoch + 1);
        (self.next, self.round) = (0, self.round.wrapping_add(1));
        Ok(())
    }

    /// Sets the view. Pixels do not change until they are refreshed.
    pub fn look(&mut self, view: View) {
        if self.view != view {
            self.view = view;
            self.picture.view = Some(view);
            self.epoch += 1;
        }
    }

    /// Returns the next `count` rays of the newest view: tag, origin on the fore clipping surface,
    /// and direction of length 1. Each passes a random place of its pixel.
    pub fn requests(
        &mut self,
        count: usize,
    ) -> impl Iterator<Item = (PixelTag, DVec3, DVec3)> + '_ {
        (0..count).map(|_| {
            let (width, height) = self.picture.size();
            let pixel = self.permuted(self.next);
            let (x, y) = pair(mix(self.seed, self.round), pixel);
            let x = (f64::from(pixel % width) + f64::from(x)) / f64::from(width);
            let y = 1.0 - (f64::from(pixel / width) + f64::from(y)) / f64::from(height);
            self.next += 1;
            if self.next as usize == self.shown.len() {
                (self.next, self.round) = (0, self.round.wrapping_add(1));
            }
            let (origin, direction, _) =
                self.view.clipped_ray(x, y).unwrap_or((self.view.vp, DVec3::ZERO, 0.0));
            (PixelTag { pixel, epoch: self.epoch }, origin, direction)
        })
    }

    /// Adds a ray's radiance, W·sr⁻¹·m⁻² per RGB channel, 0 beyond the aft clipping surface. A
    /// radiance that is not finite changes nothing.
    pub fn insert(&mut self, tag: PixelTag, radiance: [f32; 3]) {
        let Some((pixel, (epoch, count))) = self.pixel(tag, radiance) else { return };
        if tag.epoch > *epoch {
            (*epoch, *count, *pixel) = (tag.epoch, 1, radiance);
        } else if tag.epoch == *epoch {
            *count = count.saturating_add(1);
            for (mean, new) in pixel.iter_mut().zip(radiance) {
                *mean += (new - *mean) / *count as f32;
            }
        }
    }

    /// Shows an approximate radiance, such as a stored one, until the pixel's first ray of the
    /// current view arrives.
    pub fn guess(&mut self, tag: PixelTag, radiance: [f32; 3]) {
        let Some((pixel, shown)) = self.pixel(tag, radiance) else { return };
        if shown.0 < tag.epoch {
            (*shown, *pixel) = ((tag.epoch, 0), radiance);
        }
    }

    /// Returns the tag for a ray of the current view through this pixel that was traced without a
    /// request. `None` outside the picture.
    pub fn pixel_tag(&self, column: u32, row: u32) -> Option<PixelTag> {
        let (width, height) = self.picture.size();
        (column < width && row < height)
            .then(|| PixelTag { pixel: row * width + column, epoch: self.epoch })
    }

    /// Returns whether a tag is of the current view.
    pub(crate) fn is_current(&self, tag: PixelTag) -> bool {
        tag.epoch == self.epoch
    }

    /// Returns whether each pixel has shown a radiance yet, rows from the top.
    pub fn has_colour(&self) -> impl Iterator<Item = bool> + '_ {
        self.shown.iter().map(|&(epoch, _)| epoch > 0)
    }

    /// Returns the current picture.
    pub fn picture(&self) -> &Picture {
        &self.picture
    }

    /// Returns colour, view and count of rays of a tag's pixel, if the radiance is finite.
    fn pixel(
        &mut self,
        tag: PixelTag,
        radiance: [f32; 3],
    ) -> Option<(&mut [f32; 3], &mut (u64, u32))> {
        let index = tag.pixel as usize;
        let pixel = self.picture.pixels.get_mut(index).zip(self.shown.get_mut(index));
        pixel.filter(|_| {
            tag.epoch >= self.first && radiance.iter().all(|channel| channel.is_finite())
        })
    }

    /// Returns the `index`-th pixel of this round: a Feistel network on the next power of four,
    /// walked until it lands in the picture.
    fn permuted(&self, index: u32) -> u32 {
        let pixels = self.shown.len() as u32;
        // Half of the bits that number the pixels, rounded up.
        let half = (u32::BITS - (pixels - 1).leading_zeros()).div_ceil(2).max(1);
        let mask = (1 << half) - 1;
        let key = mix(self.seed, self.round);
        let mut at = index;
        loop {
            let (mut left, mut right) = (at >> half, at & mask);
            for round in 0..ROUNDS {
                (left, right) = (right, left ^ (mix(key.wrapping_add(round), right) & mask));
            }
            at = left << half | right;
            if at < pixels {
                return at;
            }
        }
    }
}

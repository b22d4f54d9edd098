//! Chosen pixels become requests (Walter et al. 1999, §4.1): jittered in the pixel, or through the point that it shows.

use super::PointImage;
use super::points::{FRESH, GENERATIONS, Points};
use super::random;
use super::sample::{Aim, Purpose, Request, Tag};

impl PointImage {
    /// A request for a pixel of the current view.
    pub(super) fn request(&self, pixel: u32, seed: u32) -> Request {
        let (width, height) = self.planes.size;
        let (column, row) = (pixel as usize % width, pixel as usize / width);
        let slot = self.planes.slot[pixel as usize];
        let anywhere = || {
            let (x, y) = random::pair(seed, pixel);
            Aim::Picture((column as f32 + x) / width as f32, 1.0 - (row as f32 + y) / height as f32)
        };
        let Points { flags, position, .. } = &self.points;
        // A point that was culled is not what the pixel shows.
        let is_shown = self.planes.colour[pixel as usize] != super::colour::NONE;
        let flags = if is_shown { flags.get(slot as usize).copied() } else { None };
        let at = slot as usize;
        let (aim, purpose) = match flags {
            None => (anywhere(), Purpose::Pixel),
            Some(flags) if flags & FRESH != 0 && !random::mix(!seed, pixel).is_multiple_of(self.params.check_every) => {
                (anywhere(), Purpose::Refine)
            }
            Some(_) => (Aim::Through(position.each_ref().map(|axis| axis[at])), Purpose::Resample),
        };
        let tag = Tag { purpose, pixel, slot, generation: flags.unwrap_or(0) & GENERATIONS, epoch: self.epoch };
        Request { aim, predicted: false, tag }
    }

    /// `wanted` pixels anywhere, for comparison with the dither.
    pub(super) fn choose_anywhere(&self, wanted: usize, seed: u32, chosen: &mut Vec<u32>) {
        let pixels = self.planes.slot.len() as u64;
        let anywhere = |index| ((u64::from(random::mix(seed, index)) * pixels) >> 32) as u32;
        chosen.extend((0..wanted as u32).map(anywhere));
    }
}

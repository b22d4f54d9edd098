//! Chosen pixels become requests (Walter et al. 1999, §4.1): jittered in the pixel, or through the point that it shows.

use super::PointImage;
use super::colour;
use super::points::{FRESH, GENERATIONS};
use super::sample::{Aim, Purpose, Request, Tag};
use holo_display::{mix, pair};

impl PointImage {
    /// A request for a pixel of the current view.
    #[inline]
    pub(super) fn request(&self, pixel: u32, seed: u32) -> Request {
        let (width, height) = self.planes.size;
        // In 32 bits: divisions of 64 take twice as long.
        let (column, row) = (pixel % width as u32, pixel / width as u32);
        let anywhere = || {
            let (x, y) = pair(seed, pixel);
            Aim::Picture((column as f32 + x) / width as f32, 1.0 - (row as f32 + y) / height as f32)
        };
        let point = self.shown(pixel);
        let (aim, purpose) = match point {
            None => (anywhere(), Purpose::Pixel),
            Some((_, flags)) if flags & FRESH != 0 && !self.is_check(seed, pixel) => {
                (anywhere(), Purpose::Refine)
            }
            Some((at, _)) if self.params.stages.resampling => {
                (Aim::Through(self.points.position(at)), Purpose::Resample)
            }
            Some(_) => (anywhere(), Purpose::Pixel),
        };
        let tag = self.tag(pixel, purpose, point);
        Request { aim, predicted: false, tag }
    }

    /// The tag of a ray that a renderer traced for the current view of its own accord: from the eye (or from so near that it makes no
    /// difference) through this pixel, anywhere in it. Its sample then counts as one that was asked for. `None` outside the picture.
    pub fn pixel_tag(&self, column: u32, row: u32) -> Option<Tag> {
        let pixel = self.pixel(column, row)?;
        let point = self.point_in(pixel);
        let purpose = match point {
            Some((_, flags)) if flags & FRESH != 0 => Purpose::Refine,
            Some(_) if self.params.stages.resampling => Purpose::Resample,
            _ => Purpose::Pixel,
        };
        Some(self.tag(pixel, purpose, point))
    }

    /// The tag of a sample that was seen from elsewhere and lies in this pixel, a stored one say: it is averaged with what the pixel has
    /// of other views, of two surfaces the nearer is shown, and a sample of the current view is not touched. So ever so many of them take
    /// one point a pixel. `None` outside the picture.
    pub fn guess_tag(&self, column: u32, row: u32) -> Option<Tag> {
        let pixel = self.pixel(column, row)?;
        Some(self.tag(pixel, Purpose::Guess, None))
    }

    fn pixel(&self, column: u32, row: u32) -> Option<u32> {
        let (width, height) = self.planes.size;
        ((column as usize) < width && (row as usize) < height).then(|| row * width as u32 + column)
    }

    /// The point that lies in a pixel and that it shows, and its flags. Since the last picture another may have taken the slot.
    pub(super) fn point_in(&self, pixel: u32) -> Option<(usize, u8)> {
        self.shown(pixel).filter(|&(slot, _)| self.is_in(slot, pixel))
    }

    fn tag(&self, pixel: u32, purpose: Purpose, point: Option<(usize, u8)>) -> Tag {
        let generation = point.map_or(0, |(_, flags)| flags & GENERATIONS);
        Tag {
            purpose,
            pixel,
            slot: self.planes.slot[pixel as usize],
            generation,
            epoch: self.epoch,
        }
    }

    /// The point that a pixel shows, and its flags. One that was culled is not what the pixel shows.
    fn shown(&self, pixel: u32) -> Option<(usize, u8)> {
        let slot = self.planes.slot[pixel as usize] as usize;
        let is_shown = self.planes.colour[pixel as usize] != colour::NONE;
        self.points.states.get(slot).filter(|_| is_shown).map(|state| (slot, state.flags()))
    }

    /// Whether a point lies in a pixel of the current view.
    pub(super) fn is_in(&self, slot: usize, pixel: u32) -> bool {
        let width = self.planes.size.0;
        let Some(map) = self.map else { return false };
        let (column, row, depth) = map.project(self.points.position(slot));
        let at = pixel as usize;
        // As the projection of all points has it: the whole part.
        depth >= map.nearest()
            && column.floor() == (at % width) as f32
            && row.floor() == (at / width) as f32
            && !self.points.states[slot].is_empty()
    }

    /// Whether a pixel's turn has come for a ray through its point even though it is a sample of this view.
    fn is_check(&self, seed: u32, pixel: u32) -> bool {
        self.params.stages.resampling && mix(!seed, pixel).is_multiple_of(self.params.check_every)
    }

    /// `wanted` pixels anywhere, for comparison with the dither.
    pub(super) fn choose_anywhere(&self, wanted: usize, seed: u32, chosen: &mut Vec<u32>) {
        let pixels = self.planes.slot.len() as u64;
        let anywhere = |index| ((u64::from(mix(seed, index)) * pixels) >> 32) as u32;
        chosen.extend((0..wanted as u32).map(anywhere));
    }
}

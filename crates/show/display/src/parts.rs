//! Pictures that are drawn in parts, so that they are never whole in memory.

use holo_picture::Picture;

use crate::FrameRequest;

/// Most pixels of a preview.
const PREVIEW_PIXELS: f64 = (1 << 18) as f64;

/// A picture that is drawn in parts, with what all parts share so that they look alike.
#[derive(Clone, Debug)]
pub struct PartsPlan {
    /// The whole picture, of an eye at rest.
    pub look: FrameRequest,
    /// Side of the squares of pixels that share their light.
    pub step: usize,
    /// The whole picture with fewer pixels.
    pub preview: Picture,
}

impl PartsPlan {
    /// Returns the size of a preview of a picture of `size` pixels.
    #[must_use]
    pub fn preview_size(size: (u32, u32)) -> (u32, u32) {
        let pixels = f64::from(size.0) * f64::from(size.1);
        let share = (PREVIEW_PIXELS / pixels.max(1.0)).sqrt().min(1.0);
        let side = |side: u32| ((f64::from(side) * share).round() as u32).max(1);
        (side(size.0), side(size.1))
    }
}

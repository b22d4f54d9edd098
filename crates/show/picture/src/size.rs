//! Sizes of pictures: the limits that bound their memory.

/// Most pixels of a picture: 2²⁶ take 805 MB, far more than any display needs.
pub const MAX_PIXELS: u64 = 1 << 26;

/// Most pixels on one side of a picture. Bounds the memory for one scanline.
pub const MAX_SIDE: u32 = 65_535;

/// Returns whether a picture may have this size: each side from 1 to [`MAX_SIDE`], and at most
/// [`MAX_PIXELS`] in all.
pub(crate) fn is_size((width, height): (u32, u32)) -> bool {
    let sides = (1..=MAX_SIDE).contains(&width) && (1..=MAX_SIDE).contains(&height);
    sides && u64::from(width) * u64::from(height) <= MAX_PIXELS
}

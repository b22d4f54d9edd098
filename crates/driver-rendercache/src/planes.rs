//! The point image and the picture, array by array, rows from the top.

use super::colour;
use holo_cpu::filled;

/// What is kept for every pixel.
#[derive(Debug)]
pub(super) struct Planes {
    pub size: (usize, usize),
    /// Of the pixel's point, [`colour::NONE`] without one.
    pub colour: Vec<u32>,
    /// Depth of the pixel's point, as bits of an f32: positive if the point is a sample of this view, else negative, 0 without one.
    pub depth: Vec<u32>,
    /// The pixel's point; without one, the number of points.
    pub slot: Vec<u32>,
    /// How much a sample is wanted; from z-buffer to interpolation, the age of the pixel's point.
    pub priority: Vec<u8>,
    /// Radiance, channel by channel.
    pub picture: [Vec<f32>; 3],
}

impl Planes {
    pub fn new(size: (usize, usize), no_slot: u32) -> Self {
        let pixels = size.0 * size.1;
        Self {
            size,
            colour: filled(colour::NONE, pixels),
            depth: filled(0, pixels),
            slot: filled(no_slot, pixels),
            priority: filled(0, pixels),
            picture: std::array::from_fn(|_| filled(0.0, pixels)),
        }
    }
}

//! A view that a driver draws, and why it may not be able to.

use holo_picture::View;

/// A view to draw, with the frame's size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameRequest {
    /// The view.
    pub view: View,
    /// Width and height of the frame, pixels. [`View::resolve`] returns them and bounds them.
    pub size: (u32, u32),
    /// True if the eye moves, so that another view follows soon.
    pub is_moving: bool,
}

impl FrameRequest {
    /// Most pixels of a small view.
    pub const SMALL: u64 = 100_000;

    /// Returns true if the view has so few pixels that its best picture can be its first, because
    /// nobody notices the delay.
    pub fn is_small(&self) -> bool {
        let (width, height) = self.size;
        !self.is_moving && u64::from(width) * u64::from(height) <= Self::SMALL
    }
}

/// The reason why a driver cannot show a view.
#[derive(Debug, thiserror::Error)]
#[error("driver {driver}: {reason}")]
pub struct DriverError {
    /// Name of the driver.
    pub driver: &'static str,
    /// The reason, as a sentence for people.
    pub reason: String,
}

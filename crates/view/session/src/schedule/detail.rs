//! Chooses how many pixels a frame has while the eye moves: as many as earlier frames show to be
//! possible in the time.

/// Time for one frame of the driver while the eye moves, seconds. Earlier frames are shown
/// meanwhile.
const FRAME_SECONDS: f64 = 0.060;

/// Smallest size of a moving frame, as a share of each side of the picture.
const LEAST: f64 = 0.5;

/// Shares change in steps of this, so that the size does not change with every frame.
const STEP: f64 = 0.1;

/// Weight of the last frame in the running mean of the time per pixel.
const NEWEST: f64 = 0.25;

/// Chooses the size of frames while the eye moves.
pub struct Detail {
    seconds_per_pixel: f64,
    share: f64,
}

impl Default for Detail {
    fn default() -> Detail {
        // Before any measurement, half of each side.
        Detail { seconds_per_pixel: 0.0, share: 0.5 }
    }
}

impl Detail {
    /// Returns the size of the next frame for a picture of size `full` at rest.
    pub fn size(&self, full: (u32, u32)) -> (u32, u32) {
        scaled(full, self.share)
    }

    /// Returns the next frame's share of each side.
    pub fn share(&self) -> f64 {
        self.share
    }

    /// Records how long a frame of `size` took while the eye moved.
    pub fn note(&mut self, size: (u32, u32), full: (u32, u32), seconds: f64) {
        let pixels = |size: (u32, u32)| f64::from(size.0) * f64::from(size.1);
        let newest = seconds / pixels(size).max(1.0);
        self.seconds_per_pixel = if self.seconds_per_pixel == 0.0 {
            newest
        } else {
            self.seconds_per_pixel + NEWEST * (newest - self.seconds_per_pixel)
        };
        let affordable = FRAME_SECONDS / self.seconds_per_pixel.max(1e-12);
        let share = (affordable / pixels(full).max(1.0)).sqrt();
        // Smaller changes than a step are ignored.
        if (share - self.share).abs() > STEP {
            self.share = ((share / STEP).floor() * STEP).clamp(LEAST, 1.0);
        }
    }
}

/// Returns a share of both sides, so that the shape stays.
pub fn scaled(full: (u32, u32), share: f64) -> (u32, u32) {
    let side = |side: u32| ((f64::from(side) * share).round() as u32).max(1);
    (side(full.0), side(full.1))
}

#[cfg(test)]
mod tests {
    use super::*;

    const FULL: (u32, u32) = (1280, 720);

    /// Returns the size that settles on a machine that draws this many pixels per second.
    fn settled(pixels_per_second: f64) -> (u32, u32) {
        let mut detail = Detail::default();
        for _ in 0..100 {
            let size = detail.size(FULL);
            let pixels = f64::from(size.0) * f64::from(size.1);
            detail.note(size, FULL, pixels / pixels_per_second);
        }
        detail.size(FULL)
    }

    #[test]
    fn a_fast_machine_draws_every_pixel_and_a_slow_one_as_many_as_it_can() {
        assert_eq!(settled(1e9), FULL);
        assert_eq!(settled(1e3), (640, 360));
        let (width, height) = settled(1e7);
        let seconds = f64::from(width * height) / 1e7;
        assert!((0.03..0.07).contains(&seconds), "{width}×{height}: {seconds} s");
    }

    #[test]
    fn one_slow_frame_does_not_change_the_size() {
        let mut detail = Detail::default();
        for _ in 0..100 {
            detail.note((1280, 720), FULL, 0.02);
        }
        detail.note((1280, 720), FULL, 0.08);
        assert_eq!(detail.size(FULL), FULL);
    }
}

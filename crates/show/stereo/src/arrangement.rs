//! How the pictures of two eyes make one picture.

use std::ops::Range;

use holo_display::Frame;

/// Where a picture has the pixels of each eye.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StereoArrangement {
    /// The left half for the left eye, the right half for the right one. The middle column of an odd
    /// number is black.
    SideBySide,
    /// The upper half for the left eye, the lower half for the right one. The middle row of an odd
    /// number is black.
    OverUnder,
    /// Red for the left eye, green and blue for the right one.
    Anaglyph,
    /// Rows from the top in turn: the first for the left eye.
    Interlaced,
}

impl StereoArrangement {
    /// Returns the columns and rows of a picture of `size` pixels that an eye's own picture has: a
    /// part of the same size in its middle, so that pixels stay square.
    pub fn part(self, size: (u32, u32)) -> (Range<u32>, Range<u32>) {
        let middle = |side: u32| {
            let half = (side / 2).max(1);
            let start = (side - half) / 2;
            start..start + half
        };
        match self {
            Self::SideBySide => (middle(size.0), 0..size.1),
            Self::OverUnder => (0..size.0, middle(size.1)),
            Self::Anaglyph | Self::Interlaced => (0..size.0, 0..size.1),
        }
    }

    /// Returns whether frames must have all pixels: enlarged rows would be those of the wrong eye.
    pub fn needs_all_pixels(self) -> bool {
        self == Self::Interlaced
    }

    /// Arranges the frames of the left and the right eye in a frame of `size` pixels.
    pub fn arrange(self, size: (u32, u32), [left, right]: [&Frame; 2]) -> Frame {
        let mut frame = Frame::black(size);
        frame.is_stereo = true;
        let has_certainty = [left, right].iter().all(|eye| !eye.certainty.is_empty());
        if let Some(first) = left.certainty.first().filter(|_| has_certainty) {
            let unknown = holo_display::Certainty { error: f32::INFINITY, samples: 0 };
            frame.certainty = vec![unknown; frame.depth.len()];
            debug_assert!(first.error >= 0.0, "a standard error");
        }
        let mut copy = |eye: &Frame, from: usize, to: usize| {
            frame.picture.pixels[to] = eye.picture.pixels[from];
            frame.depth[to] = eye.depth[from];
            if has_certainty {
                frame.certainty[to] = eye.certainty[from];
            }
        };
        let (width, height) = (size.0 as usize, size.1 as usize);
        let across = left.picture.width as usize;
        let down = left.picture.height as usize;
        for row in 0..down {
            for column in 0..across {
                let from = row * across + column;
                match self {
                    Self::SideBySide => {
                        copy(left, from, row * width + column);
                        copy(right, from, row * width + width - across + column);
                    }
                    Self::OverUnder => {
                        copy(left, from, row * width + column);
                        copy(right, from, (height - down + row) * width + column);
                    }
                    Self::Anaglyph => copy(left, from, from),
                    Self::Interlaced => {
                        copy(if row % 2 == 0 { left } else { right }, from, from);
                    }
                }
            }
        }
        if self == Self::Anaglyph {
            for (pixel, right) in frame.picture.pixels.iter_mut().zip(&right.picture.pixels) {
                (pixel[1], pixel[2]) = (right[1], right[2]);
            }
        }
        self.count(&mut frame, [left, right]);
        frame
    }

    /// Sets the counts of pixels and samples. Eyes that share the picture's pixels have half of them
    /// each.
    fn count(self, frame: &mut Frame, [left, right]: [&Frame; 2]) {
        let shares = matches!(self, Self::Anaglyph | Self::Interlaced);
        let both = |a: u64, b: u64| if shares { (a + b) / 2 } else { a + b };
        frame.uncovered_pixels = both(left.uncovered_pixels, right.uncovered_pixels);
        frame.empty_pixels = both(left.empty_pixels, right.empty_pixels);
        frame.unseen_pixels = both(left.unseen_pixels, right.unseen_pixels);
        frame.guessed_pixels = both(left.guessed_pixels, right.guessed_pixels);
        frame.gleam_pixels = both(left.gleam_pixels, right.gleam_pixels);
        // Most samples serve both eyes.
        frame.samples_used = left.samples_used.max(right.samples_used);
    }
}

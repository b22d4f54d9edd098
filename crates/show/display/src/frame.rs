//! The frame that a driver draws.

use holo_picture::{Picture, View, ViewKind};

/// The accuracy of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Certainty {
    /// Standard error of the relative luminance of the pixel's radiance; infinite
    /// where nothing is known.
    pub error: f32,
    /// Number of samples on the surface that the pixel itself shows. Its radiance may also come
    /// from pixels around it.
    pub samples: u32,
}

/// A picture drawn from samples, with its depth and counts of its pixels.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Linear radiance, row 0 at the top; 0 where nothing is known.
    pub picture: Picture,
    /// Distance from the eye, scene units, for each pixel of the picture: infinite where the ray
    /// hit nothing, 0 where nothing is known.
    pub depth: Vec<f32>,
    /// The accuracy of each pixel; empty if the driver does not know it.
    pub certainty: Vec<Certainty>,
    /// Pixels that no section covers.
    pub uncovered_pixels: u64,
    /// Covered pixels without samples of their own. They are filled from other pixels, or are 0.
    pub empty_pixels: u64,
    /// Pixels that show the sky because no ray of their beam can hit anything.
    pub unseen_pixels: u64,
    /// Pixels whose surface has no known light, drawn as if the eye carried a lamp.
    pub guessed_pixels: u64,
    /// Pixels on glossy surfaces with few samples that leave towards the eye. Their light is known
    /// from other directions, so gleams are a guess.
    pub gleam_pixels: u64,
    /// Number of samples that the picture uses.
    pub samples_used: u64,
    /// True if the picture shows what two eyes see, so that its pixels are not those of one view.
    pub is_stereo: bool,
}

impl Frame {
    /// Returns a black frame of `size` pixels about which nothing is known.
    pub fn black(size: (u32, u32)) -> Self {
        let picture = Picture::new(size.0, size.1);
        Self {
            depth: vec![0.0; picture.pixels.len()],
            certainty: Vec::new(),
            picture,
            uncovered_pixels: 0,
            empty_pixels: 0,
            unseen_pixels: 0,
            guessed_pixels: 0,
            gleam_pixels: 0,
            samples_used: 0,
            is_stereo: false,
        }
    }

    /// Returns this frame enlarged to `size` pixels, for the same view. Each pixel takes the
    /// nearest one of this frame. Counts of pixels grow in proportion.
    pub fn enlarged(&self, size: (u32, u32)) -> Self {
        let (from, to) = ((self.picture.width, self.picture.height), size);
        let grown = |count: u64| {
            let (many, few) = (u64::from(to.0) * u64::from(to.1), self.depth.len() as u64);
            (u128::from(count) * u128::from(many) / u128::from(few.max(1))) as u64
        };
        let mut frame = Self {
            uncovered_pixels: grown(self.uncovered_pixels),
            empty_pixels: grown(self.empty_pixels),
            unseen_pixels: grown(self.unseen_pixels),
            guessed_pixels: grown(self.guessed_pixels),
            gleam_pixels: grown(self.gleam_pixels),
            samples_used: self.samples_used,
            is_stereo: self.is_stereo,
            ..Self::black(size)
        };
        frame.picture.view = self.picture.view;
        let nearest = |at: u32, from: u32, to: u32| {
            ((2 * u64::from(at) + 1) * u64::from(from) / (2 * u64::from(to))) as usize
        };
        for (row, (pixels, depths)) in (0..).zip(
            frame
                .picture
                .pixels
                .chunks_mut(size.0 as usize)
                .zip(frame.depth.chunks_mut(size.0 as usize)),
        ) {
            let start = nearest(row, from.1, to.1) * from.0 as usize;
            for (column, (pixel, depth)) in (0..).zip(pixels.iter_mut().zip(depths)) {
                let source = start + nearest(column, from.0, to.0);
                *pixel = self.picture.pixels[source];
                *depth = self.depth[source];
            }
        }
        frame
    }

    /// Sets pixels without a view ray to black, such as those in the corners of a fisheye.
    pub fn blank_corners(&mut self, view: &View) {
        if view.kind == ViewKind::Perspective {
            return;
        }
        let size = (self.picture.width, self.picture.height);
        for ((number, pixel), depth) in (0..).zip(&mut self.picture.pixels).zip(&mut self.depth) {
            let (x, y) = View::pixel_centre(size, number % size.0, number / size.0);
            if view.try_ray(x, y).is_none() {
                (*pixel, *depth) = ([0.0; 3], 0.0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_enlarged_frame_repeats_the_nearest_pixels_and_scales_the_counts() {
        let mut frame = Frame::black((2, 2));
        for (number, (pixel, depth)) in
            (0_u8..).zip(frame.picture.pixels.iter_mut().zip(&mut frame.depth))
        {
            (*pixel, *depth) = ([f32::from(number); 3], f32::from(number));
        }
        (frame.empty_pixels, frame.samples_used) = (2, 7);
        let large = frame.enlarged((4, 3));
        let row = |row: usize| large.depth[row * 4..row * 4 + 4].to_vec();
        assert_eq!(row(0), [0.0, 0.0, 1.0, 1.0]);
        assert_eq!(row(2), [2.0, 2.0, 3.0, 3.0]);
        assert_eq!(large.picture.pixels[11], [3.0; 3]);
        assert_eq!((large.empty_pixels, large.samples_used), (6, 7));
        assert_eq!(frame.enlarged((1, 1)).depth.len(), 1);
    }
}

//! Finds the points nearest to a pixel by testing the pixels around it.
//!
//! Invariant: points at one distance are in the order of their pixels.

/// Number of pixels in each direction that are tested.
const REACH: usize = 10;

/// A point as seen from a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Near {
    /// Square of its distance, pixels.
    pub squared: f32,
    /// Columns and rows from the pixel to the point.
    pub offset: [f32; 2],
    /// The pixel whose middle it is.
    pub pixel: u32,
}

/// The pixels that have a point, and the steps to the pixels around a pixel by their length.
pub(super) struct Window {
    width: usize,
    /// Row by row, with [`REACH`] pixels without points around the picture.
    has_point: Vec<bool>,
    around: Vec<PixelStep>,
}

/// A step from one pixel to another.
#[derive(Clone, Copy)]
struct PixelStep {
    /// By how much the other's number is larger, in [`Window::has_point`] and in the picture.
    padded: isize,
    pixels: isize,
    /// Columns and rows.
    offset: [f32; 2],
    /// Square of its length.
    squared: f32,
}

impl Window {
    pub fn new((width, height): (usize, usize), points: impl Iterator<Item = usize>) -> Self {
        let padded = width + 2 * REACH;
        let reach = REACH as isize;
        let step = |column: isize, row: isize| PixelStep {
            padded: row * padded as isize + column,
            pixels: row * width as isize + column,
            offset: [column as f32, row as f32],
            squared: (column * column + row * row) as f32,
        };
        let rows = -reach..=reach;
        let mut around: Vec<PixelStep> =
            rows.flat_map(|row| (-reach..=reach).map(move |column| step(column, row))).collect();
        // Beyond the circle, the square has only some of the pixels at each distance.
        around.retain(|step| step.squared <= (REACH * REACH) as f32);
        // A stable sort: steps of one length stay row by row.
        around.sort_by(|a, b| a.squared.total_cmp(&b.squared));
        let mut window =
            Self { width, has_point: vec![false; padded * (height + 2 * REACH)], around };
        for point in points {
            let index = window.index(point);
            window.has_point[index] = true;
        }
        window
    }

    /// Puts the `most` points that are nearest to a pixel into `nearest`. Returns false if too few
    /// are around.
    pub fn find(&self, pixel: usize, most: usize, nearest: &mut Vec<Near>) -> bool {
        let index = self.index(pixel);
        nearest.clear();
        for step in &self.around {
            if self.has_point[index.wrapping_add_signed(step.padded)] {
                let pixel = pixel.wrapping_add_signed(step.pixels) as u32;
                nearest.push(Near { squared: step.squared, offset: step.offset, pixel });
                if nearest.len() == most {
                    return true;
                }
            }
        }
        false
    }

    fn index(&self, pixel: usize) -> usize {
        let (column, row) = (pixel % self.width, pixel / self.width);
        (row + REACH) * (self.width + 2 * REACH) + column + REACH
    }
}

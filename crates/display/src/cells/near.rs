//! The nearest of some points to a place, and how they are found among the pixels around one.
//!
//! Invariant: points at one distance are in the order of their pixels.

/// Pixels in each direction that are looked at.
const REACH: usize = 10;
/// How far from the middle of its pixel a point may be.
const ASIDE: f32 = 0.708;

/// A point as seen from a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Near {
    /// Square of its distance, pixels.
    pub squared: f32,
    /// Its place less the other's.
    pub offset: [f32; 2],
    /// The pixel in which it lies.
    pub pixel: u32,
}

/// The points nearest to a place, the nearest first.
pub(crate) struct Nearest<const K: usize> {
    found: [Near; K],
    count: usize,
}

impl<const K: usize> Default for Nearest<K> {
    fn default() -> Self {
        Self { found: [Near { squared: f32::INFINITY, offset: [0.0; 2], pixel: u32::MAX }; K], count: 0 }
    }
}

impl<const K: usize> Nearest<K> {
    pub fn clear(&mut self) {
        self.count = 0;
    }

    pub fn as_slice(&self) -> &[Near] {
        &self.found[..self.count]
    }

    /// Takes in the point at `point` in `pixel` as seen from `place`.
    pub fn add(&mut self, point: [f32; 2], pixel: u32, place: [f32; 2]) {
        let offset = [point[0] - place[0], point[1] - place[1]];
        let squared = offset[0] * offset[0] + offset[1] * offset[1];
        let comes_before = |other: &Near| squared < other.squared || squared == other.squared && pixel < other.pixel;
        if self.count == K {
            if !comes_before(&self.found[K - 1]) {
                return;
            }
        } else {
            self.count += 1;
        }
        let mut at = self.count - 1;
        while at > 0 && comes_before(&self.found[at - 1]) {
            self.found[at] = self.found[at - 1];
            at -= 1;
        }
        self.found[at] = Near { squared, offset, pixel };
    }

    /// Square of the distance of the last of `K`; infinite of fewer.
    fn last(&self) -> f32 {
        if self.count == K { self.found[K - 1].squared } else { f32::INFINITY }
    }
}

/// The point of each pixel, if it has one, and the pixels around any by their distance.
pub(crate) struct Window {
    width: usize,
    /// Row by row with `REACH` empty pixels around; 0 for none.
    points: Vec<u32>,
    around: Vec<Step>,
}

/// From a pixel to one around it.
#[derive(Clone, Copy)]
struct Step {
    /// In the points.
    points: isize,
    /// In the picture.
    pixels: isize,
    /// Columns and rows.
    offset: [f32; 2],
    /// Square of the least distance from the one's middle to anything in the other.
    least: f32,
}

impl Window {
    pub fn new((width, height): (usize, usize)) -> Self {
        let padded = width + 2 * REACH;
        let reach = REACH as isize;
        let step = |column: isize, row: isize| {
            let offset = [column as f32, row as f32];
            let least = (offset[0].hypot(offset[1]) - ASIDE).max(0.0);
            Step { points: row * padded as isize + column, pixels: row * width as isize + column, offset, least: least * least }
        };
        let mut around: Vec<Step> =
            (-reach..=reach).flat_map(|row| (-reach..=reach).map(move |column| step(column, row))).collect();
        // What is beyond the circle is not all there.
        around.retain(|step| step.offset[0].hypot(step.offset[1]) <= REACH as f32);
        around.sort_by(|a, b| a.least.total_cmp(&b.least));
        Self { width, points: vec![0; padded * (height + 2 * REACH)], around }
    }

    /// Puts a point into a pixel: where in it, in 256ths.
    pub fn put(&mut self, pixel: usize, [right, down]: [u8; 2]) {
        let index = self.index(pixel);
        self.points[index] = 1 << 16 | u32::from(right) << 8 | u32::from(down);
    }

    /// The points nearest to a pixel's middle; false if too few are around.
    pub fn find<const K: usize>(&self, pixel: usize, nearest: &mut Nearest<K>) -> bool {
        let index = self.index(pixel);
        nearest.clear();
        for step in &self.around {
            if step.least > nearest.last() {
                return true;
            }
            let point = self.points[index.wrapping_add_signed(step.points)];
            if point != 0 {
                let aside = |part: u8| (f32::from(part) + 0.5) / 256.0 - 0.5;
                let [right, down] = [aside((point >> 8) as u8), aside(point as u8)];
                let place = [step.offset[0] + right, step.offset[1] + down];
                nearest.add(place, pixel.wrapping_add_signed(step.pixels) as u32, [0.0; 2]);
            }
        }
        // As far as the circle goes.
        nearest.last() < (REACH as f32 - ASIDE).powi(2)
    }

    fn index(&self, pixel: usize) -> usize {
        let (column, row) = (pixel % self.width, pixel / self.width);
        (row + REACH) * (self.width + 2 * REACH) + column + REACH
    }
}

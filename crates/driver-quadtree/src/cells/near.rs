//! The nearest of some points to a place, and how they are found among the pixels around one.
//!
//! Invariant: points at one distance are in the order of their pixels.

/// Pixels in each direction that are looked at.
const REACH: usize = 10;
/// Pixels within that reach, at most, and one more.
const PIXELS: usize = 512;
/// Pixels that are looked at together.
const GROUP: usize = 8;
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
        Self {
            found: [Near { squared: f32::INFINITY, offset: [0.0; 2], pixel: u32::MAX }; K],
            count: 0,
        }
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
        let comes_before = |other: &Near| {
            squared < other.squared || squared == other.squared && pixel < other.pixel
        };
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
}

/// The point of each pixel, if it has one, and the pixels around any by their distance.
pub(crate) struct Window {
    width: usize,
    /// Row by row with `REACH` empty pixels around; 0 for none.
    points: Vec<u32>,
    /// By distance, then by pixel.
    around: Vec<Step>,
    /// How far points may be from the middles of their pixels.
    aside: f32,
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
    /// No point yet, of a picture of this size. All are to be `in_middles` of pixels, or anywhere in them.
    pub fn new((width, height): (usize, usize), in_middles: bool) -> Self {
        let aside = if in_middles { 0.0 } else { ASIDE };
        let padded = width + 2 * REACH;
        let reach = REACH as isize;
        let step = |column: isize, row: isize| {
            let offset = [column as f32, row as f32];
            let least = (offset[0].hypot(offset[1]) - aside).max(0.0);
            // Of middles, not by way of the root: as other ways to find them have it.
            let least = if in_middles {
                offset[0] * offset[0] + offset[1] * offset[1]
            } else {
                least * least
            };
            Step {
                points: row * padded as isize + column,
                pixels: row * width as isize + column,
                offset,
                least,
            }
        };
        let mut around: Vec<Step> = (-reach..=reach)
            .flat_map(|row| (-reach..=reach).map(move |column| step(column, row)))
            .collect();
        // What is beyond the circle is not all there.
        around.retain(|step| step.offset[0].hypot(step.offset[1]) <= REACH as f32);
        // It is stable: of one distance, they stay row by row.
        around.sort_by(|a, b| a.least.total_cmp(&b.least));
        Self { width, points: vec![0; padded * (height + 2 * REACH)], around, aside }
    }

    /// Puts a point into a pixel: where in it, in 256ths, if not in the middle.
    pub fn put(&mut self, pixel: usize, within: Option<[u8; 2]>) {
        let index = self.index(pixel);
        let [right, down] = within.unwrap_or_default();
        self.points[index] = 1 << 16 | u32::from(right) << 8 | u32::from(down);
    }

    /// The points nearest to a pixel's middle; false if too few are around.
    pub fn find<const K: usize>(&self, pixel: usize, nearest: &mut Nearest<K>) -> bool {
        let index = self.index(pixel);
        // Gathered without a branch for each pixel, which chance would decide: in half of the time.
        let (mut found, mut count, mut limit) = ([0_u16; PIXELS], 0, f32::INFINITY);
        for (number, group) in self.around.chunks(GROUP).enumerate() {
            if group[0].least > limit {
                break;
            }
            for (within, step) in group.iter().enumerate() {
                found[count] = (number * GROUP + within) as u16;
                count += usize::from(self.points[index.wrapping_add_signed(step.points)] != 0);
            }
            if count >= K && limit == f32::INFINITY {
                // As far as anything in the pixels so far may be; of middles, there is nothing nearer in those that follow.
                let aside = 2.0 * self.aside;
                limit = if aside > 0.0 {
                    (group[group.len() - 1].least.sqrt() + aside).powi(2)
                } else {
                    0.0
                };
            }
        }
        if limit == f32::INFINITY || limit > (REACH as f32 - self.aside).powi(2) {
            return false;
        }
        if self.aside == 0.0 {
            nearest.count = K;
            for (near, &step) in nearest.found.iter_mut().zip(&found[..count]) {
                let Step { least, offset, pixels, .. } = self.around[usize::from(step)];
                *near = Near {
                    squared: least,
                    offset,
                    pixel: pixel.wrapping_add_signed(pixels) as u32,
                };
            }
            return true;
        }
        nearest.clear();
        for step in found[..count].iter().map(|&step| &self.around[usize::from(step)]) {
            let point = self.points[index.wrapping_add_signed(step.points)];
            let aside = |part: u8| (f32::from(part) + 0.5) / 256.0 - 0.5;
            let [right, down] = [aside((point >> 8) as u8), aside(point as u8)];
            let place = [step.offset[0] + right, step.offset[1] + down];
            nearest.add(place, pixel.wrapping_add_signed(step.pixels) as u32, [0.0; 2]);
        }
        true
    }

    fn index(&self, pixel: usize) -> usize {
        let (column, row) = (pixel % self.width, pixel / self.width);
        (row + REACH) * (self.width + 2 * REACH) + column + REACH
    }
}

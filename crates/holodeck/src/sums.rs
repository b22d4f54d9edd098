//! Sums over the paths of each pixel, on ever finer grids of pixels.
//!
//! Invariant: a pixel whose paths have all been added has the value that its number of paths
//! determines. Only [`TracedPicture::fill`] gives pixels the value of another one.

/// Most pixels of the coarsest grid along each side of a picture. They have a path in any picture,
/// whatever ends it.
const FIRST: u32 = 16;

/// The step of the finest grid that may be the coarsest one, a power of two.
const LEAST_COARSE: u32 = 16;

/// Sums over a pixel's paths, for each channel.
#[derive(Clone, Copy, Debug, Default)]
pub struct PictureSums {
    /// Number of paths.
    pub paths: u32,
    /// Sums of the paths' radiances.
    pub first: [f64; 3],
}

impl PictureSums {
    pub(crate) fn add(&mut self, other: &PictureSums) {
        self.paths += other.paths;
        add(&mut self.first, other.first);
    }

    /// Returns the mean radiance.
    pub fn mean(&self) -> [f32; 3] {
        let n = f64::from(self.paths.max(1));
        self.first.map(|sum| (sum / n) as f32)
    }
}

pub(crate) fn add(sums: &mut [f64; 3], other: [f64; 3]) {
    sums.iter_mut().zip(other).for_each(|(sum, other)| *sum += other);
}

/// The pixels of every `step`th column and row.
#[derive(Clone, Copy, Debug)]
pub struct PixelGrid {
    size: (u32, u32),
    step: u32,
    /// True for a grid without the pixels of the grid of twice its step.
    is_between: bool,
}

impl PixelGrid {
    /// Returns the grid of all pixels.
    pub fn all(size: (u32, u32)) -> PixelGrid {
        PixelGrid { size, step: 1, is_between: false }
    }

    /// Returns the coarsest grid of a picture, with at most 256 pixels if the picture is larger.
    pub fn coarsest(size: (u32, u32)) -> PixelGrid {
        let step = size.0.max(size.1).div_ceil(FIRST).next_power_of_two().max(LEAST_COARSE);
        PixelGrid { size, step, is_between: false }
    }

    /// Returns the grids, each with half the step of the one before, of the pixels that this grid
    /// lacks. All of them together have every other pixel once.
    pub fn finer(self) -> impl Iterator<Item = PixelGrid> {
        let steps = std::iter::successors(Some(self.step / 2), |step| Some(step / 2));
        steps.take_while(|&step| step > 0).map(move |step| PixelGrid {
            size: self.size,
            step,
            is_between: true,
        })
    }

    /// Returns the number of places. Some of them may have no pixel.
    pub fn len(self) -> usize {
        let (columns, rows) = self.sides();
        columns as usize * rows as usize
    }

    /// Returns the pixel at a place; `None` if a coarser grid has it.
    pub fn pixel(self, place: usize) -> Option<u32> {
        let columns = self.sides().0 as usize;
        let (column, row) =
            ((place % columns) as u32 * self.step, (place / columns) as u32 * self.step);
        let is_coarser = column.is_multiple_of(2 * self.step) && row.is_multiple_of(2 * self.step);
        (!self.is_between || !is_coarser).then_some(row * self.size.0 + column)
    }

    fn sides(self) -> (u32, u32) {
        (self.size.0.div_ceil(self.step), self.size.1.div_ceil(self.step))
    }
}

/// A traced picture, in rows from the top.
#[derive(Clone, Debug)]
pub struct TracedPicture {
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// The sums of each pixel.
    pub sums: Vec<PictureSums>,
    /// Sums of the squares of the paths' radiances. Empty unless standard errors are wanted.
    pub squares: Vec<[f64; 3]>,
    /// Sums over the paths of even number minus those of odd number. Empty unless these have cells
    /// of their own.
    pub differences: Vec<[f64; 3]>,
}

impl TracedPicture {
    /// Returns a picture without paths.
    pub fn new(size: (u32, u32), has_squares: bool, has_differences: bool) -> TracedPicture {
        let pixels = size.0 as usize * size.1 as usize;
        let zeros = |are_wanted| vec![[0.0; 3]; if are_wanted { pixels } else { 0 }];
        let (squares, differences) = (zeros(has_squares), zeros(has_differences));
        TracedPicture { size, sums: vec![PictureSums::default(); pixels], squares, differences }
    }

    /// Returns the variance of a pixel's mean as if its paths were independent.
    pub(crate) fn noise(&self, pixel: usize) -> [f64; 3] {
        let (sums, squares) = (&self.sums[pixel], &self.squares[pixel]);
        let n = f64::from(sums.paths.max(1));
        std::array::from_fn(|channel| {
            let mean = sums.first[channel] / n;
            (squares[channel] / n - mean * mean).max(0.0) / (n - 1.0).max(1.0)
        })
    }

    /// Gives each pixel without paths the sums of the nearest traced pixel of a coarser grid, to
    /// the left or above. Returns the number of such pixels.
    pub fn fill(&mut self) -> usize {
        let width = self.size.0;
        let coarsest = PixelGrid::coarsest(self.size).step;
        let mut filled = 0;
        for pixel in 0..self.sums.len() {
            if self.sums[pixel].paths > 0 {
                continue;
            }
            filled += 1;
            let (column, row) = (pixel as u32 % width, pixel as u32 / width);
            let steps = std::iter::successors(Some(2), |step| Some(2 * step));
            let before = |step: u32| (row / step * step * width + column / step * step) as usize;
            // A filled pixel of a coarser grid has the value that its own search has found.
            let mut nearest = steps.take_while(|&step| step <= coarsest).map(before);
            if let Some(found) = nearest.find(|&other| self.sums[other].paths > 0) {
                self.sums[pixel] = self.sums[found];
                for sums in [&mut self.squares, &mut self.differences] {
                    if !sums.is_empty() {
                        sums[pixel] = sums[found];
                    }
                }
            }
        }
        filled
    }

    /// Returns the step of the finest grid of pixels that all have paths.
    pub fn finest_whole_grid(&self) -> u32 {
        let coarsest = PixelGrid::coarsest(self.size).step;
        let is_whole = |step: &u32| {
            let grid = PixelGrid { size: self.size, step: *step, is_between: false };
            let mut pixels = (0..grid.len()).filter_map(|place| grid.pixel(place));
            pixels.all(|pixel| self.sums[pixel as usize].paths > 0)
        };
        let steps = std::iter::successors(Some(1), |step| Some(2 * step));
        steps.take_while(|&step| step < coarsest).find(is_whole).unwrap_or(coarsest)
    }

    /// Returns the size of a picture of squares of `step` pixels a side, and the sums of these
    /// squares.
    pub fn reduced(&self, step: u32) -> ((u32, u32), Vec<PictureSums>) {
        let (width, height) = self.size;
        let size = (width.div_ceil(step), height.div_ceil(step));
        let mut squares = vec![PictureSums::default(); size.0 as usize * size.1 as usize];
        for (pixel, sums) in (0..).zip(&self.sums) {
            let (column, row): (u32, u32) = (pixel % width, pixel / width);
            squares[(row / step * size.0 + column / step) as usize].add(sums);
        }
        (size, squares)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grids_reach_every_pixel_once() {
        for size in [(1, 1), (16, 16), (37, 19), (64, 5), (700, 3), (300, 290)] {
            let coarsest = PixelGrid::coarsest(size);
            assert!((1..=256).contains(&coarsest.len()), "{size:?}");
            let pixels =
                |grid: PixelGrid| (0..grid.len()).filter_map(move |place| grid.pixel(place));
            let finer = coarsest.finer().flat_map(pixels);
            let mut reached: Vec<u32> = pixels(coarsest).chain(finer).collect();
            reached.sort_unstable();
            assert_eq!(reached, (0..size.0 * size.1).collect::<Vec<_>>());
            assert_eq!(pixels(PixelGrid::all(size)).collect::<Vec<_>>(), reached);
        }
    }

    #[test]
    fn pixels_without_paths_copy_the_nearest_traced_pixel_of_a_coarser_grid() {
        let size = (600, 300);
        let mut traced = TracedPicture::new(size, true, true);
        let is_traced = |column: u32, row: u32| {
            column.is_multiple_of(64) && row.is_multiple_of(64)
                || column < 200 && column.is_multiple_of(8) && row.is_multiple_of(8)
                || (column, row) == (333, 222)
        };
        let value = |column: u32, row: u32| f64::from(1000 * row + column);
        for (row, column) in (0..size.1).flat_map(|row| (0..size.0).map(move |c| (row, c))) {
            if is_traced(column, row) {
                let pixel = (row * size.0 + column) as usize;
                traced.sums[pixel] = PictureSums { paths: 1, first: [value(column, row); 3] };
                traced.squares[pixel] = [value(column, row).powi(2); 3];
                traced.differences[pixel] = [-value(column, row); 3];
            }
        }
        let count = traced.sums.iter().filter(|sums| sums.paths > 0).count();
        let filled = traced.fill();
        assert_eq!(count + filled, traced.sums.len());
        for (row, column) in (0..size.1).flat_map(|row| (0..size.0).map(move |c| (row, c))) {
            let steps =
                [1, 2, 4, 8, 16, 32, 64].map(|step| (column / step * step, row / step * step));
            let (c, r) = steps.into_iter().find(|&(c, r)| is_traced(c, r)).unwrap();
            let pixel = (row * size.0 + column) as usize;
            assert_eq!(traced.sums[pixel].first, [value(c, r); 3], "{column} {row}");
            assert_eq!(traced.squares[pixel], [value(c, r).powi(2); 3]);
            assert_eq!(traced.differences[pixel], [-value(c, r); 3]);
        }
        assert_eq!(traced.fill(), 0);
    }

    #[test]
    fn squares_at_the_edges_have_the_pixels_that_there_are() {
        let mut traced = TracedPicture::new((5, 3), false, false);
        traced.sums.fill(PictureSums { paths: 1, ..PictureSums::default() });
        let (size, squares) = traced.reduced(2);
        assert_eq!(size, (3, 2));
        assert_eq!(squares.iter().map(|sums| sums.paths).collect::<Vec<_>>(), [4, 4, 2, 2, 2, 1]);
    }
}

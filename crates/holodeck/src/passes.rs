//! Passes of `holodeck render`. Each adds paths to every pixel, until there are enough.
//!
//! Under a time limit, the first pass goes over ever finer grids of pixels. If the time ends it
//! early, pixels without a path copy a pixel nearby ([`filled`]).
//!
//! Invariants:
//! - A pixel's value is a function of its number of paths (engine `path`).
//! - A time limit ends the work after the block of pixels that a thread is tracing. The limit
//!   therefore holds even for long passes, once one pixel in [`COARSEST`]² has a path.

use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use holo_picture::View;
use holo_tracer::Tracer;

/// Pixels that a thread takes at a time: some milliseconds of work.
const BLOCK: usize = 64;

/// The step between columns and rows of the first grid under a time limit, a power of two.
const COARSEST: u32 = 16;

/// Most paths per pixel in one pass.
const PASS: u32 = 4;

/// Rays for records of indirect light, for each sample in a place without records, if there is a
/// time limit: see [`Tracer::set_effort`].
const EFFORT: u32 = 2;

/// Share of the time limit during which records may be begun. Later ones would serve few samples.
const RECORD_SHARE: f64 = 0.75;

/// Least remaining time for a record to be begun. The first record of a scene makes a hundred
/// coarse ones and takes up to a second.
const RECORD_TIME: Duration = Duration::from_secs(1);

/// A picture to be traced.
pub struct Job {
    /// The engine, with the scene.
    pub tracer: Tracer,
    /// The view.
    pub view: View,
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// Seed of all random numbers.
    pub seed: u64,
    /// Threads that trace.
    pub threads: usize,
    /// The end of the work.
    pub limit: Limit,
}

/// The condition that ends the work, besides an interruption.
#[derive(Clone, Copy, Debug)]
pub enum Limit {
    /// A number of paths per pixel.
    Paths(u32),
    /// A time since the work began.
    Time(Duration),
}

/// Sums over a pixel's paths, for each channel.
#[derive(Clone, Copy, Default)]
pub struct Sums {
    /// Number of paths.
    pub paths: u32,
    /// Sums of the paths' radiances.
    pub first: [f64; 3],
    /// Sums of the squares of these radiances.
    pub second: [f64; 3],
}

/// The progress of the work.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Share of the limit that is used up, 0 to 1.
    pub share: f64,
    /// Number of paths of every pixel.
    pub paths: u32,
    /// Time since the work began.
    pub elapsed: Duration,
}

impl Job {
    /// Traces passes until the limit is reached or `is_interrupted`. `clock` returns the time since
    /// the work began. Returns the sums of all pixels, in rows from the top.
    pub fn run(
        &self,
        clock: impl Fn() -> Duration + Sync,
        is_interrupted: impl Fn() -> bool + Sync,
        mut show: impl FnMut(Progress),
    ) -> Vec<Sums> {
        let sums = vec![Sums::default(); self.size.0 as usize * self.size.1 as usize];
        let sums = Mutex::new(sums);
        let is_over = || match self.limit {
            Limit::Time(time) => {
                let elapsed = clock();
                let last = time.mul_f64(RECORD_SHARE).min(time.saturating_sub(RECORD_TIME));
                self.tracer.set_effort(if elapsed < last { EFFORT } else { 0 });
                is_interrupted() || elapsed >= time
            }
            Limit::Paths(_) => is_interrupted(),
        };
        let all: Vec<u32> = (0..self.size.0 * self.size.1).collect();
        let mut paths = 0;
        loop {
            let count = match self.limit {
                Limit::Paths(wanted) => PASS.min(wanted - paths),
                // The first coarse picture must be ready soon, so no sample waits for records of
                // light.
                Limit::Time(_) if paths == 0 => 1,
                Limit::Time(_) => PASS,
            };
            if paths == 0 && matches!(self.limit, Limit::Time(_)) {
                self.tracer.set_effort(0);
                self.pass(&sums, &grid(self.size, COARSEST), 0..1, || false);
                for step in [8, 4, 2, 1] {
                    self.pass(&sums, &between(self.size, step), 0..1, || {
                        is_interrupted() || self.is_late(clock())
                    });
                }
            } else {
                self.pass(&sums, &all, paths..paths + count, || paths > 0 && is_over());
            }
            paths += count;
            let elapsed = clock();
            let share = match self.limit {
                Limit::Paths(wanted) => f64::from(paths) / f64::from(wanted),
                Limit::Time(time) => elapsed.as_secs_f64() / time.as_secs_f64(),
            };
            show(Progress { share: share.min(1.0), paths, elapsed });
            if matches!(self.limit, Limit::Paths(wanted) if paths >= wanted) || is_over() {
                break;
            }
        }
        sums.into_inner().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns true if the time is up.
    fn is_late(&self, elapsed: Duration) -> bool {
        matches!(self.limit, Limit::Time(time) if elapsed >= time)
    }

    /// Adds paths to these pixels, or to some of them if the time is up.
    fn pass(
        &self,
        sums: &Mutex<Vec<Sums>>,
        pixels: &[u32],
        paths: Range<u32>,
        is_over: impl Fn() -> bool + Sync,
    ) {
        let blocks = pixels.len().div_ceil(BLOCK);
        let stride = stride(blocks);
        let next = AtomicUsize::new(0);
        let work = || {
            loop {
                let turn = next.fetch_add(1, Ordering::Relaxed);
                if turn >= blocks || is_over() {
                    return;
                }
                let start = turn * stride % blocks * BLOCK;
                let block = &pixels[start..(start + BLOCK).min(pixels.len())];
                let new: Vec<Sums> =
                    block.iter().map(|&pixel| self.pixel(pixel, paths.clone())).collect();
                let mut all = sums.lock().unwrap_or_else(PoisonError::into_inner);
                for (&pixel, new) in block.iter().zip(&new) {
                    all[pixel as usize].add(new);
                }
            }
        };
        std::thread::scope(|scope| {
            for _ in 0..self.threads {
                scope.spawn(work);
            }
        });
    }

    fn pixel(&self, pixel: u32, paths: Range<u32>) -> Sums {
        let (column, row) = (pixel % self.size.0, pixel / self.size.0);
        let turn = mix((u64::from(row) << 32 | u64::from(column)) ^ self.seed.rotate_left(17));
        let mut sums = Sums { paths: paths.len() as u32, ..Sums::default() };
        for path in paths {
            let [dx, dy] = jitter(path, turn);
            let x = (f64::from(column) + dx) / f64::from(self.size.0);
            let y = 1.0 - (f64::from(row) + dy) / f64::from(self.size.1);
            // Corners of fisheyes have no direction, and stay black.
            let Some((origin, direction, reach)) = self.view.clipped_ray(x, y) else { continue };
            let traced = self.tracer.trace_path(origin, direction, turn, u64::from(path));
            if reach.is_finite() && traced.distance > reach {
                // Beyond the aft clipping surface everything is black.
                continue;
            }
            for (channel, value) in traced.radiance.into_iter().enumerate() {
                sums.first[channel] += f64::from(value);
                sums.second[channel] += f64::from(value) * f64::from(value);
            }
        }
        sums
    }
}

impl Sums {
    fn add(&mut self, other: &Sums) {
        self.paths += other.paths;
        for channel in 0..3 {
            self.first[channel] += other.first[channel];
            self.second[channel] += other.second[channel];
        }
    }

    /// Returns the mean radiance.
    pub fn mean(&self) -> [f32; 3] {
        let n = f64::from(self.paths.max(1));
        self.first.map(|sum| (sum / n) as f32)
    }

    /// Returns the standard error of the mean, as if paths were independent.
    pub fn standard_error(&self) -> [f32; 3] {
        let n = f64::from(self.paths.max(1));
        std::array::from_fn(|channel| {
            let mean = self.first[channel] / n;
            let variance = (self.second[channel] / n - mean * mean).max(0.0);
            (variance / (n - 1.0).max(1.0)).sqrt() as f32
        })
    }
}

/// Returns the pixels of every `step`th column and row.
fn grid((width, height): (u32, u32), step: u32) -> Vec<u32> {
    let columns = || (0..width).step_by(step as usize);
    let rows = (0..height).step_by(step as usize);
    rows.flat_map(|row| columns().map(move |column| row * width + column)).collect()
}

/// Returns those pixels of a grid that are not in the grid of twice its step.
fn between(size: (u32, u32), step: u32) -> Vec<u32> {
    let is_new = |pixel: &u32| {
        let (column, row) = (pixel % size.0, pixel / size.0);
        column % (2 * step) != 0 || row % (2 * step) != 0
    };
    grid(size, step).into_iter().filter(is_new).collect()
}

/// Returns the sums of a picture whose first pass was incomplete. A pixel without paths gets the
/// sums of the nearest traced pixel to the left or above.
pub fn filled(sums: &[Sums], width: u32) -> Vec<Sums> {
    let nearest = |pixel: usize| {
        let (column, row) = (pixel as u32 % width, pixel as u32 / width);
        let steps = std::iter::successors(Some(1), |step| Some(2 * step));
        let before = |step: u32| (row / step * step * width + column / step * step) as usize;
        let mut found = steps.take_while(|&step| step <= COARSEST).map(|step| sums[before(step)]);
        found.find(|sums| sums.paths > 0).unwrap_or_default()
    };
    (0..sums.len()).map(nearest).collect()
}

/// Returns the step of the finest grid of pixels that all have paths.
pub fn finest_whole_grid(sums: &[Sums], size: (u32, u32)) -> u32 {
    let steps = std::iter::successors(Some(1), |step| Some(2 * step));
    let is_whole =
        |step: &u32| grid(size, *step).iter().all(|&pixel| sums[pixel as usize].paths > 0);
    steps.take_while(|&step| step < COARSEST).find(is_whole).unwrap_or(COARSEST)
}

/// Returns the size of a picture of squares of `step` pixels a side, and the sums of these squares.
pub fn reduced(sums: &[Sums], (width, height): (u32, u32), step: u32) -> ((u32, u32), Vec<Sums>) {
    let size = (width.div_ceil(step), height.div_ceil(step));
    let mut squares = vec![Sums::default(); size.0 as usize * size.1 as usize];
    for (pixel, sums) in (0..).zip(sums) {
        let (column, row): (u32, u32) = (pixel % width, pixel / width);
        squares[(row / step * size.0 + column / step) as usize].add(sums);
    }
    (size, squares)
}

/// Returns the step between blocks that are traced one after the other: about 0.618 of their
/// number, and coprime to it. The paths of a pass that ends early are then spread over the picture.
fn stride(blocks: usize) -> usize {
    let coprime = |step: &usize| {
        let (mut a, mut b) = (blocks, *step);
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a == 1
    };
    ((blocks as f64 * 0.618) as usize..blocks).find(coprime).unwrap_or(1)
}

/// Returns the position of path `index` in its pixel: the R2 sequence (Roberts 2018), shifted by
/// the pixel's own offset. Any number of paths is well spread over the box filter.
fn jitter(index: u32, turn: u64) -> [f64; 2] {
    /// Powers of the plastic number ρ: 1/ρ and 1/ρ².
    const STEP: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];
    let offset = [(turn >> 32) as f64, f64::from(turn as u32)].map(|bits| bits / 4_294_967_296.0);
    [0, 1].map(|axis| (offset[axis] + STEP[axis] * f64::from(index)).fract())
}

/// The finaliser of SplitMix64 (Steele, Lea & Flood 2014).
fn mix(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::AtomicU64;

    use holo_picture::ViewSpec;
    use holo_scenes::Bundled;
    use holo_tracer::Settings;

    use super::*;

    const SIZE: (u32, u32) = (32, 24);
    const BLOCKS: u64 = 12;
    const THREADS: u64 = 2;

    fn job(is_cached: bool, limit: Limit) -> Job {
        let folder = tempfile::tempdir().unwrap();
        let written = holo_scenes::write(Bundled::Cornell, folder.path()).unwrap();
        let scene = holo_scene::load(&written.obj, &Default::default()).unwrap().scene;
        let tracer = Tracer::new(Arc::new(scene), Settings::default()).unwrap();
        let mut spec = ViewSpec::default();
        spec.apply_line("-vp 2.78 2.73 -2 -vd 0 0 1 -vu 0 1 0 -vh 60").unwrap();
        let (view, size) = spec.resolve(SIZE).unwrap();
        let tracer = if is_cached { tracer.with_cache(0.03, 1) } else { tracer };
        Job { tracer, view, size, seed: 1, threads: THREADS as usize, limit }
    }

    /// Traces with a clock that advances by a second at each reading.
    fn run(job: &Job) -> Vec<Sums> {
        let readings = AtomicU64::new(0);
        job.run(
            || Duration::from_secs(readings.fetch_add(1, Ordering::Relaxed)),
            || false,
            |progress| assert!((0.0..=1.0).contains(&progress.share)),
        )
    }

    #[test]
    fn a_time_limit_ends_the_work_within_a_pass() {
        // A thread reads the clock before each block. After each pass the clock is read twice.
        for seconds in [0, 1, 5, 20, 100] {
            let sums = run(&job(false, Limit::Time(Duration::from_secs(seconds))));
            assert!(sums.iter().all(|sums| sums.paths == 0 || sums.paths % PASS == 1));
            let blocks: u64 =
                sums.iter().map(|sums| u64::from(sums.paths.div_ceil(PASS))).sum::<u64>()
                    / BLOCK as u64;
            let passes = 5 + seconds / BLOCKS;
            let least = seconds.saturating_sub(3 * passes + THREADS);
            assert!((least..=seconds + 1).contains(&blocks), "{seconds}: {blocks}");
        }
    }

    #[test]
    fn a_first_pass_that_is_cut_off_is_filled_from_pixels_nearby() {
        let cut = run(&job(false, Limit::Time(Duration::from_secs(4))));
        let traced = cut.iter().filter(|sums| sums.paths > 0).count();
        assert!((100..cut.len()).contains(&traced), "{traced}");
        let whole = run(&job(false, Limit::Time(Duration::from_secs(20))));
        for (pixel, filled) in filled(&cut, SIZE.0).iter().enumerate() {
            assert_eq!(filled.paths, 1);
            if cut[pixel].paths > 0 {
                assert_eq!(filled.first, cut[pixel].first);
            }
            // The value is that of another pixel of the same picture, at most 15 away.
            let (column, row) = (pixel % 32, pixel / 32);
            let rows = row.saturating_sub(15)..=row;
            let mut near =
                rows.flat_map(|y| (column.saturating_sub(15)..=column).map(move |x| y * 32 + x));
            assert!(near.any(|other| cut[other].first == filled.first));
        }
        assert!(whole.iter().all(|sums| sums.paths > 0));
    }

    #[test]
    fn squares_of_the_finest_whole_grid_have_all_paths() {
        let mut steps = Vec::new();
        for seconds in [0, 4, 8, 40] {
            let sums = run(&job(false, Limit::Time(Duration::from_secs(seconds))));
            let found = finest_whole_grid(&sums, SIZE);
            steps.push(found);
            let (size, squares) = reduced(&sums, SIZE, found);
            assert_eq!(size, (SIZE.0.div_ceil(found), SIZE.1.div_ceil(found)));
            assert!(squares.iter().all(|sums| sums.paths > 0), "{seconds}: {found}");
            let paths = |sums: &[Sums]| sums.iter().map(|sums| sums.paths).sum::<u32>();
            assert_eq!(paths(&squares), paths(&sums));
            let light = |sums: &[Sums]| sums.iter().map(|sums| sums.first[1]).sum::<f64>();
            assert!((light(&squares) - light(&sums)).abs() <= 1e-9 * light(&sums));
        }
        assert!(steps.is_sorted_by(|a, b| a >= b) && steps[0] > 1 && steps[3] == 1, "{steps:?}");
        let (size, squares) = reduced(&[Sums { paths: 1, ..Sums::default() }; 15], (5, 3), 2);
        assert_eq!(size, (3, 2));
        assert_eq!(squares.iter().map(|sums| sums.paths).collect::<Vec<_>>(), [4, 4, 2, 2, 2, 1]);
    }

    #[test]
    fn grids_reach_every_pixel_once() {
        for size in [(1, 1), (16, 16), (37, 19), (64, 5)] {
            let finer = [8, 4, 2, 1].into_iter().flat_map(|step| between(size, step));
            let mut pixels: Vec<u32> = grid(size, COARSEST).into_iter().chain(finer).collect();
            pixels.sort_unstable();
            assert_eq!(pixels, (0..size.0 * size.1).collect::<Vec<_>>());
        }
    }

    #[test]
    fn a_pixel_with_as_many_paths_has_the_same_value() {
        let uneven = run(&job(false, Limit::Time(Duration::from_secs(40))));
        for count in [1 + PASS, 1 + 2 * PASS] {
            let even = run(&job(false, Limit::Paths(count)));
            assert!(even.iter().all(|sums| sums.paths == count));
            let mut compared = 0;
            for (a, b) in uneven.iter().zip(&even).filter(|(a, _)| a.paths == count) {
                for (a, b) in
                    a.first.into_iter().chain(a.second).zip(b.first.into_iter().chain(b.second))
                {
                    assert!((a - b).abs() <= 1e-12 * b.abs(), "{a} {b}");
                }
                compared += 1;
            }
            assert!(compared > 0, "{count}");
        }
    }

    #[test]
    fn the_first_picture_under_a_time_limit_waits_for_no_records_of_light() {
        let hurried = job(true, Limit::Time(Duration::ZERO));
        assert!(run(&hurried).iter().any(|sums| sums.paths == 1));
        let records = |job: &Job| job.tracer.light().map_or(0, |light| light.len());
        assert_eq!(records(&hurried), 0);
        let patient = job(true, Limit::Paths(1));
        run(&patient);
        assert!(records(&patient) > 100, "{}", records(&patient));
        let longer = job(true, Limit::Time(Duration::from_secs(200)));
        run(&longer);
        assert!(records(&longer) > 0, "later passes make records");
    }

    #[test]
    fn an_interruption_leaves_a_whole_picture() {
        let job = job(false, Limit::Paths(1000));
        let sums = job.run(|| Duration::ZERO, || true, |_| {});
        assert!(sums.iter().all(|sums| sums.paths == PASS));
    }

    #[test]
    fn strides_reach_every_block() {
        for blocks in 1..300 {
            let mut reached: Vec<usize> =
                (0..blocks).map(|i| i * stride(blocks) % blocks).collect();
            reached.sort_unstable();
            assert_eq!(reached, (0..blocks).collect::<Vec<_>>());
        }
    }
}

//! Passes of `holodeck render`. Each adds paths to every pixel, until there are enough.
//!
//! The first pass goes over ever finer grids of pixels. If it is ended early, pixels without a path
//! copy a pixel nearby ([`TracedPicture::fill`]).
//!
//! Invariants:
//! - A pixel's value is a function of its number of paths (engine `path`).
//! - After a time limit or an interruption, threads end the blocks of pixels that they are tracing.
//!   The pixels of the coarsest grid have a path in any case.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use holo_picture::View;
use holo_tracer::Tracer;
use parking_lot::Mutex;

use crate::sums::{PictureSums, PixelGrid, TracedPicture, add};

/// Pixels that a thread takes at a time: some milliseconds of work.
const BLOCK: usize = 64;

/// Pixels of the coarsest grid that a thread takes at a time, because they are few.
const FIRST_BLOCK: usize = 8;

/// Most paths per pixel in one pass.
const PASS: u32 = 4;

/// Time between two reports of progress.
const REPORT_EVERY: Duration = Duration::from_millis(100);

/// A picture to be traced.
pub struct TraceJob {
    /// The engine, with the scene.
    pub tracer: Tracer,
    /// An engine with cells and random numbers of its own, for every other path. Blocks of pixels
    /// differ by the error of cells, which pixels share. `None` if it does not matter, or if there
    /// are no cells.
    pub twin: Option<Tracer>,
    /// The view.
    pub view: View,
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// Seed of all random numbers.
    pub seed: u64,
    /// Threads that trace.
    pub threads: usize,
    /// The end of the work.
    pub limit: WorkLimit,
    /// True if standard errors are wanted.
    pub has_errors: bool,
}

/// The condition that ends the work, besides an interruption.
#[derive(Clone, Copy, Debug)]
pub enum WorkLimit {
    /// A number of paths per pixel.
    Paths(u32),
    /// A time since the work began.
    Time(Duration),
}

/// New sums of one pixel.
#[derive(Default)]
struct PixelSums {
    sums: PictureSums,
    squares: [f64; 3],
    difference: [f64; 3],
}

impl TraceJob {
    /// Traces passes until the limit is reached or `is_interrupted`. `clock` returns the time since
    /// the work began. `show` gets the number of paths so far, several times a second.
    pub fn run(
        &self,
        clock: impl Fn() -> Duration + Sync,
        is_interrupted: impl Fn() -> bool + Sync,
        mut show: impl FnMut(u64),
    ) -> TracedPicture {
        let traced =
            Mutex::new(TracedPicture::new(self.size, self.has_errors, self.twin.is_some()));
        let is_over = || {
            let is_late = matches!(self.limit, WorkLimit::Time(time) if clock() >= time);
            is_late || is_interrupted()
        };
        let mut before = 0;
        let mut pass = |grid: PixelGrid,
                        block: usize,
                        paths: Range<u32>,
                        is_over: &(dyn Fn() -> bool + Sync)| {
            before += self.pass(&traced, grid, block, paths, is_over, |new| show(before + new));
            show(before);
        };
        let coarsest = PixelGrid::coarsest(self.size);
        pass(coarsest, FIRST_BLOCK, 0..1, &|| false);
        coarsest.finer().for_each(|grid| pass(grid, BLOCK, 0..1, &is_over));
        let mut paths = 1;
        loop {
            let count = match self.limit {
                WorkLimit::Paths(wanted) => PASS.min(wanted.saturating_sub(paths)),
                WorkLimit::Time(_) => PASS,
            };
            if count == 0 || is_over() {
                break;
            }
            pass(PixelGrid::all(self.size), BLOCK, paths..paths + count, &is_over);
            paths += count;
        }
        traced.into_inner()
    }

    /// Adds paths to these pixels, or to some of them if it ends early. Returns the number of
    /// paths, and reports it to `show` meanwhile.
    fn pass(
        &self,
        traced: &Mutex<TracedPicture>,
        grid: PixelGrid,
        block: usize,
        paths: Range<u32>,
        is_over: &(dyn Fn() -> bool + Sync),
        mut show: impl FnMut(u64),
    ) -> u64 {
        let blocks = grid.len().div_ceil(block);
        let stride = stride(blocks);
        let (next, count) = (AtomicUsize::new(0), AtomicU64::new(0));
        let work = || {
            loop {
                let turn = next.fetch_add(1, Ordering::Relaxed);
                if turn >= blocks || is_over() {
                    return;
                }
                let start = turn * stride % blocks * block;
                let places = start..(start + block).min(grid.len());
                let pixels = places.filter_map(|place| grid.pixel(place));
                let new: Vec<(u32, PixelSums)> =
                    pixels.map(|pixel| (pixel, self.pixel(pixel, paths.clone()))).collect();
                count.fetch_add((new.len() * paths.len()) as u64, Ordering::Relaxed);
                let mut all = traced.lock();
                for (pixel, new) in new {
                    all.sums[pixel as usize].add(&new.sums);
                    if let Some(squares) = all.squares.get_mut(pixel as usize) {
                        add(squares, new.squares);
                    }
                    if let Some(difference) = all.differences.get_mut(pixel as usize) {
                        add(difference, new.difference);
                    }
                }
            }
        };
        let (at_work, ended) = channel::<()>();
        std::thread::scope(|scope| {
            for _ in 0..self.threads {
                let (work, at_work) = (&work, at_work.clone());
                scope.spawn(move || {
                    work();
                    drop(at_work);
                });
            }
            drop(at_work);
            while ended.recv_timeout(REPORT_EVERY) == Err(RecvTimeoutError::Timeout) {
                show(count.load(Ordering::Relaxed));
            }
        });
        count.into_inner()
    }

    fn pixel(&self, pixel: u32, paths: Range<u32>) -> PixelSums {
        let (column, row) = (pixel % self.size.0, pixel / self.size.0);
        let turn =
            holo_sobol::mix((u64::from(row) << 32 | u64::from(column)) ^ self.seed.rotate_left(17));
        let mut new = PixelSums::default();
        new.sums.paths = paths.len() as u32;
        for path in paths {
            let (tracer, turn, path, is_odd) = match &self.twin {
                None => (&self.tracer, turn, path, false),
                // Both halves are stratified by themselves, so they are independent.
                Some(_) if path.is_multiple_of(2) => (&self.tracer, turn, path / 2, false),
                Some(twin) => (twin, holo_sobol::mix(turn), path / 2, true),
            };
            let [dx, dy] = jitter(path, turn);
            let x = (f64::from(column) + dx) / f64::from(self.size.0);
            let y = 1.0 - (f64::from(row) + dy) / f64::from(self.size.1);
            // Corners of fisheyes have no direction, and stay black.
            let Some((origin, direction, reach)) = self.view.clipped_ray(x, y) else { continue };
            let traced = tracer.trace_path(origin, direction, turn, u64::from(path));
            if reach.is_finite() && traced.distance > reach {
                // Beyond the aft clipping surface everything is black.
                continue;
            }
            let radiance = traced.radiance.map(f64::from);
            add(&mut new.sums.first, radiance);
            add(&mut new.squares, radiance.map(|value| value * value));
            add(&mut new.difference, radiance.map(|value| if is_odd { -value } else { value }));
        }
        new
    }
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

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::AtomicU64;

    use holo_picture::ViewSpec;
    use holo_scenes::Bundled;
    use holo_tracer::Settings;

    use super::*;

    const SIZE: (u32, u32) = (32, 24);
    const THREADS: u64 = 2;

    fn job(limit: WorkLimit) -> TraceJob {
        let folder = tempfile::tempdir().unwrap();
        let written = holo_scenes::write(Bundled::Cornell, folder.path()).unwrap();
        let scene = holo_scene::load(&written.obj, &Default::default()).unwrap().scene;
        let tracer = Tracer::new(Arc::new(scene), Settings::default()).unwrap();
        let mut spec = ViewSpec::default();
        spec.apply_line("-vp 2.78 2.73 -2 -vd 0 0 1 -vu 0 1 0 -vh 60").unwrap();
        let (view, size) = spec.resolve(SIZE).unwrap();
        TraceJob {
            tracer,
            twin: None,
            view,
            size,
            seed: 1,
            threads: THREADS as usize,
            limit,
            has_errors: true,
        }
    }

    /// Traces with a clock that advances by a second at each reading.
    fn run(job: &TraceJob) -> TracedPicture {
        let readings = AtomicU64::new(0);
        job.run(|| Duration::from_secs(readings.fetch_add(1, Ordering::Relaxed)), || false, |_| {})
    }

    #[test]
    fn a_time_limit_ends_the_work_within_a_pass() {
        // A thread reads the clock before each block. Beyond the coarsest grid, whose pixels always
        // get a path, no block begins after the limit.
        for seconds in [0, 1, 5, 20, 100] {
            let sums = run(&job(WorkLimit::Time(Duration::from_secs(seconds)))).sums;
            assert!(sums.iter().all(|sums| sums.paths == 0 || sums.paths % PASS == 1));
            let paths: u64 = sums.iter().map(|sums| u64::from(sums.paths)).sum();
            let coarsest = PixelGrid::coarsest(SIZE).len() as u64;
            let most = coarsest + seconds * BLOCK as u64 * u64::from(PASS);
            assert!((coarsest..=most).contains(&paths), "{seconds}: {paths}");
            // Readings that begin no block: one for each grid and pass, and one for each thread.
            let blocks = seconds.saturating_sub(5 + seconds / 10 + THREADS + 1);
            let first = (SIZE.0 * SIZE.1) as u64 / BLOCK as u64 + 8;
            let whole = blocks.saturating_sub(first) * (BLOCK as u64 / 2) * u64::from(PASS);
            assert!(paths >= whole, "{seconds}: {paths} {whole}");
        }
    }

    #[test]
    fn a_first_pass_that_is_cut_off_is_filled_from_pixels_nearby() {
        let mut cut = run(&job(WorkLimit::Time(Duration::from_secs(6))));
        let before = cut.sums.clone();
        let untraced = cut.fill();
        let traced = before.iter().filter(|sums| sums.paths > 0).count();
        assert!((50..before.len()).contains(&traced), "{traced}");
        assert_eq!(traced + untraced, before.len());
        let whole = run(&job(WorkLimit::Time(Duration::from_secs(40)))).sums;
        for (pixel, filled) in cut.sums.iter().enumerate() {
            assert_eq!(filled.paths, 1);
            if before[pixel].paths > 0 {
                assert_eq!(filled.first, before[pixel].first);
            }
            // The value is that of another pixel of the same picture, at most 15 away.
            let (column, row) = (pixel % 32, pixel / 32);
            let rows = row.saturating_sub(15)..=row;
            let mut near =
                rows.flat_map(|y| (column.saturating_sub(15)..=column).map(move |x| y * 32 + x));
            assert!(
                near.any(|other| before[other].paths > 0 && before[other].first == filled.first)
            );
        }
        assert!(whole.iter().all(|sums| sums.paths > 0));
    }

    #[test]
    fn squares_of_the_finest_whole_grid_have_all_paths() {
        let mut steps = Vec::new();
        for seconds in [0, 5, 9, 40] {
            let traced = run(&job(WorkLimit::Time(Duration::from_secs(seconds))));
            let found = traced.finest_whole_grid();
            steps.push(found);
            let (size, squares) = traced.reduced(found);
            let sums = traced.sums;
            assert_eq!(size, (SIZE.0.div_ceil(found), SIZE.1.div_ceil(found)));
            assert!(squares.iter().all(|sums| sums.paths > 0), "{seconds}: {found}");
            let paths = |sums: &[PictureSums]| sums.iter().map(|sums| sums.paths).sum::<u32>();
            assert_eq!(paths(&squares), paths(&sums));
            let light = |sums: &[PictureSums]| sums.iter().map(|sums| sums.first[1]).sum::<f64>();
            assert!((light(&squares) - light(&sums)).abs() <= 1e-9 * light(&sums));
        }
        assert!(steps.is_sorted_by(|a, b| a >= b) && steps[0] > 1 && steps[3] == 1, "{steps:?}");
    }

    #[test]
    fn a_pixel_with_as_many_paths_has_the_same_value() {
        let uneven = run(&job(WorkLimit::Time(Duration::from_secs(40))));
        for count in [1 + PASS, 1 + 2 * PASS] {
            let even = run(&job(WorkLimit::Paths(count)));
            assert!(even.sums.iter().all(|sums| sums.paths == count));
            let mut compared = 0;
            for pixel in 0..even.sums.len() {
                if uneven.sums[pixel].paths != count {
                    continue;
                }
                let values = |traced: &TracedPicture| {
                    let [sums, squares] = [traced.sums[pixel].first, traced.squares[pixel]];
                    sums.into_iter().chain(squares).collect::<Vec<_>>()
                };
                for (a, b) in values(&uneven).into_iter().zip(values(&even)) {
                    assert!((a - b).abs() <= 1e-12 * b.abs(), "{a} {b}");
                }
                compared += 1;
            }
            assert!(compared > 0, "{count}");
        }
    }

    #[test]
    fn an_interruption_ends_the_first_pass_and_leaves_a_sensible_picture() {
        let job = job(WorkLimit::Paths(1000));
        // Interrupted from the beginning, and in the middle of the first pass.
        for readings in [0, 9] {
            let asked = AtomicU64::new(0);
            let is_interrupted = || asked.fetch_add(1, Ordering::Relaxed) >= readings;
            let mut shown = Vec::new();
            let mut traced = job.run(|| Duration::ZERO, is_interrupted, |paths| shown.push(paths));
            let paths: u64 = traced.sums.iter().map(|sums| u64::from(sums.paths)).sum();
            let coarsest = PixelGrid::coarsest(SIZE).len() as u64;
            assert!((coarsest..600).contains(&paths), "{readings}: {paths}");
            assert_eq!(paths == coarsest, readings == 0, "{readings}: {paths}");
            assert!(shown.is_sorted() && shown.last() == Some(&paths), "{shown:?}");
            assert_eq!(traced.fill() as u64, traced.sums.len() as u64 - paths);
            assert!(traced.sums.iter().all(|sums| sums.paths == 1));
        }
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

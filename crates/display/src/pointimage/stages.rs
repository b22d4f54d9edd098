//! A frame, stage by stage (Walter et al. 2002, Figure 1).

use super::cull::Cull;
use super::interpolate::{Interpolate, Looks};
use super::map::Map;
use super::params::{EmptyPixels, Smoothing, Stage, Stages};
use super::points::{Age, NOISY};
use super::predict::Occupancy;
use super::prefetch::prefetch;
use super::prefilter::Prefilter;
use super::sample::Sample;
use super::{Moment, PointImage, dither, parallel, random, zbuffer};
use holo_picture::View;

/// Pixels along the side of the squares by which requests are ordered.
const TILE: usize = 32;
/// Samples whose points are fetched together.
const AHEAD: usize = 32;

impl PointImage {
    /// All stages that are on and that have something to do.
    pub(super) fn make(&mut self, moment: &Moment, ended: &mut dyn FnMut(Stage)) {
        let moved = self.view.as_ref() != Some(&moment.view);
        self.look(&moment.view, moved);
        let is_hinted = std::mem::take(&mut self.is_hinted);
        self.update(moment.samples, moved, is_hinted);
        ended(Stage::UpdatePoints);
        self.requests.clear();
        // At rest nothing is about to come into view.
        let predicted = moment.predicted.filter(|predicted| self.params.stages.prediction && *predicted != moment.view);
        self.predicted = predicted;
        if let Some(predicted) = predicted {
            self.predict(&predicted, moment.wanted, ended);
        }
        if moved || self.is_dirty || !moment.samples.is_empty() {
            self.project();
            ended(Stage::ProjectAndTileSort);
            let (threads, frame) = (self.params.threads, self.frames);
            zbuffer::fill(self.isa, &self.buckets, &mut self.planes, &mut self.points, threads, frame);
            ended(Stage::ZBufferTiles);
            if self.params.stages.depth_cull {
                self.cull();
                ended(Stage::DepthCull);
            }
            if self.params.stages.prefilter {
                self.prefilter();
                ended(Stage::Prefilter);
            }
            self.interpolate();
            ended(Stage::Interpolate);
            self.is_dirty = false;
        }
        if moment.wanted > self.requests.len() {
            self.sample(moment.wanted - self.requests.len());
            ended(Stage::Sampling);
        }
        self.frames = self.frames.wrapping_add(1);
    }

    fn look(&mut self, view: &View, moved: bool) {
        if !self.has_origin {
            (self.origin, self.has_origin) = (view.vp, true);
        }
        if moved {
            self.epoch = self.epoch.wrapping_add(1);
            self.has_fresh = false;
            let (width, height) = self.planes.size;
            self.view = Some(*view);
            self.map = Some(Map::new(view, self.origin, width as f64, height as f64));
        }
        self.eye = view.vp - self.origin;
    }

    /// Ages the points by as much as `samples` are worth, if that is anything or they are to be looked through anyway; takes those in.
    fn update(&mut self, samples: &[Sample], moved: bool, is_hinted: bool) {
        self.age(samples.len(), moved, is_hinted);
        self.take_all(samples);
    }

    /// Ages the points by as much as `samples` new ones are worth.
    pub(super) fn age(&mut self, samples: usize, moved: bool, is_hinted: bool) {
        let increment = if self.params.stages.ageing { self.points.increment(samples) } else { 0 };
        if increment > 0 || moved || is_hinted {
            let lengths = parallel::bands(self.points.capacity(), 64, self.params.threads);
            let ages = Age::new(&mut self.points, increment, moved, &self.params).split(&lengths);
            parallel::for_each(ages, |kernel| self.isa.run(kernel));
        }
    }

    /// Takes samples in; says how many new points they made.
    pub(super) fn take_all(&mut self, samples: &[Sample]) -> usize {
        self.points.taken = 0;
        self.noise.take(samples, self.points.capacity());
        for samples in samples.chunks(AHEAD) {
            self.points.prefetch(samples.iter().map(|sample| sample.tag.slot));
            for sample in samples {
                if !self.take(sample) {
                    self.rejected += 1;
                }
            }
        }
        self.points.taken
    }

    fn predict(&mut self, view: &View, wanted: usize, ended: &mut dyn FnMut(Stage)) {
        let (width, height) = Occupancy::scaled(self.planes.size);
        let map = Map::new(view, self.origin, width, height);
        self.occupancy.project(self.isa, &map, &self.points, self.params.threads);
        ended(Stage::PredictedProjection);
        let limit = (wanted as f64 * self.params.predicted_share).floor() as usize;
        let seed = random::mix(self.params.seed ^ 0x5bd1_e995, self.frames);
        self.occupancy.request(self.planes.size, limit, seed, &mut self.requests);
        ended(Stage::PredictedSampling);
    }

    fn project(&mut self) {
        let Some(map) = &self.map else { return };
        self.buckets.fill(self.isa, map, self.planes.size, &mut self.points);
    }

    fn bands(&self) -> Vec<std::ops::Range<usize>> {
        parallel::bands(self.planes.size.1, 16, self.params.threads)
    }

    fn cull(&mut self) {
        let bands = self.bands();
        let width = self.planes.size.0;
        let colours = parallel::cut(&mut self.planes.colour, bands.iter().map(|rows| rows.len() * width));
        let (depth, threshold) = (&self.planes.depth[..], self.params.cull_threshold);
        let work = bands.iter().zip(colours);
        let work = work.map(|(rows, colour)| Cull { width, from: rows.start, colour, depth, threshold });
        parallel::for_each(work.collect(), |kernel| self.isa.run(kernel));
    }

    fn prefilter(&mut self) {
        let bands = self.bands();
        let width = self.planes.size.0;
        let black = self.params.empty == EmptyPixels::Black;
        let gaps_only = self.params.stages.interpolation && self.prior() == 0.0;
        let pictures = cut_picture(&mut self.planes.picture, &bands, width);
        let colour = &self.planes.colour[..];
        let work = bands.iter().zip(pictures);
        let work = work.map(|(rows, picture)| Prefilter { width, from: rows.start, colour, picture, black, gaps_only });
        parallel::for_each(work.collect(), |kernel| self.isa.run(kernel));
    }

    fn interpolate(&mut self) {
        let prior = self.prior();
        let bands = self.bands();
        let width = self.planes.size.0;
        let pictures = cut_picture(&mut self.planes.picture, &bands, width);
        let priorities = parallel::cut(&mut self.planes.priority, bands.iter().map(|rows| rows.len() * width));
        let (colour, age) = (&self.planes.colour[..], &self.planes.age[..]);
        let (smoothing, stages) = (self.params.smoothing, self.params.stages);
        let black = self.params.empty == EmptyPixels::Black && !stages.prefilter;
        let fill = stages.interpolation;
        let looks = Looks { own_point: !fill || smoothing == Smoothing::Gaps, black, fill, prior };
        let work = bands.iter().zip(pictures).zip(priorities).map(|((rows, picture), priority)| Interpolate {
            width,
            from: rows.start,
            colour,
            age,
            picture,
            priority,
            looks,
        });
        parallel::for_each(work.collect(), |kernel| self.isa.run(kernel));
        if smoothing != Smoothing::Everywhere && self.has_fresh {
            self.show_means();
        }
    }

    /// What the 7×7 mean weighs in the 3×3 filter.
    fn prior(&self) -> f32 {
        let Stages { prefilter, interpolation, .. } = self.params.stages;
        if prefilter && interpolation { self.noise.weight(self.params.noise_smoothing) } else { 0.0 }
    }

    /// Pixels whose point is a sample of this view show its mean to the last digit: packed colours would round it. With few noisy
    /// samples it is mixed with the smoothed picture, which fades as they grow.
    fn show_means(&mut self) {
        let prior = self.prior();
        let planes = &mut self.planes;
        let [red, green, blue] = &mut planes.picture;
        let shown = planes.depth.iter().zip(&planes.slot).zip(red).zip(green).zip(blue);
        for ((((&depth, &slot), red), green), blue) in shown {
            if (depth as i32) > 0 {
                let details = &self.points.details[slot as usize];
                let is_noisy = prior > 0.0 && self.points.flags[slot as usize] & NOISY != 0;
                let own = if is_noisy { details.count as f32 / (details.count as f32 + prior) } else { 1.0 };
                for (shown, mean) in [red, green, blue].into_iter().zip(details.mean) {
                    *shown = if is_noisy { *shown + own * (mean - *shown) } else { mean };
                }
            }
        }
    }

    fn sample(&mut self, wanted: usize) {
        let mut chosen = std::mem::take(&mut self.chosen);
        chosen.clear();
        let seed = random::mix(self.params.seed, self.frames);
        if self.params.stages.dither {
            dither::choose(self.isa, &self.planes.priority, self.planes.size.0, wanted, seed, &mut chosen);
        } else {
            self.choose_anywhere(wanted, seed, &mut chosen);
        }
        sort_by_tile(&mut chosen, &mut self.sorted, self.planes.size.0);
        let mut requests = std::mem::take(&mut self.requests);
        let mut chunks = chosen.chunks(AHEAD).peekable();
        while let Some(pixels) = chunks.next() {
            // What the points after those are known by.
            for &pixel in chunks.peek().copied().unwrap_or_default() {
                prefetch(&self.planes.slot[pixel as usize]);
                prefetch(&self.planes.colour[pixel as usize]);
            }
            self.points.prefetch_places(pixels.iter().map(|&pixel| self.planes.slot[pixel as usize]));
            requests.extend(pixels.iter().map(|&pixel| self.request(pixel, seed)));
        }
        (self.requests, self.chosen) = (requests, chosen);
    }
}

/// Orders pixels by tile, so that samples come back as they are kept: near together what is near together.
fn sort_by_tile(pixels: &mut Vec<u32>, sorted: &mut Vec<u32>, width: usize) {
    let Some(last) = pixels.iter().max().map(|&pixel| pixel as usize / width / TILE) else { return };
    let across = width.div_ceil(TILE);
    let tile = |pixel: u32| {
        let (row, column) = (pixel / width as u32, pixel % width as u32);
        row as usize / TILE * across + column as usize / TILE
    };
    // Divisions take long: once for each pixel.
    let tiles: Vec<usize> = pixels.iter().map(|&pixel| tile(pixel)).collect();
    let mut starts = vec![0; (last + 1) * across + 1];
    tiles.iter().for_each(|&tile| starts[tile + 1] += 1);
    (1..starts.len()).for_each(|tile| starts[tile] += starts[tile - 1]);
    sorted.clear();
    sorted.resize(pixels.len(), 0);
    for (&pixel, &tile) in pixels.iter().zip(&tiles) {
        let start = &mut starts[tile];
        sorted[*start] = pixel;
        *start += 1;
    }
    std::mem::swap(pixels, sorted);
}

/// The rows of each band, channel by channel.
fn cut_picture<'a>(
    picture: &'a mut [Vec<f32>; 3],
    bands: &[std::ops::Range<usize>],
    width: usize,
) -> Vec<[&'a mut [f32]; 3]> {
    let [red, green, blue] =
        picture.each_mut().map(|plane| parallel::cut(plane, bands.iter().map(|rows| rows.len() * width)));
    red.into_iter().zip(green).zip(blue).map(|((red, green), blue)| [red, green, blue]).collect()
}

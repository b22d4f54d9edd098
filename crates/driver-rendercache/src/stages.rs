//! A frame, stage by stage (Walter et al. 2002, Figure 1).

use super::bands::Work;
use super::interpolate::{Looks, Weights};
use super::map::Map;
use super::params::{EmptyPixels, Smoothing, Stage, Stages};
use super::points::{Age, NOISY};
use super::project::{BLOCK, Screen};
use super::sample::{Purpose, Sample};
use super::shared::states_as_atomic;
use super::zbuffer::Fill;
use super::{Moment, PointImage, dither, parallel};
use holo_cpu::prefetch_at;
use holo_display::mix;
use holo_picture::View;

/// Pixels along the side of the squares by which requests are ordered.
const TILE: usize = 32;
/// Samples whose points are fetched together.
const AHEAD: usize = 32;
/// Blocks of points that are looked at for one purpose after another: 288 kB.
const PORTION: usize = 64;

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
        let predicted = moment
            .predicted
            .filter(|predicted| self.params.stages.prediction && *predicted != moment.view);
        self.predicted = predicted;
        let is_new = moved || self.is_dirty || !moment.samples.is_empty();
        self.project(predicted.as_ref(), is_new, ended);
        if predicted.is_some() {
            self.ask_ahead(moment.wanted);
            ended(Stage::PredictedSampling);
        }
        if is_new {
            self.show(ended);
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
            (self.origin, self.has_origin) = (view.eye(), true);
        }
        if moved {
            self.epoch = self.epoch.wrapping_add(1);
            self.has_fresh = false;
            let (width, height) = self.planes.size;
            self.view = Some(*view);
            self.map = Some(Map::new(view, self.origin, width as f64, height as f64));
        }
        self.eye = view.eye() - self.origin;
    }

    /// Ages the points by as much as `samples` are worth, if that is anything or they are to be looked through anyway; takes those in.
    fn update(&mut self, samples: &[Sample], moved: bool, is_hinted: bool) {
        self.age(samples.len(), moved, is_hinted);
        self.take_all(samples);
    }

    /// Ages the points by as much as `samples` new ones are worth.
    pub(super) fn age(&mut self, samples: usize, moved: bool, is_hinted: bool) {
        let increment = if self.params.stages.ageing {
            self.points.increment(samples, self.params.mean_last_age)
        } else {
            0
        };
        if increment > 0 || moved || is_hinted {
            let lengths = self.buckets.lengths().iter().copied();
            let parts = parallel::cut(&mut self.points.states, lengths);
            let (isa, params) = (self.isa, &self.params);
            parallel::for_each(parts, |states| isa.run(Age::new(states, increment, moved, params)));
        }
    }

    /// Takes samples in; says how many new points they made.
    pub(super) fn take_all(&mut self, samples: &[Sample]) -> usize {
        self.points.taken = 0;
        self.noise.take(samples, self.points.capacity());
        let mut chunks = samples.chunks(AHEAD);
        let mut next = chunks.next().unwrap_or_default();
        self.prefetch(next);
        while !next.is_empty() {
            let samples = next;
            next = chunks.next().unwrap_or_default();
            self.prefetch(next);
            for sample in samples {
                if !self.take(sample) {
                    self.rejected += 1;
                }
            }
        }
        self.points.taken
    }

    /// Asks for the points that samples will change, or for the slots that they will take.
    fn prefetch(&self, samples: &[Sample]) {
        let mut new = 0;
        for sample in samples {
            match sample.tag.purpose {
                Purpose::Fill | Purpose::Pixel => {
                    self.points.prefetch_free(AHEAD + new);
                    new += 1;
                    if sample.tag.purpose == Purpose::Pixel {
                        prefetch_at(&self.planes.slot, sample.tag.pixel as usize);
                        prefetch_at(&self.planes.colour, sample.tag.pixel as usize);
                    }
                }
                _ => self.points.prefetch(sample.tag.slot),
            }
        }
    }

    /// Projects all points: for the `predicted` view, and for the current one if the picture is to be made anew. In portions that stay
    /// in the second cache, so that they come from memory once.
    fn project(&mut self, predicted: Option<&View>, is_new: bool, ended: &mut dyn FnMut(Stage)) {
        let (isa, size) = (self.isa, self.planes.size);
        let (width, height) = self.occupancy.scaled(size);
        let predicted = predicted.map(|view| Map::new(view, self.origin, width, height));
        let marks = predicted.as_ref().map(|map| self.occupancy.begin(map));
        let tile_rows = self.buckets.tile_rows;
        let screen =
            self.map.as_ref().filter(|_| is_new).map(|map| Screen { map, size, tile_rows });
        if predicted.is_none() && screen.is_none() {
            return;
        }
        let lengths = self.buckets.lengths().to_vec();
        let states = parallel::cut(&mut self.points.states, lengths.into_iter());
        let blocks = &self.points.blocks;
        let mut marks = marks.into_iter().flatten();
        let marks = std::iter::repeat_with(|| marks.next());
        let parts = self.buckets.begin().into_iter().zip(states).zip(marks);
        parallel::for_each_telling(
            parts.collect(),
            ended,
            |((mut chains, states), mut marks), ended| {
                let blocks =
                    blocks[chains.points.start / BLOCK..chains.points.end / BLOCK].chunks(PORTION);
                let portions = blocks.zip(states.chunks_mut(PORTION * BLOCK));
                for ((blocks, states), first) in
                    portions.zip((chains.points.start..).step_by(PORTION * BLOCK))
                {
                    if let Some(marks) = &mut marks {
                        marks.add(isa, blocks, states);
                        ended(Stage::PredictedProjection);
                    }
                    if let Some(screen) = screen {
                        chains.add(isa, screen, first, blocks, states);
                        ended(Stage::ProjectAndTileSort);
                    }
                }
            },
        );
    }

    /// Requests for what is about to come into view.
    fn ask_ahead(&mut self, wanted: usize) {
        let limit = (wanted as f64 * self.params.predicted_share).floor() as usize;
        let seed = mix(self.params.seed ^ 0x5bd1_e995, self.frames);
        self.occupancy.request(self.planes.size, limit, seed, &mut self.requests);
    }

    /// The picture of the points that were projected.
    fn show(&mut self, ended: &mut dyn FnMut(Stage)) {
        let prior = self.prior();
        let (weights, window) = (Weights::new(&self.params), self.params.prefilter_window as usize);
        let (smoothing, stages, empty) =
            (self.params.smoothing, self.params.stages, self.params.empty);
        let fill = stages.interpolation;
        let looks = Looks {
            own_point: !fill || smoothing == Smoothing::Gaps,
            black: empty == EmptyPixels::Black && !stages.prefilter,
            fill,
            prior,
            weights,
        };
        let states = states_as_atomic(&mut self.points.states);
        let work = Work {
            isa: self.isa,
            size: self.planes.size,
            fill: Fill { isa: self.isa, buckets: &self.buckets, states, frame: self.frames },
            cull_threshold: stages.depth_cull.then_some(self.params.cull_threshold),
            prefilter: stages.prefilter.then_some((
                window,
                empty == EmptyPixels::Black,
                fill && prior == 0.0,
            )),
            looks,
        };
        work.run(&mut self.planes, &mut self.scratch, ended);
        if smoothing != Smoothing::Everywhere && self.has_fresh {
            self.show_means();
            ended(Stage::Interpolate);
        }
    }

    /// What the 7×7 mean weighs in the 3×3 filter.
    fn prior(&self) -> f32 {
        let Stages { prefilter, interpolation, .. } = self.params.stages;
        if prefilter && interpolation {
            self.noise.weight(self.params.noise_smoothing)
        } else {
            0.0
        }
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
                let is_noisy = prior > 0.0 && self.points.states[slot as usize].has(NOISY);
                let own = if is_noisy {
                    details.count as f32 / (details.count as f32 + prior)
                } else {
                    1.0
                };
                for (shown, mean) in [red, green, blue].into_iter().zip(details.mean) {
                    *shown = if is_noisy { *shown + own * (mean - *shown) } else { mean };
                }
            }
        }
    }

    fn sample(&mut self, wanted: usize) {
        let mut chosen = std::mem::take(&mut self.chosen);
        chosen.clear();
        let seed = mix(self.params.seed, self.frames);
        if self.params.stages.dither {
            let (threads, width) = (self.params.threads, self.planes.size.0);
            dither::choose(
                self.isa,
                threads,
                &self.planes.priority,
                width,
                wanted,
                seed,
                &mut chosen,
            );
        } else {
            self.choose_anywhere(wanted, seed, &mut chosen);
        }
        sort_by_tile(&mut chosen, &mut self.sorted, self.planes.size.0);
        let mut requests = std::mem::take(&mut self.requests);
        requests.reserve(chosen.len());
        let chunk = |number: usize| {
            let start = (number * AHEAD).min(chosen.len());
            &chosen[start..(start + AHEAD).min(chosen.len())]
        };
        // What the points are known by, two chunks ahead; the points, one ahead.
        let prefetch_pixels = |number| {
            for &pixel in chunk(number) {
                prefetch_at(&self.planes.slot, pixel as usize);
                prefetch_at(&self.planes.colour, pixel as usize);
            }
        };
        let prefetch_points = |number| {
            chunk(number)
                .iter()
                .for_each(|&pixel| self.points.prefetch_place(self.planes.slot[pixel as usize]))
        };
        prefetch_pixels(0);
        prefetch_pixels(1);
        prefetch_points(0);
        for number in 0..chosen.len().div_ceil(AHEAD) {
            prefetch_pixels(number + 2);
            prefetch_points(number + 1);
            requests.extend(chunk(number).iter().map(|&pixel| self.request(pixel, seed)));
        }
        (self.requests, self.chosen) = (requests, chosen);
    }
}

/// Orders pixels by tile, so that samples come back as they are kept: near together what is near together.
fn sort_by_tile(pixels: &mut Vec<u32>, sorted: &mut Vec<u32>, width: usize) {
    let Some(last) = pixels.iter().max().map(|&pixel| pixel as usize / width / TILE) else {
        return;
    };
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

//! The render cache: takes samples, makes pictures and requests, stage by stage (Walter et al.
//! 2002, Figure 1).

use glam::DVec3;
use holo_display::mix;
use holo_picture::{Picture, View};

use crate::interpolate::{CacheFilter, interpolate, show_means};
use crate::map::Map;
use crate::noise::MeanNoise;
use crate::params::{EmptyPixels, PointImageError, PointImageParams, Smoothing};
use crate::planes::PixelPlanes;
use crate::points::{BLOCK, PointSlots};
use crate::predict::Occupancy;
use crate::project::Buckets;
use crate::pyramid::Pyramid;
use crate::sample::{RayResult, Request};
use crate::stage::{Stage, Stages};
use crate::{cull, prefilter, zbuffer};

/// Points are few if fewer than one in so many pixels shows one. With more of them, a gap is
/// nothing rather than unknown, and resampling finds hidden points quickly enough.
const SPARSE: usize = 3;

/// The input of a frame.
#[derive(Clone, Copy, Debug)]
pub struct Moment<'a> {
    /// The view to draw. Its aspect ratio should be the picture's.
    pub view: View,
    /// The view that is expected when the samples of this frame's requests arrive. `None`: no
    /// prediction.
    pub predicted: Option<View>,
    /// The renderer's results since the last frame, in any order.
    pub samples: &'a [RayResult],
    /// The largest number of rays to request.
    pub wanted: usize,
}

/// The render cache.
#[derive(Debug)]
pub struct PointImage {
    pub(crate) params: PointImageParams,
    pub(crate) points: PointSlots,
    pub(crate) planes: PixelPlanes,
    buckets: Buckets,
    occupancy: Occupancy,
    /// The origin of the points' coordinates: the first view's eye, world.
    pub(crate) origin: DVec3,
    pub(crate) view: Option<View>,
    /// The same view in the form that projection uses.
    pub(crate) map: Option<Map>,
    pub(crate) predicted: Option<View>,
    /// The number of the view.
    pub(crate) epoch: u32,
    /// True if any point may be a sample of the current view.
    pub(crate) has_fresh: bool,
    pub(crate) noise: MeanNoise,
    /// The number of frames so far; chooses the jitter.
    pub(crate) frames: u32,
    /// What must be done before the next picture.
    pub(crate) stale: Stale,
    /// The number of pixels with a point, before any was culled.
    known_pixels: usize,
    /// The share of pixels with a point before an object left a hole; 0 once it is closed. The
    /// pyramid fills holes.
    pub(crate) share_before_hole: f64,
    pub(crate) requests: Vec<Request>,
}

/// What has changed since the picture was made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stale {
    /// Nothing: the picture is the view's.
    Nothing,
    /// The points are projected, and the picture is older.
    Picture,
    /// Points, stages or the view.
    Projection,
}

/// A picture, and the rays that would improve the next picture most.
#[derive(Clone, Copy, Debug)]
pub struct CacheFrame<'a> {
    pub(crate) cache: &'a PointImage,
}

impl PointImage {
    /// Returns an empty cache for pictures of `size` pixels, all black. It takes about 150 bytes
    /// per pixel.
    ///
    /// # Errors
    /// If the size is outside the limits of [`Picture::check_size`], or a number outside its range.
    pub fn new(size: (u32, u32), params: PointImageParams) -> Result<Self, PointImageError> {
        Picture::check_size(size.0, size.1)?;
        params.check()?;
        let size = (size.0 as usize, size.1 as usize);
        let capacity = capacity(size, &params);
        Ok(Self {
            points: PointSlots::new(capacity, params.group as usize),
            planes: PixelPlanes::new(size),
            buckets: Buckets::new(size, capacity),
            occupancy: Occupancy::new(size, params.predicted_block as usize),
            origin: DVec3::ZERO,
            view: None,
            map: None,
            predicted: None,
            epoch: 0,
            has_fresh: false,
            noise: MeanNoise::default(),
            frames: 0,
            stale: Stale::Projection,
            known_pixels: 0,
            share_before_hole: 0.0,
            requests: Vec::new(),
            params,
        })
    }

    /// Changes the size of pictures from the next frame on. All points stay, so the next picture
    /// shows what is known.
    ///
    /// The number of slots only grows: an eye that moves has fewer pixels, and when it stops, the
    /// picture at rest finds the points that there were.
    ///
    /// # Errors
    /// If the size is outside the limits of [`Picture::check_size`]. Nothing is changed then.
    pub fn resize(&mut self, size: (u32, u32)) -> Result<(), PointImageError> {
        Picture::check_size(size.0, size.1)?;
        let size = (size.0 as usize, size.1 as usize);
        if (self.planes.width, self.planes.height) == size {
            return Ok(());
        }
        self.points.grow(capacity(size, &self.params));
        self.planes = self.planes.resized(size);
        self.buckets = Buckets::new(size, self.points.capacity());
        self.occupancy = Occupancy::new(size, self.params.predicted_block as usize);
        // The next frame projects into the new pixels, and their means begin anew.
        (self.map, self.predicted, self.stale) = (None, None, Stale::Projection);
        self.requests.clear();
        Ok(())
    }

    /// Switches stages on and off, from the next frame on.
    pub fn set_stages(&mut self, stages: Stages) {
        if stages != self.params.stages {
            self.stale = Stale::Projection;
        }
        self.params.stages = stages;
    }

    /// Returns the number of points that the cache holds.
    pub fn point_count(&self) -> usize {
        (0..self.points.capacity()).filter(|&slot| !self.points.is_empty(slot)).count()
    }

    /// Adds samples without making a picture, for renderers that produce many samples between two
    /// pictures.
    ///
    /// Points age only by the number of new points. Millions of samples that are averaged into
    /// existing points do not remove other points.
    pub fn insert(&mut self, samples: &[RayResult]) {
        let new_points = self.take_all(samples);
        self.age(new_points);
        if !samples.is_empty() {
            self.stale = Stale::Projection;
        }
    }

    /// Turns to a view without making a picture: projects the points, so that samples that come
    /// before the next frame find the points in their pixels. This takes a part of the time of a
    /// frame.
    pub fn aim(&mut self, view: &View) {
        self.look(view);
        self.requests.clear();
        self.predicted = None;
        if self.stale == Stale::Projection {
            self.project(&mut |_| {});
        }
        self.frames = self.frames.wrapping_add(1);
    }

    /// Makes the next picture and the next requests.
    pub fn frame(&mut self, moment: &Moment) -> CacheFrame<'_> {
        self.frame_watched(moment, &mut |_| {})
    }

    /// Makes the next picture and the next requests. Calls `ended` after each stage that ran, so
    /// that the caller can time the stages.
    pub fn frame_watched(
        &mut self,
        moment: &Moment,
        ended: &mut dyn FnMut(Stage),
    ) -> CacheFrame<'_> {
        self.look(&moment.view);
        self.age(moment.samples.len());
        self.take_all(moment.samples);
        ended(Stage::UpdatePoints);
        self.requests.clear();
        // At rest nothing new comes into view.
        let is_ahead = |view: &View| self.params.stages.prediction && *view != moment.view;
        self.predicted = moment.predicted.filter(is_ahead);
        if let Some(predicted) = self.predicted {
            self.occupancy.project(&self.points, &predicted, self.origin);
            ended(Stage::PredictedProjection);
            let limit = (moment.wanted as f64 * self.params.predicted_share).floor() as usize;
            let seed = mix(self.params.seed ^ 0x5bd1_e995, self.frames);
            self.requests = self.occupancy.requests(limit, seed);
            ended(Stage::PredictedSampling);
        }
        if !moment.samples.is_empty() {
            self.stale = Stale::Projection;
        }
        self.show(ended);
        if moment.wanted > self.requests.len() {
            self.request_pixels(moment.wanted - self.requests.len());
            ended(Stage::Sampling);
        }
        self.frames = self.frames.wrapping_add(1);
        CacheFrame { cache: self }
    }

    /// Sets the view.
    fn look(&mut self, view: &View) {
        if self.view.as_ref() == Some(view) && self.map.is_some() {
            return;
        }
        if self.view.is_none() {
            self.origin = view.eye();
        }
        let size = (self.planes.width as f64, self.planes.height as f64);
        self.map = Some(Map::new(view, self.origin, size));
        self.view = Some(*view);
        self.epoch = self.epoch.wrapping_add(1);
        self.points.is_fresh.fill(false);
        self.has_fresh = false;
        self.stale = Stale::Projection;
    }

    /// Makes points older after `samples` new ones.
    fn age(&mut self, samples: usize) {
        let PointImageParams { stages, mean_last_age, hidden_ageing, hint_ageing, .. } =
            self.params;
        let by = if stages.ageing { self.points.increment(samples, mean_last_age) } else { 0 };
        if by > 0 {
            let evict = stages.eviction.then_some(self.params.eviction_age);
            let shown = self.planes.slot.iter().map(|&slot| slot as usize);
            let by = (by, by.saturating_mul(hidden_ageing), hint_ageing);
            self.points.grow_older(by, evict, shown);
        }
    }

    /// Finds the point that each pixel shows.
    fn project(&mut self, ended: &mut dyn FnMut(Stage)) {
        let Self { params, points, planes, buckets, .. } = self;
        let Some(map) = &self.map else { return };
        buckets.fill(points, map, (planes.width, planes.height));
        ended(Stage::ProjectAndTileSort);
        zbuffer::fill(planes, buckets);
        ended(Stage::ZBufferTiles);
        self.known_pixels = planes.point_count();
        if params.stages.depth_cull {
            cull::cull(planes, params.cull_threshold);
            if self.is_sparse() {
                cull::cull_behind(&mut self.planes);
            }
            ended(Stage::DepthCull);
        }
        self.stale = Stale::Picture;
    }

    /// Returns whether points are so few that the pyramid fills the gaps between them.
    fn is_sparse(&self) -> bool {
        self.params.stages.pyramid && self.known_pixels * SPARSE < self.planes.colour.len()
    }

    /// Makes the picture and the priorities from the points, if anything has changed.
    fn show(&mut self, ended: &mut dyn FnMut(Stage)) {
        match self.stale {
            Stale::Nothing => return,
            Stale::Picture => {}
            Stale::Projection => self.project(ended),
        }
        self.stale = Stale::Nothing;
        let is_sparse = self.is_sparse();
        let Self { params, points, planes, .. } = self;
        let PointImageParams { stages, prefilter_window, .. } = *params;
        if self.known_pixels as f64 >= self.share_before_hole * planes.colour.len() as f64 {
            self.share_before_hole = 0.0;
        }
        // What a clipping surface takes away is no hole.
        let is_clipped = self.view.is_some_and(|view| view.is_clipped());
        let has_hole = stages.pyramid && self.share_before_hole > 0.0 && !is_clipped;
        let black = params.empty == EmptyPixels::Black;
        let mut prior = 0.0;
        if stages.prefilter {
            prior = self.noise.weight(params.noise_smoothing);
            let wide = (is_sparse || has_hole).then(|| {
                let weight =
                    params.pyramid_weight + params.noisy_pyramid_weight * self.noise.variance();
                Pyramid::new(planes, weight)
            });
            if wide.is_some() {
                ended(Stage::Pyramid);
            }
            prefilter::prefilter(planes, prefilter_window as usize, black, wide.flatten().as_ref());
            ended(Stage::Prefilter);
        }
        // Pixels that the prefilter filled do not become black again.
        interpolate(planes, &CacheFilter::new(params, prior, black && !stages.prefilter));
        if params.smoothing != Smoothing::Everywhere && self.has_fresh {
            show_means(planes, points, prior);
        }
        ended(Stage::Interpolate);
    }
}

/// Returns the number of slots for a picture of this size.
fn capacity(size: (usize, usize), params: &PointImageParams) -> usize {
    let slots = (size.0 * size.1) as f64 * params.points_per_pixel;
    (slots.ceil() as usize).next_multiple_of(BLOCK)
}

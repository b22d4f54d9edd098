//! The render cache: a picture every frame from far fewer samples than pixels (Walter, Drettakis & Parker 1999; Walter, Drettakis &
//! Greenberg 2002).
//!
//! Recent results of any renderer are kept as coloured points of the scene. Each frame projects them into the view at hand, removes
//! what should be hidden, fills gaps, and says which rays are wanted most. It needs nothing but samples, and waits for none:
//!
//! ```
//! use holo_driver_rendercache::{Moment, Place, PointImage, PointImageParams, Sample};
//! # use holo_picture::View;
//! # let size = (64, 48);
//! # let view = View::new([0.0; 3].into(), [0.0, 1.0, 0.0].into(), [0.0, 0.0, 1.0].into(), None, None, size)?;
//! let mut cache = PointImage::new(size, PointImageParams::default())?;
//! let mut samples = Vec::new();
//! for _ in 0..3 {
//!     let frame = cache.frame(&Moment { view, predicted: None, samples: &samples, wanted: 100 });
//!     samples = frame
//!         .requests()
//!         .map(|(tag, origin, direction)| {
//!             // The renderer: a wall two units away.
//!             let place = Place::At(origin + direction * (2.0 / direction.y));
//!             Sample { tag, ..Sample::new(place, [0.5, 0.5, 0.4]) }
//!         })
//!         .collect();
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! What always holds:
//! - The same calls give the same bits, on any processor and any number of threads. No clock: who wants to know how long a stage
//!   takes is told when it ends ([`PointImage::frame_watched`]).
//! - At rest every pixel tends to the mean of its own rays, the box filter, and no other pixel's light is in it (where samples state
//!   noise, in proportion to 1/n of n samples: [`PointImageParams::noise_smoothing`]).
//! - What is before a view's fore clipping surface is not shown; what is beyond the aft one is black.
//! - Nothing changes and nothing is wanted: nothing is computed.
//! - No number that comes in makes it panic; samples that are not finite are left out and counted.

mod bands;
mod beams;
mod colour;
mod cull;
mod dither;
mod driver;
pub mod frameless;
mod frameless_driver;
mod hints;
mod interpolate;
mod map;
mod noise;
mod parallel;
mod params;
mod planes;
mod points;
mod predict;
mod prefilter;
mod project;
mod request;
mod rows;
mod sample;
mod screen;
mod settings;
mod shared;
mod stages;
mod truncate;
mod update;
mod zbuffer;

pub use driver::RenderCacheDriver;
pub use frameless_driver::FramelessDriver;
pub use holo_cpu::Instructions;
pub use map::far_depth;
pub use params::{EmptyPixels, PointImageError, PointImageParams, Smoothing, Stage, Stages};
pub use sample::{Place, Sample, Tag};
pub use settings::{SETTINGS, Setting};

use bands::Scratch;
use glam::DVec3;
use holo_cpu::Isa;
use holo_picture::{Picture, View};
use map::Map;
use noise::Noise;
use planes::Planes;
use points::Points;
use predict::Occupancy;
use project::{BLOCK, Buckets};
use sample::Request;

/// What a frame is made from.
#[derive(Clone, Copy, Debug)]
pub struct Moment<'a> {
    /// The view to show; of any size, but its shape should be the picture's.
    pub view: View,
    /// Where the view is expected to be when samples asked for now arrive. None: no prediction.
    pub predicted: Option<View>,
    /// Results since the last frame, in any order.
    pub samples: &'a [Sample],
    /// Samples to ask for at most.
    pub wanted: usize,
}

/// The render cache: samples in, pictures and requests out.
#[derive(Debug)]
pub struct PointImage {
    params: PointImageParams,
    isa: Isa,
    points: Points,
    planes: Planes,
    buckets: Buckets,
    occupancy: Occupancy,
    /// One for each thread.
    scratch: Vec<Scratch>,
    /// What positions are relative to; 0 until the first frame if none was given.
    origin: DVec3,
    has_origin: bool,
    /// The current view's eye, relative to the origin.
    eye: DVec3,
    view: Option<View>,
    /// The same as projection takes it.
    map: Option<Map>,
    predicted: Option<View>,
    /// Counts views.
    epoch: u32,
    /// Whether any point may be a sample of the current view.
    has_fresh: bool,
    noise: Noise,
    /// Counts frames; chooses the jitter.
    frames: u32,
    /// Whether an application made points older: those that are too old have yet to leave.
    is_hinted: bool,
    /// Whether the picture is not what the points would give.
    is_dirty: bool,
    requests: Vec<Request>,
    chosen: Vec<u32>,
    sorted: Vec<u32>,
    rejected: u64,
}

impl PointImage {
    /// An empty cache for pictures of `size` pixels, all black. Takes some 120 bytes per pixel.
    ///
    /// # Errors
    /// A size outside the limits of [`Picture::check_size`], a parameter outside its range.
    pub fn new(size: (u32, u32), params: PointImageParams) -> Result<Self, PointImageError> {
        Picture::check_size(size.0, size.1)?;
        let isa = params.check()?;
        let size = (size.0 as usize, size.1 as usize);
        let capacity = ((size.0 * size.1) as f64 * params.points_per_pixel).ceil() as usize;
        let capacity = capacity.next_multiple_of(BLOCK);
        let buckets = Buckets::new(size, capacity, params.threads);
        let scratch = || Scratch::new(size.0, buckets.tile_rows, capacity as u32);
        Ok(Self {
            scratch: std::iter::repeat_with(scratch).take(params.threads).collect(),
            isa,
            points: Points::new(capacity, params.group as usize),
            planes: Planes::new(size, capacity as u32),
            buckets,
            occupancy: Occupancy::new(size, params.predicted_block as usize, params.threads),
            origin: params.origin.unwrap_or(DVec3::ZERO),
            has_origin: params.origin.is_some(),
            eye: DVec3::ZERO,
            view: None,
            map: None,
            predicted: None,
            epoch: 0,
            has_fresh: false,
            noise: Noise::default(),
            frames: 0,
            is_hinted: false,
            is_dirty: true,
            requests: Vec::new(),
            chosen: Vec::new(),
            sorted: Vec::new(),
            rejected: 0,
            params,
        })
    }

    /// Settings in use.
    pub fn params(&self) -> &PointImageParams {
        &self.params
    }

    /// Switches stages on and off, from the next frame on.
    pub fn set_stages(&mut self, stages: Stages) {
        self.is_dirty |= stages != self.params.stages;
        self.is_hinted |= stages != self.params.stages;
        self.params.stages = stages;
    }

    /// Chooses what pixels without points show and which are smoothed, from the next frame on.
    pub fn set_looks(&mut self, empty: EmptyPixels, smoothing: Smoothing) {
        self.is_dirty |= (empty, smoothing) != (self.params.empty, self.params.smoothing);
        (self.params.empty, self.params.smoothing) = (empty, smoothing);
    }

    /// Points that the cache holds at most.
    pub fn capacity(&self) -> usize {
        self.points.capacity()
    }

    /// Points that the cache holds.
    pub fn point_count(&self) -> usize {
        self.points.states.iter().filter(|state| !state.is_empty()).count()
    }

    /// Samples that were left out because a number in them was not finite.
    pub fn rejected(&self) -> u64 {
        self.rejected
    }

    /// Takes samples in without making a picture: for renderers that give more of them than fit between two pictures.
    ///
    /// Points age by those that make a new point only: millions that are averaged into pixels must not drive the others out.
    pub fn insert(&mut self, samples: &[Sample]) {
        let new_points = self.take_all(samples);
        self.age(new_points, false, false);
        self.is_dirty |= !samples.is_empty();
    }

    /// Makes the next picture and the next requests.
    pub fn frame(&mut self, moment: &Moment) -> Frame<'_> {
        self.frame_watched(moment, &mut |_| {})
    }

    /// [`frame`](Self::frame), calling `ended` after each stage that ran, or after each part of it, stages that pass on what they have
    /// just made going by turns: for clocks. Of several threads it is told what this one does.
    pub fn frame_watched(&mut self, moment: &Moment, ended: &mut dyn FnMut(Stage)) -> Frame<'_> {
        self.make(moment, ended);
        Frame { cache: self }
    }
}

/// A picture, and the rays that would improve the next one most.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    cache: &'a PointImage,
}

impl<'a> Frame<'a> {
    /// (width, height).
    pub fn size(&self) -> (u32, u32) {
        (self.cache.planes.size.0 as u32, self.cache.planes.size.1 as u32)
    }

    /// Radiance, channel by channel, rows from the top.
    pub fn channels(&self) -> [&'a [f32]; 3] {
        self.cache.planes.picture.each_ref().map(Vec::as_slice)
    }

    /// The picture, with its view.
    pub fn picture(&self) -> Picture {
        let (width, height) = self.size();
        let mut picture = Picture::new(width, height);
        let [red, green, blue] = self.channels();
        for (((pixel, &red), &green), &blue) in
            picture.pixels.iter_mut().zip(red).zip(green).zip(blue)
        {
            *pixel = [red, green, blue];
        }
        picture.view = self.cache.view;
        picture
    }

    /// Depth along the view's direction of the point that each pixel shows, rows from the top; 0 without one. In views that are no
    /// perspective the distance along the pixel's ray. From [`far_depth`] on it stands for infinity, or for what the view clips.
    pub fn depth(&self) -> impl Iterator<Item = f32> + 'a {
        let planes = &self.cache.planes;
        let depth = planes.depth.iter().zip(&planes.colour);
        // The sign says whether the point is a sample of this view.
        depth.map(
            |(&depth, &colour)| {
                if colour == colour::NONE { 0.0 } else { f32::from_bits(depth).abs() }
            },
        )
    }

    /// Whether a point maps to each pixel after the depth cull, rows from the top.
    pub fn has_point(&self) -> impl Iterator<Item = bool> + 'a {
        self.cache.planes.colour.iter().map(|&colour| colour != colour::NONE)
    }

    /// The rays wanted: what to give back with the sample, origin (on the view's fore clipping surface), and direction of length 1 (0 in the corners of fisheyes, where
    /// there is nothing to see). Predicted ones first.
    pub fn requests(&self) -> impl Iterator<Item = (Tag, DVec3, DVec3)> + 'a {
        let cache = self.cache;
        cache.requests.iter().filter_map(move |request| {
            let view =
                if request.predicted { cache.predicted.as_ref() } else { cache.view.as_ref() };
            let (origin, direction) = request.ray(view?, cache.origin);
            Some((request.tag, origin, direction))
        })
    }

    /// How many rays are wanted, and how many of them for the predicted view.
    pub fn request_counts(&self) -> (usize, usize) {
        let requests = &self.cache.requests;
        (requests.len(), requests.iter().filter(|request| request.predicted).count())
    }
}

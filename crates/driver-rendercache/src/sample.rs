//! What goes to a renderer and what comes back.

use glam::DVec3;
use holo_picture::View;

/// Where a sample lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    /// At a point of the scene, in scene units.
    At(DVec3),
    /// Infinitely far away, in this direction. In a parallel view, whose rays all have one
    /// direction, the sample needs the tag of a pixel.
    Toward(DVec3),
}

/// What a request was for. It goes back with its sample, and does no harm when it comes late.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tag {
    pub(crate) purpose: Purpose,
    pub(crate) pixel: u32,
    pub(crate) slot: usize,
    /// Which of the points that the slot has held.
    pub(crate) generation: u8,
    /// The view that it is for.
    pub(crate) epoch: u32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// A point like any other.
    #[default]
    Fill,
    /// Seen from elsewhere in a pixel of the current view: shown until something better comes.
    Guess,
    /// For a pixel of the current view without a point, anywhere in the pixel.
    Pixel,
    /// Through a point, to see whether it has changed.
    Resample,
    /// For a pixel whose point is a sample of the same view, anywhere in the pixel: to be averaged.
    Refine,
}

/// Where a ray goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Aim {
    /// Picture coordinates.
    Picture(f32, f32),
    /// A point relative to the cache's origin.
    Through([f32; 3]),
}

/// A ray that is wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Request {
    pub aim: Aim,
    /// Whether it is for the predicted view.
    pub predicted: bool,
    pub tag: Tag,
}

impl Request {
    /// Returns origin, on the fore clipping surface, and unit direction of the ray of `view`.
    pub fn ray(&self, view: &View, origin: DVec3) -> (DVec3, DVec3) {
        let (start, direction) = match self.aim {
            Aim::Picture(x, y) => view.ray(x.into(), y.into()),
            Aim::Through(point) => view.ray_to(DVec3::from(point.map(f64::from)) + origin),
        };
        (start + direction * view.span(direction)[0], direction)
    }
}

/// A renderer's result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The request's tag; the default for a sample without a request.
    pub tag: Tag,
    /// Where the ray ended.
    pub place: Place,
    /// Radiance, W·sr⁻¹·m⁻² per RGB channel.
    pub radiance: [f32; 3],
    /// Expected standard deviation of the largest channel of `radiance`; 0 if the renderer is not
    /// random. Infinite if it is random and does not know: then no difference counts as a change.
    pub noise: f32,
}

impl Sample {
    /// Returns a clean sample without a request.
    pub fn new(place: Place, radiance: [f32; 3]) -> Self {
        Self { tag: Tag::default(), place, radiance, noise: 0.0 }
    }
}

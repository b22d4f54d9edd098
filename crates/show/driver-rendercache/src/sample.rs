//! Requests to a renderer, and its samples.

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

/// The use of a request's sample. The renderer returns it with the sample. A late tag does no harm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tag {
    pub(crate) purpose: Purpose,
    pub(crate) pixel: u32,
    pub(crate) slot: usize,
    /// The number of the point among those that the slot has held, modulo 256.
    pub(crate) generation: u8,
    /// The number of the view.
    pub(crate) epoch: u32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// Becomes a point like any other.
    #[default]
    Fill,
    /// Lies in a pixel of the current view and was seen from elsewhere. Shown until a better sample
    /// arrives.
    Guess,
    /// Goes anywhere through a pixel of the current view that has no point.
    Pixel,
    /// Goes through a point, to test whether it has changed.
    Resample,
    /// Goes anywhere through a pixel whose point is a sample of the same view. It is averaged.
    Refine,
}

/// The target of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum RayTarget {
    /// Picture coordinates.
    Picture(f32, f32),
    /// A point relative to the cache's origin.
    Through([f32; 3]),
}

/// A requested ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Request {
    pub aim: RayTarget,
    /// True if the ray is for the predicted view.
    pub predicted: bool,
    pub tag: Tag,
}

impl Request {
    /// Returns the ray of `view`: its origin on the fore clipping surface, and its unit direction.
    pub fn ray(&self, view: &View, origin: DVec3) -> (DVec3, DVec3) {
        let (start, direction) = match self.aim {
            RayTarget::Picture(x, y) => view.ray(x.into(), y.into()),
            RayTarget::Through(point) => view.ray_to(DVec3::from(point.map(f64::from)) + origin),
        };
        (start + direction * view.span(direction)[0], direction)
    }
}

/// A renderer's result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayResult {
    /// The request's tag; the default for a sample without a request.
    pub tag: Tag,
    /// Where the ray ended.
    pub place: Place,
    /// Radiance, W·sr⁻¹·m⁻² per RGB channel.
    pub radiance: [f32; 3],
    /// Expected standard deviation of the largest channel of `radiance`; 0 if the renderer is not
    /// random. Infinite if it is unknown: then no difference counts as a change.
    pub noise: f32,
    /// Number of the object that the ray hit, for [`PointImage::move_object`]; 0 if it is unknown.
    ///
    /// [`PointImage::move_object`]: crate::PointImage::move_object
    pub object: u32,
    /// True if the point is likely to change soon, because it moves, or lies in a shadow or a
    /// highlight that does (1999, §4.2). It then ages faster.
    pub is_changing: bool,
}

impl RayResult {
    /// Returns a clean sample without a request.
    pub fn new(place: Place, radiance: [f32; 3]) -> Self {
        let (tag, noise, object, is_changing) = (Tag::default(), 0.0, 0, false);
        Self { tag, place, radiance, noise, object, is_changing }
    }
}

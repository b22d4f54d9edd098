//! What goes to a renderer and what comes back.

use glam::DVec3;
use holo_picture::View;

/// Where a sample lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    /// At a point of the scene, in scene units.
    At(DVec3),
    /// Infinitely far away, in this direction. In a parallel view, whose pixels all look the same way, only with the tag of a pixel.
    Toward(DVec3),
}

/// What a request was for; goes back with its sample. Opaque, and harmless when it comes late.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tag {
    pub(super) purpose: Purpose,
    pub(super) pixel: u32,
    pub(super) slot: u32,
    /// Which of the points that the slot has held.
    pub(super) generation: u8,
    /// Which view it was asked for.
    pub(super) epoch: u32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Purpose {
    /// A point like any other.
    #[default]
    Fill,
    /// Seen from elsewhere in a pixel of the current view: shown until something better comes.
    Guess,
    /// For a pixel of the current view without a point, anywhere in the pixel.
    Pixel,
    /// Through a point, to see whether it has changed.
    Resample,
    /// For a pixel whose point is a sample of the same view, anywhere in the pixel: to be averaged in.
    Refine,
}

/// Where a ray goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Aim {
    /// Picture coordinates.
    Picture(f32, f32),
    /// A point relative to the origin.
    Through([f32; 3]),
}

/// A ray that is wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Request {
    pub aim: Aim,
    /// Whether it is for the predicted view.
    pub predicted: bool,
    pub tag: Tag,
}

impl Request {
    /// Origin (on the fore clipping surface) and direction (of length 1) of the ray of `view`.
    pub fn ray(&self, view: &View, origin: DVec3) -> (DVec3, DVec3) {
        let (start, direction) = match self.aim {
            Aim::Picture(x, y) => view.ray(x.into(), y.into()),
            Aim::Through(point) => {
                let point = DVec3::from(point.map(f64::from)) + origin;
                view.ray_to(point)
            }
        };
        (start + direction * view.span(direction)[0], direction)
    }
}

/// A renderer's result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Of the request; the default for a sample that nobody asked for (a stored one).
    pub tag: Tag,
    /// Where the ray met something.
    pub place: Place,
    /// Radiance, W·sr⁻¹·m⁻² per RGB channel.
    pub radiance: [f32; 3],
    /// Expected standard deviation of `radiance`'s largest channel, if the renderer is random; 0 if it is not. Infinite if it is and
    /// does not know, as of a single path that met no light: then no difference in colour is taken for a change.
    pub noise: f32,
    /// The object that was met, as the application numbers them.
    pub object: u32,
    /// Whether the renderer expects it to change soon (a specular highlight, a moving thing): it then ages faster.
    pub is_highlight: bool,
}

impl Sample {
    /// A clean sample of object 0 that nobody asked for.
    pub fn new(place: Place, radiance: [f32; 3]) -> Self {
        Self { tag: Tag::default(), place, radiance, noise: 0.0, object: 0, is_highlight: false }
    }
}

//! Views, pictures of radiance, their files, their look on a display, and comparison measures.
//!
//! - [`View`]: a view of one of Radiance's types v, l, c, a and h. [`ViewSpec`] holds the parts of
//!   a view that a person or a file states.
//! - [`Picture`]: linear radiance per pixel, row 0 at the top. Reads and writes `.hdr`, `.pfm` and
//!   `.exr`, writes `.png`.
//! - [`Look`]: how a display shows radiance: exposure, tones, false colours, contours.
//! - [`compare()`] and [`bias_interval`]: measure the difference between a picture and a reference.
//!
//! Invariants: a [`View`] is finite and not degenerate. A picture that was read has the file's
//! exposure divided out, and at most [`MAX_PIXELS`] pixels.

mod clip;
mod compare;
mod error;
mod files;
mod kind;
mod look;
mod picture;
mod size;
mod view;
mod view_error;
mod view_spec;

pub use clip::Clip;
pub use compare::{
    BIAS_Z, CompareError, Measures, bias_interval, compare, worst_block_away,
    worst_block_beyond_noise, worst_block_shown,
};
pub use error::PictureError;
pub use files::{Format, PngRows, RadianceRows};
pub use holo_color::{EFFICACY, WEIGHTS as LUMINANCE_WEIGHTS, luminance, relative_luminance};
pub use kind::ViewKind;
pub use look::{
    Adaptation, Bands, Exposure, Image, Legend, Look, Scale, ScaleError, Scaling, Tick, Tone,
    auto_exposure,
};
pub use picture::Picture;
pub use size::{MAX_PIXELS, MAX_SIDE};
pub use view::{DEFAULT_VH, View, ViewParams};
pub use view_error::ViewError;
pub use view_spec::ViewSpec;

//! Local objects: models that a person carries into a stored scene (Larson & Simmons 1999,
//! §2.4.6).
//!
//! 1. A [`LocalObject`] is a model at a pose, with a hierarchy of its own.
//! 2. A [`LightProbe`] is the light that arrives at one place. A driver draws the six views of
//!    [`probe_views`] from stored samples, and their light and distances make a reflection cube.
//! 3. An [`ObjectLighting`] divides a probe's light into a few lights, which cast shadows, and the
//!    rest. A [`LitObject`] is an object with that light, and with its shadow on what the probe
//!    shows. Mirrors of the object may show what the probe's centre does not see. [`side_places`]
//!    finds places for further probes that do.
//! 4. An [`ObjectLayer`] casts the rays of a frame against the objects, and adds up passes. It also
//!    estimates the share of light that the objects take from the surfaces around them.
//!    [`ObjectLayer::compose`] draws both over a frame of any driver. While an object moves, a ray
//!    stands for several pixels, and mirrors look their light up in the probe alone.
//!
//! Objects hide each other and cast shadows on each other, but do not reflect each other. Light
//! that they emit is seen, and lights nothing else. Glass shows the probe's light, refracted, and
//! casts no shadow.
//!
//! Invariants:
//! - No input or output, no clock, and no randomness: the same calls give the same bits.
//! - A pose is finite and its scale is positive: only [`LocalObject::new`] accepts one.
//! - The room stays as it is. Only a frame's pixels and distances change.

mod at_rest;
mod darkening;
mod error;
mod harmonics;
mod layer;
mod lighting;
mod lights;
mod lit;
mod numbers;
mod object;
mod pose;
mod probe;
mod room;
mod shading;
mod shadow;
mod sheen;
mod sides;
mod surface;

pub use error::{MOST_TRIANGLES, ObjectError};
pub use layer::{LayerDetail, ObjectLayer};
pub use lighting::{LIGHTS, ObjectLighting};
pub use lit::LitObject;
pub use object::{LocalObject, ObjectModel};
pub use pose::ObjectPose;
pub use probe::{LightProbe, ProbeError, probe_views};
pub use room::Room;
pub use sides::side_places;

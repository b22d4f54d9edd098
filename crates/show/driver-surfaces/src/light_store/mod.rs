//! The light of a session: samples on the surfaces that they show, stored by place.
//!
//! 1. [`Materials`] are a scene's materials, as the driver needs them.
//! 2. A [`Follower`] follows rays through mirrors, panes and solid glass to the surface that they
//!    show. [`Reflections`] end some of them in cubes.
//! 3. A [`Placer`] finds the surface of each sample that has waited in [`Waits`].
//! 4. A [`LightStore`] stores them. [`Sums`] are sums of samples.
//!
//! Invariant: nothing here knows a view or a picture. Several views may be drawn from one store.

mod cell;
mod materials;
mod place;
mod reflections;
mod store;
mod trail;
mod waits;

pub use cell::Sums;
pub(crate) use cell::{FaceClass, SampleLight, luminance};
pub use materials::Materials;
pub(crate) use materials::{Finish, LEAST_REFLECTANCE, MaterialClass};
pub use place::{Placed, Placer, RaySample};
pub(crate) use reflections::{Reflections, RoughMetal};
pub use store::LightStore;
pub(crate) use store::{Bucket, Cube, Grid, StoredLight};
pub(crate) use trail::{AtPanes, Follower, RayContent, Trail, TrailEnd};
pub(crate) use waits::Waits;

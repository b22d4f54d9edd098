//! Reflection and refraction at single surfaces, for the tracer and for displays: Fresnel's shares
//! at smooth boundaries, and the GGX distribution of rough ones.
//!
//! Invariant: pure functions of directions, without materials or scenes.
#![forbid(unsafe_code)]

mod facets;
mod fresnel;
mod microfacet;

pub use facets::{FACETS, GlossFacet, facets};
pub use fresnel::{dielectric, mirrored, pane, reflect, refract};
pub use microfacet::Ggx;

//! Local objects, compared with closed forms.
#![allow(clippy::unwrap_used)]

mod common;
mod layer;
mod mirrors;
mod objects;
mod shadows;

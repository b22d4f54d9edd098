//! Light for surfaces of which nothing is known.

use crate::light_store::LightStore;
use crate::view::SurfaceView;
use crate::visible::VisiblePoint;
use glam::Vec3;

/// How much darker a surface is drawn that is seen edge-on, while no light is known at all.
const SHADE: f32 = 0.7;

/// Light for surfaces without known light in any pixel nearby.
pub(crate) struct AmbientGuess<'a> {
    pub store: &'a LightStore,
    /// Mean of all samples, for surfaces of which nothing is known. Without any sample, the light
    /// that the scene's lamps let expect.
    mean: Vec3,
    /// The eye, relative to the scene's origin, if there is no sample. Surfaces are then shaded by
    /// their angle, so that the room is recognised.
    eye: Option<Vec3>,
}

impl<'a> AmbientGuess<'a> {
    pub fn new(view: &SurfaceView, store: &'a LightStore) -> AmbientGuess<'a> {
        match store.samples() {
            0 => AmbientGuess { store, mean: view.expected_light(), eye: Some(view.eye()) },
            _ => AmbientGuess { store, mean: store.mean(), eye: None },
        }
    }

    /// Returns the light of a surface of which nothing is known.
    pub fn of(&self, seen: &VisiblePoint) -> Vec3 {
        let Some(eye) = self.eye else { return self.mean };
        let cosine = (seen.point - eye).normalize_or(seen.normal).dot(seen.normal).abs();
        self.mean * (1.0 - SHADE * (1.0 - cosine))
    }
}

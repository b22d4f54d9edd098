//! The suns and punctual lights of a scene.

use crate::punctual::MAX_PUNCTUAL_LIGHTS;
use crate::sun::MAX_SUNS;
use crate::{PunctualLight, Scene, SceneError, Sun};

impl Scene {
    /// Gives the scene these suns instead of its own.
    ///
    /// # Errors
    /// [`SceneError::Sun`] if one has no unit direction or no plausible irradiance.
    /// [`SceneError::Limit`] if there are more than [`MAX_SUNS`].
    pub fn with_suns(mut self, suns: Vec<Sun>) -> Result<Scene, SceneError> {
        if suns.len() > MAX_SUNS {
            let (count, limit) = (suns.len() as u64, MAX_SUNS as u64);
            return Err(SceneError::Limit { what: "suns", count, limit });
        }
        if let Some(bad) = suns.iter().position(|sun| !sun.is_valid()) {
            return Err(SceneError::Sun(bad));
        }
        self.suns = suns;
        Ok(self)
    }

    /// Returns the suns of the model and that of the sky.
    pub fn all_suns(&self) -> impl Iterator<Item = &Sun> {
        self.suns.iter().chain(self.sky.sun())
    }

    /// Gives the scene these punctual lights instead of its own.
    ///
    /// # Errors
    /// [`SceneError::PunctualLight`] if a value of one is not possible. [`SceneError::Limit`] if
    /// there are more than [`MAX_PUNCTUAL_LIGHTS`].
    pub fn with_punctual_lights(mut self, lights: Vec<PunctualLight>) -> Result<Scene, SceneError> {
        if lights.len() > MAX_PUNCTUAL_LIGHTS {
            let (count, limit) = (lights.len() as u64, MAX_PUNCTUAL_LIGHTS as u64);
            return Err(SceneError::Limit { what: "punctual lights", count, limit });
        }
        if let Some(bad) = lights.iter().position(|light| !light.is_valid()) {
            return Err(SceneError::PunctualLight(bad));
        }
        self.punctual_lights = lights;
        Ok(self)
    }
}

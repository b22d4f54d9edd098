//! From a frame's radiance to the colours of a screen: the one place where front ends say how a
//! frame looks.

use holo_picture::Look;

use crate::stage::Shown;

/// A person's display settings. None of them needs a new ray.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Display {
    /// The exposure before `stops` are applied.
    pub exposure: Exposure,
    /// Brighter by so many stops, each a factor of 2.
    pub stops: f32,
}

/// The base of an exposure.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Exposure {
    /// The frame: it adapts as an eye does.
    #[default]
    Automatic,
    /// This factor from radiance to linear display values.
    Locked(f32),
}

impl Display {
    /// Returns the factor from radiance to linear display values.
    pub fn factor(&self, shown: &Shown) -> f32 {
        let base = match self.exposure {
            Exposure::Automatic => shown.exposure,
            Exposure::Locked(factor) => factor,
        };
        base * self.stops.exp2()
    }

    /// Returns the frame's sRGB bytes, rows from the top.
    pub fn colours(&self, shown: &Shown) -> Vec<u8> {
        let exposure = holo_picture::Exposure::Factor(self.factor(shown));
        Look { exposure, ..Look::default() }.show(&shown.frame.picture).rgb
    }
}

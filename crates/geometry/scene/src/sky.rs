//! The sky: the light of rays that meet nothing.
//!
//! Invariants:
//! - Everything asks [`Sky::radiance`] alone. Who needs more, such as a density to sample it by,
//!   derives it from that.
//! - An even sky is three numbers, and has the bits that it always had.
//! - The sun of a sky is no part of its radiance: suns are sampled apart. People see its disc by
//!   [`Sky::seen`].

use std::fmt;
use std::sync::Arc;

use glam::DVec3;
use holo_daylight::SkyFormula;

use crate::limits::MAX_RADIANCE;
use crate::material::is_radiance;
use crate::sky_picture::SkyPicture;
use crate::{Rgb, SceneError, Sun};

/// The light of rays that meet nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct Sky {
    pub(crate) light: SkyLight,
    /// The sun that belongs to it. It is seen, unlike the suns of a model's file.
    pub(crate) sun: Option<Sun>,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum SkyLight {
    /// The same radiance in every direction.
    Even(Rgb),
    /// A formula above the horizon, and an even ground below.
    Formula(Box<FormulaSky>),
    /// A picture of all directions.
    Picture(Box<PictureSky>),
}

/// A sky by a formula.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FormulaSky {
    pub formula: SkyFormula,
    /// Radiance of the ground, W·sr⁻¹·m⁻².
    pub ground: Rgb,
    /// Factor of the formula's radiance in each channel.
    pub colour: Rgb,
    pub axes: SkyAxes,
}

/// A sky that is a picture.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PictureSky {
    pub picture: Arc<SkyPicture>,
    /// Factor of the picture's numbers.
    pub scale: f32,
    pub axes: SkyAxes,
}

/// Directions of the horizon's frame in a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkyAxes {
    pub(crate) east: DVec3,
    pub(crate) north: DVec3,
    pub(crate) up: DVec3,
}

impl SkyAxes {
    /// Returns the axes of a scene with this up axis. Without a turn, east is the scene's first
    /// axis: north is +Y if Z is up, and -Z if Y is up. `turn` turns north clockwise as seen from
    /// above, degrees.
    #[must_use]
    pub fn new(up: DVec3, turn: f64) -> SkyAxes {
        let up = up.normalize_or(DVec3::Z);
        let first = if up.x.abs() > 0.9 { DVec3::Y } else { DVec3::X };
        let east = (first - up * up.dot(first)).normalize_or(DVec3::X);
        let north = up.cross(east);
        let (sin, cos) = turn.to_radians().sin_cos();
        SkyAxes { east: east * cos - north * sin, north: north * cos + east * sin, up }
    }

    /// Returns a direction of the scene in the horizon's frame.
    #[inline]
    pub(crate) fn to_horizon(self, direction: DVec3) -> DVec3 {
        DVec3::new(direction.dot(self.east), direction.dot(self.north), direction.dot(self.up))
    }

    /// Returns a direction of the horizon's frame in the scene.
    #[must_use]
    pub fn to_scene(self, direction: DVec3) -> DVec3 {
        self.east * direction.x + self.north * direction.y + self.up * direction.z
    }

    /// Returns whether the axes are orthonormal and right-handed.
    pub(crate) fn is_valid(&self) -> bool {
        let SkyAxes { east, north, up } = *self;
        let is_unit = |axis: DVec3| (axis.length() - 1.0).abs() < 1e-6;
        is_unit(east) && is_unit(up) && east.cross(north).distance(up) < 1e-6
    }
}

impl Default for Sky {
    /// Returns a black sky.
    fn default() -> Sky {
        Sky::from([0.0; 3])
    }
}

impl From<Rgb> for Sky {
    /// Returns a sky of the same radiance in every direction.
    fn from(radiance: Rgb) -> Sky {
        Sky { light: SkyLight::Even(radiance), sun: None }
    }
}

impl Sky {
    /// Returns a sky by a formula, with a ground of this radiance below the horizon.
    #[must_use]
    pub fn of_formula(formula: SkyFormula, ground: f32, axes: SkyAxes) -> Sky {
        let sky = FormulaSky { formula, ground: [ground; 3], colour: [1.0; 3], axes };
        Sky { light: SkyLight::Formula(Box::new(sky)), sun: None }
    }

    /// Returns a sky that is a picture, its numbers times `scale`.
    #[must_use]
    pub fn of_picture(picture: SkyPicture, scale: f32, axes: SkyAxes) -> Sky {
        let sky = PictureSky { picture: Arc::new(picture), scale, axes };
        Sky { light: SkyLight::Picture(Box::new(sky)), sun: None }
    }

    /// Gives the sky a sun that is seen.
    #[must_use]
    pub fn with_sun(self, sun: Option<Sun>) -> Sky {
        Sky { sun, ..self }
    }

    /// Returns its radiance if that is the same in every direction.
    #[must_use]
    #[inline]
    pub fn as_even(&self) -> Option<Rgb> {
        match self.light {
            SkyLight::Even(radiance) => Some(radiance),
            _ => None,
        }
    }

    /// Returns whether displays need the scene to know what a ray that meets nothing shows.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        self.as_even().is_some() && self.sun.is_none()
    }

    /// Returns its sun.
    #[must_use]
    pub fn sun(&self) -> Option<&Sun> {
        self.sun.as_ref()
    }

    /// Returns the radiance from a unit direction of the scene, without the sun, W·sr⁻¹·m⁻².
    #[must_use]
    #[inline]
    pub fn radiance(&self, direction: DVec3) -> Rgb {
        match &self.light {
            SkyLight::Even(radiance) => *radiance,
            SkyLight::Formula(sky) => {
                let direction = sky.axes.to_horizon(direction);
                if direction.z < 0.0 {
                    return sky.ground;
                }
                let radiance = sky.formula.radiance(direction) as f32;
                sky.colour.map(|share| radiance * share)
            }
            SkyLight::Picture(sky) => {
                let radiance = sky.picture.at(sky.axes.to_horizon(direction));
                radiance.map(|channel| channel * sky.scale)
            }
        }
    }

    /// Returns what a person sees in a unit direction of the scene: the radiance, and the disc of
    /// the sky's sun.
    #[must_use]
    pub fn seen(&self, direction: DVec3) -> Rgb {
        let sky = self.radiance(direction);
        let Some(sun) = self.sun.filter(|sun| sun.is_at(direction)) else { return sky };
        let disc = sun.radiance();
        std::array::from_fn(|k| sky[k] + disc[k])
    }

    /// Returns the mean radiance over all directions.
    #[must_use]
    pub fn mean(&self) -> Rgb {
        if let SkyLight::Even(radiance) = self.light {
            return radiance;
        }
        let mut sum = [0.0_f64; 3];
        let directions = all_directions();
        let share = 1.0 / directions.len() as f64;
        for direction in directions {
            let radiance = self.radiance(direction);
            (0..3).for_each(|k| sum[k] += share * f64::from(radiance[k]));
        }
        sum.map(|channel| channel as f32)
    }

    /// Returns a radiance that the sky does not exceed by far, in any channel. The sun is left out.
    #[must_use]
    pub fn brightest(&self) -> f32 {
        match &self.light {
            SkyLight::Even(radiance) => radiance.iter().copied().fold(0.0, f32::max),
            SkyLight::Formula(sky) => {
                // Around the sun and along the horizon.
                let sun = sky.axes.to_scene(sky.formula.sun);
                let directions = all_directions().into_iter().chain([sun, sky.axes.up]);
                let all = directions.flat_map(|direction| self.radiance(direction));
                all.fold(0.0, f32::max)
            }
            SkyLight::Picture(sky) => sky.picture.brightest() * sky.scale,
        }
    }

    /// Returns the irradiance of a horizontal surface without obstacles, without the sun, W·m⁻² in
    /// each channel.
    #[must_use]
    pub fn horizontal(&self) -> Rgb {
        let up = match &self.light {
            SkyLight::Even(radiance) => return radiance.map(|c| c * std::f32::consts::PI),
            SkyLight::Formula(sky) => sky.axes.up,
            SkyLight::Picture(sky) => sky.axes.up,
        };
        let mut sum = [0.0_f64; 3];
        let directions = all_directions();
        let share = 4.0 * std::f64::consts::PI / directions.len() as f64;
        for direction in directions {
            let cosine = direction.dot(up);
            if cosine > 0.0 {
                let radiance = self.radiance(direction);
                (0..3).for_each(|k| sum[k] += share * cosine * f64::from(radiance[k]));
            }
        }
        sum.map(|channel| channel as f32)
    }

    /// Returns the axes of its horizon; those of a scene whose third axis is up if it is even.
    #[must_use]
    pub fn axes(&self) -> SkyAxes {
        match &self.light {
            SkyLight::Even(_) => SkyAxes::new(DVec3::Z, 0.0),
            SkyLight::Formula(sky) => sky.axes,
            SkyLight::Picture(sky) => sky.axes,
        }
    }

    /// Returns the number of columns of a picture; `None` if it has no detail.
    #[must_use]
    pub fn detail(&self) -> Option<usize> {
        match &self.light {
            SkyLight::Picture(sky) => Some(sky.picture.width),
            _ => None,
        }
    }

    /// Returns whether any of it is not black.
    #[must_use]
    pub fn shines(&self) -> bool {
        self.brightest() > 0.0
    }

    /// Returns the sky with its radiance and its sun times these factors.
    #[must_use]
    pub fn dimmed(mut self, sky: f32, sun: f32) -> Sky {
        match &mut self.light {
            SkyLight::Even(radiance) => *radiance = radiance.map(|channel| channel * sky),
            SkyLight::Formula(formula) => {
                formula.ground = formula.ground.map(|channel| channel * sky);
                formula.colour = formula.colour.map(|channel| channel * sky);
            }
            SkyLight::Picture(picture) => picture.scale *= sky,
        }
        let dim = |of: Sun| Sun { irradiance: of.irradiance.map(|channel| channel * sun), ..of };
        self.sun = self.sun.filter(|_| sun > 0.0).map(dim);
        self
    }

    pub(crate) fn validate(&self) -> Result<(), SceneError> {
        let is_valid = match &self.light {
            SkyLight::Even(radiance) => is_radiance(*radiance),
            SkyLight::Formula(sky) => {
                let factors = match sky.formula.shape {
                    holo_daylight::SkyShape::Gradation { factors } => factors,
                    _ => [0.0; 6],
                };
                let bounded = |value: f64| value.abs() <= f64::from(MAX_RADIANCE);
                sky.axes.is_valid()
                    && is_radiance(sky.ground)
                    && is_radiance(sky.colour)
                    && factors.iter().all(|&factor| factor.abs() <= 1e3)
                    && (0.0..).contains(&sky.formula.scale)
                    && bounded(sky.formula.scale)
                    && (sky.formula.sun.length() - 1.0).abs() < 1e-6
                    && is_radiance([self.brightest(); 3])
            }
            SkyLight::Picture(sky) => {
                sky.axes.is_valid() && sky.scale >= 0.0 && is_radiance([self.brightest(); 3])
            }
        };
        if !is_valid {
            return Err(SceneError::Sky);
        }
        match self.sun.is_none_or(|sun| sun.is_valid()) {
            true => Ok(()),
            false => Err(SceneError::SkySun),
        }
    }
}

impl fmt::Display for Sky {
    /// Writes a radiance as on the command line, and other skies in words.
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match &self.light {
            SkyLight::Even([r, g, b]) => write!(f, "{r},{g},{b}")?,
            SkyLight::Formula(_) => {
                let [mean, ..] = self.mean();
                write!(f, "a sky by a formula of mean radiance {mean:.4}")?;
            }
            SkyLight::Picture(sky) => {
                let (width, height) = (sky.picture.width, sky.picture.height);
                write!(f, "a picture of {width} x {height} pixels")?;
            }
        }
        match self.sun {
            None => Ok(()),
            Some(Sun { towards: [x, y, z], irradiance: [irradiance, ..] }) => {
                write!(f, " with a sun of {irradiance:.2} W/m² towards {x:.4},{y:.4},{z:.4}")
            }
        }
    }
}

/// Returns unit directions that divide the sphere into equal parts: a spiral.
fn all_directions() -> Vec<DVec3> {
    const COUNT: u32 = 1 << 15;
    let golden = std::f64::consts::PI * (3.0 - 5_f64.sqrt());
    let direction = |at: u32| {
        let z = 1.0 - (2.0 * f64::from(at) + 1.0) / f64::from(COUNT);
        let (sin, cos) = (golden * f64::from(at)).sin_cos();
        let level = (1.0 - z * z).sqrt();
        DVec3::new(level * cos, level * sin, z)
    };
    (0..COUNT).map(direction).collect()
}

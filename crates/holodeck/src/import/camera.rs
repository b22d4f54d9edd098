//! The rays of a captured picture's pixels.
//!
//! Invariant: directions have unit length. A pixel without a ray, in the corner of a fisheye, is
//! `None`.

use std::f64::consts::{PI, TAU};

use anyhow::{Result, bail, ensure};
use clap::ValueEnum;
use glam::DVec3;
use holo_picture::View;
use serde::{Deserialize, Serialize};

/// How a picture shows the directions around its eye.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Projection {
    /// All directions, twice as wide as high: longitude across, latitude up
    Equirectangular,
    /// Six square faces side by side: right, left, up, down, front, back
    Cube,
    /// Those of the view that the picture states
    View,
}

/// The meaning of a picture of depths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum DepthAlong {
    /// Distances from the eye
    #[default]
    Ray,
    /// Distances along the axis of the view, or of the cube's face
    Axis,
}

/// The ray of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelRay {
    /// Where it begins.
    pub eye: DVec3,
    /// Its direction; unit length.
    pub direction: DVec3,
    /// Cosine of its angle to the axis; `None` if the projection has none.
    pub cosine: Option<f64>,
}

/// Where a picture was taken, and how it shows directions.
#[derive(Clone, Copy, Debug)]
pub struct PanoramaCamera {
    projection: Projection,
    /// The eye and its directions. For [`Projection::View`], the whole view.
    view: View,
    size: (u32, u32),
}

impl PanoramaCamera {
    /// Returns the camera of a picture of `size` pixels. Of `view`, panoramas use the eye and the
    /// directions.
    ///
    /// # Errors
    /// If the size does not suit the projection.
    pub fn new(projection: Projection, view: View, size: (u32, u32)) -> Result<PanoramaCamera> {
        let (width, height) = size;
        match projection {
            Projection::Equirectangular => ensure!(
                u64::from(width) == 2 * u64::from(height),
                "{width}x{height} pixels: an equirectangular panorama is twice as wide as high"
            ),
            Projection::Cube => ensure!(
                u64::from(width) == 6 * u64::from(height),
                "{width}x{height} pixels: a cube is six squares side by side"
            ),
            Projection::View => {}
        }
        Ok(PanoramaCamera { projection, view, size })
    }

    /// Returns the projection that the shape of a panorama suggests.
    ///
    /// # Errors
    /// If none has this shape.
    pub fn guess((width, height): (u32, u32)) -> Result<Projection> {
        match f64::from(width) / f64::from(height) {
            2.0 => Ok(Projection::Equirectangular),
            6.0 => Ok(Projection::Cube),
            _ => bail!(
                "{width}x{height} pixels: it states no view, and is neither an equirectangular \
                 panorama (twice as wide as high) nor a cube (six squares side by side)"
            ),
        }
    }

    /// Returns its projection.
    pub fn projection(&self) -> Projection {
        self.projection
    }

    /// Returns its view.
    pub fn view(&self) -> &View {
        &self.view
    }

    /// Returns the ray through the middle of a pixel; row 0 is at the top.
    pub fn ray(&self, column: u32, row: u32) -> Option<PixelRay> {
        let (x, y) = View::pixel_centre(self.size, column, row);
        let (front, right, up) = (self.view.vd, self.view.right(), self.view.up());
        match self.projection {
            Projection::Equirectangular => {
                let (sine, cosine) = ((x - 0.5) * TAU).sin_cos();
                let (rise, level) = ((y - 0.5) * PI).sin_cos();
                let direction = (front * cosine + right * sine) * level + up * rise;
                Some(PixelRay { eye: self.view.vp, direction, cosine: None })
            }
            Projection::Cube => {
                // The front of each face, and what is right and up in it. A person who faces front
                // sees the bottom of `up` and the top of `down`.
                let faces = [
                    (right, -front, up),
                    (-right, front, up),
                    (up, right, -front),
                    (-up, right, front),
                    (front, right, up),
                    (-front, -right, up),
                ];
                let across = x * faces.len() as f64;
                let face = (across as usize).min(faces.len() - 1);
                let (axis, right, up) = faces[face];
                let (u, v) = (2.0 * (across - face as f64) - 1.0, 2.0 * y - 1.0);
                let direction = (axis + right * u + up * v).normalize();
                Some(PixelRay { eye: self.view.vp, direction, cosine: Some(direction.dot(axis)) })
            }
            Projection::View => {
                let (eye, direction) = self.view.try_ray(x, y)?;
                Some(PixelRay { eye, direction, cosine: Some(direction.dot(front)) })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A camera that faces along y.
    fn camera(projection: Projection, size: (u32, u32)) -> PanoramaCamera {
        let view = View::new(DVec3::ONE, DVec3::Y, DVec3::Z, Some(90.0), None, size).unwrap();
        PanoramaCamera::new(projection, view, size).unwrap()
    }

    #[test]
    fn an_equirectangular_panorama_has_its_direction_in_the_middle_and_right_on_the_right() {
        let camera = camera(Projection::Equirectangular, (4000, 2000));
        for (column, row, direction) in [
            (2000, 1000, DVec3::Y),
            (3000, 1000, DVec3::X),
            (1000, 1000, -DVec3::X),
            (0, 1000, -DVec3::Y),
            (3999, 1000, -DVec3::Y),
            (17, 0, DVec3::Z),
            (17, 1999, -DVec3::Z),
            (
                2500,
                500,
                (DVec3::X + DVec3::Y).normalize() * 0.5_f64.sqrt() + DVec3::Z * 0.5_f64.sqrt(),
            ),
        ] {
            let ray = camera.ray(column, row).unwrap();
            // Half a pixel is 0.0008 radians.
            assert!(ray.direction.distance(direction) < 0.002, "{column} {row}: {}", ray.direction);
            assert!((ray.direction.length() - 1.0).abs() < 1e-12);
            assert_eq!((ray.eye, ray.cosine), (DVec3::ONE, None));
        }
    }

    #[test]
    fn the_faces_of_a_cube_meet_at_their_edges() {
        let camera = camera(Projection::Cube, (6000, 1000));
        let at = |face: u32, column: u32, row: u32| {
            camera.ray(face * 1000 + column, row).unwrap().direction
        };
        let [right, left, up, down, front, back] = [0, 1, 2, 3, 4, 5];
        for (face, middle) in [
            (right, DVec3::X),
            (left, -DVec3::X),
            (up, DVec3::Z),
            (down, -DVec3::Z),
            (front, DVec3::Y),
            (back, -DVec3::Y),
        ] {
            assert!(at(face, 500, 500).distance(middle) < 0.002, "{face}");
        }
        // Two pixels on both sides of each edge, away from its middle.
        for (one, other) in [
            (at(front, 999, 300), at(right, 0, 300)),
            (at(front, 0, 300), at(left, 999, 300)),
            (at(right, 999, 300), at(back, 0, 300)),
            (at(left, 0, 300), at(back, 999, 300)),
            (at(front, 300, 0), at(up, 300, 999)),
            (at(front, 300, 999), at(down, 300, 0)),
            (at(right, 300, 0), at(up, 999, 699)),
            (at(left, 300, 999), at(down, 0, 699)),
            (at(back, 300, 0), at(up, 699, 0)),
        ] {
            assert!(one.distance(other) < 0.003, "{one} {other}");
        }
        let ray = camera.ray(4000, 0).unwrap();
        assert!((ray.cosine.unwrap() - 1.0 / 3.0_f64.sqrt()).abs() < 0.002, "the corner of a face");
    }

    #[test]
    fn a_shape_suggests_a_projection_or_none() {
        assert_eq!(PanoramaCamera::guess((200, 100)).unwrap(), Projection::Equirectangular);
        assert_eq!(PanoramaCamera::guess((600, 100)).unwrap(), Projection::Cube);
        let error = PanoramaCamera::guess((640, 480)).unwrap_err().to_string();
        assert!(error.contains("640x480") && error.contains("twice as wide"), "{error}");
        let view = *camera(Projection::View, (640, 480)).view();
        assert!(PanoramaCamera::new(Projection::Equirectangular, view, (640, 480)).is_err());
        assert!(PanoramaCamera::new(Projection::Cube, view, (640, 480)).is_err());
    }
}

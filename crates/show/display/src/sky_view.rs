//! What rays show that meet nothing.

use std::fmt;
use std::sync::Arc;

use glam::DVec3;
use holo_picture::View;

/// What a person sees along rays that meet nothing. Drivers know no more of a sky than this.
#[derive(Clone)]
pub enum SkyView {
    /// The same radiance in every direction.
    Even([f32; 3]),
    /// The radiance from each unit direction.
    Varying(Arc<dyn Fn(DVec3) -> [f32; 3] + Send + Sync>),
}

impl SkyView {
    /// Returns the radiance from a unit direction, W·sr⁻¹·m⁻².
    #[inline]
    pub fn along(&self, direction: DVec3) -> [f32; 3] {
        match self {
            Self::Even(radiance) => *radiance,
            Self::Varying(sky) => sky(direction),
        }
    }

    /// Returns the radiance that the middle of a pixel shows, W·sr⁻¹·m⁻². Pixels count from the top
    /// left, row by row.
    pub fn at_pixel(&self, view: &View, size: (u32, u32), pixel: usize) -> [f32; 3] {
        let sky = match self {
            Self::Even(radiance) => return *radiance,
            Self::Varying(sky) => sky,
        };
        let width = size.0 as usize;
        let (x, y) = View::pixel_centre(size, (pixel % width) as u32, (pixel / width) as u32);
        sky(view.ray(x, y).1)
    }
}

impl Default for SkyView {
    /// Returns a black sky.
    fn default() -> Self {
        Self::Even([0.0; 3])
    }
}

impl From<[f32; 3]> for SkyView {
    fn from(radiance: [f32; 3]) -> Self {
        Self::Even(radiance)
    }
}

impl fmt::Debug for SkyView {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Even(radiance) => f.debug_tuple("Even").field(radiance).finish(),
            Self::Varying(_) => f.write_str("Varying"),
        }
    }
}

#[cfg(test)]
mod tests {
    use holo_picture::ViewSpec;

    use super::*;

    #[test]
    fn a_pixel_shows_the_sky_of_its_own_direction() {
        let mut spec = ViewSpec::default();
        spec.apply_line("-vp 0 0 0 -vd 0 1 0 -vu 0 0 1 -vh 90 -vv 90").unwrap();
        let (view, size) = spec.resolve((4, 4)).unwrap();
        let sky = SkyView::Varying(Arc::new(|d: DVec3| d.as_vec3().to_array()));
        // The first pixel is up and left of the middle, and the last one down and right.
        let [x, y, z] = sky.at_pixel(&view, size, 0);
        assert!((x / y + 0.75).abs() < 1e-6 && (z / y - 0.75).abs() < 1e-6, "{x} {y} {z}");
        let [x, y, z] = sky.at_pixel(&view, size, 15);
        assert!((x / y - 0.75).abs() < 1e-6 && (z / y + 0.75).abs() < 1e-6, "{x} {y} {z}");
        assert_eq!(SkyView::Even([1.0, 2.0, 3.0]).at_pixel(&view, size, 7), [1.0, 2.0, 3.0]);
    }
}

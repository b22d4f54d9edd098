//! The distance of what each pixel of a rendered picture shows.

use holo_picture::{Picture, View};
use holo_raycast::{Ray, Raycaster};
use rayon::prelude::*;

/// Returns a picture of distances from the eye along the rays through the middles of pixels, scene
/// units, the same in all channels. They are infinite if a ray hits nothing, and NaN if a pixel has
/// no ray or its ray is clipped.
pub fn depths(raycaster: &Raycaster, view: &View, size: (u32, u32)) -> Picture {
    let depth = |pixel: u32| {
        let (x, y) = View::pixel_centre(size, pixel % size.0, pixel / size.0);
        let Some((origin, direction, reach)) = view.clipped_ray(x, y) else { return f32::NAN };
        // With a fore clipping distance, the ray begins before the eye.
        let (eye, _) = view.ray(x, y);
        let before = (origin - eye).dot(direction);
        let met = raycaster.localize(origin, direction).and_then(|(ray, skipped)| {
            let ray = Ray { t_max: (reach - skipped) as f32, ..ray };
            raycaster.nearest(&ray).map(|hit| f64::from(hit.t) + skipped)
        });
        match met {
            Some(distance) => (distance + before) as f32,
            // Nothing is known of what lies beyond an aft clipping distance.
            None if reach.is_finite() => f32::NAN,
            None => f32::INFINITY,
        }
    };
    let mut picture = Picture::new(size.0, size.1);
    picture.view = Some(*view);
    picture.pixels.par_iter_mut().zip(0..size.0 * size.1).for_each(|(shown, pixel)| {
        *shown = [depth(pixel); 3];
    });
    picture
}

//! Scenes for tests and measurements of the render cache: rays that meet formulas.
#![allow(dead_code, reason = "each test file uses its own part")]
#![allow(clippy::unwrap_used, reason = "tests")]

use glam::DVec3;
use holo_driver_rendercache::{CacheFrame, Moment, Place, RayResult};
use holo_picture::{Picture, View};

/// The place where a ray ended, and its radiance.
pub type Hit = (Place, [f32; 3]);
/// A scene: a function from a ray's origin and direction to its hit.
pub type Scene<'a> = &'a dyn Fn(DVec3, DVec3) -> Hit;

/// A view along `direction` (degrees from +y towards +x) from `eye`, 60 degrees wide.
pub fn view(eye: DVec3, degrees: f64, size: (u32, u32)) -> View {
    let (sine, cosine) = degrees.to_radians().sin_cos();
    View::new(eye, DVec3::new(sine, cosine, 0.0), DVec3::Z, Some(60.0), None, size).unwrap()
}

/// Light and dark squares of `side`, in three-dimensional space.
pub fn checker(p: DVec3, side: f64) -> f32 {
    let odd = (p / side + 1e-4).floor().as_i64vec3().element_sum().rem_euclid(2) == 1;
    if odd { 0.8 } else { 0.2 }
}

/// Inside of a box 10 by 8 by 3 with checkered walls, with a ball in it.
pub fn room(origin: DVec3, direction: DVec3) -> Hit {
    let far = (DVec3::new(5.0, 4.0, 1.5) * direction.signum() - origin) / direction;
    let wall = far.min_element();
    let centre = DVec3::new(0.5, 2.0, -0.6);
    if let Some(distance) = ball(origin, direction, centre, 0.7).filter(|&distance| distance < wall)
    {
        let p = origin + direction * distance;
        let light =
            0.2 + 0.7 * ((p - centre).normalize().dot(DVec3::new(0.3, -0.5, 0.8)).max(0.0)) as f32;
        return (Place::At(p), [light, 0.4 * light, 0.2 * light]);
    }
    let p = origin + direction * wall;
    let light = checker(p, 0.5) * (1.2 - 0.1 * p.length() as f32);
    (Place::At(p), [light, light, 0.8 * light])
}

/// Distance along a ray to a ball.
pub fn ball(origin: DVec3, direction: DVec3, centre: DVec3, radius: f64) -> Option<f64> {
    let to = centre - origin;
    let along = to.dot(direction);
    let half = radius * radius - (to - direction * along).length_squared();
    (half >= 0.0 && along - half.sqrt() > 0.0).then(|| along - half.sqrt())
}

/// Answers to all requests of a frame.
pub fn answer(frame: &CacheFrame, scene: Scene) -> Vec<RayResult> {
    frame
        .requests()
        .map(|(tag, origin, direction)| {
            let (place, radiance) = scene(origin, direction);
            RayResult { tag, ..RayResult::new(place, radiance) }
        })
        .collect()
}

/// One sample through the middle of each pixel.
pub fn whole_picture(view: &View, size: (u32, u32), scene: Scene) -> Vec<RayResult> {
    (0..size.0 * size.1)
        .map(|pixel| {
            let (x, y) = View::pixel_centre(size, pixel % size.0, pixel / size.0);
            let (origin, direction) = view.ray(x, y);
            let (place, radiance) = scene(origin, direction);
            RayResult::new(place, radiance)
        })
        .collect()
}

/// A frame without prediction.
pub fn moment(view: View, samples: &[RayResult], wanted: usize) -> Moment<'_> {
    Moment { view, predicted: None, samples, wanted }
}

/// 64 random bits of an index (splitmix64).
pub fn random(index: u64) -> u64 {
    let mut bits = index.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ bits >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ bits >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ bits >> 31
}

/// A wall at `depth` in front of a view along +y.
pub fn wall(origin: DVec3, direction: DVec3, depth: f64) -> Place {
    Place::At(origin + direction * (depth / direction.y))
}

/// Box-filtered truth, and the mean variance of a ray within its pixel, from 24×24 rays a pixel.
pub fn truth(view: &View, size: (u32, u32), scene: Scene) -> (Vec<f32>, f64) {
    let fine = 24;
    let mut sums = vec![0.0; (size.0 * size.1) as usize];
    let mut squares = 0.0;
    for row in 0..size.1 * fine {
        for column in 0..size.0 * fine {
            let (x, y) = View::pixel_centre((size.0 * fine, size.1 * fine), column, row);
            let (origin, direction) = view.ray(x, y);
            let radiance = scene(origin, direction).1[0];
            sums[(row / fine * size.0 + column / fine) as usize] += radiance / (fine * fine) as f32;
            squares += f64::from(radiance).powi(2) / f64::from(size.0 * size.1 * fine * fine);
        }
    }
    let of_means =
        sums.iter().map(|&mean| f64::from(mean).powi(2)).sum::<f64>() / sums.len() as f64;
    (sums, squares - of_means)
}

/// Mean squared difference of a picture's red channel.
pub fn squared_error(shown: &Picture, truth: &[f32]) -> f64 {
    let squares = shown.pixels.iter().zip(truth).map(|(a, b)| f64::from(a[0] - b).powi(2));
    squares.sum::<f64>() / truth.len() as f64
}

/// Runs `work` on `threads` threads and returns its result.
pub fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
}

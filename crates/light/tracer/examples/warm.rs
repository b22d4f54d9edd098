//! Measures cost and noise of a sample, for the engine `path` and for `cached` with a warm cache.
//!
//! `cargo run --release -p holo-tracer --example warm -- SCENE.obj VP VD VH` (vectors as `x,y,z`)
//! traces rays of a view with one thread. It prints one line of JSON: samples per second, and the
//! mean relative variance of a sample. The worst 1 % of rays is left out of the mean, because a few
//! bright paths decide it.

use std::error::Error;
use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;
use holo_raycast::Raycaster;
use holo_tracer::{DEFAULT_ACCURACY, Settings, Tracer};

/// The view has `SIDE`² rays.
const SIDE: u64 = 64;
/// Samples of each ray, for its variance.
const SAMPLES: u64 = 64;
/// Rays traced first, so that there are records.
const WARMING: u64 = 1 << 18;

fn vector(text: &str) -> Result<DVec3, Box<dyn Error>> {
    let parts = text.split(',').map(str::parse).collect::<Result<Vec<f64>, _>>()?;
    Ok(DVec3::from_array(parts.try_into().map_err(|_| "three numbers, as x,y,z")?))
}

/// The rays of a view, from a sequence that is even at any length.
struct View {
    eye: DVec3,
    forward: DVec3,
    right: DVec3,
    up: DVec3,
}

impl View {
    fn ray(&self, number: u64) -> DVec3 {
        // Additive recurrences of the plastic number are even at any length.
        let at = |step: f64| 2.0 * ((number as f64 + 0.5) * step).fract() - 1.0;
        (self.forward
            + self.right * at(0.754_877_666_246_692_8)
            + self.up * at(0.569_840_290_998_053_3))
        .normalize()
    }
}

/// Returns samples per second, and the relative variance of one sample.
fn measure(tracer: &Tracer, view: &View) -> (f64, f64) {
    let start = Instant::now();
    let mut variances: Vec<f64> = (0..SIDE * SIDE)
        .map(|number| {
            let (mut sum, mut squares) = (0.0, 0.0);
            for sample in 0..SAMPLES {
                let [r, g, b] =
                    tracer.trace(view.eye, view.ray(number), (number << 32) + sample).radiance;
                let luminance =
                    0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b);
                sum += luminance;
                squares += luminance * luminance;
            }
            let mean = sum / SAMPLES as f64;
            let variance = (squares / SAMPLES as f64 - mean * mean).max(0.0) * SAMPLES as f64
                / (SAMPLES - 1) as f64;
            if mean > 0.0 { variance / (mean * mean) } else { 0.0 }
        })
        .collect();
    let rate = (SIDE * SIDE * SAMPLES) as f64 / start.elapsed().as_secs_f64();
    variances.sort_by(f64::total_cmp);
    let kept = variances.len() * 99 / 100;
    (rate, variances[..kept].iter().sum::<f64>() / kept as f64)
}

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [path, eye, towards, angle] = args.as_slice() else {
        return Err("usage: warm SCENE.obj VP VD VH".into());
    };
    let (eye, forward) = (vector(eye)?, vector(towards)?.normalize());
    let half = (angle.parse::<f64>()?.to_radians() / 2.0).tan();
    let up = if forward.z.abs() < 0.9 { DVec3::Z } else { DVec3::Y };
    let right = forward.cross(up).normalize();
    let view = View { eye, forward, right: right * half, up: right.cross(forward) * half };
    let loaded = holo_scene::load(path.as_ref(), &Default::default())?;
    let raycaster = Arc::new(Raycaster::build(loaded.scene.into())?);
    let paths = Tracer::with_raycaster(Arc::clone(&raycaster), Settings::default())?;
    let cached =
        Tracer::with_raycaster(raycaster, Settings::default())?.with_cache(DEFAULT_ACCURACY, 1);
    for number in 0..WARMING {
        let _ = cached.trace(view.eye, view.ray(number), number);
    }
    let (path, cached) = (measure(&paths, &view), measure(&cached, &view));
    println!(
        r#"{{"path_rate": {}, "path_variance": {}, "cached_rate": {}, "cached_variance": {}}}"#,
        path.0, path.1, cached.0, cached.1
    );
    Ok(())
}
